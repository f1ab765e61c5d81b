"""Micropolar bonds: beams, or cohesive bonds with shear, with a rotation at each node."""

from __future__ import annotations

from pdmesh.model.material import USUAL_LAW, BondLaw, Cohesive, Material
from pdmesh.model.material_constants import BONDS_NU
from pdmesh.model.materials.kind import (
    MaterialKind,
    Refusal,
    Refusals,
    bonds_alone,
    compressible,
    softens,
    symmetric_alone,
)

SAME = 1e-12  # of Poisson's ratios: nearer than round-off
OTHERS = "'bond', 'ordinary' or 'correspondence'"
NO_ROTATIONS = "load steps solve for displacements, not for the rotations that nodes of 'micropolar' have too"
NEAR = 1e-3  # of Poisson's ratios: bonds whose shear is this soft are springs


def wrong(material: Material) -> Refusals:
    """Bending and shear resist up to the Poisson's ratio of springs."""
    yield from compressible(material)
    if material.law not in (USUAL_LAW, "cohesive"):
        yield Refusal("law", f"'{USUAL_LAW}' or 'cohesive' with model 'micropolar'")
    if softens(material) and material.failure != "stretch":
        yield Refusal("failure", "'stretch' with law 'cohesive'")
    most = BONDS_NU[material.plane]
    if material.nu is not None and most + SAME < material.nu < 0.5:
        expected = f"{most:.4g} at most with model 'micropolar' in plane {material.plane}: its beams are soft beyond"
        yield Refusal("nu", expected)
    elif material.nu is not None and softens(material) and material.nu > most - NEAR:
        yield Refusal("nu", f"less than {most - NEAR:.4g} with cohesive bonds that shear, or model 'bond'")


def in_space(material: Material) -> Refusals:
    """A beam's rotation is one number."""
    yield Refusal("model", f"{OTHERS} in 3D")


def from_rest(material: Material) -> Refusals:
    """Load steps, by which a start at rest is solved, know displacements alone."""
    yield Refusal("model", f"{OTHERS}, as run.start is static: {NO_ROTATIONS}")


def at_rest(material: Material, breaks: bool) -> Refusals:
    """Path steps follow bonds that soften; load steps know no rotations."""
    if not softens(material):
        yield Refusal("model", f"{OTHERS} (or law 'cohesive'), as the solver is static: {NO_ROTATIONS}")
    elif not breaks:
        yield Refusal("model", f"{OTHERS}, as the solver is static and cracks are particles: {NO_ROTATIONS}")


MICROPOLAR = MaterialKind(
    name="micropolar",
    structs=(BondLaw, Cohesive),
    failures=("stretch", "none"),
    wrong=wrong,
    in_space=in_space,
    at_rest=at_rest,
    from_rest=from_rest,
    one_sided=symmetric_alone,
    adaptive=bonds_alone,
)
