"""Reads a text file of points - x y z block volume - as Peridigm and PeriLab have them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from pdmesh.drawing.mesh_arrays import Block, Mesh
from pdmesh.drawing.text_fields import finite_number, text_lines
from pdmesh.scene.shapes import SceneError

COLUMNS = {5: ("x", "y", "z", "block", "volume"), 4: ("x", "y", "block", "volume")}
HEADER = re.compile(r"\s*#?\s*header\s*:", re.IGNORECASE)
LARGEST = 1e15  # number of a block
NAMES = {"block_id": "block", "block": "block", "volume": "volume", "vol": "volume", "x": "x", "y": "y", "z": "z"}


def read_table(path: Path) -> Mesh:
    """The points of the text file at `path`, blocks as sets "block_1". Raises SceneError and OSError.

    A first line ``header: x y block_id volume`` names the columns; without it they are x y z block volume, or x y block
    volume. ``#`` begins a comment.
    """
    names: tuple[str, ...] | None = None
    rows, numbers = [], []
    for number, line in enumerate(text_lines(path), start=1):
        if HEADER.match(line):
            if names is not None:
                raise SceneError(f"{path}: line {number}: a second or late 'header:'; use one, before the first point")
            text = line.partition(":")[2]
            names = tuple(NAMES.get(word.lower(), word) for word in text.replace(",", " ").split())
            if not {"x", "y", "block", "volume"} <= set(names) or len(set(names)) < len(names):
                wanted = "use the header: x y z block_id volume"
                raise SceneError(f"{path}: line {number}: cannot read '{text.strip():.60}'; {wanted}")
            continue
        words = line.partition("#")[0].replace(",", " ").split()
        if words:
            names = names or COLUMNS.get(len(words))
            row = [value for value in map(finite_number, words) if value is not None]
            if names is None or not len(row) == len(words) == len(names):
                wanted = " ".join(names or COLUMNS[5])
                raise SceneError(f"{path}: line {number}: cannot read '{' '.join(words):.60}'; use numbers {wanted}")
            rows.append(row)
            numbers.append(number)
    if names is None or not rows:
        raise SceneError(f"{path} has no points; use lines of x, y, z, block and volume")
    table = np.array(rows)
    of = {name: table[:, at] for at, name in enumerate(names)}
    exact = (of["block"] == np.rint(of["block"])) & (np.abs(of["block"]) < LARGEST)
    for at in np.flatnonzero(~exact)[:1].tolist():
        wanted = "a whole number of at most 15 digits"
        raise SceneError(f"{path}: line {numbers[at]}: block is {of['block'][at]:g}; use {wanted}")
    points = np.column_stack([of[axis] for axis in "xyz" if axis in of])
    cells = Block("vertex", np.arange(len(points))[:, None])
    order = np.argsort(of["block"], kind="stable")
    blocks, first = np.unique(of["block"][order].astype(np.int64), return_index=True)
    members = np.split(order, first[1:])
    sets = {f"block_{block}": [rows] for block, rows in zip(blocks.tolist(), members, strict=True)}
    return Mesh(points, (cells,), sets, volumes=(of["volume"],))
