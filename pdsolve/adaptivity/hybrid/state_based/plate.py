"""The fine nodes of a whole plate of one linear peridynamic solid, and their bonds."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.bond_division import parts_of
from pdsolve.adaptivity.hybrid.coarse_cells import Plate
from pdsolve.adaptivity.hybrid.lattice import BELOW, LEFT
from pdsolve.bonds.assembly import Bonds, find
from pdsolve.conditions import Drive
from pdsolve.laws.ordinary import Columns
from pdsolve.model import Model


class PlateBonds(NamedTuple):
    """The b bonds of a plate, each once; 1 and 2 are its ends, from left to right or upwards."""

    one: NDArray[np.int64]  # (b,) rows of the grid
    two: NDArray[np.int64]
    way: NDArray[np.int64]  # (b,) row of `Whole.ways`
    dilating: NDArray[np.float64]  # (b, 2) D at either end, 1/m
    shearing: NDArray[np.float64]  # (b, 2) 2 mu S, Pa/m^2
    limit: NDArray[np.float64]  # (b,) stretch at which it breaks
    intact: NDArray[np.bool_]  # (b,)


class Divisions(NamedTuple):
    """The p parts into which cells divide bonds of k ways from the 4 places of a node in its cell, x fastest.

    Those of way k from place f, on one side, are first[f, k, side] to first[f, k, side + 1].
    """

    first: NDArray[np.int64]  # (4, k, 3)
    t: NDArray[np.float64]  # (p, 2) shares of the bond where it begins and ends
    cell: NDArray[np.int64]  # (p, 2) the cell it is in, from the node's own


class Whole(NamedTuple):
    """What does not change: the plate with all its n fine nodes."""

    model: Model
    plate: Plate
    xy: NDArray[np.int64]  # (n, 2) of nodes, in spacings from the plate's corner
    row: NDArray[np.int64]  # (ny + 1, nx + 1) of the grid, -1 without a node
    area: NDArray[np.float64]  # (n,) m^2
    cut: NDArray[np.int64]  # (n,) bonds that pre-cracks cut
    corners: NDArray[np.int64]  # (n, 4) nodes with even coordinates that each node lies between
    ways: NDArray[np.int64]  # (k, 2) in spacings
    bonds: PlateBonds
    divisions: Divisions
    bulk: float  # K, Pa
    shear: float  # 2 mu, Pa
    lasts: NDArray[np.bool_]  # (n,) nodes whose bonds do not break
    hot: float  # stretch of a coarse cell beyond which cells around it become fine
    resistance: float  # 1/s^2, of all nodes of any zone: `Operator.stiffness_bound` over density
    driven: Drive  # conditions on all fine nodes

    @property
    def peak(self) -> float:
        """The least stretch that breaks a bond; infinite if none breaks."""
        return float(self.bonds.limit.min(initial=np.inf))


def bonds_of(bonds: Bonds, law: Columns, xy: NDArray[np.int64]) -> tuple[NDArray[np.int64], PlateBonds]:
    """The ways (k, 2) of bonds, and the bonds, each once."""
    own = np.repeat(np.arange(len(bonds.start) - 1), np.diff(bonds.start))
    other = bonds.neighbour.astype(np.int64)
    dx, dy = (xy[other] - xy[own]).T
    some = np.flatnonzero((dx > 0) | (dx == 0) & (dy > 0))
    one, two = own[some], other[some]
    back = find(bonds, two, one)
    ways, way = np.unique(np.column_stack([dx, dy])[some], axis=0, return_inverse=True)
    dilating, shearing = (np.column_stack([each[some], each[back]]) for each in (law.dilating, law.shearing))
    intact = np.ones(len(some), dtype=np.bool_)
    return ways, PlateBonds(one, two, way.ravel(), dilating, shearing, bonds.limit[some].astype(np.float64), intact)


def divisions_of(ways: NDArray[np.int64]) -> Divisions:
    """The parts of the bonds `ways` (k, 2)."""
    first, parts = parts_of(ways)
    return Divisions(
        first, np.array([part[:2] for part in parts]), np.array([part.cell for part in parts], dtype=np.int64)
    )


def places_on(plate: Plate) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Where nodes (n, 2) are, in spacings from the corner; and which row of the grid is where, -1 without a node."""
    y, x = np.divmod(plate.place, plate.at.stride)
    xy = np.column_stack([x - LEFT, y - BELOW])
    row = np.full((plate.at.ny + 1, plate.at.nx + 1), -1, dtype=np.int64)
    row[xy[:, 1], xy[:, 0]] = np.arange(len(xy))
    return xy, row


def corners_of(xy: NDArray[np.int64], row: NDArray[np.int64]) -> NDArray[np.int64]:
    """`Whole.corners`, in rows of their own, of nodes at xy (n, 2)."""
    low, high = xy - xy % 2, np.minimum(xy + xy % 2, np.array(row.shape)[::-1] - 1)
    return np.column_stack([row[y[:, 1], x[:, 0]] for y in (low, high) for x in (low, high)])
