"""Reads a mesh in a confined process of its own - by meshio, Gmsh or netCDF4 - and writes its arrays.

Some readers loop forever on a broken file or follow references to other files. Run as ``python -P -m
pdmesh.drawing.sandbox.mesh_reader RESULT`` with a job as JSON on stdin. The result is a ``.npz`` with a JSON
description in the array ``about``.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import meshio
import numpy as np
from numpy.typing import NDArray

from pdmesh.drawing.sandbox import exodus, gmsh_mesh
from pdmesh.drawing.sandbox.walls import raise_walls

NEEDED = {  # by meshio, to read a format
    ".xdmf": ("h5py", "xml.etree.ElementTree"),
    ".vtu": ("lzma", "xml.etree.ElementTree"),
    ".med": ("h5py",),
}
OTHERS = {"gmsh": gmsh_mesh, "exodus": exodus}
NAMES = {"gmsh": "Gmsh", "exodus": "netCDF4"}


def main(result: str) -> None:
    """Do the job on stdin and write `result`."""
    job = json.load(sys.stdin)
    walls: tuple[str, ...] = ()
    with open(result, "wb") as file:
        try:
            if job["walls"]:
                with contextlib.redirect_stderr(io.StringIO()):
                    meshio._common.error(":x:")  # loads what it says errors with, which walls would not let it
            # confinement blocks later imports
            os.environ["HDF5_USE_FILE_LOCKING"] = "FALSE"  # walls keep a lock from being taken, and nobody writes
            if job["reader"] in OTHERS:
                OTHERS[job["reader"]].load()
                if hasattr(os, "sched_setaffinity"):  # no thread beside this one may be started
                    os.sched_setaffinity(0, [min(os.sched_getaffinity(0))])
            else:
                for module in NEEDED.get(Path(job["path"]).suffix.lower(), ()):
                    with contextlib.suppress(ImportError):  # meshio says so, where it needs it
                        import_module(module)
            if job["walls"]:
                walls = raise_walls(Path.cwd(), job["seconds"], job["memory"])
            about, arrays = _found(job)
        except ModuleNotFoundError as error:
            about, arrays = {"missing": error.name}, {}
        except OSError as error:
            about, arrays = {"library": str(error)}, {}
        description = np.frombuffer(json.dumps(about | {"walls": walls}).encode(), dtype=np.uint8)
        np.savez(file, about=description, **arrays)  # type: ignore[arg-type]
        file.flush()
        os._exit(0)


def _found(job: dict[str, Any]) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    try:
        with contextlib.redirect_stdout(sys.stderr):
            path, reader = Path(job["path"]), OTHERS.get(job["reader"])
            mesh = meshio.read(path) if reader is None else reader.read(path)
        return _described(mesh, job["tags"])
    except ModuleNotFoundError as error:
        return {"missing": error.name}, {}
    except KeyError as error:
        return {"error": f"{error.args[0]} is not defined"}, {}
    except MemoryError:
        return {"error": f"there is not enough memory to read it; {gmsh_mesh.FEWER}"}, {}
    except (Exception, SystemExit) as error:  # meshio exits where no reader of the suffix can read the file
        says = str(error) if isinstance(error, Exception) and "at least one array" not in str(error) else ""
        reason = (
            says or f"{NAMES.get(job['reader'], 'meshio')} cannot read the file"
        )  # numpy's words where a file is empty say nothing
        return {"error": reason}, {}


def _described(mesh: Any, tags: list[str]) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
    """A mesh as a JSON description and arrays. Raises ValueError for an inconsistent mesh."""
    arrays = _arrays(mesh)
    tag = next((name for name in tags if name in mesh.cell_data), None)
    if tag is not None:
        for number, (block, values) in enumerate(zip(mesh.cells, mesh.cell_data[tag], strict=True)):
            numbers = np.asarray(values).ravel()
            if len(numbers) != len(block.data) or not np.isfinite(numbers).all():
                raise ValueError("groups are not numbers, one for each cell")
            arrays[f"tags {number}"] = numbers.astype(np.int64)
    sets = {name: members for name, members in mesh.cell_sets.items() if not name.startswith("gmsh:")}
    for place, members in enumerate(sets.values()):
        for number, cells in enumerate(members):
            arrays[f"set {place} {number}"] = np.asarray(() if cells is None else cells).astype(np.int64).ravel()
    for place, rows in enumerate(mesh.point_sets.values()):
        arrays[f"points {place}"] = np.asarray(rows).astype(np.int64).ravel()
    groups = {str(name): [int(value) for value in entry] for name, entry in mesh.field_data.items()}
    about = {"types": [block.type for block in mesh.cells], "tag": tag, "groups": groups}
    return about | {"sets": list(sets), "point sets": list(mesh.point_sets)}, arrays


def _arrays(mesh: Any) -> dict[str, NDArray[Any]]:
    """The points and cells of a mesh. Raises ValueError for cells of points that are not there."""
    points = np.asarray(mesh.points)
    if points.ndim != 2 or points.shape[1] < 2 or not len(points) or points.dtype.kind not in "fiu":
        raise ValueError("the mesh has no points")
    arrays: dict[str, NDArray[Any]] = {"points": points.astype(np.float64)}
    for number, block in enumerate(mesh.cells):
        data = np.asarray(block.data)
        if data.ndim != 2 or data.dtype.kind not in "iu":
            raise ValueError(f"cells '{block.type}' are no lists of points")
        if data.size and not 0 <= data.min() <= data.max() < len(points):
            raise ValueError(f"cells '{block.type}' have points that do not exist")
        arrays[f"cells {number}"] = data.astype(np.int64)
        if "volume" in mesh.cell_data and block.type == "vertex":
            arrays[f"volumes {number}"] = np.asarray(mesh.cell_data["volume"][number], dtype=np.float64)
    return arrays


if __name__ == "__main__":
    main(sys.argv[1])
