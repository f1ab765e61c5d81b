"""A mesh as arrays: points, blocks of cells with meshio's names of their types, and named sets of both."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Rows = NDArray[np.int64]
QUADS = {"triangle": 3, "triangle6": 3, "triangle7": 3, "quad": 4, "quad8": 4, "quad9": 4}
LINES = {"line": 2, "line3": 2}
POINTS = {"vertex": 1}
# Faces of solids by their corners, in the order in which Abaqus numbers them
SIDES: dict[str, tuple[tuple[int, ...], ...]] = {
    "tetra": ((0, 1, 2), (0, 3, 1), (1, 3, 2), (2, 3, 0)),
    "pyramid": ((0, 1, 2, 3), (0, 4, 1), (1, 4, 2), (2, 4, 3), (3, 4, 0)),
    "wedge": ((0, 1, 2), (3, 5, 4), (0, 3, 4, 1), (1, 4, 5, 2), (2, 5, 3, 0)),
    "hexahedron": (
        (0, 1, 2, 3),
        (4, 7, 6, 5),
        (0, 4, 5, 1),
        (1, 5, 6, 2),
        (2, 6, 7, 3),
        (3, 7, 4, 0),
    ),
}
CORNERS = {"tetra": 4, "pyramid": 5, "wedge": 6, "hexahedron": 8}


class Block(NamedTuple):
    """Cells of one type: the points of each, (k, corners)."""

    type: str
    data: Rows

    @property
    def shape(self) -> str:
        """The type without its order: "hexahedron" of "hexahedron20"."""
        return self.type.rstrip("0123456789")

    @property
    def dimension(self) -> int | None:
        """The dimension of the cells; None for a type that is not read."""
        by_dimension = (POINTS, LINES, QUADS)
        for dimension, types in enumerate(by_dimension):
            if self.type in types:
                return dimension
        return 3 if self.shape in SIDES else None

    @property
    def corners(self) -> Rows:
        """The cells without the points between their corners."""
        count = (POINTS | LINES | QUADS).get(self.type) or CORNERS[self.shape]
        return self.data[:, :count]


@dataclass(frozen=True)
class Mesh:
    """Points and cells, with named sets of both."""

    points: NDArray[np.float64]  # (n, 2 or 3)
    cells: tuple[Block, ...]
    cell_sets: dict[str, list[Rows]] = field(default_factory=dict)  # by name: rows of each block
    point_sets: dict[str, Rows] = field(default_factory=dict)
    volumes: tuple[NDArray[np.float64], ...] = ()  # of the cells of each block, where they are points; NaN: unknown
    spacing: float | None = None  # of points that were made cells
    parts: Rows | None = None  # the part that each point is of, if the file has several
    plane: str = ""  # "stress" or "strain", if the file says so
    notes: tuple[str, ...] = ()  # on what the file says and the mesh leaves out

    def of_dimension(self, dimension: int) -> tuple[list[Block], dict[str, list[Rows]]]:
        """The blocks of cells of this dimension, and the rows of each that are in a set."""
        chosen = [at for at, block in enumerate(self.cells) if block.dimension == dimension and len(block.data)]
        sets = {name: [members[number] for number in chosen] for name, members in self.cell_sets.items()}
        return [self.cells[number] for number in chosen], sets
