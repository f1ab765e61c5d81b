"""Geometry to multiscale peridynamic grids: input is a Gmsh drawing, output the node grid as JSON.

For scripts: a `Scene` describes a plate in a few lines, `read_scene` reads one from a file, `build` makes its grid.
"""

from typing import TYPE_CHECKING

from pdmesh.lazy_imports import lazily

VERSION = "1.1.0"

if TYPE_CHECKING:
    from shapely import box

    from pdmesh.drawing.building import build
    from pdmesh.drawing.file_reading import build_file, file_parameters, read_scene
    from pdmesh.drawing.geo import read_outline
    from pdmesh.model.document import Fatigue, Gap, GridError, LoadCell, Material, ParticleRules, Run, Static
    from pdmesh.model.laminate import laminate
    from pdmesh.model.medium import Medium
    from pdmesh.scene.body import Body
    from pdmesh.scene.conditions import friedlander, ramp
    from pdmesh.scene.functions_of_place import over_time
    from pdmesh.scene.heat import Heat
    from pdmesh.scene.k_field import k_field
    from pdmesh.scene.node_fields import Picture, Weibull
    from pdmesh.scene.scene import Scene
    from pdmesh.scene.shapes import Circle, SceneError, UntrustedError
    from pdmesh.scene.solids import Box, Cylinder, Sphere
else:
    __getattr__, __dir__ = lazily(
        __name__,
        {
            "Body": "pdmesh.scene.body",
            "Box": "pdmesh.scene.solids",
            "Circle": "pdmesh.scene.shapes",
            "Cylinder": "pdmesh.scene.solids",
            "Gap": "pdmesh.model.document",
            "GridError": "pdmesh.model.document",
            "Heat": "pdmesh.scene.heat",
            "LoadCell": "pdmesh.model.document",
            "Material": "pdmesh.model.document",
            "Medium": "pdmesh.model.medium",
            "ParticleRules": "pdmesh.model.document",
            "Picture": "pdmesh.scene.node_fields",
            "Run": "pdmesh.model.document",
            "Scene": "pdmesh.scene.scene",
            "SceneError": "pdmesh.scene.shapes",
            "Sphere": "pdmesh.scene.solids",
            "Fatigue": "pdmesh.model.document",
            "Static": "pdmesh.model.document",
            "UntrustedError": "pdmesh.scene.shapes",
            "Weibull": "pdmesh.scene.node_fields",
            "box": "shapely",
            "build": "pdmesh.drawing.building",
            "build_file": "pdmesh.drawing.file_reading",
            "file_parameters": "pdmesh.drawing.file_reading",
            "friedlander": "pdmesh.scene.conditions",
            "k_field": "pdmesh.scene.k_field",
            "laminate": "pdmesh.model.laminate",
            "over_time": "pdmesh.scene.functions_of_place",
            "ramp": "pdmesh.scene.conditions",
            "read_outline": "pdmesh.drawing.geo",
            "read_scene": "pdmesh.drawing.file_reading",
        },
    )

__all__ = [
    "Body",
    "Box",
    "Circle",
    "Cylinder",
    "Fatigue",
    "Gap",
    "GridError",
    "Heat",
    "LoadCell",
    "Material",
    "Medium",
    "ParticleRules",
    "Picture",
    "Run",
    "Scene",
    "SceneError",
    "Sphere",
    "Static",
    "UntrustedError",
    "Weibull",
    "box",
    "build",
    "build_file",
    "file_parameters",
    "friedlander",
    "k_field",
    "laminate",
    "over_time",
    "ramp",
    "read_outline",
    "read_scene",
]
