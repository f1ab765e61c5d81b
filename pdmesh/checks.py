"""What makes a scene impossible, found before any node is made; each finding is one SceneError."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
import shapely

from pdmesh.conditions import Condition, describe
from pdmesh.grid import InitialVelocity, Load, Material, Run
from pdmesh.shapes import SceneError, Surface

if TYPE_CHECKING:
    from pdmesh.scene import Scene

LARGEST_PLATE = 20.0  # m; beyond, the numbers are taken for millimetres
MOST_NODES = 2e7
FASTEST_WAVE, LIGHTEST = 1e5, 0.1  # m/s, kg/m^3: beyond, a material is taken for N-mm-tonne
EDGE = 1e-6  # of a spacing
SMALLEST_SPACING = 1e-15  # m; below, areas and ratios are no numbers any more


def check(scene: Scene) -> None:
    """Raises SceneError naming the first part of the scene that makes no sense."""
    if not isinstance(scene.run, Run):
        raise SceneError(f"run: found {scene.run!r}, expected a Run")
    _spacings(scene)
    _plate(scene)
    _zones(scene)
    _cracks(scene)
    for number, material in enumerate([scene.material, *(region.region.material for region in scene.regions)]):
        if material is not None:
            _material(material, "material" if number == 0 else f"material '{scene.regions[number - 1].region.name}'")
    for region in scene.regions:
        if scene.whole.disjoint(region.shape):
            raise SceneError(f"material '{region.region.name}': found outside the plate, expected inside")
    for condition in scene.conditions:
        _condition(condition, scene)


def _spacings(scene: Scene) -> None:
    spacings = {"spacing": scene.spacing} | {f"zone '{zone.name}': spacing": zone.spacing for zone in scene.zones}
    for request in scene.refinements:
        if request.target not in ("crack", "notch", "hole"):
            raise SceneError(f"refine: found '{request.target}', expected crack, notch or hole")
        spacings[f"refine {request.target}: distance"] = request.distance
        spacings[f"refine {request.target}: spacing"] = 1.0 if request.spacing is None else request.spacing
    for place, value in spacings.items():
        if not isinstance(value, float | int) or not math.isfinite(value) or not value > 0:
            raise SceneError(f"{place}: found {value!r}, expected more than 0 m")
        if value < SMALLEST_SPACING:
            raise SceneError(f"{place}: found {value:g} m, expected at least {SMALLEST_SPACING:g} m")
    if not isinstance(scene.horizon, float | int) or not 1 <= scene.horizon <= 64:
        raise SceneError(f"horizon: found {scene.horizon!r}, expected a ratio to the spacing of 1 to 64")
    levels = {place: value for place, value in spacings.items() if place.endswith("spacing")}
    if any(request.spacing is None for request in scene.refinements):
        levels = {place: value for place, value in levels.items() if not place.startswith("refine")}
    for place, value in levels.items():
        steps = math.log2(scene.spacing / value)
        if abs(steps - round(steps)) > 1e-6 or steps < 0:
            raise SceneError(
                f"{place}: found {value:g} m, expected the coarsest spacing, {scene.spacing:g} m, over a power of 2"
            )


def _plate(scene: Scene) -> None:
    if scene.shape.is_empty:
        raise SceneError("outline: found nothing left by its holes and notches, expected a plate")
    x0, y0, x1, y1 = scene.shape.bounds
    width, height = x1 - x0, y1 - y0
    if scene.spacing > max(width, height):
        raise SceneError(f"spacing: found {scene.spacing:g} m, expected less than the plate's {width:g} x {height:g} m")
    if max(width, height) > LARGEST_PLATE and scene.units != "m":
        raise SceneError(
            f"outline: found {width:g} x {height:g} m, expected metres, not millimetres"
            f' (a plate of more than {LARGEST_PLATE:g} m needs the parameter Units = "m")'
        )
    nodes = scene.shape.area / scene.spacing**2
    if nodes > MOST_NODES:
        raise SceneError(
            f"spacing: found {scene.spacing:g} m, about {nodes:.1g} nodes on {width:g} x {height:g} m,"
            f" expected no more than {MOST_NODES:.0e}"
        )


def _zones(scene: Scene) -> None:
    names = [zone.name for zone in scene.zones]
    for zone in scene.zones:
        if names.count(zone.name) > 1:
            raise SceneError(f"zone '{zone.name}': found {names.count(zone.name)} of this name, expected one")
        if not zone.shape.intersection(scene.whole).area > 0:
            raise SceneError(f"zone '{zone.name}': found outside the plate, expected inside")
        x0, y0, x1, y1 = zone.shape.bounds
        if zone.spacing > max(x1 - x0, y1 - y0):
            raise SceneError(
                f"zone '{zone.name}': spacing: found {zone.spacing:g} m, expected less than its size"
                f" {max(x1 - x0, y1 - y0):g} m"
            )
        nodes = zone.shape.intersection(scene.whole).area / zone.spacing**2
        if nodes > MOST_NODES:
            raise SceneError(
                f"zone '{zone.name}': spacing: found {zone.spacing:g} m, about {nodes:.1g} nodes,"
                f" expected no more than {MOST_NODES:.0e}"
            )


def _cracks(scene: Scene) -> None:
    if not scene.cracks:
        return
    inside = scene.shape.buffer(EDGE * scene.finest, join_style="mitre")
    for crack in scene.cracks:
        if not inside.covers(crack.line):
            outside = crack.line.difference(inside)
            x, y = shapely.get_coordinates(crack.line if outside.is_empty else outside)[-1]
            raise SceneError(
                f"crack '{crack.name}': found ({x:g}, {y:g}) m outside the plate, expected all of it inside"
            )


def _material(material: Material, place: str) -> None:
    if not np.isfinite([material.E, material.rho, material.G0, material.kr]).all():
        raise SceneError(f"{place}: found {material}, expected finite numbers")
    wave = math.sqrt(material.E / material.rho)
    if wave > FASTEST_WAVE or material.rho < LIGHTEST:
        raise SceneError(
            f"{place}: found E = {material.E:g} and rho = {material.rho:g}, waves of {wave:.2g} m/s, expected Pa and"
            " kg/m^3 (steel: 2e11 and 7800), not MPa and t/mm^3"
        )


def _condition(condition: Condition, scene: Scene) -> None:
    action, place = condition.action, describe(condition.action)
    rows = condition.place.rows
    if not isinstance(rows, int) or rows < 1:
        raise SceneError(f"{place}: rows: found {rows!r}, expected a whole number of at least 1")
    if isinstance(action, Load):
        if (action.traction is None) == (action.body_force is None):
            raise SceneError(f"{place}: found neither or both of traction and body force, expected one of them")
        if action.traction is not None and isinstance(condition.place.shape, Surface):
            raise SceneError(f"{place}: found a traction on a surface, expected a body force there, or a curve")
        values = [*(action.traction or ()), *(action.body_force or ())]
    else:
        if action.x is None and action.y is None:
            raise SceneError(f"{place}: found no component, expected x, y or both")
        values = [value for value in (action.x, action.y) if value is not None]
    if not np.isfinite(values).all():
        raise SceneError(f"{place}: found {values}, expected finite numbers")
    if not isinstance(action, InitialVelocity) and not isinstance(action.breakable, bool):
        raise SceneError(f"{place}: breakable: found {action.breakable!r}, expected True or False")
    if condition.place.shape.distance(scene.shape) > rows * scene.spacing:
        raise SceneError(f"{place}: found away from the plate, expected in it or along its edge")
