"""Frames as views of Gmsh: MSH 2.2, binary, which every version of Gmsh opens.

A view is a list of values for each frame ($NodeData, "MSH file format version 2", Gmsh reference manual). The file
holds the nodes of all frames, numbered by their rows in the table `node`. Where nodes are born and die, a frame has
values only at its living nodes.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.files import replacing
from pdmesh.plain_text import for_quotes

ELEMENTS = {"vertex": 15, "quad": 3, "hexahedron": 5}  # Gmsh's numbers
TAGS = (0, 1)  # of each element: physical group, the plate's surface


class MshFrame(NamedTuple):
    """Values at points at one time."""

    time: float  # s
    number: int  # of the frame, from 0
    points: NDArray[np.int64]  # (k,) which points the values are of, from 0
    data: dict[str, NDArray[np.generic]]  # (k,) scalars, (k, 3) vectors, (k, 9) tensors


def write(
    path: Path, points: NDArray[np.float64], cells: tuple[str, NDArray[np.int64]], frames: Iterable[MshFrame]
) -> None:
    """Write points (p, 3), m, their cells (vertices, quads or hexahedra), and one view a field with all frames."""
    kind, corners = cells
    with replacing(path) as part, part.open("wb") as file:
        file.write(b"$MeshFormat\n2.2 1 8\n" + np.int32(1).tobytes() + b"\n$EndMeshFormat\n")
        file.write(b"$Nodes\n%d\n" % len(points))
        listed = np.zeros(len(points), dtype=[("number", "<i4"), ("place", "<f8", 3)])
        listed["number"], listed["place"] = np.arange(1, len(points) + 1), points
        file.write(listed.tobytes() + b"\n$EndNodes\n")
        file.write(b"$Elements\n%d\n" % len(corners))
        file.write(np.array([ELEMENTS[kind], len(corners), len(TAGS)], dtype="<i4").tobytes())
        tags = np.broadcast_to(TAGS, (len(corners), len(TAGS)))
        rows = np.column_stack([np.arange(1, len(corners) + 1), tags, corners + 1])
        file.write(rows.astype("<i4").tobytes() + b"\n$EndElements\n")
        for frame in frames:
            for name, column in frame.data.items():
                values = np.asarray(column, dtype=np.float64).reshape(len(frame.points), -1)
                finite = np.isfinite(values).all(axis=1)
                count, width = int(finite.sum()), values.shape[1]
                head = f'1\n"{for_quotes(name)}"\n1\n{frame.time!r}\n3\n{frame.number}\n{width}\n{count}\n'
                view = np.zeros(count, dtype=[("number", "<i4"), ("values", "<f8", width)])
                view["number"], view["values"] = frame.points[finite] + 1, values[finite].reshape(view["values"].shape)
                file.write(b"$NodeData\n" + head.encode() + view.tobytes() + b"\n$EndNodeData\n")
