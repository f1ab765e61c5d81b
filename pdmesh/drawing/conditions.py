"""What groups and parameters of a drawing add to a scene, a plate or a body: conditions, regions, other bodies.

group                parameters below Peridynamics/
"load:NAME"          Loads/NAME/Traction x, y, z, or Body force x, y, z, or Force x, y, z, or Pressure, Following (0); *
"fix:NAME"           Fixes/NAME/Components (all), Displacement x, y, z; or, in a plate, K1, K2, Tip; *
"move:NAME"          Moves/NAME/Velocity x, y, z, or Acceleration, or Initial velocity, or Initial displacement; *
"spring:NAME"        Springs/NAME/Stiffness x, y, z, or Body stiffness x, y, z; * but Profile
"gap:NAME"           -, two points
-                    Load cells/NAME/Of "CONDITION, CONDITION", whose forces it sums
* of each condition  Rows (as `pdmesh.Scene.load` has it), Profile (constant), Breakable (0)

Loads and motions may be words instead of numbers: an expression of x, y and z (m), or the name of a file of values
beside the drawing; both give SI units. Of diffusion and of heat there are

"begin:NAME"         Begins/NAME/Concentration or Temperature
"hold:NAME"          Holds/NAME/Concentration or Temperature; *
"supply:NAME"        Supplies/NAME/Flux, Rate, Heat flux (W/m^2) or Heat rate (W/m^3); *
"exchange:NAME"      Exchanges/NAME/Coefficient or h (W/(m^2 K)), Outside; *
* of each condition  Rows (1), Profile (constant)
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from typing import Any, Protocol, TypeVar

import shapely

from pdmesh.drawing import parameters as named
from pdmesh.drawing.group_names import picked
from pdmesh.drawing.parameters import MOTIONS, PREFIX, Parameters, content, either
from pdmesh.model.document import LARGEST
from pdmesh.scene.body import Body
from pdmesh.scene.edges import point_in
from pdmesh.scene.k_field import k_field
from pdmesh.scene.scene import Scene
from pdmesh.scene.shapes import SceneError
from pdmesh.scene.solids import brick

S = TypeVar("S", Scene, Body)
G = TypeVar("G")  # a group of a drawing
G_contra = TypeVar("G_contra", contravariant=True)
LOADS = ("Traction", "Body force", "Force")
SPRINGS = ("Stiffness", "Body stiffness")
COUNTS = {2: "four", 3: "six"}  # numbers of a box, by dimension
FOLDERS = {
    "load": "Loads",
    "fix": "Fixes",
    "move": "Moves",
    "spring": "Springs",
    "pin": "Pins",
    "absorb": "Absorbs",
    "begin": "Begins",
    "hold": "Holds",
    "supply": "Supplies",
    "exchange": "Exchanges",
}
Groups = Mapping[str, Mapping[str, G]]  # by kind and name
Places = Mapping[str, Iterable[tuple[str, Any, str]]]  # by kind: name, place and folder of parameters


class GroupShapes(Protocol[G_contra]):
    """What a drawing's groups are in a plate or in a body, m. All raise SceneError, beginning with a place."""

    def area(self, group: G_contra, place: str) -> Any:
        """The surface or the solid of a group."""

    def where(self, group: G_contra, place: str) -> Any:
        """Where a condition on the group acts."""

    def points(self, group: G_contra) -> list[tuple[float, ...]]:
        """The points of a group of points."""

    def part_of_boundary(self, words: str, place: str) -> Any:
        """The edge or the face that words pick."""


def places_of(groups: Groups[G], shapes: GroupShapes[G], parameters: Parameters, dimension: int) -> Places:
    """The places of all conditions, of groups and of parameters without one. Raises SceneError."""
    places: dict[str, list[tuple[str, Any, str]]] = {}
    for kind, top in FOLDERS.items():
        if kind not in groups:
            continue
        places[kind] = [
            (name, shapes.where(group, f"{kind} '{name}'"), f"{top}/{name}") for name, group in groups[kind].items()
        ]
        for name in sorted(parameters.below(top) - set(groups[kind])):
            folder = f"{top}/{name}"
            word, *others = picked(parameters, folder)
            if others:
                raise SceneError(
                    f"parameter '{PREFIX}{folder}/{others[0]}' cannot be combined with a {word}; use one of them"
                )
            text, place = parameters.text(f"{folder}/{word}"), f"parameter '{PREFIX}{folder}/{word}'"
            if word == "Box":
                where: Any = _box(text, place, parameters, dimension)
            elif word == "Node":
                where = shapely.Point(point_in(text, dimension, place, parameters.unit))
            else:
                where = shapes.part_of_boundary(text, place)
            places[kind].append((name, where, folder))
    return places


def _box(text: str, place: str, parameters: Parameters, dimension: int) -> Any:
    """The rectangle or the box that numbers describe, the low corner first."""
    axes = "xyz"[:dimension]
    try:
        ends = [parameters.unit.to_si(float(word)) for word in text.split()]
    except ValueError:
        ends = []
    if len(ends) != 2 * dimension:
        corners = " ".join(f"{axis}{end}" for end in "01" for axis in axes) + "'" + " in a body" * (dimension == 3)
        raise SceneError(f"{place} is '{text}'; use {COUNTS[dimension]} numbers '{corners}")
    low, high = ends[:dimension], ends[dimension:]
    if not all(-LARGEST <= first < last <= LARGEST for first, last in zip(low, high, strict=True)):
        *most, last = (f"{axis}0 < {axis}1" for axis in axes)
        raise SceneError(f"{place} is '{text}'; use {', '.join(most)} and {last}, at most {LARGEST:g} m")
    return shapely.box(*ends) if dimension == 2 else brick(tuple(low), tuple(high))


def single_point(points: Sequence[tuple[float, ...]], place: str) -> shapely.Point:
    """The point of a group of one. Raises SceneError, beginning with `place`."""
    if len(points) != 1:
        raise SceneError(f"{place} has {len(points)} points; use one, as it is a support at one node")
    return shapely.Point(points[0])


def with_monitors_and_regions(scene: S, groups: Groups[G], shapes: GroupShapes[G], parameters: Parameters) -> S:
    """The scene with gaps, load cells, and regions of other materials and media. Raises SceneError."""
    for name, group in groups["gap"].items():
        points = shapes.points(group)
        if len(points) != 2:
            raise SceneError(f"gap '{name}' has {len(points)} points; use two")
        scene = scene.gap(name, *points)
    for name in sorted(parameters.below("Load cells")):
        words = parameters.text(f"Load cells/{name}/Of").split(",")
        scene = scene.load_cell(name, *filter(None, map(str.strip, words)))
    for name, group in groups["material"].items():
        material = named.material(parameters, f"Materials/{name}", scene.material)
        if material is None:
            raise SceneError(f"parameter '{PREFIX}Materials/{name}/E' is missing; give a number")
        scene = scene.region(shapes.area(group, f"material '{name}'"), material, name)
    for name, group in groups["medium"].items():
        diffusivity = parameters.number(f"Media/{name}/D")
        scene = scene.diffusivity(shapes.area(group, f"medium '{name}'"), diffusivity, name)
    return scene


def acted_on(scene: S, places: Places, parameters: Parameters) -> S:
    """The scene with its loads, supports and motions. Raises SceneError."""
    for name, where, folder in places["load"]:
        load_components = _filled(_given(parameters, folder, LOADS, scene.AXES))
        pressure = parameters.of_place(f"{folder}/Pressure")
        load_components |= {} if pressure is None else {"pressure": pressure}
        following = parameters.flag(f"{folder}/Following", False)
        if not load_components:
            raise SceneError(
                f"parameter '{PREFIX}{folder}/Traction x' is missing; give a number (or Traction"
                f" {' or '.join(scene.AXES[1:])}, or of Body force or Force, or Pressure)"
            )
        scene = scene.load(where, name=name, following=following, **load_components, **_shared(parameters, folder))
    for name, where, folder in places["fix"]:
        # displacements by axis, m; None for one that is free
        component_choices = [
            "".join(chosen) for count in range(len(scene.AXES), 0, -1) for chosen in combinations(scene.AXES, count)
        ]
        components = parameters.text(f"{folder}/Components", scene.AXES, of=component_choices)
        displacements: dict[str, Any] = {}
        if parameters.below(folder) & set(named.K_FIELD):
            displacements, shared = _k_field(scene, parameters, folder)
            scene = scene.fix(where, **displacements, name=name, **shared)
            continue
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
        moves = _given(parameters, folder, MOTIONS, scene.AXES)
        scene = scene.move(where, name=name, **moves, **_shared(parameters, folder))
    for name, where, folder in places["spring"]:
        stiff = _filled(_given(parameters, folder, SPRINGS, scene.AXES))
        scene = scene.spring(where, name=name, **stiff, **rows(parameters, folder))
    return scene


SAMPLES = 100  # of the field of a tip that moves


def _k_field(scene: Scene | Body, parameters: Parameters, folder: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Displacements of a K field, and other arguments of the condition. Raises SceneError naming the parameter."""
    place = f"parameter '{PREFIX}{folder}/K1'"
    others = parameters.below(folder) & {"Components", *(f"Displacement {axis}" for axis in scene.AXES)}
    if others or not isinstance(scene, Scene):
        wrong = f"is beside {min(others)}; leave it out" if others else "is for plates; use Displacement x, y, z"
        raise SceneError(f"{place} {wrong}")
    if scene.material is None:
        raise SceneError(f"{place}: the plate has no material; give Material/E, rho and G0")
    try:
        x, y = (float(parameters.unit.to_si(float(word))) for word in parameters.text(f"{folder}/Tip", "0 0").split())
    except ValueError:
        raise SceneError(f"parameter '{PREFIX}{folder}/Tip' is no place; use 'x y' in the drawing's unit") from None
    arguments, speed = _shared(parameters, folder), parameters.number(f"{folder}/Tip speed", 0.0)
    moving: dict[str, Any] = {}
    if speed:
        if scene.run.duration is None:
            raise SceneError(f"parameter '{PREFIX}{folder}/Tip speed' needs Run/Duration; give it in s")
        times = [scene.run.duration * number / SAMPLES for number in range(SAMPLES + 1)]
        moving = {"speed": speed, "times": times, "profile": arguments.pop("profile")}
    field = k_field(
        scene.material,
        parameters.number(f"{folder}/K1", 0.0),
        parameters.number(f"{folder}/K2", 0.0),
        tip=(x, y),
        angle=parameters.number(f"{folder}/Tip angle", 0.0),
        **moving,
    )
    return dict(zip(scene.AXES, field, strict=True)), arguments


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


def diffusing(scene: S, places: Places, parameters: Parameters) -> S:
    """The scene with its conditions of diffusion. Raises SceneError."""
    for name, where, folder in places["begin"]:
        scene = scene.begin(where, content(parameters, folder), name)
    for name, where, folder in places["hold"]:
        scene = scene.hold(where, content(parameters, folder), name=name, **_rows_and_profile(parameters, folder))
    for name, where, folder in places["supply"]:
        value, word = either(parameters, folder, "Flux", "Rate", "Heat flux", "Heat rate")
        supply = scene.heat if word.startswith("Heat") else scene.supply
        supply_arguments: dict[str, Any] = {word.removeprefix("Heat ").lower(): value}
        scene = supply(where, **supply_arguments, name=name, **_rows_and_profile(parameters, folder))
    for name, where, folder in places["exchange"]:
        _, word = either(parameters, folder, "Coefficient", "h")
        value, outside = parameters.number(f"{folder}/{word}"), parameters.of_place(f"{folder}/Outside")
        if outside is None:
            outside = parameters.number(f"{folder}/Outside", None if word == "h" else 0.0)
        exchange = scene.convection if word == "h" else scene.exchange
        scene = exchange(where, value, outside, name=name, **_rows_and_profile(parameters, folder))
    return scene


def _rows_and_profile(parameters: Parameters, folder: str) -> dict[str, Any]:
    return {"rows": parameters.whole(f"{folder}/Rows", 1), "profile": parameters.profile(f"{folder}/Profile")}


def with_bodies(scene: S, groups: Groups[G], shapes: GroupShapes[G], parameters: Parameters) -> S:
    """The scene with the other bodies beside it. Raises SceneError naming the parameter."""
    speeds: list[str] = [f"Velocity {axis}" for axis in scene.AXES]
    for name, group in groups["body"].items():
        shape, folder = shapes.area(group, f"body '{name}'"), f"Bodies/{name}"
        rigid = parameters.flag(f"{folder}/Rigid", False)
        parameter_names = parameters.below(folder) - {"Spacing", "Rigid", "Spin", *speeds}
        wrong = sorted(parameter_names - set(named.RIGID) if rigid else parameter_names & set(named.RIGID))
        if wrong:
            what = "rigid" if rigid else "not rigid"
            raise SceneError(
                f"parameter '{PREFIX}{folder}/{wrong[0]}' cannot be used for a body that is {what}; leave it out"
            )
        spacing = parameters.maybe_length(f"{folder}/Spacing")
        velocity: Any = tuple(parameters.number(f"{folder}/{speed}", 0.0) for speed in speeds)
        spin: Any = 0.0  # rad/s; of a body in space about x, y and z
        if isinstance(scene, Scene):
            spin = parameters.number(f"{folder}/Spin", spin)
        else:
            text = parameters.text(f"{folder}/Spin", "0 0 0")
            try:
                x, y, z = map(float, text.split())
            except ValueError:
                place = f"parameter '{PREFIX}{folder}/Spin'"
                raise SceneError(f"{place} is '{text}'; use three numbers 'x y z' in a body") from None
            spin = x, y, z
        if rigid:
            scene = scene.rigid(
                shape,
                name,
                parameters.maybe(f"{folder}/Mass"),
                velocity,
                spin,
                parameters.text(f"{folder}/Held").split(),
                parameters.profile(f"{folder}/Profile"),
                spacing,
                radius=parameters.maybe_length(f"{folder}/Radius"),
            )
            continue
        material = named.material(parameters, folder, scene.material) if parameter_names else None
        scene = scene.body(shape, name, spacing, material, velocity, spin)
    return scene
