"""Bonds alone: springs of a law."""

from __future__ import annotations

from pdmesh.model.material import Bilinear, BondLaw, Cohesive, Material
from pdmesh.model.material_constants import BONDS_NU
from pdmesh.model.materials.kind import MaterialKind, Refusal, Refusals

NEAR = 0.01  # Poisson's ratios this near are one


def wrong(material: Material) -> Refusals:
    """Poisson's ratio of cohesive bonds is that of springs at most."""
    most = BONDS_NU[material.plane]
    if material.law == "cohesive" and material.nu is not None and material.nu > most + NEAR:
        yield Refusal("nu", f"{most:.4g} of bonds in plane {material.plane}, or less, with law 'cohesive'")


BOND = MaterialKind(
    name="bond",
    structs=(BondLaw, Bilinear, Cohesive),
    failures=("stretch",),
    wrong=wrong,
)
