"""The ordinary solid: linear, state-based."""

from __future__ import annotations

from pdmesh.model.material import Family
from pdmesh.model.materials.kind import MaterialKind, compressible

ORDINARY = MaterialKind(
    name="ordinary",
    structs=(Family,),
    failures=("stretch", "energy", "none"),
    wrong=compressible,
)
