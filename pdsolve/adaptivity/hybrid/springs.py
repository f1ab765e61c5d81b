"""Springs of a fine node's family and of the equivalent compact lattice, and the clipping of bonds by cells.

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
from pdsolve.adaptivity.hybrid.bond_division import divide_family, node_position_in_cell
from pdsolve.laws import limits
from pdsolve.laws.bond_limits import Sizes

X, Y, X2, Y2, INVERSE, STIFFNESS = range(6)  # columns of a table of springs
COARSE_OFFSETS = ((1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1))
TIE = -1  # direction of a piece's end that is a node
EAST, NORTH = 0, 1  # directions of the coarse edge that it lies on
WINDOW = 7  # cells that bonds of a node could pass through, along each axis: families reach 6 spacings
NOTHING = 1e-12  # of the largest modulus: bonds with less are none


class Springs(NamedTuple):
    """The k springs of a node of a full lattice; the second half are the opposites of the first, in order."""

    family_dx: NDArray[np.int64]  # (k,) spacings to the neighbour
    family_dy: NDArray[np.int64]
    spring_table: NDArray[np.float64]  # (k, 8) xi, 2 xi / |xi|^2, 1 / |xi|^2, k (N/m^2)
    peak_stretch: float  # stretch beyond which a bond softens; where it is the limit, it is brittle
    limit_stretch: float  # stretch at which a bond breaks
    c11: float  # N/m^2
    c66: float


def create_fine_springs(material: Material, ratio: float, h: float) -> Springs:
    """Springs of the fine lattice of spacing `h`, m: calibrated bonds with a `ratio` of horizon to spacing."""
    return create_springs_of_materials((material,), ratio, h)[0]


def create_springs_of_materials(materials: tuple[Material, ...], ratio: float, h: float) -> tuple[Springs, ...]:
    """Springs of each material, all of one family: 0 where a material has none but another has some."""
    farther = any(has_partial_cells(material) for material in materials)
    xi = offsets(ratio + 0.5 if farther else ratio)
    moduli = [_calibrated_bond_moduli(material, ratio, np.hypot(*xi.T)) for material in materials]
    in_family = np.logical_or.reduce([c > 0 for c in moduli]) & ((xi[:, 1] > 0) | ((xi[:, 1] == 0) & (xi[:, 0] > 0)))
    xi = np.concatenate([xi[in_family], -xi[in_family]])
    return tuple(
        _create_family_springs(one, ratio, h, xi, np.tile(c[in_family], 2))
        for one, c in zip(materials, moduli, strict=True)
    )


def _calibrated_bond_moduli(material: Material, ratio: float, length: NDArray[np.float64]) -> NDArray[np.float64]:
    """Calibrated modulus (k,) of bonds of these lengths, in a lattice of spacing 1."""
    reach, partial = np.full(len(length), float(ratio)), has_partial_cells(material)
    counted = hu_beta(length, reach, np.ones(len(length))) if partial else 1.0
    factors = calibration(ratio, material, partial)
    c = factors.stiffness * micromodulus(material, length, reach) * counted * factors.shells.at(length)
    return np.where(c > NOTHING * c.max(), c, 0.0)


def _create_family_springs(
    material: Material, ratio: float, h: float, xi: NDArray[np.float64], c: NDArray[np.float64]
) -> Springs:
    """Springs of a family xi (k, 2), in spacings, with moduli c (k,)."""
    length = np.hypot(*xi.T)
    n_x, n_y = (xi / length[:, None]).T
    stiffness = c / length  # of a lattice of spacing 1 and horizon `ratio`, which has the same springs
    c11, c66 = (float(0.5 * np.sum(c * length * term)) for term in (n_x**4, (n_x * n_y) ** 2))
    horizon = np.array([ratio * h])
    critical = calibration(ratio, material, has_partial_cells(material)).stretch * critical_stretch(material, horizon)
    stretch = limits(material, Sizes(critical, np.full(1, h), horizon, ratio))
    dx, dy = np.round(xi.T).astype(np.int64)
    return Springs(dx, dy, _spring_table(xi * h, stiffness), float(stretch.peak[0]), float(stretch.limit[0]), c11, c66)


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


class BondParts(NamedTuple):
    """Parts into which cells divide fine bonds, for each place of a node in a cell (4) and a whole family.

    The parts of bond k from place f, on one side, are first[f, k, 0] to first[f, k, 1]. A bond along a line between
    cells belongs half to either side; those on the other side end at first[f, k, 2].
    """

    part_bounds_of_sides: NDArray[np.int64]  # (4, k, 3)
    begin_and_end_shares: NDArray[np.float64]  # (s, 2) shares of the bond where it begins and ends
    cell_offset: NDArray[np.int64]  # (s, 2) the cell it is in, from the node's own
    part_end_edges: NDArray[
        np.int64
    ]  # (s, 2, 3) where it begins and ends: coarse node, from the cell's corner, and direction
    begin_and_end_shares_along_edge: NDArray[np.float64]  # (s, 2) how far along that edge
    side_cell_bits: NDArray[np.uint64]  # (4, k, 2) the cells of a bond on each side: bits of the window


def divide_bonds(springs: Springs) -> BondParts:
    """The points at which the bonds of a family cross cells, by the parity of their node."""
    first, parts = divide_family(np.column_stack([springs.family_dx, springs.family_dy]))
    sides = np.zeros((4, len(springs.family_dx), 2), dtype=np.uint64)
    ends: list[list[tuple[int, int, int, float]]] = []
    for f in range(4):
        px, py = node_position_in_cell(f, 2)
        for k, (dx, dy) in enumerate(zip(springs.family_dx.tolist(), springs.family_dy.tolist(), strict=True)):
            for part in parts[first[f, k, 0] : first[f, k, 2]]:
                ends.append([_part_end_on_edge(px + t * dx, py + t * dy, t) for t in part[:2]])
            for side in range(2):
                cells = {part.cell_offset for part in parts[first[f, k, side] : first[f, k, side + 1]]}
                sides[f, k, side] = sum(1 << WINDOW * (y + WINDOW // 2) + x + WINDOW // 2 for x, y in cells)
    return BondParts(
        first,
        np.array([part[:2] for part in parts]),
        np.array([part.cell_offset for part in parts], dtype=np.int64),
        np.array([[end[:3] for end in part_ends] for part_ends in ends], dtype=np.int64),
        np.array([[end[3] for end in part_ends] for part_ends in ends]),
        sides,
    )


def _part_end_on_edge(x: float, y: float, t: float) -> tuple[int, int, int, float]:
    """Coarse node, direction of the edge from there, and share along it, at which a part begins or ends."""
    if t in (0.0, 1.0):
        return 0, 0, TIE, 0.0
    column, row = x / 2, y / 2
    near = 1e-9
    if abs(column - round(column)) < near:
        below = int(np.floor(row + near))
        w = row - below
        return round(column), below, NORTH, 0.0 if abs(w) < near else w
    left_column = int(np.floor(column + near))
    return left_column, round(row), EAST, column - left_column
