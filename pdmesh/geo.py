"""The only file that knows Gmsh: a .geo drawing becomes a Scene.

A drawing says what its shapes mean by the names of its physical groups and carries its numbers as ONELAB
parameters below ``Peridynamics/``, so that Gmsh's own window edits them:

    group                              parameters
    Physical Surface("zone:NAME")      Zones/NAME/Spacing
    Physical Curve("crack:NAME")       -
    Physical Curve("load:NAME")        Loads/NAME/Traction x, Traction y, Rows
    -                                  Material/E, rho, G0, Force law, Micromodulus, Plane
    -                                  Horizon ratio, Run/Time step, Duration, Frame every

A .geo file is a program, so it is looked through for commands that reach outside and read in a child process
(this module run as a script) with a time limit; a drawing that exits, hangs or crashes takes nothing along.
"""

from __future__ import annotations

import difflib
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import numpy as np
from shapely import LineString, MultiLineString, MultiPolygon, Polygon, line_merge, polygonize_full, unary_union

from pdmesh.grid import Horizon, Material, Run
from pdmesh.scene import Crack, Scene, SceneError, Traction, Zone

T = TypeVar("T")

PREFIX = "Peridynamics/"
SYSTEM_LIBRARIES = (
    "libgl1 libglu1-mesa libxft2 libxcursor1 libxinerama1 libxrender1 libxfixes3 libxext6 libfontconfig1 libgomp1"
)
TIME_LIMIT = 60.0  # s
CHORD_TOLERANCE = 0.01  # of the finest spacing
REACHES_OUTSIDE = re.compile(
    r"\b(SystemCall|NonBlockingSystemCall|OnelabRun|CreateDir|Save|Print|Exit|Abort|Plugin|Include|Merge"
    r"|Printf(?=\s*\([^)]*\)\s*>)|ShapeFromFile|MergeWithBoundingBox)\b"
)
COMMENT_OR_STRING = re.compile(r'/\*.*?\*/|//[^\n]*|"(?:[^"\\\n]|\\.)*"|\'[^\'\n]*\'', re.DOTALL)


def read_geo(path: Path, assignments: Sequence[tuple[str, str]] = (), trust: bool = False) -> Scene:
    """The scene drawn in the .geo file at `path`, with ONELAB parameters set by name before it is read.

    Parameter names may leave out ``Peridynamics/``. Raises SceneError naming the file, the place, what was
    found and what was expected. `trust` reads files that run commands as well.
    """
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise SceneError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise SceneError(f"{path}: found bytes that are not text, expected a Gmsh .geo script") from None
    _check_text(path, text, trust)
    drawing = _in_child(path, [(_full_name(name), value) for name, value in assignments])
    try:
        return _scene(drawing, path.name)
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from None


def _check_text(path: Path, text: str, trust: bool) -> None:
    if not text.endswith("\n"):
        raise SceneError(f"{path}: last line: found no line end, expected one (Gmsh drops the statement silently)")
    bare = COMMENT_OR_STRING.sub(lambda match: "\n" * match[0].count("\n") or " ", text)
    found = REACHES_OUTSIDE.search(bare)
    if found and not trust:
        line = bare.count("\n", 0, found.start()) + 1
        raise SceneError(
            f"{path}: line {line}: found '{found[0].split('(')[0].strip()}', expected a drawing that reaches for no"
            " other file or program (--trust reads it all the same)"
        )


def _full_name(name: str) -> str:
    return name if name.startswith(PREFIX) else PREFIX + name


def _in_child(path: Path, assignments: list[tuple[str, str]]) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder) / "drawing.json"
        command = [sys.executable, "-m", "pdmesh.geo", str(path.resolve()), str(result), json.dumps(assignments)]
        try:
            child = subprocess.run(command, capture_output=True, text=True, timeout=TIME_LIMIT, check=False)
        except subprocess.TimeoutExpired:
            raise SceneError(f"{path}: Gmsh was still reading after {TIME_LIMIT:g} s, expected it to end") from None
        if not result.exists():
            last = (child.stderr.strip().splitlines() or ["no message"])[-1]
            raise SceneError(f"{path}: Gmsh stopped before the end of the drawing: {last}")
        drawing: dict[str, Any] = json.loads(result.read_text(encoding="utf-8"))
    if drawing["missing library"]:
        raise SceneError(
            f"Gmsh cannot be loaded: {drawing['missing library']}; on Debian and Ubuntu this installs what it needs:"
            f" apt-get install {SYSTEM_LIBRARIES}"
        )
    for name in drawing["unknown"]:
        close = difflib.get_close_matches(name, drawing["parameters"], n=1)
        hint = f" such as '{close[0]}'" if close else ""
        raise SceneError(f"{path}: parameter '{name}' is not in the drawing, expected one that is{hint}")
    for message in drawing["messages"]:
        raise SceneError(f"{path}: {message}")
    return drawing


# ---- the drawing's groups and parameters as a Scene


def _scene(drawing: dict[str, Any], source: str) -> Scene:
    groups = {"zone": {}, "crack": {}, "load": {}}  # type: dict[str, dict[str, Any]]
    dimension = {"zone": 2, "crack": 1, "load": 1}
    for group in drawing["groups"]:
        kind, _, name = group["name"].partition(":")
        if kind not in groups or not name or dimension[kind] != group["dimension"]:
            shape = ("Point", "Curve", "Surface", "Volume")[group["dimension"]]
            raise SceneError(
                f'Physical {shape}("{group["name"]}"): expected Physical Surface("zone:NAME"),'
                ' Physical Curve("crack:NAME") or Physical Curve("load:NAME")'
            )
        groups[kind][name] = group
    parameters = _Parameters(drawing["parameters"])
    for kind, folder in (("zone", "Zones"), ("load", "Loads")):
        for name in sorted(parameters.below(folder) - set(groups[kind])):
            shape = "Surface" if kind == "zone" else "Curve"
            raise SceneError(f'Physical {shape}("{kind}:{name}"): found none, expected one for {PREFIX}{folder}/{name}')
    scene = Scene(
        zones=tuple(
            Zone(name, _surface(name, group), parameters.number(f"Zones/{name}/Spacing"))
            for name, group in groups["zone"].items()
        ),
        cracks=tuple(
            Crack(f"{name}", line) for name, group in groups["crack"].items() for line in _lines(group["curves"])
        ),
        tractions=tuple(
            Traction(
                name,
                MultiLineString(_lines(group["curves"])),
                parameters.vector(f"Loads/{name}/Traction"),
                parameters.whole(f"Loads/{name}/Rows", 1),
            )
            for name, group in groups["load"].items()
        ),
        material=_checked(
            Material,
            {
                "E": parameters.number("Material/E"),
                "rho": parameters.number("Material/rho"),
                "G0": parameters.number("Material/G0"),
                "law": parameters.text("Material/Force law", "brittle"),
                "micromodulus": parameters.text("Material/Micromodulus", "conical"),
                "plane": parameters.text("Material/Plane", "stress"),
            },
            "Material",
        ),
        horizon=_checked(Horizon, {"ratio": parameters.number("Horizon ratio", 3.0)}, "Horizon"),
        run=_run(parameters),
        source=source,
        parameters=tuple(drawing["parameters"].items()),
    )
    unused = sorted(set(drawing["parameters"]) - parameters.used)
    known = sorted(parameters.used)
    for name in unused:
        if name.removeprefix(PREFIX).split("/")[0] in ("Zones", "Loads", "Material", "Run"):
            close = difflib.get_close_matches(name, known, n=1)
            hint = f" (is '{close[0]}' meant?)" if close else ""
            raise SceneError(f"parameter '{name}': found a name that means nothing here{hint}")
    return scene


def _run(parameters: _Parameters) -> Run:
    step = parameters.number("Run/Time step")
    duration = parameters.number("Run/Duration")
    if not step > 0 or not duration >= 0:
        raise SceneError(
            f"{PREFIX}Run: found a time step of {step:g} s and a duration of {duration:g} s, expected positive numbers"
        )
    every = parameters.whole("Run/Frame every", 50)
    return _checked(Run, {"time_step": step, "steps": round(duration / step), "every": every}, "Run")


def _checked(kind: type[T], fields: dict[str, Any], place: str) -> T:
    try:
        return msgspec.convert(fields, kind)
    except msgspec.ValidationError as error:
        raise SceneError(f"{PREFIX}{place}: {error}") from None


class _Parameters:
    """The ONELAB values of a drawing, asked for by their name below ``Peridynamics/``."""

    def __init__(self, values: dict[str, float | str]) -> None:
        self._values = values
        self.used: set[str] = set()

    def below(self, folder: str) -> set[str]:
        prefix = f"{PREFIX}{folder}/"
        return {name.removeprefix(prefix).split("/")[0] for name in self._values if name.startswith(prefix)}

    def _get(self, name: str, default: float | str | None, kind: type, expected: str) -> Any:
        full = PREFIX + name
        self.used.add(full)
        value = self._values.get(full, default)
        if value is None:
            raise SceneError(f"parameter '{full}': found none, expected {expected}")
        if not isinstance(value, kind):
            raise SceneError(f"parameter '{full}': found {value!r}, expected {expected}")
        return value

    def number(self, name: str, default: float | None = None) -> float:
        value: float = self._get(name, default, float, "a number")
        if not np.isfinite(value):
            raise SceneError(f"parameter '{PREFIX}{name}': found {value}, expected a finite number")
        return value

    def vector(self, name: str) -> tuple[float, float]:
        return self.number(f"{name} x", 0.0), self.number(f"{name} y", 0.0)

    def whole(self, name: str, default: int) -> int:
        value = self.number(name, float(default))
        if value != round(value):
            raise SceneError(f"parameter '{PREFIX}{name}': found {value:g}, expected a whole number")
        return round(value)

    def text(self, name: str, default: str) -> str:
        value: str = self._get(name, default, str, "a word")
        return value


def _lines(curves: Iterable[Sequence[Sequence[float]]]) -> list[LineString]:
    merged = line_merge(MultiLineString([LineString(points) for points in curves]))
    return list(merged.geoms) if isinstance(merged, MultiLineString) else [merged]


def _surface(name: str, group: dict[str, Any]) -> Polygon | MultiPolygon:
    faces = []
    for curves in group["surfaces"]:
        found, cuts, dangles, crossings = polygonize_full([unary_union([LineString(points) for points in curves])])
        if found.is_empty or not (cuts.is_empty and dangles.is_empty and crossings.is_empty):
            raise SceneError(f"zone '{name}': found an outline that does not close, expected closed curves")
        faces.append(max(found.geoms, key=lambda face: Polygon(face.exterior).area))
    return unary_union(faces)


# ---- the child process


def _vertices(gmsh: Any, curve: int) -> tuple[list[float], list[float]] | None:
    """The points a curve runs between, exactly; None for a closed curve."""
    ends = gmsh.model.getBoundary([(1, curve)], combined=False, oriented=True)
    if len(ends) != 2:
        return None
    start, end = ([float(value) for value in gmsh.model.getValue(0, point, [])[:2]] for _, point in ends)
    return start, end


def _sample(gmsh: Any, curve: int, tolerance: float) -> list[list[float]]:
    """Points along a curve, halved until no chord is off by more than `tolerance`."""
    low, high = (bound[0] for bound in gmsh.model.getParametrizationBounds(1, curve))

    def at(parameter: float) -> list[float]:
        return [float(value) for value in gmsh.model.getValue(1, curve, [parameter])[:2]]

    def between(t0: float, p0: list[float], t1: float, p1: list[float], depth: int) -> list[list[float]]:
        middle = (t0 + t1) / 2
        point = at(middle)
        if depth > 3 and np.hypot(point[0] - (p0[0] + p1[0]) / 2, point[1] - (p0[1] + p1[1]) / 2) <= tolerance:
            return [p1]
        if depth > 16:
            return [p1]
        return between(t0, p0, middle, point, depth + 1) + between(middle, point, t1, p1, depth + 1)

    start, end = _vertices(gmsh, curve) or (at(low), at(low))
    if gmsh.model.getType(1, curve) == "Line":
        return [start, end]
    return [start, *between(low, start, high, end, 0)]


def _parameters_of(gmsh: Any) -> dict[str, float | str]:
    values: dict[str, float | str] = {}
    for name in gmsh.onelab.getNames(f"^{PREFIX}"):
        numbers, texts = gmsh.onelab.getNumber(name), gmsh.onelab.getString(name)
        if len(numbers) or len(texts):
            values[name] = float(numbers[0]) if len(numbers) else str(texts[0])
    return values


def _assign(gmsh: Any, known: dict[str, float | str], assignments: list[tuple[str, str]]) -> None:
    for name, value in assignments:
        if isinstance(known[name], str):
            gmsh.onelab.setString(name, [value])
            continue
        try:
            gmsh.onelab.setNumber(name, [float(value)])
        except ValueError:
            raise ValueError(f"parameter '{name}': found '{value}', expected a number") from None


def _groups_of(gmsh: Any, tolerance: float) -> list[dict[str, Any]]:
    groups = []
    for dimension, tag in gmsh.model.getPhysicalGroups():
        entities = gmsh.model.getEntitiesForPhysicalGroup(dimension, tag)
        group = {"name": gmsh.model.getPhysicalName(dimension, tag), "dimension": dimension}
        if dimension == 1:
            group["curves"] = [_sample(gmsh, curve, tolerance) for curve in entities]
        elif dimension == 2:
            group["surfaces"] = [
                [
                    _sample(gmsh, abs(curve), tolerance)
                    for _, curve in gmsh.model.getBoundary([(2, surface)], combined=False, oriented=True)
                ]
                for surface in entities
            ]
        groups.append(group)
    return groups


def _read_in_child(path: str, assignments: list[tuple[str, str]]) -> dict[str, Any]:
    drawing: dict[str, Any] = {"missing library": "", "unknown": [], "messages": [], "parameters": {}, "groups": []}
    try:
        import gmsh
    except OSError as error:
        return drawing | {"missing library": str(error)}
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.logger.start()
    try:
        gmsh.open(path)
        drawing["parameters"] = _parameters_of(gmsh)
        if assignments:
            drawing["unknown"] = [name for name, _ in assignments if name not in drawing["parameters"]]
            if drawing["unknown"]:
                return drawing
            for reset in (gmsh.onelab.clear, gmsh.parser.clear, gmsh.clear):
                reset()
            _assign(gmsh, drawing["parameters"], assignments)
            gmsh.open(path)
            drawing["parameters"] = _parameters_of(gmsh)
        spacings = [value for name, value in drawing["parameters"].items() if name.endswith("/Spacing")]
        finest = min([value for value in spacings if isinstance(value, float) and value > 0], default=1e-3)
        drawing["groups"] = _groups_of(gmsh, CHORD_TOLERANCE * finest)
    except Exception as error:  # gmsh raises bare Exception
        drawing["messages"].append(" ".join(str(error).split()))
    drawing["messages"] += [f"Gmsh says: {line}" for line in gmsh.logger.get() if line.startswith(("Warning", "Error"))]
    return drawing


if __name__ == "__main__":
    Path(sys.argv[2]).write_text(json.dumps(_read_in_child(sys.argv[1], json.loads(sys.argv[3]))), encoding="utf-8")
