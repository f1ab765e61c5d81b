"""Correspondence: any solid behind the gradient of a family."""

from __future__ import annotations

from pdmesh.model.material import Correspondence, Family, Material, Orthotropic, Plastic, Silling, StressFailure
from pdmesh.model.materials.kind import MaterialKind, Refusal, Refusals, compressible
from pdmesh.model.materials.solids import SOLIDS
from pdmesh.model.orthotropic import ORTHOTROPIC, inadmissible


def wrong(material: Material) -> Refusals:
    """Settings that contradict each other, or are missing."""
    yield from _of_ply(material) if material.solid == ORTHOTROPIC else compressible(material)
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


def _of_ply(material: Material) -> Refusals:
    """What an orthotropic solid cannot be, or lacks."""
    yield from (Refusal(*wrong) for wrong in inadmissible(material))
    if material.failure not in ("stress", "none"):
        yield Refusal("failure", f"stress or none with solid '{ORTHOTROPIC}'")
    for name in ("strength_across", "shear_strength") if material.failure == "stress" else ():
        if getattr(material, name) is None:
            yield Refusal(name, f"the strength, Pa, with solid '{ORTHOTROPIC}' and failure 'stress'")
    if material.control not in ("silling", "none"):
        yield Refusal("control", f"silling or none with solid '{ORTHOTROPIC}'")
    if material.order > 1 or material.constant_term:
        yield Refusal("order" if material.order > 1 else "constant_term", f"the default with solid '{ORTHOTROPIC}'")


CORRESPONDENCE = MaterialKind(
    name="correspondence",
    structs=(Family, StressFailure, Correspondence, Silling, Plastic, Orthotropic),
    failures=("stretch", "energy", "stress", "none"),
    wrong=wrong,
)
