"""Bonds alone: springs of a law."""

from __future__ import annotations

from pdmesh.model.material import USUAL_LAW, Bilinear, BondLaw, Cohesive, Material
from pdmesh.model.material_constants import BONDS_NU
from pdmesh.model.materials.kind import MaterialKind, Refusal, Refusals, softens

FOLLOWED = (USUAL_LAW, "bilinear", "cohesive")  # laws whose bonds break at rest
NEAR = 0.01  # Poisson's ratios this near are one


def wrong(material: Material) -> Refusals:
    """Poisson's ratio of cohesive bonds is that of springs at most."""
    most = BONDS_NU[material.plane]
    if material.law == "cohesive" and material.nu is not None and material.nu > most + NEAR:
        yield Refusal("nu", f"{most:.4g} of bonds in plane {material.plane}, or less, with law 'cohesive'")


def at_rest(material: Material, breaks: bool) -> Refusals:
    """Load steps follow bonds that break, path steps those that soften to nothing along a curve."""
    if breaks and softens(material) and material.law not in FOLLOWED:
        yield Refusal("law", f"{' or '.join(map(repr, FOLLOWED))}, as the solver is static")


def one_sided(material: Material) -> Refusals:
    """One-sided bonds do not go round the tips of cracks."""
    if material.sight != "visibility":
        yield Refusal("sight", "'visibility' in the thesis mode")
    if material.law == "cohesive":
        yield Refusal("law", f"'{USUAL_LAW}' or 'bilinear' in the thesis mode, whose lattice is not calibrated")


def adaptive(material: Material, first: Material, adapt: str) -> Refusals:
    """Fine zones have the laws and the sight that their own kernels know."""
    why = f", as run.adapt is {adapt}"
    if adapt == "hybrid" and material.law not in (USUAL_LAW, "bilinear"):
        yield Refusal("law", f"{USUAL_LAW} or bilinear{why}")
    if adapt != "split" and material.sight != "visibility":
        yield Refusal("sight", f"visibility{why}")
    one_family = adapt == "collocation" or (adapt == "hybrid" and material.plane == "space")
    if one_family and material.micromodulus != first.micromodulus:
        yield Refusal("micromodulus", f"{first.micromodulus}, as elsewhere{why}")
    if adapt != "hybrid" and material.law != USUAL_LAW:
        yield Refusal("law", f"{USUAL_LAW}{why}")


BOND = MaterialKind(
    name="bond",
    structs=(BondLaw, Bilinear, Cohesive),
    failures=("stretch",),
    wrong=wrong,
    at_rest=at_rest,
    one_sided=one_sided,
    adaptive=adaptive,
)
