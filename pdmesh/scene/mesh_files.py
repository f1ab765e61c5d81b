"""Values at the points of meshes in files of other programs: VTU, VTK, series of VTU (.pvd) and CalculiX (.frd).

Coordinates are in m and values in SI. Of a series, values are 0 at time 0 unless it has that time.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from pdmesh.files import read_bytes
from pdmesh.model.values_at_places import MOST_BYTES, MOST_ROWS, path_beside
from pdmesh.model.values_of_place import AXES, MESHES, PlaceError, Table

Array = NDArray[np.float64]
MOST_FILES = 10_000  # of a series


class MeshValues(NamedTuple):
    """Values of one time at places."""

    time: float | None  # s
    places: Array  # (k, 3) m
    values: Array  # (k,)


def is_mesh(value: str) -> bool:
    """Whether words name such a file: FILE or FILE:NAME."""
    return value.partition(":")[0].strip().lower().endswith(MESHES)


def table_of_mesh(words: str, folder: Path, dimension: int) -> Table:
    """Values of ``FILE`` or ``FILE:NAME`` at points of a mesh, or at middles of its cells; of a series over time.

    Components of a vector are NAME_x, NAME_y and NAME_z. Raises PlaceError.
    """
    name, _, wanted = (part.strip() for part in words.partition(":"))
    path = path_beside(name, folder)
    if name.lower().endswith(".frd"):
        moments = _of_frd(path, wanted)
    elif name.lower().endswith(".pvd"):
        moments = [MeshValues(time, *_of_vtu(part, wanted)) for time, part in _series(path)]
    else:
        moments = [MeshValues(None, *_of_vtu(path, wanted))]
    places = moments[0].places
    if any(moment.places.shape != places.shape or (moment.places != places).any() for moment in moments):
        raise PlaceError(f"{name}: points differ from time to time; use a mesh that stays")
    if len(places) * len(moments) > MOST_ROWS:
        raise PlaceError(f"{name} has {len(places)} points at {len(moments)} times; use at most {MOST_ROWS} values")
    _, first, where = np.unique(places[:, :dimension], axis=0, return_index=True, return_inverse=True)
    if any((moment.values != moment.values[first][where.ravel()]).any() for moment in moments):
        raise PlaceError(f"{name} has several values of {wanted} at one place; use a mesh with one value at each")
    times = [moment.time for moment in moments if moment.time is not None]
    rows = [moment.values for moment in moments]
    if times and times[0] > 0:
        times, rows = [0.0, *times], [np.zeros(len(places)), *rows]
    values = tuple(np.concatenate(rows).tolist())
    return Table(tuple(map(tuple, places[:, :dimension].tolist())), values, AXES[:dimension], tuple(times))


def _of_vtu(path: Path, wanted: str) -> tuple[Array, Array]:
    """Places and values of a mesh that meshio reads. Raises PlaceError."""
    import meshio  # slow to import, and few scenes have such files

    try:
        mesh = meshio.read(path)
    except (Exception, SystemExit) as error:  # meshio exits where no reader can read the file
        raise PlaceError(f"{path.name}: cannot be read ({error}); use a mesh that meshio reads") from None
    points = np.zeros((len(mesh.points), 3))
    points[:, : mesh.points.shape[1]] = mesh.points
    places, values = dict[str, Array](), dict[str, Array]()
    for key, numbers in mesh.point_data.items():
        for part, column in _components(key, numbers):
            places[part], values[part] = points, column
    middles = [points[block.data].mean(axis=1) for block in mesh.cells]
    for key, blocks in mesh.cell_data.items():
        for part, column in _components(key, np.concatenate(blocks)):
            if part not in values:
                places[part], values[part] = np.concatenate(middles), column
    if not wanted and len(values) == 1:
        wanted = next(iter(values))
    if wanted not in values:
        raise PlaceError(_unknown(path.name, list(values)))
    return places[wanted], values[wanted]


def _components(name: str, numbers: NDArray[np.generic]) -> Iterator[tuple[str, Array]]:
    """The columns of a scalar (n,) or a vector (n, 2) or (n, 3), by name."""
    if numbers.ndim == 1:
        yield name, np.asarray(numbers, dtype=float)
    elif numbers.ndim == 2 and numbers.shape[1] in (2, 3):
        yield from (
            (f"{name}_{axis}", np.asarray(part, dtype=float)) for axis, part in zip(AXES, numbers.T, strict=False)
        )


def _unknown(name: str, values: list[str]) -> str:
    return f"{name} has the values {', '.join(values) or 'none'}; name one of them, {name}:NAME"


def _series(path: Path) -> list[tuple[float, Path]]:
    """The times, s, and files of a .pvd. Raises PlaceError."""
    try:
        sets = ElementTree.fromstring(read_bytes(path, MOST_BYTES)).findall("Collection/DataSet")
        files = sorted((float(part.attrib["timestep"]), part.attrib["file"]) for part in sets)
    except (ElementTree.ParseError, KeyError, ValueError, OSError) as error:
        raise PlaceError(f"{path.name}: cannot be read ({error}); use a .pvd with times and files") from None
    if not files or len(files) > MOST_FILES or len({time for time, _ in files}) < len(files):
        raise PlaceError(f"{path.name} has {len(files)} files; use 1 to {MOST_FILES}, one for each time")
    series = []
    for time, file in files:
        parts = Path(file).parts
        if len(parts) not in (1, 2) or (path.parent / parts[0]).is_symlink():
            raise PlaceError(f"{path.name} names {file!r:.80}; use files beside it, or in a folder beside it")
        folder = path.parent / parts[0] if len(parts) == 2 and parts[0] not in ("..", "/") else path.parent
        if len(parts) == 2 and folder == path.parent:
            raise PlaceError(f"{path.name} names {file!r:.80}; use files beside it, or in a folder beside it")
        series.append((time, path_beside(parts[-1], folder)))
    return series


def _of_frd(path: Path, wanted: str) -> list[MeshValues]:
    """Values of a component, such as D1, at the nodes of a CalculiX file, at each of its times. Raises PlaceError."""
    try:
        lines = read_bytes(path, MOST_BYTES).decode("ascii", "replace").splitlines()
    except OSError as error:
        raise PlaceError(f"{path.name}: cannot be read: {error.strerror or error}") from None
    nodes: dict[int, list[float]] = {}
    components, moments, at = dict[str, None](), list[MeshValues](), 0
    while at < len(lines):
        line = lines[at]
        if line[:6] == "    2C":
            at, nodes = _rows(lines, at + 1, 3, line, path.name)
        elif line[:6] == "  100C":
            at, names = _names(lines, at + 1)
            components |= dict.fromkeys(names)
            at, values = _rows(lines, at, len(names), line, path.name)
            if wanted in names:
                column = names.index(wanted)
                placed = np.array([(*nodes[number], row[column]) for number, row in values.items() if number in nodes])
                if not len(placed):
                    raise PlaceError(f"{path.name}: no node of the file has a value of {wanted}; write it with nodes")
                moments.append(MeshValues(_number(line[12:24], path.name), placed[:, :3], placed[:, 3]))
        else:
            at += 1
    if not moments:
        raise PlaceError(_unknown(path.name, list(components)))
    return moments


def _names(lines: list[str], at: int) -> tuple[int, list[str]]:
    """The line after the names of a result's components, from the line `at` on, and the stored ones."""
    names = []
    while at < len(lines) and lines[at][:3] in (" -4", " -5"):
        if lines[at][:3] == " -5" and lines[at][5:13].strip() != "ALL":
            names.append(lines[at][5:13].strip())
        at += 1
    return at, names


def _number(text: str, name: str) -> float:
    """The time of a result. Raises PlaceError."""
    try:
        return float(text)
    except ValueError:
        raise PlaceError(f"{name}: {text!r:.40} is no time; use an .frd as CalculiX writes it") from None


def _rows(lines: list[str], at: int, count: int, header: str, name: str) -> tuple[int, dict[int, list[float]]]:
    """The line after rows of `count` numbers by node, from the line `at` on, and the rows. Raises PlaceError."""
    rows: dict[int, list[float]] = {}
    digits = 5 if header.rstrip()[-1:] == "0" else 10  # of a number of a node: short or long
    while at < len(lines) and lines[at][:3] in (" -1", " -2"):
        line, begin = lines[at], 3 + digits
        try:
            numbers = [float(line[k : k + 12]) for k in range(begin, min(len(line.rstrip()), begin + 72), 12)]
            if line[:3] == " -1":
                rows[(number := int(line[3:begin]))] = numbers
            else:
                rows[number] += numbers
        except (ValueError, UnboundLocalError):
            raise PlaceError(
                f"{name}: line {at + 1}: no node and numbers; use an .frd in ASCII, not in binary"
            ) from None
        at += 1
    if any(len(numbers) != count for numbers in rows.values()):
        raise PlaceError(f"{name}: line {at}: not {count} numbers for each node; use an .frd as CalculiX writes it")
    return at, rows
