"""The kinds of materials, one a file, by the names users give them (`Material.model`)."""

from __future__ import annotations

from functools import cache

from pdmesh.model.material import DECLARED, USUAL_LAW, Material
from pdmesh.model.materials.bond import BOND
from pdmesh.model.materials.correspondence import CORRESPONDENCE
from pdmesh.model.materials.kind import MaterialKind, Refusal, Refusals
from pdmesh.model.materials.micropolar import MICROPOLAR
from pdmesh.model.materials.ordinary import ORDINARY

KINDS: dict[str, MaterialKind] = {kind.name: kind for kind in (ORDINARY, CORRESPONDENCE, MICROPOLAR, BOND)}
MIXED = {USUAL_LAW, "bilinear"}  # laws of one plate: a bilinear bond whose peak is its limit is brittle


def law_name(material: Material) -> str:
    """The law of a material's bonds or families, in words."""
    if material.model == "bond":
        return f"cohesive, {material.shape}" if material.law == "cohesive" else material.law
    if material.control in ("breitzman-dayal", "wan"):
        return f"{material.model} with {material.control}"
    if material.order > 1 or material.constant_term:
        return f"{material.model} of order {material.order}"
    cohesive = material.model == "micropolar" and material.law == "cohesive"
    return f"{material.model}, cohesive, {material.shape}" if cohesive else material.model


@cache
def refused_by(kind: str) -> tuple[tuple[str, object], ...]:
    """Parameters that a kind refuses, as only others have them, and their values where they are left out."""
    kind_parameters, usual = KINDS[kind].parameters, Material(E=1.0, rho=1.0, G0=1.0)
    others = (
        name for material_kind in KINDS.values() for name in material_kind.parameters if name not in kind_parameters
    )
    return tuple((name, getattr(usual, name)) for name in others if DECLARED[name].refused)


__all__ = ["KINDS", "MIXED", "MaterialKind", "Refusal", "Refusals", "law_name", "refused_by"]
