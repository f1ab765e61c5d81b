"""Micropolar bonds: beams, or cohesive bonds with shear, with a rotation at each node."""

from __future__ import annotations

from pdmesh.model.material import USUAL_LAW, BondLaw, Cohesive, Material
from pdmesh.model.material_constants import BONDS_NU
from pdmesh.model.materials.kind import MaterialKind, Refusal, Refusals, compressible, softens

SAME = 1e-12  # of Poisson's ratios: nearer than round-off
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


MICROPOLAR = MaterialKind(
    name="micropolar",
    structs=(BondLaw, Cohesive),
    failures=("stretch", "none"),
    wrong=wrong,
)
