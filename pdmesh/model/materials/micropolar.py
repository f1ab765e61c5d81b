"""Micropolar bonds: beams, with a rotation at each node."""

from __future__ import annotations

from pdmesh.model.document import Material
from pdmesh.model.material_constants import BONDS_NU
from pdmesh.model.materials.kind import (
    Kind,
    Refusal,
    Refusals,
    bonds_alone,
    compressible,
    intact_at_rest,
    symmetric_alone,
)

SAME = 1e-12  # of Poisson's ratios: nearer than round-off


def wrong(material: Material) -> Refusals:
    """Bending resists up to the Poisson's ratio of springs."""
    yield from compressible(material)
    most = BONDS_NU[material.plane]
    if material.nu is not None and most + SAME < material.nu < 0.5:
        expected = f"{most:.4g} at most with model 'micropolar' in plane {material.plane}: its beams are soft beyond"
        yield Refusal("nu", expected)


def in_space(material: Material) -> Refusals:
    """A beam's rotation is one number."""
    yield Refusal("model", "another in a body in space")


def from_rest(material: Material) -> Refusals:
    """Solvers of plates at rest know displacements alone."""
    yield Refusal("model", "one without rotations at rest with 'micropolar'")


def at_rest(material: Material, breaks: bool) -> Refusals:
    """Nor do load steps."""
    yield from from_rest(material)
    yield from intact_at_rest(material, breaks)


MICROPOLAR = Kind(
    name="micropolar",
    parameters=(),
    failures=("stretch", "none"),
    wrong=wrong,
    in_space=in_space,
    at_rest=at_rest,
    from_rest=from_rest,
    one_sided=symmetric_alone,
    adaptive=bonds_alone,
)
