"""Runs Gmsh in a process of its own: reads a drawing or a CAD file and writes its shapes as JSON.

This is the only module that imports Gmsh. A drawing that exits, hangs or crashes ends only this process. Unless the
drawing is trusted, walls (walls.py) confine the process before the file is opened. Run as ``python -P -m
pdmesh.drawing.sandbox.gmsh_reader RESULT`` with a Job as JSON on stdin.
"""

from __future__ import annotations

import contextlib
import json
import os
import re
import sys
from pathlib import Path
from typing import Any, TextIO

import numpy as np
import numpy.ctypeslib  # Gmsh's module imports it when it is first used

from pdmesh.drawing.sandbox.surface_triangles import spatial_groups, unmeshed
from pdmesh.drawing.sandbox.walls import WITHOUT_WORDS, limit_time, raise_walls, say_stage
from pdmesh.drawing.sandbox.zone_groups import add_zones, dimension_of, with_names
from pdmesh.quantities import number_in

PREFIX = "Peridynamics/"
BODIES = f"{PREFIX}Bodies/"
NOT_FINITE = re.compile(r"([\[,:] *)-?(?:nan|inf)\b")  # Gmsh's JSON has numbers that are not JSON
LEAST_TOLERANCE = 1e-8  # of the size of a drawing: finer chords are not made for any spacing
PICTURE = 5e-4  # of the size of a part: how far the chords of its picture are from its curves
PLATE = "zone:plate"  # the group a CAD file's surfaces are put in


def main(result: str) -> None:
    """Do the job on stdin and write `result`."""
    job = json.load(sys.stdin)
    with open(result, "w", encoding="utf-8") as file:
        _read(job, file)
        file.flush()
        os._exit(0)  # nothing of Gmsh's own ending is needed


def _read(job: dict[str, Any], file: TextIO) -> None:
    gmsh_output: dict[str, Any] = {"missing": "", "library": "", "parameters": [], "groups": []}
    gmsh_output |= {"zones": [], "supplied": [], "not numbers": [], "messages": [], "remarks": [], "walls": []}
    try:
        import gmsh
    except ModuleNotFoundError as error:
        json.dump(gmsh_output | {"missing": error.name}, file)
        return
    except OSError as error:
        json.dump(gmsh_output | {"library": str(error)}, file)
        return
    with contextlib.chdir(Path(__file__).parent):  # PETSc in it runs libraries that .petscrc here names
        gmsh.initialize(interruptible=False, readConfigFiles=False)
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.logger.start()
    if job["walls"]:
        os.environ.clear()
        if hasattr(os, "sched_setaffinity"):  # Open CASCADE asks for as many threads as there are processors
            os.sched_setaffinity(0, [min(os.sched_getaffinity(0))])
        gmsh_output["walls"] = raise_walls(Path.cwd(), job["seconds"])
    else:
        limit_time(job["seconds"])
    try:
        say_stage("reading")
        if job["cad"]:
            gmsh.option.setString("Geometry.OCCTargetUnit", job["unit"])
            gmsh.model.occ.importShapes(job["path"])
            gmsh.model.occ.synchronize()
            volumes = [tag for _, tag in gmsh.model.getEntities(3)]
            if volumes:
                gmsh.model.addPhysicalGroup(3, volumes, name="zone:body")
                gmsh_output |= _spatial_groups(gmsh, job, job["tolerance"])
            else:
                tolerance = max(job["tolerance"] or 1e-4 * _size(gmsh), LEAST_TOLERANCE * _size(gmsh))
                surfaces = [
                    [_sample(gmsh, curve, tolerance) for curve in _bounds(gmsh, [surface])]
                    for _, surface in gmsh.model.getEntities(2)
                ]
                gmsh_output["groups"] = [
                    {"name": PLATE, "dimension": 2, "number": 1, "curves": [], "surfaces": surfaces}
                ]
        else:
            _open(gmsh, job, gmsh_output)
    except Exception as error:  # gmsh raises bare Exception
        gmsh_output["messages"].append(" ".join(str(error).split()) or _silent(gmsh_output["parameters"]))
    kinds = (
        ("Error",) if gmsh_output.get("points") == [] else ("Warning", "Error")
    )  # no shape is needed to refuse zones
    lines = [line for line in gmsh.logger.get()[: gmsh_output.pop("lines", None)] if line.startswith(kinds)]
    said, gmsh_output["remarks"] = with_names(gmsh, lines)
    gmsh_output["messages"] += said
    json.dump(gmsh_output, file)


def _open(gmsh: Any, job: dict[str, Any], gmsh_output: dict[str, Any]) -> None:
    path, assignments = job["path"], job["assignments"]
    gmsh.open(path)
    gmsh_output["parameters"] = _parameters_of(gmsh)
    if assignments:
        drawing_names = {entry["name"] for entry in gmsh_output["parameters"]}
        gmsh_output["supplied"] = [name for name, _, _ in assignments if name not in drawing_names]
        for reset in (gmsh.onelab.clear, gmsh.parser.clear, gmsh.clear):
            reset()
        gmsh_output["not numbers"] = _assign(gmsh, gmsh_output["parameters"], assignments)
        gmsh.open(path)
        gmsh_output["parameters"] = _parameters_of(gmsh)
    dimension = dimension_of(gmsh)
    if job.get("numbered"):
        gmsh_output |= _numbered(gmsh, job, dimension)
        return
    bodies = {entry["name"].split("/")[2] for entry in gmsh_output["parameters"] if entry["name"].startswith(BODIES)}
    gmsh_output["zones"] = add_zones(gmsh, dimension, _spacings(gmsh_output["parameters"]), bodies)
    if dimension == 3:
        names = [gmsh.model.getPhysicalName(*group) for group in gmsh.model.getPhysicalGroups(3)]
        zones = [name.removeprefix("zone:") for name in names if name.startswith("zone:")]
        spacings = _spacings(gmsh_output["parameters"])
        meshable = bool(zones) and all(spacings.get(zone, 0.0) > 0 for zone in zones)
        gmsh_output |= _spatial_groups(gmsh, job, job["chords"] * _finest(spacings) if meshable else 0.0)
    else:
        gmsh_output["groups"] = _groups_of(gmsh, gmsh_output["parameters"], job["chords"])


def _numbered(gmsh: Any, job: dict[str, Any], dimension: int) -> dict[str, Any]:
    """Each face of the volumes, or each edge of the surfaces, as a group with its number, and what Gmsh calls it."""
    shapes = gmsh.model.getEntities(dimension)
    boundary = gmsh.model.getBoundary(shapes, combined=False, oriented=False)
    numbers = sorted({int(tag) for _, tag in boundary})
    types = {number: gmsh.model.getType(dimension - 1, number) for number in numbers}
    tolerance = PICTURE * max(_size(gmsh), LEAST_TOLERANCE)
    gmsh.model.removePhysicalGroups()
    for number in numbers:
        gmsh.model.addPhysicalGroup(dimension - 1, [number], number)
    if dimension == 3:
        gmsh.model.addPhysicalGroup(3, [tag for _, tag in shapes], name="zone:part")
        return _spatial_groups(gmsh, job, tolerance) | {"types": types, "count": len(shapes)}
    edges = [{"number": number, "curves": [_sample(gmsh, number, tolerance)]} for number in numbers]
    surfaces = [[_sample(gmsh, curve, tolerance) for curve in _bounds(gmsh, [surface])] for _, surface in shapes]
    flat = all(gmsh.model.getType(*surface) == "Plane" for surface in shapes)
    return {"groups": edges, "surfaces": surfaces, "types": types, "count": len(shapes), "flat": flat}


def _spatial_groups(gmsh: Any, job: dict[str, Any], tolerance: float) -> dict[str, Any]:
    """Groups of a body with their numbers, and the union of the zones as ``whole``; without triangles if their
    tolerance is 0, as zones or spacings are missing."""
    numbers = [number for _, number in gmsh.model.getPhysicalGroups()]
    gmsh_output = spatial_groups(gmsh, tolerance, job["conforming"]) if tolerance > 0 else unmeshed(gmsh)
    *groups, zone_union = gmsh_output["groups"]
    numbered = [group | {"number": number} for group, number in zip(groups, numbers, strict=True)]
    return gmsh_output | {"groups": numbered, "whole": zone_union}


def _parameters_of(gmsh: Any) -> list[dict[str, Any]]:
    texts = [NOT_FINITE.sub(r"\1NaN", gmsh.onelab.get(name)) for name in gmsh.onelab.getNames(f"^{PREFIX}")]
    entries = [json.loads(text) for text in texts]
    for entry in entries:  # an entry without a value has none here
        entry["values"] = list(gmsh.onelab.getNumber(entry["name"])) or list(gmsh.onelab.getString(entry["name"]))
    return [entry for entry in entries if entry["values"]]


def _assign(gmsh: Any, drawing_parameters: list[dict[str, Any]], assignments: list[list[str]]) -> list[list[str]]:
    """Set parameters, including those that the drawing does not define; returns those that should be numbers and
    are not, and what to use.

    Numbers with a unit are converted to that of the parameter: for lengths that of the drawing, for the drawing's own
    numbers the one it declares.
    """
    wrong = []
    entries = {entry["name"]: entry for entry in drawing_parameters}
    drawn = entries.get(f"{PREFIX}Units", {"values": ["m"]})["values"][0] or "m"
    lengths = {name: text for name, text, _ in assignments}.get(f"{PREFIX}Units") or drawn
    for name, text, unit in assignments:
        entry = entries.get(name, {"type": None})
        unit = unit or entry.get("attributes", {}).get("Units", "")
        if entry["type"] == "string":
            gmsh.onelab.setString(name, [text])
            continue
        try:
            gmsh.onelab.setNumber(name, [number_in(text, lengths if unit in ("m", drawn) else unit)])
        except ValueError as error:
            if entry["type"] == "number":
                wrong.append([name, text, str(error)])
            else:
                gmsh.onelab.setString(name, [text])
    return wrong


# ---- curves


def _groups_of(gmsh: Any, parameters: list[dict[str, Any]], chords: float) -> list[dict[str, Any]]:
    """The named groups with their curves as points; `chords` is the largest deviation of a chord, in spacings of
    its zone."""
    spacings = _spacings(parameters)
    finest = _finest(spacings)
    physical = [
        (gmsh.model.getPhysicalName(*group), *group, gmsh.model.getEntitiesForPhysicalGroup(*group))
        for group in gmsh.model.getPhysicalGroups()
    ]
    tolerances: dict[int, float] = {}
    for name, dimension, _, entities in physical:
        if dimension == 2 and name.startswith("zone:"):
            spacing = spacings.get(name.removeprefix("zone:"), finest)
            for curve in _bounds(gmsh, entities):
                tolerances[curve] = min(tolerances.get(curve, np.inf), chords * abs(spacing))

    least = LEAST_TOLERANCE * _size(gmsh)

    def sampled(curve: int) -> list[list[float]]:
        return _sample(gmsh, curve, max(tolerances.get(curve) or chords * finest, least))

    return [
        {
            "name": name,
            "dimension": dimension,
            "number": number,
            "curves": [sampled(int(curve)) for curve in entities]
            if dimension == 1
            else [[gmsh.model.getValue(0, int(point), []).tolist()] for point in entities if dimension == 0],
            "surfaces": [[sampled(curve) for curve in _bounds(gmsh, [surface])] for surface in entities]
            if dimension == 2
            else [],
        }
        for name, dimension, number, entities in physical
    ]


def _spacings(parameters: list[dict[str, Any]]) -> dict[str, float]:
    """Spacings of the zones by name, in the unit of the drawing."""
    return {
        entry["name"].split("/")[2]: entry["values"][0]
        for entry in parameters
        if re.fullmatch(PREFIX + "Zones/[^/]+/Spacing", entry["name"]) and entry["type"] == "number"
    }


def _finest(spacings: dict[str, float]) -> float:
    return min([value for value in spacings.values() if value > 0], default=1e-3)


def _size(gmsh: Any) -> float:
    """The larger side of the drawing's bounding box, m."""
    if not gmsh.model.getEntities():
        return 0.0
    x0, y0, _, x1, y1, _ = gmsh.model.getBoundingBox(-1, -1)
    return float(max(x1 - x0, y1 - y0))


def _bounds(gmsh: Any, surfaces: Any) -> list[int]:
    pairs = [(2, int(surface)) for surface in surfaces]
    return [abs(curve) for _, curve in gmsh.model.getBoundary(pairs, combined=False, oriented=True)]


def _sample(gmsh: Any, curve: int, tolerance: float) -> list[list[float]]:
    """Points along a curve between its vertices, refined until every chord deviates by at most `tolerance`."""
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


if __name__ == "__main__":
    main(sys.argv[1])


def _silent(parameters: list[dict[str, Any]]) -> str:
    """What to say of an error without a message, as Gmsh raises if its memory is not enough."""
    spacing = f" (it is {_finest(_spacings(parameters)):g})" if _spacings(parameters) else ""
    return f"{WITHOUT_WORDS}; a larger spacing{spacing} needs fewer triangles"
