"""Reads a mesh file with meshio: only this file and files of its own folder, with consistent arrays."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from pdmesh.drawing.sandbox import child
from pdmesh.drawing.sandbox.walls import warn_of_missing
from pdmesh.drawing.scratch import scratch
from pdmesh.files import check_regular, read_bytes
from pdmesh.scene.shapes import SceneError

SECONDS, SECONDS_PER_BYTE = 60.0, 1e-5  # for reading
MEMORY, MEMORY_PER_BYTE = 2**31, 200
ADVICE = " (--trust reads it all the same)"


class Block(NamedTuple):
    """Cells of one type: the points of each, (k, corners)."""

    type: str
    data: NDArray[np.int64]


@dataclass(frozen=True)
class Mesh:
    """The parts of meshio's mesh that are used, under meshio's names."""

    points: NDArray[np.float64]  # (n, 2 or 3)
    cells: tuple[Block, ...]
    cell_data: dict[str, list[NDArray[np.int64]]]  # the number of the group that each cell is in, at most one
    field_data: dict[str, list[int]]  # a group's number, and its dimension where that is known
    cell_sets: dict[str, list[NDArray[np.int64]]]  # by name: of each block, which


def read(path: Path, tags: Sequence[str], trust: bool = False) -> Mesh:
    """The mesh in the file at `path`; `tags` are names of cell data that number groups, the preferred one first.

    `trust` also reads files that the mesh refers to. Raises SceneError.
    """
    try:
        check_regular(path)
        size = path.stat().st_size
        if not trust:
            _refuse_references(path)
    except OSError as error:
        raise SceneError(f"{path}: cannot be read: {error.strerror}") from None
    job = {"path": path.name, "tags": list(tags), "memory": MEMORY + MEMORY_PER_BYTE * size}
    with scratch() as folder:
        result = folder / "found.npz"
        last = child.run_reader(
            "pdmesh.drawing.sandbox.meshio_reader",
            "meshio",
            path,
            job | {"walls": child.WALLS and not trust},
            result,
            SECONDS + SECONDS_PER_BYTE * size,
            path.parent,
        )
        try:
            with np.load(result) as found:
                arrays = dict(found)
        except (OSError, ValueError, EOFError):
            raise SceneError(f"{path}: meshio stopped before the end of the mesh: {last}") from None
    about = json.loads(arrays["about"].tobytes())
    if child.WALLS and not trust:
        warn_of_missing(path, about["walls"])
    return _mesh(path, about, arrays)


def _mesh(path: Path, about: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> Mesh:
    if "missing" in about:
        package = about["missing"]
        raise SceneError(f"{path}: {path.suffix} needs {package}; this installs it: pip install {package}")
    if "error" in about:
        raise SceneError(f"{path}: {about['error']}, expected a mesh in the format of its suffix")
    blocks = range(len(about["types"]))
    cells = tuple(Block(about["types"][number], arrays[f"cells {number}"]) for number in blocks)
    tags = {about["tag"]: [arrays[f"tags {number}"] for number in blocks]} if about["tag"] else {}
    sets = {
        name: [arrays[f"set {place} {number}"] for number in blocks if f"set {place} {number}" in arrays]
        for place, name in enumerate(about["sets"])
    }
    for members in sets.values():
        for block, chosen in zip(cells, members, strict=False):
            if chosen.size and not 0 <= chosen.min() <= chosen.max() < len(block.data):
                raise SceneError(f"{path}: found a set of cells that are not there, expected a whole mesh")
    return Mesh(arrays["points"], cells, tags, about["groups"], sets)


# ---- files that a file names


def _refuse_references(path: Path) -> None:
    """Raise SceneError if the mesh refers to files outside its own folder. Raises OSError."""
    suffix = path.suffix.lower()
    if suffix == ".inp":
        for number, line in enumerate(read_bytes(path).decode("latin-1").splitlines(), start=1):
            if line.partition(",")[0].strip().replace("*", "").upper() == "INCLUDE":
                raise SceneError(f"{path}: line {number}: found '*INCLUDE', expected a mesh in one file{ADVICE}")
    elif suffix in (".xdmf", ".vtu"):
        data = read_bytes(path)
        if re.search(rb"<!\s*(?:DOCTYPE|ENTITY)", data, re.IGNORECASE):
            raise SceneError(f"{path}: found a definition of entities, expected none{ADVICE}")
        if suffix == ".xdmf":
            _refuse_data_items(path, data)
    elif suffix == ".ply" and b"end_header" not in read_bytes(path)[: 2**20]:
        raise SceneError(f"{path}: found no end of the header, expected a whole mesh")  # meshio looks for it for ever


def _refuse_data_items(path: Path, data: bytes) -> None:
    try:
        root = ElementTree.fromstring(data)
    except ElementTree.ParseError:
        return  # meshio will say so
    for item in root.iter("DataItem"):
        if item.get("Format", "").upper() in ("HDF", "BINARY"):
            name = (item.text or "").strip().split(":")[0]
            other = path.parent / name
            if name != Path(name).name or not other.resolve().is_relative_to(path.parent.resolve()):
                raise SceneError(f"{path}: found data in '{name}', expected them in a file beside it{ADVICE}")
            check_regular(other)
