"""Two passes over families of nodes on lattices, for laws whose passes are tuples: nodal sums, then bond forces.

One description for the plane and for space. Bonds lie in `FamilySlots`, blocks of 64 nodes for nodes in any order, or
in `FamilyTiles`, tiles of 16 sites of a box. Bonds that conduct lie in `FluxTiles`, which have the first pass alone.
What differs between layouts is where a lane's neighbour and numbers are. Sums stay in registers. f_ij consists of sums
over both ends and of vectors that only change sign, so that f_ij = -f_ji to the bit.

u      (d, m) displacements of all places, m; of `FluxTiles` what a law of fluxes asks of nodes
m      (w, m) numbers of nodes between the passes
likes  tuples as long as a bond's numbers, the nodal numbers, what `finish_sums` wants of a node, and a vector
row    (.,) of a reference vector: xi, 2 xi / xi.xi, 1 / xi.xi, |xi|, 1 / |xi|
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.codegen.inner_functions import overloaded
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.codegen.lanes import (
    across,
    beside,
    bonded,
    keep,
    magnitude,
    repeated,
    same,
    stacked,
    where_above,
    which_above,
)
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.bond import (
    IN_PLACE,
    any_beyond,
    difference,
    elongation,
    entries,
    stretched,
    where_inverse,
    where_nonzero,
)
from pdsolve.lattice.fluxes import FluxTiles, conductances
from pdsolve.lattice.force_polynomials import NARROW
from pdsolve.lattice.layout import (
    ONE,
    VECTOR,
    has_bonds,
    in_tiles,
    is_in_tiles,
    neighbours,
    places_of,
    turns_of,
    vector_number,
)
from pdsolve.laws.bond_arrays import Bond, Ends
from pdsolve.laws.calls import accumulate, bond_force, finish_sums, initial_sums, margin
from pdsolve.laws.small_tensors import blank, summed

KIND = VECTOR + 1  # of a slot: row of `kinds`, or -1 less a row of `rows`
SAFE = 1e-6  # nearer to its limit than this share, a bond is looked at by itself
COLUMNS, NODAL, OWN, VECTORS = range(4)  # of `likes`


class FamilySlots(NamedTuple):
    """Bonds in blocks of 64 nodes: s slots, c numbers a bond."""

    start: NDArray[np.int64]  # (blocks + 1,) slots of a block
    slots: NDArray[np.int32]  # (s, 6) ways of the four rows, row of `vectors`, kind: a row of `kinds` where all lanes
    # have the same numbers; a slot at an edge or with a broken bond has -1 less a row of `rows`, 0 without a bond
    ids: NDArray[np.int32]  # (., 16) neighbours
    vectors: NDArray[np.floating]  # (., 8 or 9) rows of reference vectors
    kinds: NDArray[np.floating]  # (., c)
    rows: NDArray[np.floating]  # (., c, 64)


class FamilyTiles(NamedTuple):
    """Bonds in t tiles of 16 sites with k offsets, m sites; l lines of w places, q numbers a bond and direction.

    A tile lies in one row of the lattice. Numbers are stored for rows of sites, which share them where they are alike;
    those of the bond the other way are its neighbour's.
    """

    offsets: NDArray[np.int32]  # (k,) from a site to that of its neighbour
    rows: NDArray[np.int32]  # (k,) and from a row to that of its neighbour
    ahead: NDArray[np.int32]  # (k,) and along the row
    vectors: NDArray[np.floating]  # (k, 9) rows of reference vectors
    bits: NDArray[np.uint16]  # (t, k) lanes with an intact bond
    lines: NDArray[np.int32]  # (.,) of each row, those of the margins included
    numbers: NDArray[np.floating]  # (q, l k w) of bonds over the neighbour's volume, 0 without a bond
    volume: NDArray[np.floating]  # (1, m) over h^3
    wide: int  # w
    pad: int  # places of a line before its first site
    across: int  # tiles in a row
    margin: int  # sites before the first
    beyond: int  # rows before the first


@overloaded(IN_PLACE)
def numbers(bonds, tile, slot, lane, at, like):  # type: ignore[no-untyped-def]
    """Numbers of the bonds of some lanes, as the law's `tabled` has them."""
    if bonds.instance_class is FluxTiles:
        return lambda bonds, tile, slot, lane, at, like: conductances(bonds, tile, slot, lane, at)
    if is_in_tiles(bonds):
        return _two_numbers if len(like) == 4 else _three_numbers
    return _numbers_in_block


def _numbers_in_block(bonds, tile, slot, lane, at, like):  # type: ignore[no-untyped-def]
    kind = np.int64(bonds.slots[slot, KIND])
    if kind >= 0:
        return repeated(bonds.kinds, like, kind)
    return stacked(bonds.rows, like, -1 - kind, lane)


def _two_numbers(bonds, tile, slot, lane, at, like):  # type: ignore[no-untyped-def]
    place, reverse_place = _places(bonds, tile, slot, lane)
    (size,) = beside(bonds.volume, ONE, at + bonds.offsets[slot])
    a, b = beside(bonds.numbers, (0, 0), place), beside(bonds.numbers, (0, 0), reverse_place)
    return bonded((a[0] * size, b[0] * size, a[1] * size, b[1] * size), bonds.bits, tile, slot, lane)


def _three_numbers(bonds, tile, slot, lane, at, like):  # type: ignore[no-untyped-def]
    place, reverse_place = _places(bonds, tile, slot, lane)
    (size,) = beside(bonds.volume, ONE, at + bonds.offsets[slot])
    a, b = beside(bonds.numbers, (0, 0, 0), place), beside(bonds.numbers, (0, 0), reverse_place)
    return bonded((a[0] * size, b[0] * size, a[1] * size, b[1] * size, a[2] * size), bonds.bits, tile, slot, lane)


@njit(**IN_PLACE)
def _places(bonds, tile, slot, lane):  # type: ignore[no-untyped-def]
    """Where the numbers of a tile's bonds are, and those of the bonds the other way."""
    row, x = bonds.beyond + tile // bonds.across, bonds.pad + tile % bonds.across * ROW + lane
    count = len(bonds.offsets)
    place = (np.int64(bonds.lines[row]) * count + slot) * bonds.wide + x
    neighbour_line = np.int64(bonds.lines[row + bonds.rows[slot]])
    return place, (neighbour_line * count + count - 1 - slot) * bonds.wide + x + bonds.ahead[slot]


@in_tiles(lambda bonds, tile, slot, lane, c, eta: bonded(eta, bonds.bits, tile, slot, lane))
def intact(bonds, tile, slot, lane, c, eta):  # type: ignore[no-untyped-def]
    """eta, and 0 in lanes without a bond."""
    return where_nonzero(c[0], eta)


@overloaded(IN_PLACE)
def bonds_at(bonds, tile, slot, lane, at, c, u, here):  # type: ignore[no-untyped-def]
    """The bonds of some lanes whose nodes have the values `here`: deformed, or in `FluxTiles` what their ends have."""
    if bonds.instance_class is FluxTiles:
        return lambda bonds, tile, slot, lane, at, c, u, here: Ends(here, neighbours(bonds, u, here, at, slot, lane))
    return lambda bonds, tile, slot, lane, at, c, u, here: _deform(bonds, tile, slot, lane, at, c, u, here)


@njit(**IN_PLACE)
def _deform(bonds, tile, slot, lane, at, c, u, displacement):  # type: ignore[no-untyped-def]
    """Deformed bonds of some lanes; lanes without a bond are undeformed."""
    row = bonds.vectors[vector_number(bonds, slot)]
    away = difference(neighbours(bonds, u, displacement, at, slot, lane), displacement)
    eta, inverse_length = intact(bonds, tile, slot, lane, c, away), where_inverse(len(displacement)) + 2
    e = elongation(eta, row)
    stretch, inverse = stretched(e)
    size, near = magnitude(e), same(u, NARROW)
    if any_beyond(size, near):  # lane by lane, so that a sum does not depend on the lanes beside it
        q = np.sqrt(1.0 + e)
        stretch, inverse = where_above(size, near, e / (q + 1.0), stretch), where_above(size, near, 1.0 / q, inverse)
    length = row[inverse_length - 1]
    q = 1.0 + stretch
    return Bond(entries(row, displacement), eta, length, q, stretch, length * stretch, row[inverse_length] * inverse)


@cached_njit(nogil=True, error_model="numpy")
def sum_first_pass(bonds, law, u, constants, m, likes, by_lanes, first, last):  # type: ignore[no-untyped-def]
    """Fill m (w, m) in the tiles `first` to `last` - 1 with nodal numbers between the passes or, without `by_lanes`,
    with their sums."""
    none = same(u, 0.0)
    for tile in range(first, last):
        place, lanes = places_of(bonds, tile)
        begin, end = turns_of(bonds, tile, 0)
        for lane in range(0, lanes, across(u)):
            at = place + lane
            values, sums = beside(u, likes[VECTORS], at), initial_sums(law, likes[VECTORS], none)
            for slot in range(begin, end):
                if has_bonds(bonds, tile, slot):
                    c = numbers(bonds, tile, slot, lane, at, likes[COLUMNS])
                    sums = accumulate(law, bonds_at(bonds, tile, slot, lane, at, c, u, values), c, sums)
            if by_lanes:
                keep(finish_sums(law, sums, beside(constants, likes[OWN], at)), m, at)
            else:
                keep(sums, m, at)


@cached_njit(nogil=True, error_model="numpy")
def sum_bond_forces(bonds, law, u, m, f, near, likes, first, last):  # type: ignore[no-untyped-def]
    """Fill f (d, m) in the tiles `first` to `last` - 1 with force densities, N/m^3, and mark in `near` (m,) the nodes
    with a bond over its limit, or nearly; None: bonds have no limit that is looked at."""
    none = same(u, 0.0)
    for tile in range(first, last):
        place, lanes = places_of(bonds, tile)
        begin, end = turns_of(bonds, tile, 0)
        for lane in range(0, lanes, across(u)):
            at, over = place + lane, 0
            displacement, nodal = beside(u, likes[VECTORS], at), beside(m, likes[NODAL], at)
            pull = blank(likes[VECTORS], none)
            for slot in range(begin, end):
                if has_bonds(bonds, tile, slot):
                    c = numbers(bonds, tile, slot, lane, at, likes[COLUMNS])
                    neighbour_nodal = neighbours(bonds, m, likes[NODAL], at, slot, lane)
                    bond = _deform(bonds, tile, slot, lane, at, c, u, displacement)
                    pull = summed(pull, bond_force(law, bond, c, nodal, neighbour_nodal))
                    if near is not None:
                        value, limit = margin(law, bond, c, nodal, neighbour_nodal)
                        over |= which_above(value, limit * (1.0 - SAFE))
            keep(pull, f, at)
            if near is not None:
                for k in range(across(u)):
                    near[at + k] = (over >> k) & 1 != 0
