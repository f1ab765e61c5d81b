"""The ordinary solid: linear, state-based."""

from __future__ import annotations

from pdmesh.model.material import Family
from pdmesh.model.materials.kind import MaterialKind, bonds_alone, compressible, symmetric_alone

ORDINARY = MaterialKind(
    name="ordinary",
    structs=(Family,),
    failures=("stretch", "energy", "none"),
    wrong=compressible,
    one_sided=symmetric_alone,
    adaptive=bonds_alone,
)
