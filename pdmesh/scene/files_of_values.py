"""Files of values that conditions of a scene name, read as tables."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TypeVar

from pdmesh.model.value_files import with_tables
from pdmesh.model.values_of_place import PlaceError
from pdmesh.scene.body import Body
from pdmesh.scene.conditions import describe
from pdmesh.scene.scene import Scene
from pdmesh.scene.shapes import SceneError

S = TypeVar("S", bound=Scene | Body)


def with_files(scene: S, folder: Path) -> S:
    """The scene with tables in place of the names of files in a folder. Raises SceneError."""
    dimension, changed = len(scene.AXES), []
    for condition in scene.conditions:
        try:
            (action,) = with_tables((condition.action,), folder, dimension, "")
        except PlaceError as error:
            raise SceneError(f"{describe(condition.action)}: {str(error).removeprefix('[0].')}") from None
        changed.append(condition if action is condition.action else replace(condition, action=action))
    if all(new is old for new, old in zip(changed, scene.conditions, strict=True)):
        return scene
    return replace(scene, conditions=tuple(changed))  # type: ignore[arg-type]
