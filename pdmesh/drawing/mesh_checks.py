"""Reads a mesh file: by Gmsh, meshio or netCDF4 in a confined process, or as text; with consistent arrays.

Only this file and files of its own folder are read.
"""

from __future__ import annotations

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from pdmesh.drawing.mesh_arrays import Block, Mesh, Rows
from pdmesh.drawing.nastran import checked_bulk
from pdmesh.drawing.sandbox import child
from pdmesh.drawing.sandbox.walls import warn_of_missing
from pdmesh.drawing.scratch import scratch
from pdmesh.files import check_regular, read_bytes
from pdmesh.scene.shapes import SceneError

SECONDS, SECONDS_PER_BYTE = 60.0, 1e-5  # for reading
MEMORY, MEMORY_PER_BYTE = 2**31, 200
ADVICE = " (--trust reads it all the same)"
TAGS = ("gmsh:physical", "medit:ref", "cell_tags", "region", "material")  # cell data that number groups
NASTRAN = (".bdf", ".nas")
EXODUS = (".e", ".exo", ".ex2", ".g", ".gen")
MSH = (b"$MeshFormat", b"$NOD", b"$Comments")  # beginnings of Gmsh's own format, of all versions
REMEDY = "check that the file is complete, or use a coarser mesh"  # where reading takes too long
EXTRA = {"h5py", "netCDF4"}  # packages of the extra [meshes]


def read(path: Path, trust: bool = False) -> Mesh:
    """The mesh in the file at `path`. `trust` also reads files that it refers to. Raises SceneError."""
    suffix = path.suffix.lower()
    try:
        check_regular(path)
        if suffix == ".inp":
            from pdmesh.drawing.abaqus import read_abaqus

            return read_abaqus(path, trust)
        if suffix == ".txt":
            from pdmesh.drawing.point_cells import read_table

            return read_table(path)
        if not trust:
            _refuse_references(path)
        return _read_confined(path, _reader(path, suffix), trust)
    except OSError as error:
        raise SceneError(f"{path}: cannot be read: {error.strerror}") from None


def _reader(path: Path, suffix: str) -> str:
    """Which program reads the file. Raises OSError."""
    if suffix in EXODUS:
        return "exodus"
    if suffix == ".msh":
        with path.open("rb") as file:
            return "gmsh" if file.read(64).startswith(MSH) else "meshio"
    return "gmsh" if suffix in (*NASTRAN, ".unv") else "meshio"


def _read_confined(path: Path, reader: str, trust: bool) -> Mesh:
    """The mesh as a process of its own reads it. Raises SceneError and OSError."""
    size, walls = path.stat().st_size, child.WALLS and not trust
    job: dict[str, Any] = {"path": path.name, "reader": reader, "tags": TAGS, "walls": walls}
    job["memory"], notes = MEMORY + MEMORY_PER_BYTE * size, tuple[str, ...]()
    with scratch() as folder:
        place = path.parent
        if reader == "gmsh":  # which picks up other files beside the one that it opens, by their names
            place = folder / "only"
            place.mkdir()
            job["path"] = f"0{path.suffix.lower()}"
            if path.suffix.lower() in NASTRAN:
                data, notes = checked_bulk(path)
                (place / job["path"]).write_bytes(data)
            else:
                shutil.copyfile(path, place / job["path"])
        result, limit = folder / "found.npz", SECONDS + SECONDS_PER_BYTE * size
        last = child.run_reader("pdmesh.drawing.sandbox.mesh_reader", reader, path, job, result, limit, place, REMEDY)
        try:
            with np.load(result) as archive:
                arrays = dict(archive)
        except (OSError, ValueError, EOFError):
            name = reader.replace("gmsh", "Gmsh")
            raise SceneError(f"{path}: {name} stopped before the end of the mesh: {last}") from None
    about = json.loads(arrays["about"].tobytes())
    if reader == "gmsh" and {"missing", "library"} & set(about):
        return _read_confined(path, "meshio", trust)  # which reads most files as well
    if walls and not {"missing", "library"} & set(about):
        warn_of_missing(path, about["walls"])
    return replace(_mesh(path, about, arrays), notes=notes)


def _mesh(path: Path, about: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> Mesh:
    if "missing" in about:
        package = about["missing"].split(".")[0]
        wanted = "'pdsuite[meshes]'" if package in EXTRA else package
        raise SceneError(f"{path}: {path.suffix} needs {package}; this installs it: pip install {wanted}")
    if "library" in about:
        raise SceneError(f"{path}: {path.suffix} cannot be read here: {about['library']}")
    if "error" in about:
        wanted = "" if "; " in about["error"] else "; use a mesh in the format of its suffix"
        raise SceneError(f"{path}: {about['error']}{wanted}")
    cells = tuple(Block(kind, arrays[f"cells {number}"]) for number, kind in enumerate(about["types"]))
    none = np.zeros(0, dtype=np.int64)
    sets = {
        name: [arrays.get(f"set {place} {number}", none) for number in range(len(cells))]
        for place, name in enumerate(about["sets"])
    }
    for members in sets.values():
        for block, chosen in zip(cells, members, strict=True):
            if chosen.size and not 0 <= chosen.min() <= chosen.max() < len(block.data):
                raise SceneError(f"{path}: a set has cells that do not exist; use a whole mesh")
    point_sets = {name: arrays[f"points {place}"] for place, name in enumerate(about["point sets"])}
    for rows in point_sets.values():
        if rows.size and not 0 <= rows.min() <= rows.max() < len(arrays["points"]):
            raise SceneError(f"{path}: a set has points that do not exist; use a whole mesh")
    volumes = tuple(
        arrays.get(f"volumes {number}", np.full(len(block.data), np.nan)) for number, block in enumerate(cells)
    )
    tagged = _tagged(cells, about["groups"], [arrays.get(f"tags {number}") for number in range(len(cells))])
    return Mesh(arrays["points"], cells, tagged | sets, point_sets, volumes)


def _tagged(
    cells: tuple[Block, ...], groups: dict[str, list[int]], tags: list[NDArray[np.int64] | None]
) -> dict[str, list[Rows]]:
    """The sets of cells that numbers tell, under the names of the `groups`: their numbers, and dimensions if known."""
    names = {entry[0]: name for name, entry in groups.items()}
    of_dimension: dict[tuple[int, int | None], str] = {
        (entry[0], entry[1]): name for name, entry in groups.items() if len(entry) > 1
    }
    sets: dict[str, list[Rows]] = {}
    for number, (block, values) in enumerate(zip(cells, tags, strict=True)):
        for value in [] if values is None else np.unique(values[values != 0]).tolist():
            name = of_dimension.get((value, block.dimension)) or names.get(value) or str(value)
            members = sets.setdefault(name, [np.zeros(0, dtype=np.int64)] * len(cells))
            members[number] = np.flatnonzero(values == value)
    return sets


# ---- files that a file names


def _refuse_references(path: Path) -> None:
    """Raise SceneError if the mesh refers to files outside its own folder. Raises OSError."""
    suffix = path.suffix.lower()
    if suffix in (".xdmf", ".vtu"):
        data = read_bytes(path)
        if re.search(rb"<!\s*(?:DOCTYPE|ENTITY)", data, re.IGNORECASE):
            raise SceneError(f"{path} defines entities, which are not read; remove them{ADVICE}")
        if suffix == ".vtu":
            return
        try:
            root = ElementTree.fromstring(data)
        except ElementTree.ParseError:
            return  # meshio will say so
        for item in root.iter("DataItem"):
            if item.get("Format", "").upper() in ("HDF", "BINARY"):
                name = (item.text or "").strip().split(":")[0]
                data_path = path.parent / name
                if name != Path(name).name or not data_path.resolve().is_relative_to(path.parent.resolve()):
                    raise SceneError(f"{path}: data are in '{name}'; put them in a file beside it{ADVICE}")
                check_regular(data_path)
    elif suffix == ".ply" and b"end_header" not in read_bytes(path)[: 2**20]:
        raise SceneError(f"{path}: the header has no end; use a whole mesh")  # meshio looks for it for ever
