"""Sizes of triangles that keep close to curved surfaces, for Gmsh, whose module is an argument.

Each surface and each curve has one size, from its mean curvature over area or length. Gmsh's own sizes from curvature
have no bound at the tip of a cone, and are small on flat surfaces that it does not know to be flat.

What a drawing itself says of mesh sizes a node grid does not use; a note tells the user.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmesh.drawing.sandbox import words
from pdmesh.drawing.sandbox.scan import Drawing

CELLS = 8  # of a surface along each of its parameters, and of a curve, that curvature is measured in
FLAT = 1e-5  # of a chord: an arc this little off it is straight
ANGLE = 0.5  # radians that neighbouring triangles of a curved surface may turn by
SMALLEST = 12.5  # tolerances: no triangle is asked to be smaller, whatever the curvature
MOST = 2e6  # triangles; with more, all are larger
CLASSES = 4  # sizes in a factor of two
Array = NDArray[np.float64]
SIZES = ("Characteristic", "Field", "MeshSize", "Transfinite")


def set_sizes(gmsh: Any, tolerance: float) -> None:
    """Set sizes with which chords of surfaces and curves are off them by about `tolerance`."""
    curvature: dict[tuple[int, int], tuple[float, float]] = {}
    for _, tag in gmsh.model.getEntities(2):
        (u0, v0), (u1, v1) = gmsh.model.getParametrizationBounds(2, tag)
        shares = np.linspace(0, 1, 2 * CELLS + 1)
        u, v = np.meshgrid(u0 + (u1 - u0) * shares, v0 + (v1 - v0) * shares, indexing="ij")
        values = gmsh.model.getValue(2, tag, np.stack([u, v], axis=2).ravel())
        at = np.array(values).reshape(*u.shape, 3)
        first_curvature, along = _bent(at[:, 1::2])
        second_curvature, across = _bent(at[1::2].transpose(1, 0, 2))
        area = np.linalg.norm(np.cross(along, across.transpose(1, 0, 2)), axis=2)
        total = float(area.sum())
        # the larger one of its two directions, 1/m, in the mean, and its area, untrimmed, m^2
        mean = float((np.maximum(first_curvature, second_curvature.T) * area).sum()) / total if total > 0 else 0.0
        curvature[2, tag] = mean, total
    curved = {entity: _size(of, tolerance) for entity, (of, _) in curvature.items() if of > 0}
    count = sum(curvature[entity][1] / (np.sqrt(3) / 4 * size**2) for entity, size in curved.items())
    for _, tag in gmsh.model.getEntities(1):
        (low,), (high,) = gmsh.model.getParametrizationBounds(1, tag)
        places = gmsh.model.getValue(1, tag, np.linspace(low, high, 2 * CELLS + 1))
        bent, chord = _bent(np.array(places).reshape(-1, 3))
        length = np.linalg.norm(chord, axis=1)
        mean = float((bent * length).sum() / length.sum()) if length.sum() > 0 else 0.0
        if mean > 0:
            curved[1, tag] = _size(mean, tolerance)
    # sizes of surfaces are those of their curves too
    classes: dict[int, list[tuple[int, int]]] = {}
    coarser = max(1.0, (count / MOST) ** 0.5)
    for entity, size in curved.items():
        classes.setdefault(int(np.floor(CLASSES * np.log2(size * coarser))), []).append(entity)
    fields = []
    for number, entities in classes.items():
        field = gmsh.model.mesh.field.add("Constant")
        for dimension, name in ((1, "CurvesList"), (2, "SurfacesList")):
            tags = [tag for d, tag in entities if d == dimension]
            gmsh.model.mesh.field.setNumbers(field, name, tags)
        gmsh.model.mesh.field.setNumber(field, "VIn", 2.0 ** (number / CLASSES))
        fields.append(field)
    least = gmsh.model.mesh.field.add("Min")
    gmsh.model.mesh.field.setNumbers(least, "FieldsList", fields)
    gmsh.model.mesh.field.setAsBackgroundMesh(least)


def _size(curvature: float, tolerance: float) -> float:
    """Length of the chords of an arc that are off by the tolerance, or turn by the largest angle."""
    return float(max(min((8 * tolerance / curvature) ** 0.5, ANGLE / curvature), SMALLEST * tolerance))


def _bent(at: Array) -> tuple[Array, Array]:
    """Curvature (n, ...) of lines through places (2 n + 1, ..., 3), and their chords (n, ..., 3)."""
    chord, way = at[2::2] - at[:-1:2], at[1::2] - at[:-1:2]
    length = np.linalg.norm(chord, axis=-1)
    off = np.divide(np.linalg.norm(np.cross(way, chord), axis=-1), length, out=np.zeros_like(length), where=length > 0)
    bent = off > FLAT * length
    return np.divide(8 * off, length**2, out=np.zeros_like(length), where=bent), chord


def unused(drawing: Drawing) -> dict[str, int]:
    """Words about the size of mesh elements, with the first line of each."""
    first_lines: dict[str, int] = {}
    for place, token in enumerate(drawing.tokens):
        what = _what(drawing, place) if token.kind == "word" else ""
        if what:
            first_lines.setdefault(what, token.line)
    return first_lines


def _what(drawing: Drawing, place: int) -> str:
    text = drawing.text(place)
    if text == "Point" and drawing.text(place + 1) == "(":
        values = drawing.partner[place + 1] + 2
        if drawing.text(values) != "{":
            return ""
        inside, depth = range(values + 1, drawing.partner[values]), drawing.depths[values] + 1
        commas = sum(drawing.text(i) == "," and drawing.depths[i] == depth for i in inside)
        return "mesh sizes of points" if commas >= 3 else ""
    if drawing.text(place - 1) == ".":
        return f"Mesh.{text}" if drawing.text(place - 2) == "Mesh" and text in words.OPTION_SIZES else ""
    return {"Characteristic": "MeshSize"}.get(text, text) if text in SIZES else ""
