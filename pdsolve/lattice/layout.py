"""Where bonds are in lanes: in blocks of 64 nodes in any order, or in tiles of 16 sites of a box.

A group is a block or a tile; its lanes have places side by side. A slot has at most one bond a lane. Blocks list their
slots, each of which says where the neighbours of its lanes are; tiles share the slots of one pattern, a slot for each
offset between sites. Sums of forces, families and fluxes are written once over the functions of this file, which are
compiled for each layout: blocks are tuples of arrays with `ids`, tiles such with `offsets`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any

import numpy as np

from pdsolve.codegen.inner_functions import overloaded
from pdsolve.codegen.lanes import beside, listed
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.bond import IN_PLACE
from pdsolve.laws.calls import pair_of
from pdsolve.laws.law import Pair

LANES = 4 * ROW  # of a block
FAR = 1 << 30  # more than any way between two nodes
VECTOR = 4  # of a block's slot, behind the ways of its four rows: row of `vectors`
PLANE, ONE = (0, 0), (0,)  # of as many rows
# Numbers of a reference vector in a dimension: xi, 2 xi / xi.xi, 1 / xi.xi, |xi| and its inverse; to a round number
VECTOR_WIDTH = {2: 8, 3: 9}


def is_in_tiles(bonds: Any) -> bool:
    """Whether the numba type of bonds is that of tiles."""
    return _has_field(bonds, "offsets")


def _has_field(bonds: Any, name: str) -> bool:
    return name in bonds.instance_class._fields


def pair_law_of(bonds: Any) -> Pair:
    """The pair law of the numba type of bonds."""
    return pair_of(bonds.types[bonds.instance_class._fields.index("law")])


def in_tiles(
    for_tiles: Callable[..., Any], jit_options: dict[str, Any] = IN_PLACE
) -> Callable[[Callable[..., Any]], Any]:
    """Compile the decorated function for bonds in blocks, and another one in its place for bonds in tiles.

    Bonds are the first argument of both.
    """

    def decorate(for_blocks: Callable[..., Any]) -> Any:
        @wraps(for_blocks)
        def choose(bonds: Any, *arguments: Any) -> Any:
            return for_tiles if is_in_tiles(bonds) else for_blocks

        return overloaded(jit_options)(choose)

    return decorate


@in_tiles(lambda bonds, group: (bonds.margin + group * ROW, ROW))
def places_of(bonds, group):  # type: ignore[no-untyped-def]
    """The first place of a group, and how many it has."""
    return group * LANES, LANES


@overloaded(IN_PLACE)
def turns_of(bonds, group, lane):  # type: ignore[no-untyped-def]
    """The first turn of a row of lanes and the one after the last: slots of the group or, in blocks with `of_rows`,
    entries of the row."""
    if _has_field(bonds, "filled"):
        return lambda bonds, group, lane: (0, len(bonds.offsets) if bonds.filled[group] else 0)
    if is_in_tiles(bonds):
        return lambda bonds, group, lane: (np.int64(0), np.int64(len(bonds.offsets)))
    if not _looks_at_rows(bonds):
        return lambda bonds, group, lane: (bonds.start[group], bonds.start[group + 1])

    def of_row(bonds, group, lane):  # type: ignore[no-untyped-def]
        row = (group * LANES + lane) // ROW
        return bonds.start_of_rows[row], bonds.start_of_rows[row + 1]

    return of_row


@overloaded(IN_PLACE)
def slot_at(bonds, turn):  # type: ignore[no-untyped-def]
    """The slot whose turn it is."""
    if _looks_at_rows(bonds):
        return lambda bonds, turn: np.uint64(bonds.of_rows[turn])
    return lambda bonds, turn: np.uint64(turn)  # unsigned saves a look whether it counts from the end


def _looks_at_rows(bonds: Any) -> bool:
    """Whether slots are looked at row by row: in blocks of bodies."""
    fields = bonds.instance_class._fields
    return "of_rows" in fields and len(bonds.types[fields.index("axes")]) == 3


@overloaded(IN_PLACE)
def has_bonds(bonds, group, slot):  # type: ignore[no-untyped-def]
    """Whether a slot may have bonds in a group."""
    if is_in_tiles(bonds) and not _has_field(bonds, "general"):  # else bits are looked at in few tiles alone
        return lambda bonds, group, slot: bonds.bits[np.uint64(group), slot] != 0
    return lambda bonds, group, slot: True


@in_tiles(lambda bonds, slot, lane: False)
def are_listed(bonds, slot, lane):  # type: ignore[no-untyped-def]
    """Whether the neighbours of some lanes are listed: they are not side by side."""
    return bonds.slots[slot, np.uint64(lane) // np.uint64(ROW)] >= FAR


@in_tiles(lambda bonds, array, like, at, slot, lane: beside(array, like, at + bonds.offsets[slot]))
def neighbours(bonds, array, like, at, slot, lane):  # type: ignore[no-untyped-def]
    """Values of the neighbours of some lanes, the first of which is at the place `at`, in the rows of an array."""
    way = np.int64(bonds.slots[slot, np.uint64(lane) // np.uint64(ROW)])
    if way < FAR:
        return beside(array, like, at + way)
    return listed(array, like, bonds.ids, (way - FAR) * ROW + lane % ROW)


@in_tiles(lambda bonds, slot: np.uint64(slot))
def vector_number(bonds, slot):  # type: ignore[no-untyped-def]
    """The row of `vectors` that a slot has."""
    return np.uint64(bonds.slots[slot, VECTOR])
