"""The families of the current nodes: bonds between free nodes, other pieces, and their weights at sites."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.lattice import BORDER, FREE
from pdsolve.adaptivity.hybrid.state_based.arrangement import UNIT, Nodes, pieces_of
from pdsolve.adaptivity.hybrid.state_based.border_weights import Wanted, weights_of
from pdsolve.adaptivity.hybrid.state_based.families import Families, Inner, Pieces
from pdsolve.adaptivity.hybrid.state_based.plate import Whole


class Linked(NamedTuple):
    """The families of n nodes."""

    families: Families
    border: NDArray[np.int64]  # (s - n,) rows of the grid of sites on the border, which are numbered after nodes


class Ends(NamedTuple):
    """The ends of p pieces."""

    free: NDArray[np.bool_]  # (p, 2)
    at: NDArray[np.int64]  # (p, 2, 2) h / UNIT
    point: NDArray[np.int64]  # (p, 2) nodes, then places on the border
    rows: NDArray[np.int64]  # (q, 2) of the grid, that move these
    w: NDArray[np.float64]  # (q, 2)


class AtSites(NamedTuple):
    """What s sites on the border have of the k ways of bonds."""

    number: NDArray[np.int64]  # (s, k) bonds
    dilating: NDArray[np.float64]  # (s, k) mean D
    shearing: NDArray[np.float64]  # (s, k)


def linked(whole: Whole, cells: NDArray[np.uint8], nodes: Nodes, row: NDArray[np.int64]) -> Linked:
    """The families of nodes in these cells (c,); `row` (n,) is the number of each fine node, -1 of those that are
    none."""
    found, bonds, h = pieces_of(whole, cells), whole.bonds, whole.plate.h
    one, two = bonds.one[found.bond], bonds.two[found.bond]
    share = found.t[:, 1] - found.t[:, 0]
    between = (share == 1) & (found.part == 1) & (nodes.kind[one] == FREE) & (nodes.kind[two] == FREE)
    border = np.flatnonzero(nodes.kind == BORDER)
    count = int(np.count_nonzero(row >= 0))
    some = np.flatnonzero(~between)
    bond, t, part, share = found.bond[some], found.t[some], found.part[some], share[some]
    ends = _ends(whole, nodes, row, bond, t, count)
    length = h * np.hypot(*whole.ways[bonds.way[bond]].T)
    volume = np.column_stack([whole.area[bonds.one[bond]], whole.area[bonds.two[bond]]])
    at_sites = _at_sites(whole, border)
    v = volume / h**2
    rest = part * v.sum(axis=1) - np.where(ends.free, v, 0.0).sum(axis=1) / share
    site = np.full(whole.row.shape, -1, dtype=np.int64)
    site[whole.xy[border, 1], whole.xy[border, 0]] = np.arange(len(border))
    of, end = np.nonzero(~ends.free)
    weights = weights_of(
        Wanted(
            way=bonds.way[bond],
            share=share,
            rest=rest,
            end=ends.at[of, end] / UNIT,
            of=of,
            site=site,
            v=nodes.share[border],
            number=at_sites.number,
        )
    )
    own, way = np.nonzero(ends.free), bonds.way[bond[weights.piece]]
    by_v = weights.c / nodes.share[border][weights.site]
    piece = np.concatenate([own[0], weights.piece])
    a = np.concatenate([(bonds.dilating[bond] / share[:, None])[own], by_v * at_sites.dilating[weights.site, way]])
    b = np.concatenate([(bonds.shearing[bond] / share[:, None])[own], by_v * at_sites.shearing[weights.site, way]])
    order = np.argsort(piece, kind="stable")
    pieces = Pieces(
        bond=bond,
        ends=ends.point.astype(np.int32),
        xi=_xi(whole, bond, share),
        k=part * (bonds.shearing[bond] * volume).sum(axis=1) / share,
        limit=bonds.limit[bond],
        start=np.searchsorted(piece[order], np.arange(len(bond) + 1)),
        site=np.concatenate([ends.point[own], count + weights.site])[order],
        a=a[order],
        b=(b * length[piece])[order],
    )
    sites = np.concatenate([whole.area[row >= 0], nodes.share[border] * h**2])
    inner = _inner(whole, found.bond[between], row)
    return Linked(Families(whole.bulk, sites, inner, pieces, row[ends.rows], ends.w), border)


def _xi(whole: Whole, bond: NDArray[np.int64], share: NDArray[np.float64]) -> NDArray[np.float64]:
    """From one end to the other, m, and how far that is (p, 3)."""
    xi = whole.plate.h * share[:, None] * whole.ways[whole.bonds.way[bond]]
    return np.column_stack([xi, np.hypot(*xi.T)])


def _inner(whole: Whole, bond: NDArray[np.int64], row: NDArray[np.int64]) -> Inner:
    """Whole bonds between free nodes."""
    bonds, xi = whole.bonds, _xi(whole, bond, np.ones(len(bond)))
    ends = np.column_stack([row[bonds.one[bond]], row[bonds.two[bond]]]).astype(np.int32)
    b = bonds.shearing[bond] * xi[:, 2:]
    return Inner(bond, ends, xi, bonds.dilating[bond].copy(), b, bonds.limit[bond].copy())


def _ends(
    whole: Whole,
    nodes: Nodes,
    row: NDArray[np.int64],
    bond: NDArray[np.int64],
    t: NDArray[np.float64],
    count: int,
) -> Ends:
    """The ends of pieces; points on the border follow `count` nodes."""
    bonds = whole.bonds
    way = whole.ways[bonds.way[bond]]
    at = np.rint(UNIT * (whole.xy[bonds.one[bond]][:, None] + t[:, :, None] * way[:, None])).astype(np.int64)
    x, y = at[..., 0], at[..., 1]
    node = whole.row[y // UNIT, x // UNIT]
    free = (x % UNIT == 0) & (y % UNIT == 0) & (node >= 0) & (nodes.kind[node] == FREE)
    point = np.where(free, row[node], 0)
    places, which = np.unique(at[~free], axis=0, return_inverse=True)
    point[~free] = count + which.ravel()
    px, py = places.T
    cell = 2 * UNIT
    upright = px % cell == 0
    along = np.where(upright, py, px)
    low, beyond = along // cell, along % cell / cell
    rows = np.empty((len(places), 2), dtype=np.int64)
    for end in (0, 1):
        last = 2 * np.where(beyond > 0, low + end, low)
        column, line = np.where(upright, px // UNIT, last), np.where(upright, last, py // UNIT)
        rows[:, end] = whole.row[line, column]
    return Ends(free, at, point, rows, np.column_stack([1 - beyond, beyond]))


def _at_sites(whole: Whole, border: NDArray[np.int64]) -> AtSites:
    """What the sites on the border, in these rows (s,), have of bonds."""
    bonds, shape = whole.bonds, (len(border), len(whole.ways))
    number, sums = np.zeros(shape, dtype=np.int64), np.zeros((2, *shape))
    site = np.full(len(whole.xy), -1, dtype=np.int64)
    site[border] = np.arange(len(border))
    for end, rows in enumerate((bonds.one, bonds.two)):
        some = np.flatnonzero((site[rows] >= 0) & bonds.intact)
        where = site[rows[some]], bonds.way[some]
        np.add.at(number, where, 1)
        np.add.at(sums[0], where, bonds.dilating[some, end])
        np.add.at(sums[1], where, bonds.shearing[some, end])
    return AtSites(number, *(sums / np.maximum(number, 1)))
