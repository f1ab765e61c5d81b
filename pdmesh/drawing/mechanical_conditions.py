"""Loads, supports, motions and monitors in a drawing, of plates and of bodies.

group                parameters below Peridynamics/
"load:NAME"          Loads/NAME/Traction x, y, z, or Body force x, y, z, or Force x, y, z; *
"fix:NAME"           Fixes/NAME/Components (all), Displacement x, y, z; *
"move:NAME"          Moves/NAME/Velocity x, y, z, or Acceleration, or Initial velocity, or Initial displacement; *
"spring:NAME"        Springs/NAME/Stiffness x, y, z, or Body stiffness x, y, z; * but Profile
"gap:NAME"           -, two points
-                    Load cells/NAME/Of "CONDITION, CONDITION", whose forces it sums
* of each condition  Rows (as `pdmesh.Scene.load` has it), Profile (constant), Breakable (0)

Loads and motions may be words instead of numbers: an expression of x, y and z (m), or the name of a file of values
beside the drawing; both give SI units.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from typing import Any, TypeVar

from pdmesh.drawing.parameters import MOTIONS, PREFIX, Parameters
from pdmesh.scene.body import Body
from pdmesh.scene.scene import Scene
from pdmesh.scene.shapes import SceneError

S = TypeVar("S", Scene, Body)
KINDS = ("load", "fix", "move", "spring")
LOADS = ("Traction", "Body force", "Force")
MOVES = MOTIONS
SPRINGS = ("Stiffness", "Body stiffness")


def acted_on(scene: S, places: Mapping[str, Iterable[tuple[str, Any, str]]], parameters: Parameters) -> S:
    """The scene with its loads, supports and motions; `places` has name, place and parameter folder by kind.

    Raises SceneError.
    """
    for name, where, folder in places["load"]:
        load_components = _filled(_given(parameters, folder, LOADS, scene.AXES))
        if not load_components:
            raise SceneError(
                f"parameter '{PREFIX}{folder}/Traction x' is missing; give a number (or Traction"
                f" {' or '.join(scene.AXES[1:])}, or of Body force or Force)"
            )
        scene = scene.load(where, name=name, **load_components, **_shared(parameters, folder))
    for name, where, folder in places["fix"]:
        # displacements by axis, m; None for one that is free
        component_choices = [
            "".join(chosen) for count in range(len(scene.AXES), 0, -1) for chosen in combinations(scene.AXES, count)
        ]
        components = parameters.text(f"{folder}/Components", scene.AXES, of=component_choices)
        displacements: dict[str, Any] = {}
        for axis in scene.AXES:
            value = parameters.of_place(f"{folder}/Displacement {axis}", is_length=True)
            if value and axis not in components:
                raise SceneError(
                    f"parameter '{PREFIX}{folder}/Displacement {axis}' is for a component that is not held (Components"
                    f" '{components}'); leave it out"
                )
            displacements[axis] = (value or 0.0) if axis in components else None
        scene = scene.fix(where, **displacements, name=name, **_shared(parameters, folder))
    for name, where, folder in places["move"]:
        moves = _given(parameters, folder, MOVES, scene.AXES)
        scene = scene.move(where, name=name, **moves, **_shared(parameters, folder))
    for name, where, folder in places["spring"]:
        stiff = _filled(_given(parameters, folder, SPRINGS, scene.AXES))
        scene = scene.spring(where, name=name, **stiff, **rows(parameters, folder))
    return scene


def monitored(scene: S, gaps: Mapping[str, Sequence[Sequence[float]]], parameters: Parameters) -> S:
    """The scene with openings between pairs of points, m, by name, and with load cells. Raises SceneError."""
    for name, points in gaps.items():
        if len(points) != 2:
            raise SceneError(f"gap '{name}' has {len(points)} points; use two")
        scene = scene.gap(name, *points)
    for name in sorted(parameters.below("Load cells")):
        words = parameters.text(f"Load cells/{name}/Of").split(",")
        scene = scene.load_cell(name, *filter(None, map(str.strip, words)))
    return scene


def rows(parameters: Parameters, folder: str) -> dict[str, Any]:
    """Rows and breakable of a condition."""
    return {
        "rows": parameters.whole(f"{folder}/Rows", 1),
        "breakable": parameters.flag(f"{folder}/Breakable", False),
    }


def _shared(parameters: Parameters, folder: str) -> dict[str, Any]:
    arguments = rows(parameters, folder)
    if parameters.maybe(f"{folder}/Rows") is None:
        del arguments["rows"]
    return {**arguments, "profile": parameters.profile(f"{folder}/Profile")}


def _given(parameters: Parameters, folder: str, words: Sequence[str], axes: str) -> dict[str, Any]:
    """Vectors of which a component is given, as arguments of a scene's method; other components are None."""
    every = {
        word: tuple(parameters.of_place(f"{folder}/{word} {axis}", word == "Initial displacement") for axis in axes)
        for word in words
    }
    return {word.lower().replace(" ", "_"): vector for word, vector in every.items() if set(vector) != {None}}


def _filled(vectors: dict[str, Any]) -> dict[str, Any]:
    """The vectors with 0 for what is not given."""
    return {word: tuple(value or 0.0 for value in vector) for word, vector in vectors.items()}
