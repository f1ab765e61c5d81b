"""The only file that knows Gmsh: a .geo drawing, a STEP or a BREP file becomes a Scene.

What a drawing's groups and parameters mean is in drawing.py. The parameters are ONELAB parameters below
``Peridynamics/``, so that Gmsh's own window edits them.

A .geo file is a program, so it is looked through for commands that reach outside and read in a child process
(this module run as a script) with a time limit; a drawing that exits, hangs or crashes takes nothing along.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import shapely

from pdmesh.drawing import Group, face, in_metres, scene_of
from pdmesh.parameters import OWN, PREFIX, Parameter, full_name, given, refuse_unknown, unit_of, unknown
from pdmesh.scene import Scene
from pdmesh.shapes import CHORD_TOLERANCE, SceneError, Surface
from pdmesh.units import UNITS

SYSTEM_LIBRARIES = (
    "libgl1 libglu1-mesa libxft2 libxcursor1 libxinerama1 libxrender1 libxfixes3 libxext6 libfontconfig1 libgomp1"
)
TIME_LIMIT = 60.0  # s
CAD = (".step", ".stp", ".brep", ".brp")  # shapes only, nothing that runs
OPEN_CASCADE_UNITS = {"in": "INCH"}  # that do not go by their own name in capitals
LEAST_TOLERANCE = 1e-8  # of the size of a drawing: finer chords are not made for any spacing
PLATE = "zone:plate"  # the group a CAD file's surfaces are put in
REACHES_OUTSIDE = re.compile(
    r"\b(?:(?:SystemCall|NonBlockingSystemCall|System|OnelabRun|CreateDir|Save|Print|Exit|Abort|Plugin|ListFromFile)\b"
    r"|(?:General|Solver|Print)\s*\.\s*\w*"
    r"(?:File|Name|Executable|Client|Extension|Save|Script|Editor|Browser|Socket)\w*"
    r"|Printf\b[^;]*>|(?:Macro|Function)\s*\()"
)
READS_FILES = re.compile(r"\b(Include|MergeWithBoundingBox|MergeFile|Merge|ShapeFromFile)\b\s*\(?\s*([^;)]*)")
NOT_FINITE = re.compile(r"([\[,:] *)-?(?:nan|inf)\b")  # Gmsh's JSON has numbers that are not JSON
COMMENT_OR_STRING = re.compile(r"/\*.*?\*/|//[^\n]*|(\"[^\"]*\"|'[^']*')", re.DOTALL)
STRING = re.compile(r"\"[^\"]*\"|'[^']*'")  # Gmsh's have no escapes, and may span lines


def read_geo(path: Path, assignments: Sequence[tuple[str, str]] = (), trust: bool = False) -> Scene:
    """The scene drawn in the .geo file at `path`, with ONELAB parameters set by name before it is read.

    Parameter names may leave out ``Peridynamics/``; those that the drawing does not define may be set too. Raises
    SceneError naming the file, the place, what was found and what was expected. `trust` reads files that run commands
    as well.
    """
    text = _checked_text(path, trust)
    found = _in_child(path, assignments)
    return _scene(path, found, _values(found), text)


def _scene(path: Path, found: dict[str, Any], values: dict[str, float | str], text: str) -> Scene:
    try:
        return scene_of(_groups(found), values, path.name, text)
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from None


def read_parameters(path: Path, assignments: Sequence[tuple[str, str]] = (), trust: bool = False) -> list[Parameter]:
    """The parameters of the .geo file at `path`. Raises SceneError."""
    _checked_text(path, trust)
    found = _in_child(path, assignments)
    return [
        Parameter(entry["name"], _value(entry), entry.get("attributes", {}).get("Units", ""), entry.get("help", ""))
        for entry in found["parameters"]
    ]


def read_cad(path: Path, assignments: Sequence[tuple[str, str]] = ()) -> Scene:
    """The plate in a STEP or BREP file as a scene of one zone, ``plate``, with parameters as in a .geo file.

    A STEP file names the unit of its coordinates; those of a BREP file are in the unit that the parameters are in.
    Raises SceneError.
    """
    if not path.is_file():
        raise SceneError(f"{path}: cannot be read: no such file")
    try:
        values = given(assignments)
        unit_of(values)
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from None
    spacing, unit = values.get(f"{PREFIX}Zones/plate/Spacing"), str(values.get(f"{PREFIX}Units") or "m")
    found = _in_child(path, tolerance=CHORD_TOLERANCE * spacing if isinstance(spacing, float) else 0.0, unit=unit)
    return _scene(path, found, values, path.read_text(encoding="utf-8", errors="replace"))


def read_outline(path: Path, spacing: float, unit: str = "m") -> Surface:
    """The plate in a STEP or BREP file, for a scene in Python with nodes of `spacing`, m.

    `unit` is that of a BREP file's coordinates; a STEP file names its own. Raises SceneError.
    """
    if not path.is_file():
        raise SceneError(f"{path}: cannot be read: no such file")
    found = _in_child(path, tolerance=CHORD_TOLERANCE * UNITS[unit].of(spacing), unit=unit)
    surfaces = [curves for group in _groups(found) for curves in in_metres(group, UNITS[unit]).surfaces]
    return shapely.union_all([face(curves, str(path)) for curves in surfaces])


def _checked_text(path: Path, trust: bool) -> str:
    """The text of a drawing that reaches for nothing outside its folder. Raises SceneError."""
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise SceneError(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise SceneError(f"{path}: found bytes that are not text, expected a Gmsh .geo script") from None
    if "\0" in text:
        raise SceneError(f"{path}: found a zero byte, expected a Gmsh .geo script")
    if not text.endswith("\n"):
        raise SceneError(f"{path}: last line: found no line end, expected one (Gmsh drops the statement silently)")
    if not trust:
        _refuse_programs(path, text, depth=0)
    return text


def _refuse_programs(path: Path, text: str, depth: int) -> None:
    code = COMMENT_OR_STRING.sub(lambda match: match[1] or "\n" * match[0].count("\n") or " ", text)
    bare = STRING.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), code)
    found = REACHES_OUTSIDE.search(bare)
    if found:
        raise SceneError(
            f"{path}: line {bare.count(chr(10), 0, found.start()) + 1}: found '{found[0].split('(')[0].strip()}',"
            " expected a drawing that reaches for no other file or program (--trust reads it all the same)"
        )
    for match in READS_FILES.finditer(code):
        if bare[match.start() : match.start(1) + len(match[1])].strip() == "":
            continue  # inside a string
        _refuse_strangers(path, code.count("\n", 0, match.start()) + 1, match[1], match[2].strip(), depth)


def _refuse_strangers(path: Path, line: int, command: str, name: str, depth: int) -> None:
    """Raises SceneError unless a drawing reads a drawing or a CAD file of its own folder."""
    inner = name[1:-1]
    plain = STRING.fullmatch(name) and not Path(inner).is_absolute() and ".." not in Path(inner).parts
    other = path.parent / inner
    if not plain or other.suffix.lower() not in (".geo", *CAD) or depth > 8:
        raise SceneError(
            f"{path}: line {line}: found '{command} {name}', expected a .geo, STEP or BREP file in the drawing's"
            " own folder (--trust reads it all the same)"
        )
    if other.suffix.lower() == ".geo" and other.is_file():
        _refuse_programs(other, other.read_text(encoding="utf-8", errors="replace"), depth + 1)


def _in_child(
    path: Path, assignments: Sequence[tuple[str, str]] = (), tolerance: float = 0.0, unit: str = "m"
) -> dict[str, Any]:
    words = [(full_name(name), value) for name, value in assignments]
    with tempfile.TemporaryDirectory() as folder:
        result = Path(folder) / "drawing.json"
        job = json.dumps({"path": str(path.resolve()), "assignments": words, "tolerance": tolerance, "unit": unit})
        command = [sys.executable, "-m", "pdmesh.geo", str(result), job]
        try:
            child = subprocess.run(
                command, capture_output=True, text=True, errors="replace", timeout=TIME_LIMIT, check=False
            )
        except subprocess.TimeoutExpired:
            raise SceneError(f"{path}: Gmsh was still reading after {TIME_LIMIT:g} s, expected it to end") from None
        if not result.exists():
            last = (child.stderr.strip().splitlines() or ["no message"])[-1]
            raise SceneError(f"{path}: Gmsh stopped before the end of the drawing: {last}")
        found: dict[str, Any] = json.loads(result.read_text(encoding="utf-8"))
    if found["missing library"]:
        raise SceneError(
            f"Gmsh cannot be loaded: {found['missing library']}; on Debian and Ubuntu this installs what it needs:"
            f" apt-get install {SYSTEM_LIBRARIES}"
        )
    _refuse_unknown(path, found)
    for name, text in found["not numbers"]:
        raise SceneError(f"{path}: parameter '{name}': found '{text}', expected a number")
    for message in found["messages"]:
        raise SceneError(f"{path}: Gmsh says: {message}")
    for entry in found["parameters"]:
        value, low, high = _value(entry), entry.get("min", -1e200), entry.get("max", 1e200)
        if isinstance(value, float) and not low * (1 - 1e-12) <= value <= high * (1 + 1e-12):
            raise SceneError(
                f"{path}: parameter '{entry['name']}': found {value:g}, expected a number from {low:g} to {high:g}"
            )
    return found


def _refuse_unknown(path: Path, found: dict[str, Any]) -> None:
    """Raises SceneError for a parameter that was set, and neither the drawing nor the mesher knows."""
    known = {entry["name"] for entry in found["parameters"]} - set(found["supplied"])
    try:
        refuse_unknown([name for name in found["supplied"] if not name.startswith(f"{PREFIX}{OWN}/")], own=True)
    except SceneError as error:
        raise SceneError(f"{path}: {error}") from None
    for name in found["supplied"]:
        if name.startswith(f"{PREFIX}{OWN}/"):
            raise SceneError(f"{path}: {unknown(name, known)}")


def _groups(found: dict[str, Any]) -> list[Group]:
    return [
        Group(group["name"], group["dimension"], tuple(group["curves"]), tuple(map(tuple, group["surfaces"])))
        for group in found["groups"]
    ]


def _value(entry: dict[str, Any]) -> float | str:
    value = (entry.get("values") or [""])[0]
    return float(value) if entry["type"] == "number" else str(value)


def _values(found: dict[str, Any]) -> dict[str, float | str]:
    return {entry["name"]: _value(entry) for entry in found["parameters"]}


# ---- the child process


def _sample(gmsh: Any, curve: int, tolerance: float) -> list[list[float]]:
    """Points along a curve, halved until no chord is off by more than `tolerance`; the ends are its vertices."""
    low, high = (bound[0] for bound in gmsh.model.getParametrizationBounds(1, curve))

    def at(parameter: float) -> list[float]:
        return [float(value) for value in gmsh.model.getValue(1, curve, [parameter])]

    def between(t0: float, p0: list[float], t1: float, p1: list[float], depth: int) -> list[list[float]]:
        middle = (t0 + t1) / 2
        point = at(middle)
        off = np.hypot(point[0] - (p0[0] + p1[0]) / 2, point[1] - (p0[1] + p1[1]) / 2)
        if depth > 16 or (depth > 3 and off <= tolerance):
            return [p1]
        return between(t0, p0, middle, point, depth + 1) + between(middle, point, t1, p1, depth + 1)

    start, end = at(low), at(high)
    vertices = [
        [float(value) for value in gmsh.model.getValue(0, tag, [])]
        for _, tag in gmsh.model.getBoundary([(1, curve)], combined=False, oriented=False)
    ]
    if vertices:
        start, end = (
            min(vertices, key=lambda vertex: float(np.linalg.norm(np.subtract(vertex, p)))) for p in (start, end)
        )
    if gmsh.model.getType(1, curve) == "Line":
        return [start, end]
    return [start, *between(low, start, high, end, 0)]


def _parameters_of(gmsh: Any) -> list[dict[str, Any]]:
    texts = [NOT_FINITE.sub(r"\1NaN", gmsh.onelab.get(name)) for name in gmsh.onelab.getNames(f"^{PREFIX}")]
    entries = [json.loads(text) for text in texts]
    for entry in entries:  # an entry without a value has none here
        entry["values"] = list(gmsh.onelab.getNumber(entry["name"])) or list(gmsh.onelab.getString(entry["name"]))
    return [entry for entry in entries if entry["values"]]


def _assign(gmsh: Any, known: list[dict[str, Any]], assignments: list[list[str]]) -> list[list[str]]:
    """Set parameters, also some that the drawing does not define; returns those that should be numbers and are not."""
    wrong = []
    kinds = {entry["name"]: entry["type"] for entry in known}
    for name, value in assignments:
        if kinds.get(name) == "string":
            gmsh.onelab.setString(name, [value])
            continue
        try:
            gmsh.onelab.setNumber(name, [float(value)])
        except ValueError:
            if name in kinds:
                wrong.append([name, value])
            else:
                gmsh.onelab.setString(name, [value])
    return wrong


def _groups_of(gmsh: Any, parameters: list[dict[str, Any]]) -> list[dict[str, Any]]:
    spacings = {
        entry["name"].split("/")[2]: entry["values"][0]
        for entry in parameters
        if re.fullmatch(PREFIX + "Zones/[^/]+/Spacing", entry["name"]) and entry["type"] == "number"
    }
    finest = min([value for value in spacings.values() if value > 0], default=1e-3)
    physical = [
        (gmsh.model.getPhysicalName(*group), group[0], gmsh.model.getEntitiesForPhysicalGroup(*group))
        for group in gmsh.model.getPhysicalGroups()
    ]
    least = LEAST_TOLERANCE * _size(gmsh)
    tolerances: dict[int, float] = {}
    for name, dimension, entities in physical:
        if dimension == 2 and name.startswith("zone:"):
            spacing = spacings.get(name.removeprefix("zone:"), finest)
            for curve in _bounds(gmsh, entities):
                tolerances[curve] = min(tolerances.get(curve, np.inf), CHORD_TOLERANCE * abs(spacing))

    def sampled(curve: int) -> list[list[float]]:
        return _sample(gmsh, curve, max(tolerances.get(curve) or CHORD_TOLERANCE * finest, least))

    return [
        {
            "name": name,
            "dimension": dimension,
            "curves": [sampled(int(curve)) for curve in entities] if dimension == 1 else [],
            "surfaces": [[sampled(curve) for curve in _bounds(gmsh, [surface])] for surface in entities]
            if dimension == 2
            else [],
        }
        for name, dimension, entities in physical
    ]


def _size(gmsh: Any) -> float:
    if not gmsh.model.getEntities():
        return 0.0
    x0, y0, _, x1, y1, _ = gmsh.model.getBoundingBox(-1, -1)
    return float(max(x1 - x0, y1 - y0))


def _bounds(gmsh: Any, surfaces: Any) -> list[int]:
    pairs = [(2, int(surface)) for surface in surfaces]
    return [abs(curve) for _, curve in gmsh.model.getBoundary(pairs, combined=False, oriented=True)]


def _cad_groups(gmsh: Any, tolerance: float) -> list[dict[str, Any]]:
    size = _size(gmsh)
    tolerance = max(tolerance or 1e-4 * size, LEAST_TOLERANCE * size)
    surfaces = [
        [_sample(gmsh, curve, tolerance) for curve in _bounds(gmsh, [surface])]
        for _, surface in gmsh.model.getEntities(2)
    ]
    return [{"name": PLATE, "dimension": 2, "curves": [], "surfaces": surfaces}]


def _read_in_child(path: str, assignments: list[list[str]], tolerance: float, unit: str) -> dict[str, Any]:
    found: dict[str, Any] = {"missing library": "", "parameters": [], "groups": []}
    found |= {"supplied": [], "not numbers": [], "messages": []}
    try:
        import gmsh
    except OSError as error:
        return found | {"missing library": str(error)}
    gmsh.initialize(interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.logger.start()
    try:
        if path.lower().endswith(CAD):
            gmsh.option.setString("Geometry.OCCTargetUnit", OPEN_CASCADE_UNITS.get(unit, unit.upper()))
            gmsh.model.occ.importShapes(path)
            gmsh.model.occ.synchronize()
            found["groups"] = _cad_groups(gmsh, tolerance)
        else:
            _open(gmsh, path, assignments, found)
    except Exception as error:  # gmsh raises bare Exception
        found["messages"].append(" ".join(str(error).split()))
    found["messages"] += [line for line in gmsh.logger.get() if line.startswith(("Warning", "Error"))]
    return found


def _open(gmsh: Any, path: str, assignments: list[list[str]], found: dict[str, Any]) -> None:
    gmsh.open(path)
    found["parameters"] = _parameters_of(gmsh)
    if assignments:
        known = {entry["name"] for entry in found["parameters"]}
        found["supplied"] = [name for name, _ in assignments if name not in known]
        for reset in (gmsh.onelab.clear, gmsh.parser.clear, gmsh.clear):
            reset()
        found["not numbers"] = _assign(gmsh, found["parameters"], assignments)
        gmsh.open(path)
        found["parameters"] = _parameters_of(gmsh)
    found["groups"] = _groups_of(gmsh, found["parameters"])


if __name__ == "__main__":
    job = json.loads(sys.argv[2])
    outcome = json.dumps(_read_in_child(**job))
    Path(sys.argv[1]).write_text(outcome, encoding="utf-8")
