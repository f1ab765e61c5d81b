"""A full square or cubic lattice of bonds compared with the continuum it represents.

Sums over one family of a uniform grid give the stiffness and the energy of a straight crack. They depend only on the
ratio m = horizon / spacing and on the micromodulus profile.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.material import Material
from pdmesh.model.material_constants import C11, C66, critical_stretch, dimension_of, micromodulus, poisson
from pdmesh.model.neighbours import ROUND_OFF, lengths


class LatticeRatios(NamedTuple):
    """Ratios of lattice to continuum; all 1 in the limit of many neighbours."""

    c11: float
    c12: float
    c66: float
    row: float  # energy of a crack between two rows, over G0
    diagonal: float  # energy of a crack at 45 degrees, over G0


class Calibration(NamedTuple):
    """Factors that give the lattice the mean stiffness and fracture energy of the material."""

    stiffness: float  # times the micromodulus
    stretch: float  # times the critical stretch


def has_partial_cells(material: Material) -> bool:
    """Whether cells count by their share within the horizon, with families half a spacing beyond it.

    A conical micromodulus is 0 at the horizon, where shares hardly matter, so cells count in full.
    """
    return material.micromodulus == "constant"


def hu_beta(
    length: NDArray[np.float64], horizon: NDArray[np.float64], delta: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Share of a neighbour's cell, of size `delta`, within the horizon: 1 up to horizon - delta/2, then linear.

    W. Hu, Y. D. Ha, F. Bobaru, Comput. Methods Appl. Mech. Eng. 217-220 (2012) 247-261.
    """
    return np.clip((horizon + delta / 2 - length) / delta, 0.0, 1.0)


def offsets(reach: float, dimension: int = 2) -> NDArray[np.float64]:
    """Neighbours (k, d) of the origin in the lattice of spacing 1, up to |xi| = `reach`."""
    steps = np.arange(-int(reach) - 1, int(reach) + 2)
    every = np.column_stack([grid.ravel() for grid in np.meshgrid(*(steps,) * dimension)]).astype(float)
    length = lengths(every)
    return every[(length > 0) & (length <= reach * (1 + ROUND_OFF))]


def full_family(ratio: float, dimension: int = 2) -> int:
    """Number of neighbours in a full lattice within horizon / spacing = `ratio`: 28 for 3 in the plane, 122 in
    space."""
    return len(offsets(ratio, dimension))


@lru_cache
def lattice_ratios(ratio: float, micromodulus_profile: str, plane: str, partial_cells: bool) -> LatticeRatios:
    """Stiffness and fracture energy of the lattice over those of the continuum.

    With `partial_cells`, the family extends half a spacing beyond the horizon, weighted by Hu's beta; otherwise it is
    |xi| <= horizon and each cell counts in full.
    """
    unit = Material(E=1.0, rho=1.0, G0=1.0)
    material = msgspec.structs.replace(unit, micromodulus=micromodulus_profile, plane=plane)
    xi = offsets(ratio + 0.5 if partial_cells else ratio, dimension_of(plane))
    length, horizon = lengths(xi), np.full(len(xi), float(ratio))
    c = micromodulus(material, length, horizon)
    if partial_cells:
        c = c * hu_beta(length, horizon, np.ones(len(xi)))
    n_x, n_y, *_ = (xi / length[:, None]).T
    c11, c66 = (0.5 * np.sum(c * length * term) for term in (n_x**4, (n_x * n_y) ** 2))
    s0 = float(critical_stretch(material, np.array([ratio]))[0])
    spent = c * s0**2 * length / 2
    row = np.sum(spent * np.maximum(xi[:, 1], 0))
    diagonal = np.sum(spent * np.maximum(xi[:, :2].sum(axis=1), 0)) / np.sqrt(2)
    found = c11 / C11[plane], c66 / C66[plane], c66 / C66[plane], row, diagonal
    return LatticeRatios(*(float(value) for value in found))


def calibration(ratio: float, material: Material, partial_cells: bool = True) -> Calibration:
    """Calibration factors of the lattice, with or without partial cells.

    They give the material's values to the mean of the lattice's stiffnesses, and to the mean energy of cracks along a
    row and at 45 degrees.
    """
    found = lattice_ratios(ratio, material.micromodulus, material.plane, partial_cells)
    stiffness = 3 / (found.c11 + found.c12 + found.c66)
    return Calibration(stiffness, float(np.sqrt(2 / (stiffness * (found.row + found.diagonal)))))


class Sheared(NamedTuple):
    """Stiffnesses of bonds with shear and a free rotation, whose energy is c |xi| (s^2 + r gamma^2) / 2."""

    stiffness: float  # c over that of calibrated springs
    ratio: float  # r


def sheared(material: Material, ratio: float) -> Sheared:
    """Bonds whose lattice has the material's Young's modulus and Poisson's ratio in the mean of all directions.

    C11 + C12 follows from the sum of c |xi| alone, C11 - C12 and 2 C66 in the mean from r, on any square lattice.
    """
    nu, partial = poisson(material), has_partial_cells(material)
    found = lattice_ratios(ratio, material.micromodulus, material.plane, partial)
    uniform = calibration(ratio, material, partial).stiffness * (3 * found.c11 + found.c12) / 4
    if material.plane == "stress":
        return Sheared(2 / (3 * (1 - nu)) / uniform, (1 - 3 * nu) / (1 + nu))
    return Sheared(1 / (1.6 * (1 + nu) * (1 - 2 * nu)) / uniform, 1 - 4 * nu)
