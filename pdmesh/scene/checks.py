"""Checks of a scene before any node is made; each finding is one SceneError."""

from __future__ import annotations

import math
from typing import Any

import msgspec
import numpy as np
import shapely

from pdmesh.messages import unfit
from pdmesh.model.document import (
    LARGEST,
    MOST,
    Absorb,
    Condition,
    Load,
    Material,
    OfDiffusion,
    Pin,
    Region,
    Run,
    Settings,
    Spring,
)
from pdmesh.model.fracture_energy import LARGE_STRETCH, SOFT, stretch_of_lattice, wrong_energy
from pdmesh.model.mechanical_conditions import REST, wrong_spring
from pdmesh.model.medium import Medium, contradiction
from pdmesh.model.rigid_bodies import contradiction as contradiction_of_rigid
from pdmesh.model.selection import LOADS, given_of
from pdmesh.model.suggestions import explained
from pdmesh.scene.conditions import PlacedCondition, PlacedRegion, describe
from pdmesh.scene.heat import Heat, physics_of
from pdmesh.scene.plate import Plate
from pdmesh.scene.shapes import Curve, SceneError, Surface, checked_spacing

LARGE_PLATE, LARGEST_PLATE = 2.0, 20.0  # m; beyond, the numbers may be, or are taken for, millimetres
SAY_UNIT = '"mm" (--unit mm) for a drawing in millimetres, "m" for one in metres'
MOST_NODES = 2e7  # that are listed
MOST_ON_LATTICE = 4e8  # of a plate whose file may hold the lattice in place of nodes
EMPTY = 8  # times as many places around a plate are looked at as it may have nodes
MOST_STEPS = 20  # of 2 between the coarsest and the finest spacing
MOST_ROWS = 1_000_000
OVERLAP = 1e-6  # of a spacing squared: more that two bodies share is no round-off
RESOLVED = 1e-11  # of a place: what is as small as that is not told apart
FASTEST_WAVE = 1e5  # m/s: above, with a density of a solid in t/mm^3, a material is taken for N-mm-tonne
DENSITIES = 1e-11, 1e-7  # t/mm^3


def check(scene: Plate) -> None:
    """Raise SceneError naming the first invalid part of the scene."""
    _numbers(scene)
    _spacings(scene)
    _plate(scene)
    _zones(scene)
    _ = scene.slits  # raises for a crack that is not in the plate
    _bodies(scene)
    placed: tuple[PlacedRegion[Any], ...] = (*scene.regions, *scene.media)
    for region in placed:
        _inside(region, scene)
    for condition in scene.conditions:
        _condition(condition, scene)
    for gap in scene.run.gaps:
        for end in gap.ends:
            if scene.everything.distance(shapely.Point(end[:2])) > scene.spacing:
                raise SceneError(f"gap '{gap.name}': ({end[0]:g}, {end[1]:g}) m is away from the plate; put it in it")


def check_region(region: PlacedRegion[Region], scene: Plate) -> None:
    """Raise SceneError for a region of another material that the scene, checked already, cannot have."""
    composed(region.region.material, f"material '{region.region.name}'")
    physics_of(scene.medium, scene.material, [part.region for part in (*scene.regions[:1], region)])
    _inside(region, scene)


def _inside(region: PlacedRegion[Any], scene: Plate) -> None:
    if scene.whole.disjoint(region.shape):
        raise SceneError(f"{region.kind} '{region.region.name}' is outside the plate; put it inside")


def _numbers(scene: Plate) -> None:
    """Check parts without a place: their type, and whether they can be stored and computed with."""
    if scene.material is not None:
        composed(scene.material, "material")
    for region in scene.regions:
        composed(region.region.material, f"material '{region.region.name}'")
    described(scene.run, Run, "run")
    _ = scene.physics  # raises for half of what heat and mechanics together need
    if scene.medium is not None:
        passable(scene.medium)
        # collocation wants each coarse cell parted into four, as bodies have them
        if scene.run.adapt != "none" and scene.physics == "diffusion":
            raise SceneError(f"run.adapt is {scene.run.adapt}; use none in a plate of diffusion")
    if scene.units not in (None, "m"):
        raise SceneError(f"units is {scene.units!r}; use 'm', or none")
    described(Settings(area_rule=scene.area_rule), Settings, "area rule")
    ratio(scene.horizon)


def ratio(horizon: float) -> None:
    """Raise SceneError for an invalid ratio of horizon to spacing."""
    if not isinstance(horizon, float | int) or not 1 <= horizon <= 64:
        raise SceneError(f"horizon is {horizon!r}; use a ratio to the spacing of 1 to 64")


def passable(medium: Medium | Heat) -> None:
    """Raise SceneError for a medium in which nothing can diffuse, or with a contradictory solid."""
    if isinstance(medium, Heat):
        return
    described(medium, Medium, "medium")
    wrong = contradiction(medium)
    if wrong is not None:
        key, actual, expected = wrong
        raise SceneError(unfit(f"medium: {key}", actual, expected))


def described(struct: Any, kind: type[msgspec.Struct], place: str) -> None:
    """Raise SceneError for an object of the wrong type, or with a value that the grid file does not allow."""
    if not isinstance(struct, kind):
        raise SceneError(f"{place} is {struct!r:.80}; use {kind.__name__}(...)")
    fields: dict[str, Any] = {}
    for name in kind.__struct_fields__:
        value = getattr(struct, name)
        try:
            fields[name] = msgspec.to_builtins(value)
        except TypeError:
            raise SceneError(f"{place}: {name} is {value!r:.80}; use a number or a word") from None
    try:
        msgspec.convert(fields, kind)
    except msgspec.ValidationError as error:
        raise SceneError(f"{place}: {explained(error, kind, lambda: fields)}") from None
    for name, value in fields.items():
        if isinstance(value, float | int) and not abs(value) <= MOST:
            raise SceneError(f"{place}: {name} is {value:g}; use at most {MOST:g} in SI units")


def remarks(scene: Plate) -> tuple[str, ...]:
    """Remarks on interpretations of a scene that its author may not have intended."""
    x0, y0, x1, y1 = scene.shape.bounds
    notes = [note for slit in scene.slits for note in slit.notes]
    notes += remarks_on_materials(scene, scene.horizon, scene.finest, 2)
    if max(x1 - x0, y1 - y0) > LARGE_PLATE and scene.units != "m":
        notes.append(f"warning: the plate has {x1 - x0:g} x {y1 - y0:g} m; the parameter Units: {SAY_UNIT}")
    return tuple(notes)


def remarks_on_materials(scene: Any, ratio: float, finest: float, dimension: int) -> list[str]:
    """Remarks on the materials of a scene whose numbers may be in other units."""
    every = [] if scene.material is None else [("material", scene.material)]
    every += [(f"material '{part.region.name}'", part.region.material) for part in scene.regions]
    notes: list[str] = []
    for place, material in every:
        wave, stretch = math.sqrt(material.E / material.rho), stretch_of_lattice(material, ratio, finest, dimension)
        if wave > FASTEST_WAVE:
            notes.append(f"warning: {place}: waves of {wave:.2g} m/s; E and rho are in Pa and kg/m^3")
        if stretch is not None and stretch > LARGE_STRETCH and material.E < SOFT:
            notes.append(
                f"warning: {place}: bonds break at a stretch of {stretch:.2g}, more than {LARGE_STRETCH:g}: is E ="
                f" {material.E:g} in Pa, not in MPa or GPa?"
            )
        if notes:
            break
    return notes


def _spacings(scene: Plate) -> None:
    spacings = {"spacing": scene.spacing} | {f"zone '{zone.name}': spacing": zone.spacing for zone in scene.zones}
    for request in scene.refinements:
        if request.target not in ("crack", "notch", "hole"):
            raise SceneError(f"refine: '{request.target}' is unknown; use crack, notch or hole")
        spacings[f"refine {request.target}: distance"] = request.distance
        spacings[f"refine {request.target}: spacing"] = 1.0 if request.spacing is None else request.spacing
    for place, value in spacings.items():
        if checked_spacing(value, place) > LARGEST:
            raise SceneError(f"{place} is {value:g} m; use at most {LARGEST:g} m")
    levels = {place: value for place, value in spacings.items() if place.endswith("spacing")}
    if any(request.spacing is None for request in scene.refinements):
        levels = {place: value for place, value in levels.items() if not place.startswith("refine")}
    for place, value in levels.items():
        steps = math.log2(scene.spacing) - math.log2(value)
        if abs(steps - round(steps)) > 1e-6 or not 0 <= round(steps) <= MOST_STEPS:
            raise SceneError(
                f"{place} is {value:g} m; use the coarsest spacing, {scene.spacing:g} m, over a power of 2, at most"
                f" {2**MOST_STEPS}"
            )


def _plate(scene: Plate) -> None:
    if scene.shape.is_empty:
        raise SceneError("outline: holes and notches leave nothing of it; draw a plate")
    x0, y0, x1, y1 = scene.shape.bounds
    width, height = x1 - x0, y1 - y0
    if scene.spacing > max(width, height):
        unit = "" if scene.units == "m" else f" (the parameter Units: {SAY_UNIT})"
        raise SceneError(f"spacing is {scene.spacing:g} m; use less than the plate's {width:g} x {height:g} m{unit}")
    if max(width, height) > LARGEST_PLATE and scene.units != "m":
        raise SceneError(
            f"outline has {width:g} x {height:g} m; use metres, not millimetres, or the parameter Units: {SAY_UNIT}"
        )
    diagonal = math.hypot(width, height)
    for request in scene.refinements:
        if request.distance > diagonal:
            raise SceneError(
                f"refine {request.target}: distance is {request.distance:g} m; use at most {diagonal:g} m, the plate's"
                " diagonal: nothing is farther (4mm is in millimetres)"
            )
    limit_nodes(scene.shape, scene.spacing, "spacing", MOST_ON_LATTICE if scene.run.adapt == "hybrid" else MOST_NODES)
    farthest = float(np.abs([x0, y0, x1, y1]).max())
    if scene.finest < RESOLVED * farthest:
        raise SceneError(
            f"spacing is {scene.finest:g} m in a plate {farthest:g} m from the origin; use at least"
            f" {RESOLVED * farthest:g} m: places are not known better"
        )


def limit_nodes(shape: Surface, spacing: float, place: str, most: float = MOST_NODES) -> None:
    """Raise SceneError, beginning with `place`, for more nodes of a spacing (m) in a shape than can be made."""
    x0, y0, x1, y1 = shape.bounds if not shape.is_empty else (0.0, 0.0, 0.0, 0.0)
    for area, many in ((shape.area, most), ((x1 - x0) * (y1 - y0), EMPTY * most)):
        side = math.sqrt(area) / spacing
        if side * side > many:
            raise SceneError(
                f"{place} is {spacing:g} m, about {side * side:.1g} nodes on {x1 - x0:g} x {y1 - y0:g} m; use no"
                f" more than {many:.0e}"
            )


def _zones(scene: Plate) -> None:
    names = [zone.name for zone in scene.zones]
    for zone in scene.zones:
        if names.count(zone.name) > 1:
            raise SceneError(f"zone '{zone.name}': {names.count(zone.name)} have this name; use it once")
        if not zone.shape.intersection(scene.whole).area > 0:
            raise SceneError(f"zone '{zone.name}' is outside the plate; put it inside")
        x0, y0, x1, y1 = zone.shape.bounds
        if zone.spacing > max(x1 - x0, y1 - y0):
            raise SceneError(
                f"zone '{zone.name}': spacing is {zone.spacing:g} m; use less than its size {max(x1 - x0, y1 - y0):g} m"
            )
        limit_nodes(zone.shape.intersection(scene.whole), zone.spacing, f"zone '{zone.name}': spacing")


def _bodies(scene: Plate) -> None:
    """Check the bodies besides the plate: their names, spacings, materials and velocities, and that none overlap."""
    others = [(REST, scene.shape, scene.spacing)]
    for body in scene.bodies:
        place = f"body '{body.name}'"
        if not body.name or body.name in [name for name, _, _ in others]:
            raise SceneError(f"{place} has an empty name or one that another body has; use one of its own")
        checked_spacing(body.spacing, f"{place}: spacing")
        x0, y0, x1, y1 = body.shape.bounds
        if body.spacing > max(x1 - x0, y1 - y0):
            raise SceneError(f"{place}: spacing is {body.spacing:g} m; use less than its size")
        limit_nodes(body.shape, body.spacing, f"{place}: spacing")
        if body.material is not None:
            composed(body.material, place)
        if len(body.velocity) != 2 or not (np.abs(body.velocity) <= MOST).all():
            raise SceneError(f"{place}: velocity is {body.velocity}; use two finite numbers, m/s")
        if not (np.ndim(body.spin) == 0 and np.abs(body.spin) <= MOST):
            raise SceneError(f"{place}: spin is {body.spin}; use one finite number, rad/s")
        wrong = None if body.rigid is None else contradiction_of_rigid(body.rigid, 2)
        if wrong is not None:
            raise SceneError(f"{place}: {wrong}")
        for name, shape, spacing in others:
            common = shape.intersection(body.shape)
            if common.area > OVERLAP * min(spacing, body.spacing) ** 2:
                depth = 2 * shapely.maximum_inscribed_circle(common).length
                raise SceneError(f"{place} is {depth:.4g} m deep in body '{name}'; bodies may touch at most")
        others.append((body.name, body.shape, body.spacing))


def composed(material: Material, place: str) -> None:
    """Raise SceneError for an impossible material, or one in other units."""
    described(material, Material, place)
    wrong = wrong_energy(material)
    if wrong is not None:
        raise SceneError(f"{place}: {wrong}")
    wave = math.sqrt(material.E / material.rho)
    if wave > FASTEST_WAVE and DENSITIES[0] <= material.rho <= DENSITIES[1]:
        raise SceneError(
            f"{place}: E = {material.E:g} and rho = {material.rho:g} give waves of {wave:.2g} m/s; use Pa and"
            " kg/m^3 (steel: 2e11 and 7800), not MPa and t/mm^3"
        )


def _condition(condition: PlacedCondition, scene: Plate) -> None:
    action, place = condition.action, describe(condition.action)
    rows = condition.place.rows
    if not isinstance(rows, int) or not 1 <= rows <= MOST_ROWS:
        raise SceneError(f"{place}: rows is {rows!r:.40}; use a whole number of 1 to {MOST_ROWS}")
    values = _numbers_of(condition, place)
    values += [value for point in getattr(action, "profile", ()) for value in point]
    if not (np.abs(values) <= MOST).all():
        raise SceneError(f"{place} has {values}; use finite numbers of at most {MOST:g}")
    if isinstance(action, Condition) and not isinstance(action.breakable, bool):
        raise SceneError(f"{place}: breakable is {action.breakable!r}; use True or False")
    if condition.place.shape.distance(scene.everything) > rows * scene.spacing:
        raise SceneError(f"{place} is away from the plate; put it in it or along its edge")


def _numbers_of(condition: PlacedCondition, place: str) -> list[float]:
    """The values of a condition. Raises SceneError for some that contradict each other."""
    action = condition.action
    if isinstance(action, Load):
        vectors = given_of(action)
        if len(vectors) != 1:
            names = " and ".join(vectors) or "none"
            raise SceneError(f"{place}: {names} given; give one of {', '.join(LOADS)}")
        if action.traction is not None and not isinstance(condition.place.shape, Curve):
            what = "on a surface" if isinstance(condition.place.shape, Surface) else "at a point"
            wanted = "use a force or a body force there, or a curve"
            raise SceneError(f"{place}: a traction {what} is not possible; {wanted}")
        return [value for vector in vectors.values() for value in vector if isinstance(value, float | int)]
    if isinstance(action, Spring):
        wrong = wrong_spring(action, 2)
        if wrong is not None:
            raise SceneError(f"{place}{wrong}")
        if action.stiffness is not None and not isinstance(condition.place.shape, Curve):
            raise SceneError(f"{place}: a stiffness is only possible along a curve; use a body_stiffness there")
        return [*(action.stiffness or action.body_stiffness or ())]
    if isinstance(action, Pin):
        return [*action.centre]
    if isinstance(action, Absorb | OfDiffusion):
        return [value for value in msgspec.to_builtins(action).values() if isinstance(value, float | int)]
    if action.x is None and action.y is None:
        raise SceneError(f"{place} has no component; give x, y or both")
    return [value for value in (action.x, action.y) if isinstance(value, float | int)]
