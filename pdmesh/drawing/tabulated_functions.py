"""Functions of place of a scene, in the process that knows them, as tables at the nodes of its grid."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, TypeVar

from pdmesh.drawing.building import build
from pdmesh.model.values_of_place import replaced, varying
from pdmesh.scene.body import Body
from pdmesh.scene.scene import Scene

S = TypeVar("S", bound=Scene | Body)


def tabulated(scene: S) -> S:
    """The scene with tables in place of functions, which other processes do not know. Raises SceneError."""
    if isinstance(scene, Body) and any(_functions(other_body.body) for other_body in scene.bodies):
        bodies = tuple(replace(other_body, body=tabulated(other_body.body)) for other_body in scene.bodies)
        scene = replace(scene, bodies=bodies)
    if not _functions(scene):
        return scene
    alone = replace(scene, bodies=()) if isinstance(scene, Body) else scene
    built = build(alone).settings.conditions[-len(scene.conditions) :]
    changed: list[Any] = []
    conditions: tuple[Any, ...] = scene.conditions
    for condition, built_condition in zip(conditions, built, strict=True):
        tables = {(name, at): value for name, at, value in varying(built_condition)}
        action = condition.action
        for function in condition.functions:
            action = replaced(action, function.name, function.number, tables[function.name, function.number])
        changed.append(replace(condition, action=action, functions=()))
    return replace(scene, conditions=tuple(changed))  # type: ignore[arg-type]


def _functions(scene: Scene | Body) -> bool:
    """Whether a condition of the scene has a function."""
    return any(condition.functions for condition in scene.conditions)
