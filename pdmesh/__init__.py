"""Geometry to multiscale peridynamic grids: a Gmsh drawing in, the node grid as JSON out.

For scripts: a `Scene` is a plate in a few lines, `read_scene` takes one from a file, `build` makes its grid.
"""

from typing import TYPE_CHECKING

from pdmesh.lazily import lazily

VERSION = "0.1.0"

if TYPE_CHECKING:
    from shapely import box

    from pdmesh.drawing.geo import read_outline
    from pdmesh.drawing.sources import read_scene
    from pdmesh.grid.building import build
    from pdmesh.model.document import GridError, Material, ParticleRules, Run, Static
    from pdmesh.scene.conditions import ramp
    from pdmesh.scene.scene import Scene
    from pdmesh.scene.shapes import Circle, SceneError
else:
    __getattr__, __dir__ = lazily(
        __name__,
        {
            "Circle": "pdmesh.scene.shapes",
            "GridError": "pdmesh.model.document",
            "Material": "pdmesh.model.document",
            "ParticleRules": "pdmesh.model.document",
            "Run": "pdmesh.model.document",
            "Scene": "pdmesh.scene.scene",
            "SceneError": "pdmesh.scene.shapes",
            "Static": "pdmesh.model.document",
            "box": "shapely",
            "build": "pdmesh.grid.building",
            "ramp": "pdmesh.scene.conditions",
            "read_outline": "pdmesh.drawing.geo",
            "read_scene": "pdmesh.drawing.sources",
        },
    )

__all__ = [
    "Circle",
    "GridError",
    "Material",
    "ParticleRules",
    "Run",
    "Scene",
    "SceneError",
    "Static",
    "box",
    "build",
    "ramp",
    "read_outline",
    "read_scene",
]
