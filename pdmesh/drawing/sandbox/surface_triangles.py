"""Volumes and surfaces in space as triangles, from Gmsh, whose module is an argument.

Curved triangles bound the volumes of Gmsh's meshes: a side of a triangle is bent through the place midway on its curve
or its surface. Midway is meant in parameters, which are ambiguous at seams and poles: there the place nearest to the
straight side's middle counts.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmesh.drawing.sandbox.mesh_sizes import ANGLE, set_sizes
from pdmesh.drawing.sandbox.walls import say_stage

Array = NDArray[np.float64]
Nodes = NDArray[np.int64]
A, B = 0.445948490915965, 0.091576213509771  # a rule of six places, exact to degree 4 (Dunavant 1985)
RULE = [(A, A), (1 - 2 * A, A), (A, 1 - 2 * A), (B, B), (1 - 2 * B, B), (B, 1 - 2 * B)]
WEIGHTS = [0.223381589678011 / 2] * 3 + [0.109951743655322 / 2] * 3
BENT = 0.3  # of a side: a middle this far off is not that of its curve
TRIANGLE, QUAD = 2, 3  # Gmsh's numbers of these types
LEAST = 2e-5  # of the mean side of the box around a body: finer chords are of nodes that are too many
OPTIONS = {  # of a mesh, whatever a drawing says; method 5 is Delaunay's, which copes with sizes that change fast
    "Algorithm": 5,
    "ElementOrder": 1,
    "SecondOrderLinear": 0,
    "RecombineAll": 0,
    "SubdivisionAlgorithm": 0,
    "MeshSizeFactor": 1,
    "MeshSizeMin": 0,
    "MeshSizeMax": 1e22,
    "MeshSizeFromCurvature": 0,
    "MeshSizeFromPoints": 0,
    "MeshSizeExtendFromBoundary": 1,
}


def cones(gmsh: Any, places: Array, tags: Nodes, triangles: dict[int, Nodes]) -> dict[int, Array]:
    """Volumes (t,) between the first place and triangles by surface, positive if seen counterclockwise.

    `places` (n, 3) are those of the nodes with these `tags`, whose numbers `triangles` (t, 3) have.
    """
    number = np.zeros(int(tags.max(initial=0)) + 1, dtype=np.int64)
    number[tags] = np.arange(len(tags))
    keys, middles = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 3))]
    for _, curve in gmsh.model.getEntities(1):
        sides = number[np.asarray(gmsh.model.mesh.getElementsByType(1, curve)[1], dtype=np.int64)].reshape(-1, 2)
        keys.append(_keys(sides, len(tags)))
        middles.append(_midway(gmsh, (1, curve), sides, places, number))
    on_curves, first = np.unique(np.concatenate(keys), return_index=True)
    bent = np.concatenate(middles)[first]
    volumes = {}
    for face, corners in triangles.items():
        sides = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 2)
        middle, key = _midway(gmsh, (2, face), sides, places, number), _keys(sides, len(tags))
        at = np.searchsorted(on_curves, key)
        shared = np.append(on_curves, -1)[at] == key
        middle[shared] = bent[at[shared]]
        # volumes between the first node and triangles of six nodes: corners, and the middles of sides
        nodes = np.concatenate([places[corners], middle.reshape(-1, 3, 3)], axis=1) - places[0]
        total = np.zeros(len(nodes))
        for (u, v), weight in zip(RULE, WEIGHTS, strict=True):
            w = 1 - u - v
            shape = np.array([w * (2 * w - 1), u * (2 * u - 1), v * (2 * v - 1), 4 * u * w, 4 * u * v, 4 * v * w])
            along = np.array([1 - 4 * w, 4 * u - 1, 0, 4 * (w - u), 4 * v, -4 * v])
            across = np.array([1 - 4 * w, 0, 4 * v - 1, -4 * u, 4 * u, 4 * (w - v)])
            at, tangent_u, tangent_v = (np.einsum("k,tkx->tx", row, nodes) for row in (shape, along, across))
            total += weight * (at * np.cross(tangent_u, tangent_v)).sum(axis=1) / 3
        volumes[face] = total
    return volumes


def _keys(sides: Nodes, count: int) -> Nodes:
    """A number (s,) for each pair of nodes (s, 2), the same in both orders."""
    return np.asarray(sides.min(axis=1) * count + sides.max(axis=1))


def _midway(gmsh: Any, entity: tuple[int, int], sides: Nodes, places: Array, number: Nodes) -> Array:
    """The places (s, 3) midway on a curve or surface between pairs of nodes (s, 2)."""
    dimension, tag = entity
    tags, _, parameters = gmsh.model.mesh.getNodes(dimension, tag, includeBoundary=True, returnParametricCoord=True)
    straight: Array = places[sides].mean(axis=1)
    if len(parameters) != dimension * len(tags) or not len(sides):
        return straight
    at = np.zeros((len(places), dimension))
    at[number[np.asarray(tags, dtype=np.int64)]] = np.reshape(parameters, (-1, dimension))
    low, high = gmsh.model.getParametrizationBounds(dimension, tag)
    ends, half = at[sides], (np.array(high) - np.array(low)) / 2
    middle: Array = np.reshape(gmsh.model.getValue(dimension, tag, ends.mean(axis=1).ravel()), (-1, 3))
    length = np.linalg.norm(np.diff(places[sides], axis=1)[:, 0], axis=1)
    off = np.linalg.norm(middle - straight, axis=1)
    bent_sides = np.flatnonzero(off > BENT * length)
    ends = ends[bent_sides]
    mean = ends.mean(axis=1)
    choices = [mean, mean - half, mean + half, ends[:, 0], ends[:, 1]]
    for which in product(range(len(choices)), repeat=dimension) if len(bent_sides) else ():
        trial_parameters = np.clip(np.stack([choices[k][:, axis] for axis, k in enumerate(which)], axis=1), low, high)
        tried = np.reshape(gmsh.model.getValue(dimension, tag, trial_parameters.ravel()), (-1, 3))
        away = np.linalg.norm(tried - straight[bent_sides], axis=1)
        nearer = away < off[bent_sides]
        middle[bent_sides[nearer]], off[bent_sides[nearer]] = tried[nearer], away[nearer]
    middle[off > BENT * length] = straight[off > BENT * length]
    return middle


def spatial_groups(gmsh: Any, tolerance: float, conforming: bool) -> dict[str, Any]:
    """Named groups of a body: points, and for each group the corner numbers of its triangles.

    For volumes these are the triangles of their surfaces; groups of points have them as curves. `tolerance` is the
    largest deviation of a triangle from its surface. Triangles are those that Open CASCADE draws shapes with, which may
    not meet along all curves, or if `conforming` a mesh. The group ``body`` is the union of the zones. Volumes are Open
    CASCADE's, else 0; of a mesh, `cones` are the volumes between the origin and each curved triangle.
    """
    physical = _physical(gmsh)
    zones = sorted({tag for name, d, tags in physical if d == 3 and name.startswith("zone:") for tag in tags})
    say_stage("joining the zones")
    groups = [*physical, ("body", 3, _united(gmsh, zones))]
    tolerance = max(tolerance, LEAST * _mean_side(gmsh, zones))
    lines = len(gmsh.logger.get())  # what follows is judged by its triangles, not by remarks on them
    say_stage(f"triangulating its {len(gmsh.model.getEntities(2))} surfaces to {tolerance:.2g}")
    curved: dict[int, NDArray[np.float64]] = {}
    discrete = {entity for entity in gmsh.model.getEntities(2) if gmsh.model.getType(*entity) == "Discrete surface"}
    if discrete and len(discrete) == len(gmsh.model.getEntities(2)):  # of STL files, which are triangles already
        places, _, triangles = _triangles(gmsh)
    elif conforming or set(gmsh.model.getEntities(2)) - set(gmsh.model.occ.getEntities(2)):
        gmsh.model.mesh.clear()
        gmsh.model.mesh.removeConstraints()  # of a drawing for another mesh
        for option, value in OPTIONS.items():
            gmsh.option.setNumber(f"Mesh.{option}", value)
        set_sizes(gmsh, tolerance)
        gmsh.model.mesh.generate(2)
        places, tags, triangles = _triangles(gmsh)
        curved = cones(gmsh, places, tags, triangles)
    else:
        places, _, triangles = _drawn(gmsh, tolerance)
    return {
        "points": places.ravel().tolist(),
        "tolerance": tolerance,
        "lines": lines,
        "groups": [
            {
                "name": name,
                "dimension": dimension,
                "curves": [[gmsh.model.getValue(0, tag, []).tolist()] for tag in entities] if dimension == 0 else [],
                "surfaces": [],
                "triangles": _of(triangles, _faces(gmsh, dimension, entities)) if dimension >= 2 else [],
                "cones": _of(curved, _faces(gmsh, dimension, entities)) if dimension == 3 else [],
                "volume": float(sum(gmsh.model.occ.getMass(3, tag) for tag in entities))
                if dimension == 3 and _by_open_cascade(gmsh, entities)
                else 0.0,
            }
            for name, dimension, entities in groups
        ],
    }


def unmeshed(gmsh: Any) -> dict[str, Any]:
    """Named groups of a body without any triangle: of one whose zones or spacings are to be refused."""
    empty = {"curves": [], "surfaces": [], "triangles": [], "cones": [], "volume": 0.0}
    every = [*_physical(gmsh), ("body", 3, [])]
    groups = [{"name": name, "dimension": dimension, **empty} for name, dimension, _ in every]
    return {"points": [], "groups": groups}


def _physical(gmsh: Any) -> list[tuple[str, int, list[int]]]:
    """Name, dimension and entities of each named group."""
    return [
        (
            gmsh.model.getPhysicalName(*group),
            group[0],
            [int(tag) for tag in gmsh.model.getEntitiesForPhysicalGroup(*group)],
        )
        for group in gmsh.model.getPhysicalGroups()
    ]


def _mean_side(gmsh: Any, volumes: list[int]) -> float:
    """Geometric mean of the sides of the box around volumes."""
    boxes = np.array([gmsh.model.getBoundingBox(3, tag) for tag in volumes])
    return float(np.prod(boxes[:, 3:].max(axis=0) - boxes[:, :3].min(axis=0)) ** (1 / 3))


def _drawn(gmsh: Any, tolerance: float) -> tuple[NDArray[np.float64], NDArray[np.int64], dict[int, NDArray[np.int64]]]:
    """Places and tags of nodes, and by surface the numbers of corners, of the triangles that shapes are drawn with."""
    gmsh.option.setNumber("Mesh.StlLinearDeflectionRelative", 0)
    gmsh.option.setNumber("Mesh.StlLinearDeflection", tolerance)
    gmsh.option.setNumber("Mesh.StlAngularDeflection", ANGLE)
    gmsh.model.mesh.importStl()
    return _triangles(gmsh)


def _triangles(gmsh: Any) -> tuple[NDArray[np.float64], NDArray[np.int64], dict[int, NDArray[np.int64]]]:
    """Places (n, 3) and tags (n,) of all nodes, and the numbers (t, 3) of corners by surface."""
    tags, places, _ = gmsh.model.mesh.getNodes()
    tags = np.asarray(tags, dtype=np.int64)
    number = np.zeros(int(tags.max(initial=0)) + 1, dtype=np.int64)
    number[tags] = np.arange(len(tags))
    corners_by_face = {}
    for _, face in gmsh.model.getEntities(2):
        nodes, quads = (
            number[np.asarray(gmsh.model.mesh.getElementsByType(kind, face)[1], dtype=np.int64)].reshape(-1, corners)
            for kind, corners in ((TRIANGLE, 3), (QUAD, 4))
        )
        corners_by_face[face] = np.concatenate([nodes, quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)])
    return np.reshape(places, (-1, 3)), tags, corners_by_face


def _of(by_face: dict[int, NDArray[Any]], faces: list[int]) -> list[float]:
    """The values of all these surfaces, one after the other."""
    return [value for face in faces for value in by_face.get(face, np.zeros(0)).ravel().tolist()]


def _united(gmsh: Any, volumes: list[int]) -> list[int]:
    """The volumes fused into one; unchanged if there is only one, or if they are not Open CASCADE's."""
    if len(volumes) < 2 or not _by_open_cascade(gmsh, volumes):
        return volumes
    copies = gmsh.model.occ.copy([(3, tag) for tag in volumes])
    fused, _ = gmsh.model.occ.fuse(copies[:1], copies[1:])
    gmsh.model.occ.synchronize()
    return [tag for dimension, tag in fused if dimension == 3]


def _by_open_cascade(gmsh: Any, volumes: list[int]) -> bool:
    return {(3, tag) for tag in volumes} <= set(gmsh.model.occ.getEntities(3))


def _faces(gmsh: Any, dimension: int, entities: list[int]) -> list[int]:
    if dimension == 2:
        return entities
    return [abs(tag) for _, tag in gmsh.model.getBoundary([(3, tag) for tag in entities], combined=True)]
