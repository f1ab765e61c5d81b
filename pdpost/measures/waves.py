"""Speeds of waves in a material, as limits of the speed of cracks."""

from __future__ import annotations

from typing import Literal

import msgspec
import numpy as np

from pdpost.measures.strain import BONDS_NU
from pdpost.reading.embedded import read
from pdsolve.results import Results


def rayleigh_ratio(nu: float) -> float:
    """Speed of Rayleigh waves over that of shear waves in plane strain, for the Poisson ratio `nu`.

    The root below 1 of Rayleigh's equation, x = (c_R / c_s)^2 and k = (c_s / c_p)^2:
    x^3 - 8 x^2 + (24 - 16 k) x - 16 (1 - k) = 0 (K. F. Graff, Wave Motion in Elastic Solids, 1975, 6.1).
    """
    k = (1 - 2 * nu) / (2 * (1 - nu))
    roots = np.roots([1.0, -8.0, 24 - 16 * k, -16 * (1 - k)])
    real = roots.real[np.abs(roots.imag) < 1e-9]
    return float(np.sqrt(real[(real > 0) & (real < 1)].min()))


def rayleigh_speed(E: float, rho: float, plane: str) -> float:
    """Speed of Rayleigh waves, m/s, along the edge of a bond-based plate; E in Pa, rho in kg/m^3.

    In plane stress the edge of a plate is that of plane strain with the Poisson ratio nu / (1 + nu).
    """
    nu = BONDS_NU[plane]
    shear = np.sqrt(E / (2 * (1 + nu)) / rho)
    return float(shear * rayleigh_ratio(nu / (1 + nu) if plane == "stress" else nu))


class _Material(msgspec.Struct):
    E: float  # Pa
    rho: float  # kg/m^3
    plane: Literal["stress", "strain"] = "stress"


class _Plate(msgspec.Struct):
    """What is read of the grid file."""

    material: _Material


def rayleigh_of(results: Results) -> float:
    """Speed of Rayleigh waves of the plate's own material, m/s, regions of others aside."""
    material = read(results, _Plate).material
    return rayleigh_speed(material.E, material.rho, material.plane)
