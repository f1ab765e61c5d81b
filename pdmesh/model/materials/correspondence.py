"""Correspondence: any solid behind the gradient of a family."""

from __future__ import annotations

from pdmesh.model.material import Correspondence, Family, Material, Plastic, Silling, StressFailure
from pdmesh.model.materials.kind import MaterialKind, Refusal, Refusals, compressible
from pdmesh.model.materials.solids import SOLIDS


def wrong(material: Material) -> Refusals:
    """Settings that contradict each other, or are missing."""
    yield from compressible(material)
    solid, beyond = SOLIDS[material.solid], material.order > 1 or material.constant_term
    if material.hardening < 0:
        yield Refusal("hardening", "0 Pa or more: what softens flows in one row of nodes, however thin")
    if material.form == "rate" and not solid.rates:
        yield Refusal("form", f"'total' with solid '{material.solid}'")
    if material.control == "breitzman-dayal" and (material.form == "rate" or solid.flows):
        yield Refusal("control", "silling, wan or none where a node has a history")
    if beyond and material.control not in ("silling", "none"):
        yield Refusal("control", "silling or none with order above 1, or with the constant term")
    elif beyond and solid.flows and material.control != "none":
        yield Refusal("control", "'none', as the solid flows and order is above 1 or constant_term is true")


CORRESPONDENCE = MaterialKind(
    name="correspondence",
    structs=(Family, StressFailure, Correspondence, Silling, Plastic),
    failures=("stretch", "energy", "stress", "none"),
    wrong=wrong,
)
