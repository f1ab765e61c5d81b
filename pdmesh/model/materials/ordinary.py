"""The ordinary solid: linear, state-based."""

from __future__ import annotations

from pdmesh.model.material import Family, Material
from pdmesh.model.materials.kind import Kind, Refusal, Refusals, bonds_alone, compressible, symmetric_alone


def adaptive(material: Material, first: Material, adapt: str) -> Refusals:
    """Fine zones take one solid in the plane, whose bonds break by their stretch."""
    if adapt != "hybrid" or material.plane == "space":
        yield from bonds_alone(material, first, adapt)
        return
    why = f", as run.adapt is {adapt}"
    if material.failure == "energy":
        yield Refusal("failure", f"stretch or none{why}")
    if material.sight != "visibility":
        yield Refusal("sight", f"visibility{why}")


ORDINARY = Kind(
    name="ordinary",
    structs=(Family,),
    failures=("stretch", "energy", "none"),
    wrong=compressible,
    one_sided=symmetric_alone,
    adaptive=adaptive,
)
