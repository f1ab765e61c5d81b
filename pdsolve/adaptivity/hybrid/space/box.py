"""Numbering of the nodes and cells of a body.

x, y, z   of a fine node, from 0 on; its site counts x fastest and is that of the tiles, without their margin
X, Y, Z   of a cell, whose lowest corner is the fine node (2 X, 2 Y, 2 Z); its place counts X fastest, with `pad` void
          cells around the box
          likewise of the coarse node at that corner; its site counts X fastest in the box of coarse nodes
"""

from __future__ import annotations

from typing import NamedTuple

from numba import njit

from pdsolve.codegen.inner_functions import INNER

COARSE, FINE, VOID = range(3)  # cells
IDLE, FREE, BORDER = range(3)  # fine nodes: in coarse cells alone, in fine ones alone, in both


class CellBox(NamedTuple):
    """A box of sx by sy by sz fine nodes and of cx by cy by cz cells."""

    fine_nodes_x: int
    fine_nodes_y: int
    fine_nodes_z: int
    cells_x: int
    cells_y: int
    cells_z: int
    void_margin: int

    @property
    def padded_shape(self) -> tuple[int, int, int]:
        """The shape of an array of all cells, void ones included."""
        return (
            self.cells_z + 2 * self.void_margin,
            self.cells_y + 2 * self.void_margin,
            self.cells_x + 2 * self.void_margin,
        )


def create_cell_box(sides: tuple[int, ...], reach: int) -> CellBox:
    """The numbering of a box of fine nodes whose bonds reach so many spacings."""
    x, y, z = sides
    return CellBox(x, y, z, max(1, x // 2), max(1, y // 2), max(1, z // 2), reach // 2 + 2)


@njit(forceinline=True, **INNER)
def cell_place(box, x, y, z):  # type: ignore[no-untyped-def]
    """The place of the cell (X, Y, Z)."""
    pad = box.void_margin
    return ((z + pad) * (box.cells_y + 2 * pad) + y + pad) * (box.cells_x + 2 * pad) + x + pad


@njit(forceinline=True, **INNER)
def fine_site(box, x, y, z):  # type: ignore[no-untyped-def]
    """The site of the fine node (x, y, z)."""
    return (z * box.fine_nodes_y + y) * box.fine_nodes_x + x


@njit(forceinline=True, **INNER)
def fine_coordinates(box, site):  # type: ignore[no-untyped-def]
    """The fine node (x, y, z) at a site."""
    return (
        site % box.fine_nodes_x,
        site // box.fine_nodes_x % box.fine_nodes_y,
        site // (box.fine_nodes_x * box.fine_nodes_y),
    )


@njit(forceinline=True, **INNER)
def coarse_site(box, x, y, z):  # type: ignore[no-untyped-def]
    """The site of the coarse node (X, Y, Z)."""
    return (z * (box.cells_y + 1) + y) * (box.cells_x + 1) + x


@njit(**INNER)
def touches_cell_kind(box, cells, x, y, z, cell_kind):  # type: ignore[no-untyped-def]
    """Whether a fine node is in, or at the border of, a cell of a kind."""
    touching = False
    for dz in (-1, 0):
        for dy in (-1, 0):
            for dx in (-1, 0):
                touching |= cells[cell_place(box, (x + dx) >> 1, (y + dy) >> 1, (z + dz) >> 1)] == cell_kind
    return touching


@njit(**INNER)
def fine_node_kind(box, cells, x, y, z):  # type: ignore[no-untyped-def]
    """The kind of a fine node."""
    if not touches_cell_kind(box, cells, x, y, z, FINE):
        return IDLE
    return BORDER if touches_cell_kind(box, cells, x, y, z, COARSE) else FREE
