"""Reads a text file of points - x y z block volume - as Peridigm and PeriLab have them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from pdmesh.drawing.mesh_arrays import Block, Mesh
from pdmesh.files import read_bytes
from pdmesh.scene.shapes import SceneError

COLUMNS = {5: ("x", "y", "z", "block", "volume"), 4: ("x", "y", "block", "volume")}
HEADER = re.compile(r"\s*#?\s*header\s*:", re.IGNORECASE)
NAMES = {"block_id": "block", "block": "block", "volume": "volume", "vol": "volume", "x": "x", "y": "y", "z": "z"}


def read_table(path: Path) -> Mesh:
    """The points of the text file at `path`, blocks as sets "block_1". Raises SceneError and OSError.

    A first line ``header: x y block_id volume`` names the columns; without it they are x y z block volume, or x y block
    volume. ``#`` begins a comment.
    """
    names: tuple[str, ...] | None = None
    rows, numbers = [], []
    for number, line in enumerate(read_bytes(path).decode("latin-1").splitlines(), start=1):
        if HEADER.match(line):
            names = _columns(path, number, line.partition(":")[2])
            continue
        words = line.partition("#")[0].replace(",", " ").split()
        if words:
            names = names or COLUMNS.get(len(words))
            rows.append(_row(path, number, words, names))
            numbers.append(number)
    if names is None:
        raise SceneError(f"{path}: found no points, expected lines of x, y, z, block and volume")
    table = np.array(rows).reshape(-1, len(names))
    of = {name: table[:, at] for at, name in enumerate(names)}
    block = of["block"].astype(np.int64)
    for at in np.flatnonzero(block != of["block"])[:1].tolist():
        raise SceneError(f"{path}: line {numbers[at]}: block: found {of['block'][at]:g}, expected a whole number")
    points = np.column_stack([of[axis] for axis in "xyz" if axis in of])
    cells = Block("vertex", np.arange(len(points))[:, None])
    sets = {f"block_{one}": [np.flatnonzero(block == one)] for one in np.unique(block).tolist()}
    return Mesh(points, (cells,), sets, volumes=(of["volume"],))


def _columns(path: Path, number: int, text: str) -> tuple[str, ...]:
    words = text.replace(",", " ").split()
    names = tuple(NAMES.get(word.lower(), word) for word in words)
    if not {"x", "y", "block", "volume"} <= set(names) or len(set(names)) < len(names):
        raise SceneError(f"{path}: line {number}: found '{text.strip():.60}', expected header: x y z block_id volume")
    return names


def _row(path: Path, number: int, words: list[str], names: tuple[str, ...] | None) -> NDArray[np.float64]:
    try:
        row = np.array([float(word) for word in words])
    except ValueError:
        row = np.full(0, np.nan)
    if names is None or len(row) != len(names) or not np.isfinite(row).all():
        wanted = " ".join(names or COLUMNS[5])
        raise SceneError(f"{path}: line {number}: found '{' '.join(words):.60}', expected numbers {wanted}")
    return row
