"""Numbering of nodes and cells row by row, with margins, so that a neighbour is at a constant offset.

x   of a fine node (d,), 0 to its counts - 1; of a coarse node, which lies on the fine node 2 x; of a far node, which
    lies on the fine node 4 x; of a cell of 2 h: that of the coarse node at its lowest corner

The place of a node or cell is its number on its lattice.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from numba import njit
from numba.extending import overload, register_jitable

from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.vector_code import ROW

LEFT = ROW  # idle places before each row of nodes in the plane
BELOW = 8  # idle rows of fine nodes below and above
BELOW_COARSE = 2  # of coarse and far ones
AROUND = 6  # cells around the plate that are void
EVERY = 8  # steps between two looks at what has broken and what is stretched
AHEAD = 8  # h: cells this near to a node that has lost a bond become fine
TIPS = 12  # h: likewise to the tip of a pre-crack, at the start
RING = 4  # h beyond the family's reach: likewise to a cell that an outline cuts, at the start
# cells; empty ones have none of the plate, as void ones, but bonds pass through; far ones are four at a time one of 4 h
COARSE, FINE, VOID, EMPTY, FAR = range(5)
IDLE, FREE, BORDER = range(3)  # nodes; those on the border move with coarser ones
_IN_PLACE: dict[str, Any] = INNER | {"forceinline": True}


class LatticeNumbering(NamedTuple):
    """Places of the nodes of one lattice, or of all cells of 2 h."""

    counts: tuple[int, ...]  # (d,) nodes or cells along each axis
    margins: tuple[int, ...]  # (d,) idle places before the first along each axis
    strides: tuple[int, ...]  # (d,) places from one to the next along each axis, 1 along x
    place_count: int

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape (d,) of an array of all places: its last axis is x."""
        ends = (*self.strides[1:], self.place_count)
        return tuple(end // stride for end, stride in zip(ends, self.strides, strict=True))[::-1]

    @property
    def inner(self) -> tuple[slice, ...]:
        """Where nodes or cells are in an array of all places of that shape."""
        ends = zip(self.margins, self.counts, strict=True)
        return tuple(slice(margin, margin + count) for margin, count in ends)[::-1]


class ZoneNumbering(NamedTuple):
    """Places of the nodes of all spacings and of cells."""

    fine: LatticeNumbering
    coarse: LatticeNumbering
    far: LatticeNumbering
    cells: LatticeNumbering


def create_lattice_numbering(
    counts: tuple[int, ...], margins: tuple[int, ...], row_length: int | None = None
) -> LatticeNumbering:
    """Places of so many nodes or cells with `margins` on both sides of each axis; rows have `row_length` places, if
    given."""
    strides = [1]
    for count, margin in zip(counts, margins, strict=True):
        along = count + 2 * margin if row_length is None or len(strides) > 1 else row_length
        strides.append(strides[-1] * along)
    return LatticeNumbering(counts, margins, tuple(strides[:-1]), strides[-1])


def create_plate_numbering(fine_cells_x: int, fine_cells_y: int) -> ZoneNumbering:
    """Places of a rectangle of so many squares between fine nodes, both even; rows begin at whole rows of 16."""
    nodes = list[LatticeNumbering]()
    for ratio, below in ((1, BELOW), (2, BELOW_COARSE), (4, BELOW_COARSE)):
        counts = fine_cells_x // ratio + 1, fine_cells_y // ratio + 1
        nodes.append(create_lattice_numbering(counts, (LEFT, below), ROW * -(-(LEFT + counts[0] + BELOW) // ROW)))
    fine, coarse, far = nodes
    cells = create_lattice_numbering((fine_cells_x // 2, fine_cells_y // 2), (AROUND, AROUND))
    return ZoneNumbering(fine, coarse, far, cells)


def create_body_numbering(fine_nodes: tuple[int, ...], reach: int) -> ZoneNumbering:
    """Places of a box of so many fine nodes along each axis, whose bonds reach so many spacings.

    Nodes have no margins, as in tiles without theirs. There are no far nodes.
    """
    none, cells = (0,) * len(fine_nodes), tuple(max(1, count // 2) for count in fine_nodes)
    coarse, void = tuple(count + 1 for count in cells), (reach // 2 + 2,) * len(cells)
    fine, coarse_nodes, far = (create_lattice_numbering(counts, none) for counts in (fine_nodes, coarse, none))
    return ZoneNumbering(fine, coarse_nodes, far, create_lattice_numbering(cells, void))


def place_number_at(numbering: LatticeNumbering, x: Any) -> Any:
    """The place of the node or cell x (d,), or places of arrays of such."""
    steps = zip(x, numbering.margins, numbering.strides, strict=True)
    return sum((along + margin) * stride for along, margin, stride in steps)


@overload(place_number_at, jit_options=_IN_PLACE)
def _compile_place_number_at(numbering, x):  # type: ignore[no-untyped-def]
    if len(x) == 2:
        return lambda numbering, x: (x[1] + numbering.margins[1]) * numbering.strides[1] + numbering.margins[0] + x[0]

    def place_in_3d(numbering, x):  # type: ignore[no-untyped-def]
        margins, strides = numbering.margins, numbering.strides
        return (x[2] + margins[2]) * strides[2] + (x[1] + margins[1]) * strides[1] + margins[0] + x[0]

    return place_in_3d


def lattice_coordinates(numbering: LatticeNumbering, place: Any) -> Any:
    """The node or cell x (d,) at a place, or arrays of such at places."""
    x = []
    for stride, margin in zip(numbering.strides[:0:-1], numbering.margins[:0:-1], strict=True):
        along, place = divmod(place, stride)
        x.append(along - margin)
    return place - numbering.margins[0], *x[::-1]


@overload(lattice_coordinates, jit_options=_IN_PLACE)
def _compile_lattice_coordinates(numbering, place):  # type: ignore[no-untyped-def]
    if len(numbering.types[0]) == 2:
        return lambda numbering, place: (
            place % numbering.strides[1] - numbering.margins[0],
            place // numbering.strides[1] - numbering.margins[1],
        )

    def coordinates_in_3d(numbering, place):  # type: ignore[no-untyped-def]
        margins, strides = numbering.margins, numbering.strides
        return (
            place % strides[1] - margins[0],
            place % strides[2] // strides[1] - margins[1],
            place // strides[2] - margins[2],
        )

    return coordinates_in_3d


def vectorize_over_axes(function: Any) -> Any:
    """A function of coordinates (d,) and further arguments, in Python and in compiled code: the coordinates (d,) that
    `function` returns for one along an axis, the number of that axis, and the further arguments."""
    compiled = njit(**_IN_PLACE)(function)

    def apply_along_all_axes(x: Any, *others: Any) -> Any:
        return tuple(function(along, axis, *others) for axis, along in enumerate(x))

    @overload(apply_along_all_axes, jit_options=_IN_PLACE)
    def _compile_apply_along_all_axes(x, *others):  # type: ignore[no-untyped-def]
        if len(x) == 2:
            return lambda x, *others: (compiled(x[0], 0, *others), compiled(x[1], 1, *others))
        return lambda x, *others: (
            compiled(x[0], 0, *others),
            compiled(x[1], 1, *others),
            compiled(x[2], 2, *others),
        )

    return apply_along_all_axes


@register_jitable(**_IN_PLACE)
def _digit(number, base, axis):  # type: ignore[no-untyped-def]
    for _ in range(axis):
        number //= base
    return number % base


# x times a factor
scale_coordinates = vectorize_over_axes(lambda along, axis, factor: along * factor)
# x and the steps (d,) from there
add_step = vectorize_over_axes(lambda along, axis, step: along + step[axis])
# Corner 0 to 2^d - 1 of a cell x, along x first: the coarse node there
cell_corner = vectorize_over_axes(lambda along, axis, number: along + (number >> axis & 1))
# The cell that fine node x is in, or at the lower border of
cell_at = vectorize_over_axes(lambda along, axis: along >> 1)
# Cell 0 to 2^d - 1, along x first, of those that a fine node x is in or touches; some are the same
cell_around = vectorize_over_axes(lambda along, axis, number: (along + (number >> axis & 1) - 1) >> 1)
# Node or cell 0 to (2 n + 1)^d - 1, along x first, of those at most n from x along each axis
neighbour = vectorize_over_axes(lambda along, axis, n, number: along - n + _digit(number, 2 * n + 1, axis))
# x over a length, rounded down
floor_divide = vectorize_over_axes(lambda along, axis, length: along // length)


@njit(**_IN_PLACE)
def corner_number_in_cell(x):  # type: ignore[no-untyped-def]
    """Where fine node x (d,) is in its cell, 0 or 1 along each axis, as a number: 0 to 2^d - 1, along x first."""
    number = 0
    for axis in range(len(x)):
        number += (x[axis] & 1) << axis
    return number


@register_jitable(**_IN_PLACE)
def place_on_finer_lattice(numbering, finer_numbering, ratio, place):  # type: ignore[no-untyped-def]
    """The place on a `ratio` times finer lattice of the node that lies there, or places of arrays."""
    return place_number_at(finer_numbering, scale_coordinates(lattice_coordinates(numbering, place), ratio))


@njit(**INNER)
def count_cells_of_kind_around(numbering, cell_kinds, x, kind):  # type: ignore[no-untyped-def]
    """How many of the 2^d parts around a fine node x (d,) are in cells of a kind."""
    count = 0
    for number in range(1 << len(x)):
        count += cell_kinds[place_number_at(numbering.cells, cell_around(x, number))] == kind
    return count


@njit(**INNER)
def fine_node_kind(numbering, cell_kinds, x):  # type: ignore[no-untyped-def]
    """The kind of a fine node: IDLE in coarse cells alone, FREE in fine ones alone, BORDER between both."""
    if count_cells_of_kind_around(numbering, cell_kinds, x, FINE) == 0:
        return IDLE
    return BORDER if count_cells_of_kind_around(numbering, cell_kinds, x, COARSE) > 0 else FREE


@njit(**INNER)
def mark_and_list_new_fine_cells_near(numbering, cell_kinds, x, radius, new_cells, count):  # type: ignore[no-untyped-def]
    """List the places of the coarse cells within `radius` spacings of fine node x (d,); returns how many are listed
    then.

    They are marked as fine at once, so that none is listed twice. `numbering` is that of cells.
    """
    most = radius // 2 + 1
    for number in range((2 * most + 1) ** len(x)):
        cell, square, inside = neighbour(cell_at(x), most, number), 0, True
        for axis in range(len(x)):
            away = max(abs(x[axis] - (2 * cell[axis] + 1)) - 1, 0)
            square += away * away
            inside &= 0 <= cell[axis] < numbering.counts[axis]
        if inside and square < radius * radius:
            c = place_number_at(numbering, cell)
            if cell_kinds[c] == COARSE:
                cell_kinds[c] = FINE
                new_cells[count] = c
                count += 1
    return count
