"""Builds the grid of a scene that a script describes."""

from __future__ import annotations

from pdmesh.grid import building
from pdmesh.grid.building import Built
from pdmesh.scene.body import Body
from pdmesh.scene.scene import Scene


def build(scene: Scene | Body) -> Built:
    """The grid of a plate or a body. Gmsh triangulates the solids of a body first, in a process of its own.

    Raises SceneError if the grid does not represent the scene, or if Gmsh fails.
    """
    if isinstance(scene, Body):
        from pdmesh.drawing.solids import meshed

        scene = meshed(scene)
    return building.build(scene)
