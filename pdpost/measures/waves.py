"""Speeds of waves in a plate, as limits of the speed of cracks."""

from __future__ import annotations

import msgspec

from pdmesh.model.document import Material
from pdmesh.model.material_constants import poisson, rayleigh_speed
from pdpost.reading.embedded_model import read
from pdsolve.results import Results


class _Plate(msgspec.Struct):
    """The keys of the grid file that wave speeds need."""

    material: Material


def rayleigh_of(results: Results) -> float:
    """Speed of Rayleigh waves of the plate's own material, m/s, regions of others aside."""
    material = read(results, _Plate).material
    return rayleigh_speed(material.E, material.rho, material.plane, poisson(material))
