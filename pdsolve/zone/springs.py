"""Springs of a fine node's family in the plane, and of the equivalent compact lattice.

A fine bond xi is a spring of k = c(xi) h^4 / |xi| (c calibrated as in the average-horizon scheme). A coarse cell has
springs k1 = C11 - C66, half of it on each of its edges, and k2 = C66 on both diagonals. This is the stiffness of the
fine lattice, including its anisotropy: C11 = sum c |xi| h^2 n_x^4 / 2, C66 = sum c |xi| h^2 n_x^2 n_y^2 / 2.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.lattice_calibration import calibration, has_partial_cells, hu_beta, offsets
from pdmesh.model.material import Material
from pdmesh.model.material_constants import critical_stretch, micromodulus
from pdsolve.laws import limits
from pdsolve.laws.law import Sizes

X, Y, X2, Y2, INVERSE, STIFFNESS = range(6)  # columns of a table of springs
COARSE_OFFSETS = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1))
NOTHING = 1e-12  # of the largest modulus: bonds with less are none


class Springs(NamedTuple):
    """The k springs of a node of a full lattice; the second half are the opposites of the first, in order."""

    family_dx: NDArray[np.int64]  # (k,) spacings to the neighbour
    family_dy: NDArray[np.int64]
    spring_table: NDArray[np.float64]  # (k, 8) xi, 2 xi / |xi|^2, 1 / |xi|^2, k (N/m^2)
    peak_stretch: NDArray[np.float64]  # (k,) stretch beyond which a bond softens; where it is the limit, it is brittle
    limit_stretch: NDArray[np.float64]  # (k,) stretch at which a bond breaks
    c11: float  # N/m^2
    c66: float


def create_fine_springs(material: Material, ratio: float, h: float) -> Springs:
    """Springs of the fine lattice of spacing `h`, m: calibrated bonds with a `ratio` of horizon to spacing."""
    return create_springs_of_materials((material,), ratio, h)[0]


def create_springs_of_materials(materials: tuple[Material, ...], ratio: float, h: float) -> tuple[Springs, ...]:
    """Springs of each material, all of one family: 0 where a material has none but another has some."""
    farther = any(has_partial_cells(material) for material in materials)
    xi = offsets(ratio + 0.5 if farther else ratio)
    length, moduli = np.hypot(*xi.T), []
    for material in materials:  # in a lattice of spacing 1
        reach, partial = np.full(len(length), float(ratio)), has_partial_cells(material)
        counted = hu_beta(length, reach, np.ones(len(length))) if partial else 1.0
        factors = calibration(ratio, material, partial)
        c = factors.stiffness * micromodulus(material, length, reach) * counted * factors.shells.at(length)
        moduli.append(np.where(c > NOTHING * c.max(), c, 0.0))
    in_family = np.logical_or.reduce([c > 0 for c in moduli]) & ((xi[:, 1] > 0) | ((xi[:, 1] == 0) & (xi[:, 0] > 0)))
    xi = np.concatenate([xi[in_family], -xi[in_family]])
    return tuple(
        _create_family_springs(material, ratio, h, xi, np.tile(c[in_family], 2))
        for material, c in zip(materials, moduli, strict=True)
    )


def _create_family_springs(
    material: Material, ratio: float, h: float, xi: NDArray[np.float64], c: NDArray[np.float64]
) -> Springs:
    """Springs of a family xi (k, 2), in spacings, with moduli c (k,)."""
    length = np.hypot(*xi.T)
    n_x, n_y = (xi / length[:, None]).T
    stiffness = c / length  # of a lattice of spacing 1 and horizon `ratio`, which has the same springs
    c11, c66 = (float(0.5 * np.sum(c * length * term)) for term in (n_x**4, (n_x * n_y) ** 2))
    horizon = np.full(len(xi), ratio * h)
    critical = calibration(ratio, material, has_partial_cells(material)).stretch * critical_stretch(material, horizon)
    stretch = limits(material, Sizes(critical, length * h, horizon, ratio))
    dx, dy = np.round(xi.T).astype(np.int64)
    return Springs(dx, dy, _spring_table(xi * h, stiffness), stretch.peak, stretch.limit, c11, c66)


def coarse_springs(fine: Springs, h: float) -> Springs:
    """Springs of the compact coarse lattice of spacing 2 `h`, m, with the stiffness of the fine ones."""
    dx, dy = np.array(COARSE_OFFSETS, dtype=np.int64).T
    stiffness = np.where(dx * dy == 0, fine.c11 - fine.c66, fine.c66)
    table = _spring_table(2 * h * np.column_stack([dx, dy]).astype(float), stiffness)
    return fine._replace(family_dx=dx, family_dy=dy, spring_table=table)


def _spring_table(xi: NDArray[np.float64], stiffness: NDArray[np.float64]) -> NDArray[np.float64]:
    inverse = 1 / (xi**2).sum(axis=1)
    table = np.zeros((len(xi), 8))
    table[:, :6] = np.column_stack([xi, 2 * xi * inverse[:, None], inverse, stiffness])
    return table


def double_green_strain_from_stretch(stretch: Any) -> Any:
    """e = s (s + 2) of a stretch s."""
    return stretch * (stretch + 2)
