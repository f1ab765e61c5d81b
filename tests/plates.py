"""Plates that tests share."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from pdmesh.drawing.file_reading import build_file
from pdmesh.grid.building import Built
from pdmesh.model.document import Displacement, Horizon, Lattice, Material, Settings, Velocity
from pdmesh.model.node_grid import Grid, whole_lattice
from pdsolve.model import Model

ROOT = Path(__file__).parent.parent
GEOMETRIES = ROOT / "geometries"
GLASS = Material(E=65e9, rho=2235.0, G0=204.0)
STEEL = Material(E=191e9, rho=8000.0, G0=1e4, law="bilinear", kr=1.638, keep_G0=False)  # of the thesis

MESH = """$MeshFormat
2.2 0 8
$EndMeshFormat
$Nodes
4
1 0 0 0
2 0.01 0 0
3 0.01 0.01 0
4 0 0.01 0
$EndNodes
$Elements
2
1 2 2 0 1 1 2 3
2 2 2 0 1 1 3 4
$EndElements
"""


def shipped(name: str, assignments: Sequence[tuple[str, str]] = ()) -> Built:
    """A scene of `geometries`, built: a program is trusted, a drawing is read behind walls."""
    return build_file(GEOMETRIES / name, assignments, trust=name.endswith(".py"))


def square_grid(columns: int, rows: int, delta: float = 1e-3, x0: float = 0.0, y0: float = 0.0) -> Grid:
    """A rectangle of nodes of one spacing, row by row."""
    y, x = np.mgrid[0:rows, 0:columns]
    nodes = columns * rows
    return Grid(
        ids=np.arange(1, nodes + 1),
        position=np.column_stack([x0 + delta * x.ravel(), y0 + delta * y.ravel()]),
        delta=np.full(nodes, delta),
        border=np.zeros(nodes, dtype=bool),
        hole_id=np.full(nodes, -1),
        cracks=np.empty((0, 4)),
    )


def lattice(cracks: object, x0: float = 0.5, half: int = 9) -> Grid:
    """Nodes 1 m apart at x0 + whole numbers, in rows at half-integers, and segments of cracks between."""
    x, y = (each.ravel() for each in np.meshgrid(np.arange(-half, half) + x0, np.arange(-half, half) + 0.5))
    nowhere = np.full(len(x), -1)
    segments = np.array(cracks, dtype=float).reshape(-1, 4)
    return Grid(np.arange(len(x)), np.column_stack([x, y]), np.ones(len(x)), nowhere >= 0, nowhere, segments)


def two_scale_grid() -> Grid:
    """Fine nodes (1 mm) below, coarse ones (2 mm) above, with a gap of 1.5 mm between."""
    fine = square_grid(13, 8)
    coarse = square_grid(7, 4, delta=2e-3, y0=8.5e-3)
    return Grid(
        ids=np.arange(1, len(fine) + len(coarse) + 1),
        position=np.vstack([fine.position, coarse.position]),
        delta=np.concatenate([fine.delta, coarse.delta]),
        border=np.zeros(len(fine) + len(coarse), dtype=bool),
        hole_id=np.full(len(fine) + len(coarse), -1),
        cracks=np.empty((0, 4)),
    )


def plate(grid: Grid, ratio: float = 3.0, **settings: object) -> Model:
    """A model of glass on a grid."""
    return Model(grid, Settings(**{"material": GLASS, "horizon": Horizon(ratio), **settings}))  # type: ignore[arg-type]


def interface_grid(
    fine_columns: int, coarse_columns: int, coarse_rows: int, delta: float = 1e-3, gap: float = 1.5
) -> Grid:
    """Fine nodes left of x = 0, coarse ones (twice the spacing) to the right of x = `gap` fine spacings.

    With the gap of 1.5 the nodes' squares tile the plate.
    """
    fine = square_grid(fine_columns, 2 * coarse_rows, delta, x0=(1 - fine_columns) * delta)
    coarse = square_grid(coarse_columns, coarse_rows, 2 * delta, x0=gap * delta, y0=delta / 2)
    nodes = len(fine) + len(coarse)
    return Grid(
        ids=np.arange(1, nodes + 1),
        position=np.vstack([fine.position, coarse.position]),
        delta=np.concatenate([fine.delta, coarse.delta]),
        border=np.zeros(nodes, dtype=bool),
        hole_id=np.full(nodes, -1),
        cracks=np.empty((0, 4)),
    )


def two_cubes(wide: int = 8) -> Grid:
    """Nodes in space of two spacings: 16 x 16 x 12 fine ones below 8 x 8 x 20 coarse ones; or so `wide` ones."""
    fine = whole_lattice(Lattice((0.0, 0.0, 0.0), 1e-3, 2 * wide, 2 * wide, 12), cracks=np.empty((0, 9)))
    coarse = whole_lattice(Lattice((0.5e-3, 0.5e-3, 12.5e-3), 2e-3, wide, wide, 20), cracks=np.empty((0, 9)))
    nodes = len(fine) + len(coarse)
    return Grid(
        ids=np.arange(1, nodes + 1),
        position=np.vstack([fine.position, coarse.position]),
        delta=np.repeat([1e-3, 2e-3], [len(fine), len(coarse)]),
        border=np.zeros(nodes, dtype=bool),
        hole_id=np.full(nodes, -1),
        cracks=np.empty((0, 9)),
    )


def struck_plate(ratio: float = 3.0, speed: float = 32.0, clamped: bool = True, material: Material = STEEL) -> Model:
    """Kalthoff and Winkler's plate on one spacing of 1 mm, struck between its notches; held at both ends, or not."""
    outline = np.array([[0.0, 0.0], [0.1, 0.0], [0.1, 0.2], [0.0, 0.2]])
    notches = np.array([[-1.0, y, 0.05, y] for y in (75.5e-3, 124.5e-3)])
    grid = dataclasses.replace(square_grid(101, 201), cracks=notches, outline=(outline,))
    impact = Velocity(box=(-1.0, 75.5e-3, 0.1e-3, 124.5e-3), x=speed)
    ends = tuple(Displacement(box=(-1.0, y - 1e-4, 1.0, y + 1e-4), x=0.0, y=0.0) for y in (0.0, 0.2))
    return plate(grid, ratio, material=material, conditions=(*ends, impact) if clamped else (impact,))
