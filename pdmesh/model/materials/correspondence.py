"""Correspondence: any solid behind the gradient of a family."""

from __future__ import annotations

from pdmesh.model.material import Correspondence, Family, Material, Plastic, Silling, StressFailure
from pdmesh.model.materials.kind import (
    MaterialKind,
    Refusal,
    Refusals,
    bonds_alone,
    compressible,
    symmetric_alone,
)
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


def from_rest(material: Material) -> Refusals:
    """What nodes have been through on the way is not known."""
    elastic = [f"'{solid.name}'" for solid in SOLIDS.values() if not solid.flows]
    if SOLIDS[material.solid].flows:
        yield Refusal("solid", f"{' or '.join(elastic)}, as run.start is static")
    if material.form == "rate":
        yield Refusal("form", "'total', as run.start is static")


def at_rest(material: Material, breaks: bool) -> Refusals:
    """Bonds break one round after the other, of solids whose nodes remember nothing."""
    if breaks and material.failure != "none" and (SOLIDS[material.solid].flows or material.form == "rate"):
        yield Refusal("failure", "'none' with solid 'j2' or form 'rate', as the solver is static")


def with_particles(material: Material) -> Refusals:
    """Intensities and stresses at tips are those of small strains, and of what springs back."""
    if not SOLIDS[material.solid].particles:
        yield Refusal("solid", "linear or svk with cracks that are particles")


CORRESPONDENCE = MaterialKind(
    name="correspondence",
    structs=(Family, StressFailure, Correspondence, Silling, Plastic),
    failures=("stretch", "energy", "stress", "none"),
    wrong=wrong,
    at_rest=at_rest,
    from_rest=from_rest,
    with_particles=with_particles,
    one_sided=symmetric_alone,
    adaptive=bonds_alone,
)
