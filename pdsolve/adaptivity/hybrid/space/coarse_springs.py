"""The springs of coarse cells: their constants, and the lattice of those that there are.

A cell of H = 2 h has springs on its 12 edges, the 12 diagonals of its faces and its 4 body diagonals, of

    k_b = 1.5 tau C11 h          of a body diagonal
    k_f = 2 h C12 - 4/3 k_b      of a face diagonal, half of it from each of two cells
    k_e = 2 h (C11 - 2 C12) + 4/3 k_b      of an edge, a quarter of it from each of four cells

They have the stiffness of the fine lattice for any tau. With tau from the force f_i = tau C11 h^2 gamma_jk that fine
bonds leave on the vertex of a fine cube under shear, vertices of fine zones are in equilibrium too.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.force_polynomials import NARROW
from pdsolve.lattice.sites import Sites
from pdsolve.lattice.tile_bonds import INVERSE, PULL, offset_table
from pdsolve.lattice.tiles import ALIKE, EMPTY, MODULUS, SOFT_GENERAL, VOLUME, Tiles, displaced_of_bond
from pdsolve.laws.law import Law
from pdsolve.laws.pair import no_bonds
from pdsolve.laws.pair_laws import brittle
from pdsolve.numerics.memory import aligned
from pdsolve.zone.cells import (
    COARSE,
    LatticeNumbering,
    place_number_at,
    place_on_finer_lattice,
    vectorize_over_axes,
)


class CubicStiffness(NamedTuple):
    """Stiffness of a cubic lattice."""

    c11: float  # Pa
    c12: float


def cubic_stiffness(table: NDArray[np.floating]) -> CubicStiffness:
    """The stiffness of a full lattice with these bonds; see `Tiles.vectors`."""
    xi, energy = table[:, :3], table[:, PULL] / 2
    n2 = xi**2 * table[:, INVERSE, None]
    energy = energy / table[:, INVERSE]
    return CubicStiffness(float((energy * n2[:, 0] ** 2).sum()), float((energy * n2[:, 0] * n2[:, 1]).sum()))


def coarse_spring_offsets() -> NDArray[np.int64]:
    """The offsets (26, 3) of a coarse node's springs, in the order of their sites."""
    steps = np.arange(-1, 2)
    z, y, x = (axis_steps.ravel() for axis_steps in np.meshgrid(steps, steps, steps, indexing="ij"))
    offsets = np.column_stack([x, y, z])
    return np.asarray(offsets[offsets.any(axis=1)])


def coarse_spring_stiffnesses(elastic: CubicStiffness, vertex_force_ratio: float, h: float) -> NDArray[np.float64]:
    """Stiffness (26,), N/m, of whole springs."""
    body = 1.5 * vertex_force_ratio * elastic.c11 * h
    face = 2 * h * elastic.c12 - 4 / 3 * body
    edge = 2 * h * (elastic.c11 - 2 * elastic.c12) + 4 / 3 * body
    return np.asarray(np.array([edge, face, body])[np.count_nonzero(coarse_spring_offsets(), axis=1) - 1])


def create_coarse_sites(numbering: LatticeNumbering, h: float) -> Sites:
    """The sites of the coarse nodes of a box; no node is there yet."""
    margin = -(-(sum(numbering.strides)) // ROW) * ROW
    node = np.full(-(-numbering.place_count // ROW) * ROW, -1, dtype=np.int32)
    return Sites(np.zeros(0, dtype=np.int64), node, numbering.counts, margin, 2 * h, coarse_spring_offsets())


def law_of_springs(law: Law) -> Law:
    """The law of the springs that stand for bonds of this law: one of straight lines."""
    assert law.pair is not None
    return brittle.LAW if law.pair.is_curved else law


def create_spring_tiles(law: Law, sites: Sites, stiffness: NDArray[np.float64]) -> Tiles:
    """Springs (26,), N/m, of coarse nodes; none is there yet. Sums over them are forces, N."""
    length = np.sqrt((sites.ways**2).sum(axis=1)) * sites.spacing
    c, cells = np.ones((3, sites.size)), np.ones((2, sites.size))
    cells[VOLUME], cells[MODULUS] = 1.0, 0.5
    tiles, slots = sites.tiles, len(sites.ways)
    return Tiles(
        law=no_bonds(law),
        axes=(0, 0, 0),
        offsets=sites.steps.astype(np.int32),
        vectors=offset_table(sites.ways, sites.spacing, stiffness * length),
        bits=np.zeros((tiles, slots), dtype=np.uint16),
        c=aligned(c),
        cells=aligned(cells),
        kind=np.full(tiles, EMPTY, dtype=np.uint8),
        node=sites.node,
        unbreakable=np.zeros(0, dtype=np.bool_),
        material=np.zeros(0, dtype=np.uint8),
        peak=np.full((1, slots), np.inf),
        limit=np.full((1, slots), np.inf),
        memory=np.arange(tiles, dtype=np.int32),
        share=np.zeros((tiles, slots, ROW)),
        worst=np.zeros((0, slots, ROW)),
        margin=sites.margin,
        floor=-np.inf,
        near=NARROW,
        edge=np.inf,
    )


# Cell 0 to 2^d - 1 of those that the spring `step` from coarse node x lies in or beside; some are the same
_cell_beside_spring = vectorize_over_axes(
    lambda along, axis, step, number: along + (min(step[axis], 0) if step[axis] else (number >> axis & 1) - 1)
)


@cached_njit(error_model="numpy")
def set_coarse_springs(numbering, cells, cell_moduli, spring_offsets, coarse_nodes, tiles):  # type: ignore[no-untyped-def]
    """Set the springs of the coarse nodes (k, 3) in `coarse_nodes`; `cell_moduli` (c,) is that of cells."""
    for n in range(len(coarse_nodes)):
        x = coarse_nodes[n, 0], coarse_nodes[n, 1], coarse_nodes[n, 2]
        site = place_number_at(numbering.coarse, x)
        tile, lane = site // ROW, site % ROW
        for slot in range(len(spring_offsets)):
            total_modulus = 0.0
            for number in range(1 << len(x)):
                cell = place_number_at(numbering.cells, _cell_beside_spring(x, spring_offsets[slot], number))
                total_modulus += cell_moduli[cell] if cells[cell] == COARSE else 0.0
            share, bit = total_modulus / (1 << len(x)), np.uint16(1) << np.uint16(lane)
            tiles.share[tile, slot, lane] = share
            if share > 0:
                tiles.bits[tile, slot] |= bit
            else:
                tiles.bits[tile, slot] &= ~bit
        tiles.kind[tile] = _tile_stiffness_kind(tiles, tile)


@cached_njit(error_model="numpy")
def _tile_stiffness_kind(tiles, tile):  # type: ignore[no-untyped-def]
    """What the stiffnesses of a tile are made of."""
    kind = EMPTY
    for slot in range(len(tiles.offsets)):
        for lane in range(ROW):
            share = tiles.share[tile, slot, lane]
            if share not in (0, 1):
                return SOFT_GENERAL
            if share > 0:
                kind = ALIKE
    return kind


@cached_njit(error_model="numpy")
def add_spring_energies(tiles, u, node_energy, tile_numbers):  # type: ignore[no-untyped-def]
    """Add the energies (n,), J, of the springs of the coarse nodes in `tile_numbers` tiles (s,), half to each end."""
    for t in tile_numbers:
        if tiles.kind[t] == EMPTY:
            continue
        for slot in range(len(tiles.offsets)):
            row, word = tiles.vectors[slot], tiles.bits[t, slot]
            for lane in range(ROW):
                if (word >> np.uint16(lane)) & np.uint16(1):
                    e = _spring_double_green_strain(tiles, u, t * ROW + lane, slot)
                    stretch = e / (np.sqrt(1 + e) + 1)
                    c = row[PULL] * tiles.share[t, slot, lane] / row[INVERSE] / 4
                    node_energy[tiles.node[t * ROW + lane]] += c * stretch * stretch


@njit(**INNER)
def _spring_double_green_strain(tiles, u, site, slot):  # type: ignore[no-untyped-def]
    """The e of a spring."""
    row, near, e = tiles.vectors[slot], tiles.margin + site, 0.0
    for axis in range(3):
        eta = displaced_of_bond(u, tiles.shrink, row, axis, near, tiles.offsets[slot])
        e += row[INVERSE] * eta * (2 * row[axis] + eta)
    return e


@cached_njit(error_model="numpy")
def list_nodes_with_stretched_springs(  # type: ignore[no-untyped-def]
    numbering, tiles, unbreakable, u, refinement_stretch, either_way, stretched_sites
):
    """List the fine sites of coarse nodes with a spring stretched beyond `refinement_stretch` (sites,) at one of its
    ends, or shortened so far, if `either_way`; returns how many there are.

    `unbreakable` (n,) are the nodes whose bonds do not break.
    """
    count, half = 0, len(tiles.offsets) // 2
    for t in range(len(tiles.kind)):
        if tiles.kind[t] == EMPTY:
            continue
        for slot in range(half, 2 * half):
            word = tiles.bits[t, slot]
            for lane in range(ROW):
                if (word >> np.uint16(lane)) & np.uint16(1) == 0:
                    continue
                site = t * ROW + lane
                neighbour = site + tiles.offsets[slot]
                limit = min(refinement_stretch[site], refinement_stretch[neighbour])
                e = _spring_double_green_strain(tiles, u, site, slot)
                above = (abs(e) if either_way else e) > limit * (2 + limit)
                if above and not (unbreakable[tiles.node[site]] or unbreakable[tiles.node[neighbour]]):
                    for end in (site, neighbour):
                        if count < len(stretched_sites):
                            site_below = place_on_finer_lattice(numbering.coarse, numbering.fine, 2, end)
                            stretched_sites[count] = site_below
                            count += 1
    return count
