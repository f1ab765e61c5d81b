"""From bonds to the tiles of the kernel in space, some rows at a time."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdmesh.model.full_lattice import offsets
from pdmesh.model.node_grid import Grid
from pdsolve.bonds.assembly import Bonds, Part
from pdsolve.checkpoint import expect_found
from pdsolve.numerics.jit_cache import cached_njit
from pdsolve.operators.simd_lattice.kernel import INNER
from pdsolve.operators.simd_lattice.lanes import ROW
from pdsolve.operators.simd_lattice.layout import aligned
from pdsolve.operators.simd_lattice.pull import NARROW
from pdsolve.operators.space_lattice.kernel import ALIKE, CORRECTED, EMPTY, GENERAL, MODULUS, VOLUME, Tiles
from pdsolve.operators.space_lattice.vectors import FIELDS, INVERSE, PULL, SHARES, X2

OFF_PLACE = 1e-6  # spacings: how far a node may be from its place in the lattice
LEAST_FILLED = 0.25  # nodes over sites of the box around them; less is better listed
SAME = 1e-11  # relative: stiffnesses this close are one
ROUNDED = 1e-5  # relative: what rounding does to e, and more


class Sites(NamedTuple):
    """Where n nodes are in the box around them."""

    site: NDArray[np.int64]  # (n,) with x fastest, the margin before the first included
    place: NDArray[np.int32]  # (n, 3) along each axis
    sides: tuple[int, int, int]  # sites along each axis
    margin: int  # sites before the first and behind the last
    spacing: float  # m
    slot: NDArray[np.int16]  # (2 r + 1,) * 3 number of the offset by its steps along x, y and z plus r, or -1
    ways: NDArray[np.int64]  # (k, 3) steps of offsets, in the order of their sites

    @property
    def tiles(self) -> int:
        """How many tiles the box has."""
        return -(-int(np.prod(self.sides)) // ROW)


def sites_of(grid: Grid, reach: float) -> Sites | None:
    """The sites of a body's nodes, which see each other up to `reach` spacings; None if they are no lattice, or
    so few in a row that two ways to a neighbour pass as many sites."""
    spacing = float(grid.delta[0])
    if (grid.delta != spacing).any():
        return None
    corner = grid.position.min(axis=0)
    along = (grid.position - corner) / spacing
    place = np.rint(along)
    if np.abs(along - place).max() > OFF_PLACE:
        return None
    sides = tuple(int(side) + 1 for side in place.max(axis=0))
    if len(grid) < LEAST_FILLED * float(np.prod([float(side) for side in sides])):
        return None
    stride = np.array([1, sides[0], sides[0] * sides[1]])
    ways = np.rint(offsets(reach, 3)).astype(np.int64)
    ways = ways[np.lexsort(ways.T)]
    if len(np.unique(ways @ stride)) < len(ways):
        return None
    radius = int(np.abs(ways).max())
    slot = np.full((2 * radius + 1,) * 3, -1, dtype=np.int16)
    slot[tuple((ways + radius).T)] = np.arange(len(ways))
    margin = -(-int(np.abs(ways @ stride).max()) // ROW) * ROW
    site = place.astype(np.int64) @ stride + margin
    if len(np.unique(site)) < len(site):
        return None
    return Sites(site, place.astype(np.int32), sides, margin, spacing, slot, ways)  # type: ignore[arg-type]


class _Found(NamedTuple):
    """What is found of bonds while they pass."""

    bits: NDArray[np.uint16]  # (t, k)
    strength: NDArray[np.float64]  # (k,) stiffness without corrections, N/m^3, 0 where there is no bond yet
    limit: NDArray[np.float64]  # (1,) stretch at which bonds break, 0 where there is no bond yet


def tiles_of(
    parts: Iterable[Part],
    sites: Sites,
    of_nodes: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]],
    kind: type[np.floating],
) -> Tiles | None:
    """Bonds of n nodes at these sites, in precision `kind`; None if they are others than brittle ones of one material.

    `of_nodes` are corrections c (n, 3), volumes (n,), m^3, and whose bonds must not break (n,).
    """
    correction, volume, held = of_nodes
    m, count = sites.tiles * ROW + 2 * sites.margin, len(sites.ways)
    c, cells = np.zeros((3, m)), np.zeros((2, m))
    c[:, sites.site] = correction.T
    cells[VOLUME, sites.site] = volume / sites.spacing**3
    cells[MODULUS, sites.site] = 0.5
    found = _Found(np.zeros((sites.tiles, count), np.uint16), np.zeros(count), np.zeros(1))
    squares = sites.ways**2 / (sites.ways**2).sum(axis=1)[:, None]
    for part in parts:
        if not _enter(part.bonds, part.first, sites, squares, (c, cells), held, found):
            return None
    used = np.flatnonzero(found.strength)
    if not len(used):
        return None
    ways, node = sites.ways[used], np.full(sites.tiles * ROW, -1, dtype=np.int32)
    node[sites.site - sites.margin] = np.arange(len(sites.site))
    stride = np.array([1, sites.sides[0], sites.sides[0] * sites.sides[1]])
    limit = float(found.limit[0])
    bits = found.bits if len(used) == count else np.ascontiguousarray(found.bits[:, used])
    table = table_of(ways, sites.spacing, found.strength[used])
    steps = ways @ stride
    return Tiles(
        offsets=steps.astype(np.int32),
        table=table.astype(kind),
        bits=bits,
        c=aligned(c.astype(kind)),
        cells=aligned(cells.astype(kind)),
        kind=_kinds(c, cells, bits, steps, sites.margin),
        node=node,
        held=held,
        margin=sites.margin,
        near=min(limit * (limit + 2) * (1 - ROUNDED), NARROW),
        limit=limit,
    )


def table_of(ways: NDArray[np.int64], spacing: float, strength: NDArray[np.float64]) -> NDArray[np.float64]:
    """`Tiles.table` of offsets (k, 3) whose bonds have the stiffness (k,), N/m^3."""
    xi = ways * spacing
    squared = (xi**2).sum(axis=1)
    table = np.zeros((len(ways), FIELDS))
    table[:, :3], table[:, X2 : X2 + 3], table[:, INVERSE] = xi, 2 * xi / squared[:, None], 1 / squared
    table[:, PULL] = strength / np.sqrt(squared)
    table[:, SHARES : SHARES + 3] = table[:, PULL, None] * xi**2 / squared[:, None] / 2
    return table


def _kinds(
    c: NDArray[np.floating],
    cells: NDArray[np.floating],
    bits: NDArray[np.uint16],
    steps: NDArray[np.int64],
    margin: int,
) -> NDArray[np.uint8]:
    """What the stiffnesses of each tile's bonds (t,) are made of, looking at all sites it may look at."""
    there = cells[MODULUS] > 0
    first = margin + ROW * np.arange(len(bits))
    kind = np.where(there[first[:, None] + np.arange(ROW)].any(axis=1), ALIKE, EMPTY).astype(np.uint8)
    different = (c != 1).any(axis=0), np.abs(cells[VOLUME] - 1) > SAME
    for which, own in zip((CORRECTED, GENERAL), different, strict=True):
        upto = np.concatenate([[0], np.cumsum(own & there)])
        some = upto[first + ROW] > upto[first]
        for slot, step in enumerate(steps):
            some |= (upto[first + step + ROW] > upto[first + step]) & (bits[:, slot] != 0)
        kind[some & (kind != EMPTY)] = which
    return kind


def _enter(
    bonds: Bonds,
    first: int,
    sites: Sites,
    squares: NDArray[np.float64],
    numbers: tuple[NDArray[np.floating], NDArray[np.floating]],
    held: NDArray[np.bool_],
    found: _Found,
) -> bool:
    """Enter the bonds of the rows from `first` on; False if they are not what tiles can tell."""
    if not np.array_equal(bonds.peak, bonds.limit):
        return False
    return bool(_enter_rows(bonds, first, sites, squares, *numbers, held, found))


@cached_njit(error_model="numpy")
def _enter_rows(bonds, first, sites, squares, c, cells, held, found):  # type: ignore[no-untyped-def]
    place, site, radius = sites.place, sites.site, len(sites.slot) // 2
    for own in range(len(bonds.start) - 1):
        i = first + own
        tile, lane = (site[i] - sites.margin) // ROW, (site[i] - sites.margin) % ROW
        for k in range(bonds.start[own], bonds.start[own + 1]):
            j = np.int64(bonds.neighbour[k])
            x, y, z = place[j, 0] - place[i, 0], place[j, 1] - place[i, 1], place[j, 2] - place[i, 2]
            if max(abs(x), abs(y), abs(z)) > radius:
                return False
            slot = sites.slot[x + radius, y + radius, z + radius]
            if slot < 0 or not _is_limit(bonds.limit[k], held[i] or held[j], found.limit):
                return False
            share = 0.0
            for axis in range(3):
                share += squares[slot, axis] * (c[axis, site[i]] + c[axis, site[j]]) / 2
            strength = bonds.stiffness[k] / (share * cells[VOLUME, site[j]])
            if found.strength[slot] == 0:
                found.strength[slot] = strength
            elif abs(strength - found.strength[slot]) > SAME * abs(found.strength[slot]):
                return False
            found.bits[tile, slot] |= np.uint16(1) << np.uint16(lane)
    return True


@njit(**INNER)
def _is_limit(limit, held, at):  # type: ignore[no-untyped-def]
    """Whether a bond breaks as all others do."""
    if held and limit == np.inf:
        return True
    if at[0] == 0:
        at[0] = limit
    return limit == at[0] or abs(limit - at[0]) <= SAME * at[0]


def intact(
    tiles: Tiles, sites: Sites, bits: NDArray[np.uint16], rows: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Source and target rows (b,) and slots of the bonds of these rows, in order."""
    own = sites.site[rows] - tiles.margin
    there = (bits[own // ROW] >> (own % ROW).astype(np.uint16)[:, None]) & np.uint16(1)
    which, slot = np.nonzero(there)
    source, target = rows[which], tiles.node[own[which] + tiles.offsets[slot]].astype(np.int64)
    order = np.lexsort((target, source))
    return source[order], target[order], slot[order]


def springs(
    tiles: Tiles, sites: Sites, source: NDArray[np.int64], target: NDArray[np.int64], slot: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Reference vectors (b, 3), m, and force densities for a unit stretch (b,), N/m^3, of bonds."""
    row, i, j = tiles.table[slot].astype(np.float64), sites.site[source], sites.site[target]
    c, cells = tiles.c, tiles.cells
    w = (row[:, SHARES : SHARES + 3] * (c[:, i].astype(np.float64) + c[:, j]).T).sum(axis=1)
    w *= cells[VOLUME, j].astype(np.float64) * (cells[MODULUS, i] + cells[MODULUS, j])
    return row[:, :3], w / np.sqrt(row[:, INVERSE])


def placed(
    tiles: Tiles, sites: Sites, source: NDArray[np.int64], target: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.uint16]]:
    """Tile, slot and bit of bonds (b,) from `source` to `target`; those of another bond for one that is none."""
    own, step = sites.site[source] - tiles.margin, sites.site[target] - sites.site[source]
    order = np.argsort(tiles.offsets, kind="stable")
    slot = order[np.searchsorted(tiles.offsets[order], step).clip(max=len(order) - 1)]
    return own // ROW, slot, np.uint16(1) << (own % ROW).astype(np.uint16)


def cleared(
    tiles: Tiles, sites: Sites, source: NDArray[np.int64], target: NDArray[np.int64], bits: NDArray[Any]
) -> None:
    """Take bonds (b,) out of the bits (t, k). Raises CheckpointError for one that is none."""
    tile, slot, bit = placed(tiles, sites, source, target)
    step = sites.site[target] - sites.site[source]
    expect_found((tiles.offsets[slot] == step) & ((bits[tile, slot] & bit) != 0), source, target)
    np.bitwise_and.at(bits, (tile, slot), ~bit)
