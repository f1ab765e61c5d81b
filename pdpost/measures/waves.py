"""Wave speeds of a plate, as limits of crack speeds."""

from __future__ import annotations

import msgspec

from pdmesh.model.material import Material
from pdmesh.model.material_constants import poisson, rayleigh_speed
from pdpost.reading.embedded_model import read
from pdsolve.results import Results


class _WaveSpeedGridFileKeys(msgspec.Struct):
    """The keys of the grid file that wave speeds need."""

    material: Material


def plate_rayleigh_speed(results: Results) -> float:
    """Rayleigh wave speed of the plate's main material, m/s; material regions are ignored."""
    material = read(results, _WaveSpeedGridFileKeys).material
    return rayleigh_speed(material.E, material.rho, material.plane, poisson(material))
