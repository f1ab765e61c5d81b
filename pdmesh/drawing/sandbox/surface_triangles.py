"""Volumes and surfaces in space as triangles, from Gmsh, whose module is an argument."""

from __future__ import annotations

from typing import Any

import numpy as np

ANGLE = 0.5  # radians that neighbouring triangles of a curved surface may turn by
LEAST = 1e-6  # of the size of a drawing: finer chords are not made


def spatial_groups(gmsh: Any, tolerance: float) -> dict[str, Any]:
    """Named groups of a body: points, and for each group the corner numbers of its triangles.

    For volumes these are the triangles of their surfaces; groups of points have them as curves. `tolerance` is the
    largest deviation of a triangle from its surface. The group ``body`` is the union of the zones. Volumes are exact
    where Open CASCADE computes them, else 0.
    """
    physical = [
        (
            gmsh.model.getPhysicalName(*group),
            group[0],
            [int(tag) for tag in gmsh.model.getEntitiesForPhysicalGroup(*group)],
        )
        for group in gmsh.model.getPhysicalGroups()
    ]
    zones = sorted({tag for name, d, tags in physical if d == 3 and name.startswith("zone:") for tag in tags})
    whole = _united(gmsh, zones)
    _triangulate(gmsh, tolerance)
    tags, places, _ = gmsh.model.mesh.getNodes()
    number = {int(tag): at for at, tag in enumerate(tags)}
    groups = [*physical, ("body", 3, whole)]
    return {
        "points": places.tolist(),
        "groups": [
            {
                "name": name,
                "dimension": dimension,
                "curves": [[gmsh.model.getValue(0, tag, []).tolist()] for tag in entities] if dimension == 0 else [],
                "surfaces": [],
                "triangles": _triangles(gmsh, _faces(gmsh, dimension, entities), number) if dimension >= 2 else [],
                "volume": _volume(gmsh, entities) if dimension == 3 else 0.0,
            }
            for name, dimension, entities in groups
        ],
    }


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


def _triangulate(gmsh: Any, tolerance: float) -> None:
    """Triangulate all surfaces: by Open CASCADE where possible, otherwise as a mesh.

    Surfaces of STL files are triangles already.
    """
    surfaces = gmsh.model.getEntities(2)
    if surfaces and all(gmsh.model.getType(*surface) == "Discrete surface" for surface in surfaces):
        return
    x0, y0, z0, x1, y1, z1 = gmsh.model.getBoundingBox(-1, -1)
    gmsh.option.setNumber("Mesh.StlLinearDeflectionRelative", 0)
    gmsh.option.setNumber("Mesh.StlLinearDeflection", max(tolerance, LEAST * max(x1 - x0, y1 - y0, z1 - z0)))
    gmsh.option.setNumber("Mesh.StlAngularDeflection", ANGLE)
    if gmsh.model.occ.getEntities(2):
        gmsh.model.mesh.importStl()
        return
    gmsh.option.setNumber("Mesh.MeshSizeFromCurvature", 64)
    gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 0)
    gmsh.option.setNumber("Mesh.MeshSizeFromPoints", 0)
    gmsh.model.mesh.generate(2)


def _faces(gmsh: Any, dimension: int, entities: list[int]) -> list[int]:
    if dimension == 2:
        return entities
    return [abs(tag) for _, tag in gmsh.model.getBoundary([(3, tag) for tag in entities], combined=True)]


def _triangles(gmsh: Any, faces: list[int], number: dict[int, int]) -> list[int]:
    found = [np.zeros(0, dtype=np.int64)]
    for face in faces:
        for kind, split in ((2, [0, 1, 2]), (3, [0, 1, 2, 0, 2, 3])):  # triangles, and quads of recombined surfaces
            _, corners = gmsh.model.mesh.getElementsByType(kind, face)
            cells = np.array([number[int(tag)] for tag in corners], dtype=np.int64).reshape(-1, kind + 1)
            found.append(cells[:, split].ravel())
    return [int(corner) for corner in np.concatenate(found)]


def _volume(gmsh: Any, volumes: list[int]) -> float:
    if not _by_open_cascade(gmsh, volumes):
        return 0.0
    return float(sum(gmsh.model.occ.getMass(3, tag) for tag in volumes))
