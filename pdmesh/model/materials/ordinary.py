"""The ordinary solid: linear, state-based."""

from __future__ import annotations

from pdmesh.model.material import Family
from pdmesh.model.materials.kind import Kind, bonds_alone, compressible, intact_at_rest, symmetric_alone

ORDINARY = Kind(
    name="ordinary",
    structs=(Family,),
    failures=("stretch", "energy", "none"),
    wrong=compressible,
    at_rest=intact_at_rest,
    one_sided=symmetric_alone,
    adaptive=bonds_alone,
)
