"""Frames for ParaView, Gmsh and others: VTU and PVD through meshio, XDMF, MSH, CSV. SI units, reference positions.

Nodes of named conditions are sets that ParaView and others show by their names.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import meshio
import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.files import replacing, write_atomically
from pdmesh.model.node_arrays import selected
from pdmesh.plain_text import for_file_name, visible
from pdpost.exports import msh as msh_file
from pdpost.exports import xdmf as xdmf_file
from pdpost.exports.csv_columns import csv, of_frame
from pdsolve.measures import fields
from pdsolve.measures.embedded_model import read
from pdsolve.measures.frame_steps import has_diffusion_only
from pdsolve.results import Nodes, Results

MOST = 64  # sets in a file; models with a condition for each node have more
VECTORS = {"displacement": "u", "velocity": "v", "acceleration": "a"}
SCALARS = {name: name for name in ("energy", "solid")} | {"concentration": "c", "content": "h", "temperature": "T"}
SQUARE = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])  # of a node
CUBE = np.vstack([np.column_stack([SQUARE, np.full(4, height)]) for height in (-0.5, 0.5)])
SUFFIXES = (".vtu", ".pvd", ".xdmf", ".msh", ".csv")
Progress = Callable[[list[int]], Iterable[int]]  # hands on what it is given and may count it


class _Model(msgspec.Struct):
    """The keys of the grid file that name its conditions."""

    conditions: list[dict[str, Any]] = []


def node_sets(results: Results, step: int) -> dict[str, NDArray[np.bool_]]:
    """Masks (n,) of the nodes of each condition after `step`, by "kind name"; conditions of one name are one set."""
    nodes = results.nodes(step)
    sets: dict[str, NDArray[np.bool_]] = {}
    for number, condition in enumerate(read(results, _Model).conditions):
        name = visible(f"{condition.get('kind', 'condition')} {condition.get('name') or number}")
        mask = selected(nodes, condition.get("nodes"), condition.get("box"))
        sets[name] = sets.get(name, np.zeros(len(mask), dtype=bool)) | mask
    return sets


def columns(results: Results, step: int) -> dict[str, NDArray[np.generic]]:
    """The sets as numbers (n,), 1 for a node in a set and 0 for others; none where they are too many."""
    sets = node_sets(results, step)
    return {name: mask.astype(np.int32) for name, mask in sets.items()} if len(sets) <= MOST else {}


class ExportError(ValueError):
    """A file that cannot be written; the message says what was found and what was expected."""


def point_data(results: Results, step: int, also: Sequence[str] = ()) -> dict[str, NDArray[np.generic]]:
    """Point data of a frame: vectors (n, 3), scalars (n,), and tensors (n, 9) for the fields in `also`, SI units.

    Raises ResultsError.
    """
    stored = results.stored(step)
    data: dict[str, NDArray[np.generic]] = {}
    for name, letter in VECTORS.items():
        axes = [f"{letter}{axis}" for axis in "xyz"[: results.dimension]]
        if set(axes) <= set(stored):
            data[name] = _in_space(np.column_stack([results.field(axis, step) for axis in axes]))
    for name, column in SCALARS.items():
        if column in stored:
            data[name] = results.field(column, step)
    if not has_diffusion_only(results):
        data["damage"] = fields.field_values(results, "damage", step).astype(np.float32)
    if results.dimension == 3:
        stress_names = ("sxx", "sxy", "sxz", "sxy", "syy", "syz", "sxz", "syz", "szz")
        if set(stress_names) <= set(stored):
            data["stress"] = np.column_stack([results.field(part, step) for part in stress_names])
    for name in also:
        part = fields.all_field_components(results, name, step)
        zero = np.zeros_like(part["xx"])
        rows = ("xx", "xy", "xz", "xy", "yy", "yz", "xz", "yz", "zz")
        data[name] = np.column_stack([part.get(component, zero) for component in rows])
    return data


def node_data(results: Results, step: int) -> dict[str, NDArray[np.generic]]:
    """Node data (n,) that is constant until nodes change: spacing (m), area (m^2) or volume (m^3), and id."""
    nodes = results.nodes(step)
    return {"delta": nodes.delta, "area" if results.dimension == 2 else "volume": nodes.area, "node": nodes.ids}


def vtu(results: Results, step: int, path: Path, also: Sequence[str] = (), squares: bool = False) -> None:
    """Write a frame as VTU, with a set of nodes for each condition: 1 at its nodes, by its name.

    Each node is a vertex or, with `squares`, a square (in a body a cube) of its size.
    """
    points, cells = _points(results, step, squares)
    data = point_data(results, step, also) | node_data(results, step) | columns(results, step)
    data = _each(data, cells[1].shape[1])
    mesh = meshio.Mesh(points, [cells], point_data=data)
    with replacing(path) as part:
        meshio.write(part, mesh, file_format="vtu")


def pvd(
    results: Results,
    path: Path,
    steps: list[int],
    also: Sequence[str] = (),
    squares: bool = False,
    progress: Progress = iter,
    crack: Callable[[Path, Results, int], None] | None = None,
) -> None:
    """Write frames as VTU files in the folder `path` without its suffix, and `path` itself, which lists their times.

    `crack` writes the surface of the cracks after a step; it is listed as the second part of each frame.
    """
    folder = beside(path)
    files = {
        step: [f"{folder.name}/{folder.name}_{step:08d}.vtu", f"{folder.name}/{folder.name}_crack_{step:08d}.vtp"]
        for step in steps
    }
    for file in (path.parent / name for names in files.values() for name in names):
        if file.is_symlink():
            raise ExportError(f"{file} is a link, not a regular file; remove it")
    folder.mkdir(exist_ok=True)
    times = _times(results)
    lines = []
    for step in progress(steps):
        names = files[step] if crack is not None else files[step][:1]
        vtu(results, step, path.parent / names[0], also, squares)
        if crack is not None:
            crack(path.parent / names[1], results, step)
        for part, file_name in enumerate(names):
            lines.append(f'    <DataSet timestep="{times[step]!r}" part="{part}" file={quoteattr(file_name)}/>')
    head = '<VTKFile type="Collection" version="0.1" byte_order="LittleEndian">\n  <Collection>'
    text = "\n".join(['<?xml version="1.0"?>', head, *lines, "  </Collection>", "</VTKFile>", ""])
    write_atomically(path, text.encode())


def beside(path: Path) -> Path:
    """The folder of the VTU files that belong to the PVD file at `path`."""
    return path.with_name(for_file_name(path.stem))


def xdmf(
    results: Results,
    path: Path,
    steps: list[int],
    also: Sequence[str] = (),
    squares: bool = False,
    progress: Progress = iter,
    inline: bool = False,
) -> None:
    """Write frames as XDMF, and their numbers in a .bin file of the same name or, `inline`, in the file as text.

    Sets of nodes of conditions are as in `vtu`; nodes have them until they change.
    """
    times = _times(results)

    def frames() -> Iterator[xdmf_file.XdmfFrame]:
        epoch, corners = None, 1
        for step in progress(steps):
            cloud = None
            if epoch != (epoch := results.epoch(step)):
                points, cells = _points(results, step, squares)
                corners = cells[1].shape[1]
                same = node_data(results, step) | columns(results, step)
                cloud = xdmf_file.MeshPoints(points, cells, _each(same, corners))
            yield xdmf_file.XdmfFrame(times[step], _each(point_data(results, step, also), corners), cloud)

    xdmf_file.write(path, frames(), inline)


def msh(
    results: Results,
    path: Path,
    steps: list[int],
    also: Sequence[str] = (),
    squares: bool = False,
    progress: Progress = iter,
) -> None:
    """Write frames as views of Gmsh in one file."""
    times, lives = _times(results), results.lives()
    corners = np.arange(2**results.dimension if squares else 1)

    def frames() -> Iterator[msh_file.MshFrame]:
        for number, step in enumerate(progress(steps)):
            rows = lives.at(results.nodes(step).ids, step)
            points = (rows[:, None] * len(corners) + corners).ravel()
            sets = {} if number else columns(results, step)
            data = _each({**point_data(results, step, also), **sets}, len(corners))
            yield msh_file.MshFrame(times[step], number, points, data)

    msh_file.write(path, *_placed(lives.nodes, squares), frames())


def _times(results: Results) -> dict[int, float]:
    """The time (s) of each frame's step."""
    return dict(zip(*(column.tolist() for column in results.frames()), strict=True))


def table(results: Results, step: int, path: Path, also: Sequence[str] = ()) -> None:
    """Write a frame as CSV, with a column for the set of nodes of each condition."""
    write_atomically(path, csv(of_frame(results, step, also) | columns(results, step)))


def check_suffix(path: Path) -> str:
    """The suffix of `path`. Raises ExportError, naming the supported suffixes."""
    if path.suffix.lower() not in SUFFIXES:
        raise ExportError(f"{path}: suffix '{path.suffix}' is not known; use one of {', '.join(SUFFIXES)}")
    return path.suffix.lower()


def _points(results: Results, step: int, squares: bool) -> tuple[NDArray[np.float64], tuple[str, NDArray[np.int64]]]:
    """Points (p, 3), m, and the kind and corners of the cells on them."""
    return _placed(results.nodes(step), squares)


def _placed(nodes: Nodes, squares: bool) -> tuple[NDArray[np.float64], tuple[str, NDArray[np.int64]]]:
    """Points (p, 3), m, and their cells: a vertex for each node or, with `squares`, its square or cube."""
    count = len(nodes.ids)
    if squares:
        d = nodes.position.shape[1]
        kind, shape = ("quad", SQUARE) if d == 2 else ("hexahedron", CUBE)
        corners = (nodes.position[:, None, :] + nodes.delta[:, None, None] * shape).reshape(-1, d)
        return _in_space(corners), (kind, np.arange(len(shape) * count).reshape(-1, len(shape)))
    return _in_space(nodes.position), ("vertex", np.arange(count).reshape(-1, 1))


def _in_space(vectors: NDArray[Any]) -> NDArray[Any]:
    """Vectors (n, 2 or 3) padded to (n, 3)."""
    flat: NDArray[Any] = np.zeros((len(vectors), 3 - vectors.shape[1]), dtype=vectors.dtype)
    return np.hstack([vectors, flat])


def _each(data: dict[str, NDArray[np.generic]], corners: int) -> dict[str, NDArray[np.generic]]:
    """Data repeated for each corner of a node's square or cube."""
    return {name: np.repeat(values, corners, axis=0) for name, values in data.items()} if corners > 1 else data
