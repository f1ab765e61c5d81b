"""Speeds of waves in a plate, as limits of the speed of cracks."""

from __future__ import annotations

import msgspec

from pdmesh.model.continuum import poisson, rayleigh_speed
from pdmesh.model.document import Material
from pdpost.reading.embedded import read
from pdsolve.results import Results


class _Plate(msgspec.Struct):
    """What is read of the grid file."""

    material: Material


def rayleigh_of(results: Results) -> float:
    """Speed of Rayleigh waves of the plate's own material, m/s, regions of others aside."""
    material = read(results, _Plate).material
    return rayleigh_speed(material.E, material.rho, material.plane, poisson(material))
