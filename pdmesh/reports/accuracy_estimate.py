"""Proposes spacing, zones and time step for a required error, from the measured errors of three other problems.

`accuracy.json` holds displacement errors against spacing over the size of the smallest feature. The problems are a
plate with a hole, Kalthoff and Winkler's experiment and the Duran plate, each on two scales. `python -m
benchmarks.planning` measures them, and how well the promises hold for scenes that were not used. The promised error is
the largest of the three. For scenes with cracks it also has errors of a moving fine zone, for Kalthoff and Winkler's
steel and the Duran plate. The proposal is the one with the fewest bond updates.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib import resources
from itertools import combinations
from typing import Any, NamedTuple

import msgspec
import numpy as np
import shapely
from numpy.typing import NDArray

from pdmesh.drawing.parameters import PREFIX, unit_of
from pdmesh.model.document import (
    ON_ONE_LATTICE,
    Absorb,
    Acceleration,
    Displacement,
    InitialVelocity,
    Load,
    Material,
    Velocity,
    in_steps,
)
from pdmesh.model.values_at_places import largest
from pdmesh.reports.bonds_and_step import stable_step
from pdmesh.scene.missing_values import known
from pdmesh.scene.plate import Refinement
from pdmesh.scene.scene import Scene
from pdmesh.scene.shapes import SceneError, surface

RATIO = 2.0  # of the coarse spacing over the fine one; larger jumps reflect waves
NEAR = 0.5  # of the feature: how far around it a scene without zones is refined
EXTRAPOLATED = 2.0  # times below the least error measured: how far first order is trusted
TIP, BESIDE, LATTICE = 12.0, 8.0, 8.0  # spacings that are fine around a tip, and beside a crack; bonds of a coarse node
KNOCK = 0.5  # runs with more were stopped at the border of the fine zone, with 0.38 they went on
ROUNDED = 2  # digits of a proposed spacing
FOLDERS = {
    Load: "Loads",
    Displacement: "Fixes",
    Velocity: "Moves",
    Acceleration: "Moves",
    InitialVelocity: "Moves",
    Absorb: "Absorbs",
}


@dataclass(frozen=True)
class Proposal:
    """A scene changed so that its error should stay within a given share of its displacements."""

    within: float
    feature: float  # m, size of the smallest feature
    named: str  # what that is
    error: float  # promised, for the spacing rounded down
    guessed: bool  # whether no grid as fine was measured
    scene: Scene

    @property
    def adapt(self) -> str:
        """The adaptivity of the proposed run: none, hybrid, split or collocation."""
        return self.scene.run.adapt


class Curve(NamedTuple):
    """Error of one problem against spacing; beyond the measured range, the error is proportional to the spacing."""

    spacing: NDArray[np.float64]  # (k,) over the feature's size, increasing
    error: NDArray[np.float64]  # (k,) the worst up to there

    def share(self, within: float) -> float | None:
        """The largest spacing within an error; None if the error is too far below the measured range."""
        if within < self.error[0]:
            return None if within * EXTRAPOLATED < self.error[0] else float(self.spacing[0] * within / self.error[0])
        return float(np.exp(np.interp(np.log(within), np.log(self.error), np.log(self.spacing))))

    def at(self, spacing: float) -> float:
        """The error at a spacing."""
        if spacing < self.spacing[0]:
            return float(self.error[0] * spacing / self.spacing[0])
        return float(np.exp(np.interp(np.log(spacing), np.log(self.spacing), np.log(self.error))))


@lru_cache
def measured(adapt: str = "none") -> dict[float, list[Curve]]:
    """Curves for each horizon ratio, on two scales or with a moving fine zone."""
    text = resources.files("pdmesh.reports").joinpath("accuracy.json").read_text(encoding="utf-8")
    points: list[dict[str, Any]] = [
        point for point in json.loads(text)["points"] if point.get("adapt", "none") == adapt
    ]
    curves_by_ratio: dict[float, list[Curve]] = {}
    for ratio, problem in sorted({(float(point["ratio"]), str(point["problem"])) for point in points}):
        mine = [point for point in points if (point["ratio"], point["problem"]) == (ratio, problem)]
        spacing, error = np.array(sorted((point["spacing_over_feature"], point["error"]) for point in mine)).T
        curves_by_ratio.setdefault(ratio, []).append(Curve(spacing, np.maximum.accumulate(error)))
    return curves_by_ratio


def proposal(scene: Scene, within: float) -> Proposal:
    """The cheapest changed scene with a promised error of `within`, a share of its displacements.

    Raises SceneError if no grid promises that, or if the scene has no material.
    """
    if scene.material is None:
        raise SceneError("material is missing; give E, rho and G0 for a proposal")
    scene = known(scene)
    size, named = feature(scene)
    proposals: list[Proposal] = []
    errors: list[SceneError] = []
    run, profiles = scene.run, {material.micromodulus for material in _materials(scene)}
    plain = run.solver == "explicit" and run.start == "unloaded" and not run.damping
    plain &= len(profiles) == 1 and scene.area_rule in (None, "cells")
    plain &= not any(isinstance(condition.action, Acceleration | Absorb) for condition in scene.conditions)
    # a moving fine zone is for cracks, and the solver refuses some settings with one
    for adapt in ("none", "hybrid") if scene.cracks and plain else ("none",):
        for ratio, curves in measured(adapt).items():
            shares = [share for share in (curve.share(within) for curve in curves) if share is not None]
            if len(shares) < len(curves):
                continue
            largest = min(shares) * size
            unit = 10.0 ** (np.floor(np.log10(largest)) + 1 - ROUNDED)
            finest = float(f"{np.floor(largest / unit * (1 + 1e-9)) * unit:.{ROUNDED}g}")
            promised = max(curve.at(finest / size) for curve in curves)
            guessed = any(within < curve.error[0] for curve in curves)
            try:
                changed_scene = changed(scene, finest, ratio, adapt)
            except SceneError as error:
                errors.append(SceneError(f"{because(within, size, named)}{error}"))
            else:
                if adapt == "hybrid" and _knock(changed_scene) > KNOCK:
                    continue
                proposals.append(Proposal(within, size, named, promised, guessed, changed_scene))
    if proposals:
        return min(proposals, key=lambda candidate: updates(candidate.scene))
    if errors:
        raise errors[0] from None
    least = min(max(float(curve.error[0]) for curve in curves) for curves in measured().values()) / EXTRAPOLATED
    raise SceneError(f"--within is {within:.3g}; use {least:.3g} or more, as finer grids were not measured")


def _knock(scene: Scene) -> float:
    """The largest strain of a suddenly prescribed velocity, over the critical stretch.

    For constant bonds in plane stress (Ha and Bobaru, Int. J. Fracture 162 (2010) 229-244).
    """
    assert scene.material is not None
    E, rho, G0 = scene.material.E, scene.material.rho, scene.material.G0
    critical = np.sqrt(4 * np.pi * G0 / (9 * E * scene.horizon * scene.finest))
    velocities = [
        condition.action for condition in scene.conditions if isinstance(condition.action, Velocity | InitialVelocity)
    ]
    sudden = [velocity for velocity in velocities if not getattr(velocity, "profile", ())]
    corners = shapely.get_coordinates(scene.shape)
    fastest = max(
        (float(np.hypot(largest(velocity.x, corners), largest(velocity.y, corners))) for velocity in sudden),
        default=0.0,
    )
    return float(fastest / np.sqrt(E / rho) / critical)


def updates(scene: Scene) -> float:
    """Estimated number of bond updates of a scene; for a moving fine zone, with cracks as long as the plate."""
    h, area, family = scene.finest, scene.shape.area, np.pi * scene.horizon**2
    if scene.run.adapt == "hybrid":
        low_x, low_y, high_x, high_y = scene.shape.bounds
        ends = [shapely.Point(slit.line.coords[at]) for slit in scene.slits for at in (0, -1)]
        tips = len([end for end in ends if scene.shape.boundary.distance(end) > 1e-3 * scene.finest])
        path = TIP * h + max(high_x - low_x, high_y - low_y)
        fine = min(tips * path * 2 * BESIDE * h, area)
        return float(scene.run.steps * (family * fine / h**2 + LATTICE * (area - fine) / (2 * h) ** 2))
    bonds, remainder = 0.0, scene.shape
    zones = [(zone.spacing, surface(zone.shape, zone.spacing, "zone")) for zone in scene.zones]
    shapes = {"crack": [slit.line for slit in scene.slits], "hole": list(scene.holes), "notch": []}
    for request in scene.refinements:
        near = shapely.union_all(shapes[request.target]).buffer(request.distance)
        zones.append((request.spacing or scene.finest, near))
    for spacing, zone in sorted(zones, key=lambda entry: entry[0]):
        bonds += family * remainder.intersection(zone).area / spacing**2
        remainder = remainder.difference(zone)
    return float(scene.run.steps * (bonds + family * remainder.area / scene.spacing**2))


def because(within: float, size: float, named: str) -> str:
    """Beginning of a message about a spacing: the required error and the feature that determines it."""
    return f"--within {within:g}, for {size:.3g} m, {named}: "


def feature(scene: Scene) -> tuple[float, str]:
    """Size of the smallest feature, m, and its name.

    Features are the radius of a hole or notch (of a disc of equal area), the length of a pre-crack, the ligaments
    between them and to the edge, and half of the plate's smaller side.
    """
    low_x, low_y, high_x, high_y = scene.shape.bounds
    sizes = [(min(high_x - low_x, high_y - low_y) / 2, "half of the smaller side")]
    edge, scale = scene.whole.boundary, 1e-6 * max(high_x - low_x, high_y - low_y)
    shapes: list[tuple[shapely.Geometry, str]] = [(slit.line, f"crack '{slit.name}'") for slit in scene.slits]
    sizes += [(slit.line.length, f"length of crack '{slit.name}'") for slit in scene.slits]
    for number, cutout in enumerate(scene.cutouts):
        cut = surface(cutout, scene.finest, "cutout").intersection(scene.whole)
        sizes.append((float(np.sqrt(cut.area / np.pi)), f"radius of cutout {number + 1}"))
        shapes.append((cut, f"cutout {number + 1}"))
    for ring in scene.whole.interiors if hasattr(scene.whole, "interiors") else ():
        hole = shapely.Polygon(ring)
        sizes.append((float(np.sqrt(hole.area / np.pi)), "radius of a hole"))
    for shape, name in shapes:
        # from the edge or, of a line that begins there, of its other end
        if shape.distance(edge) > scale:
            away = float(shape.distance(edge))
        elif shape.geom_type != "LineString":
            away = None
        else:
            ends = [float(shapely.Point(end).distance(edge)) for end in (shape.coords[0], shape.coords[-1])]
            away = max(ends) if max(ends) > scale else None
        if away is not None:
            sizes.append((away, f"from {name} to the edge"))
    for (first_shape, first), (second_shape, second) in combinations(shapes, 2):
        away = float(first_shape.distance(second_shape))
        if away > scale:
            sizes.append((away, f"from {first} to {second}"))
    return min(sizes)


def changed(scene: Scene, finest: float, ratio: float, adapt: str = "none") -> Scene:
    """The scene with this finest spacing (m) and horizon ratio, equal width of rows and equal duration.

    Drawn zones are scaled, or zones are put around features; a moving fine zone needs none.
    """
    factor = finest / scene.finest
    if scene.zones or scene.refinements:
        zones = tuple(replace(zone, spacing=factor * zone.spacing) for zone in scene.zones)
        refinements = tuple(
            replace(request, spacing=factor * (request.spacing or scene.finest)) for request in scene.refinements
        )
        spacing = factor * scene.spacing
    else:
        zones, spacing, refinements = (), RATIO * finest, ()
        if adapt != "hybrid":
            targets = [("crack", bool(scene.cracks)), ("hole", bool(scene.holes))]
            distance = max(NEAR * feature(scene)[0], RATIO * scene.horizon * finest)
            refinements = tuple(
                Refinement(name, distance, finest)  # type: ignore[arg-type]
                for name, present in targets
                if present
            )
        if not refinements:
            spacing = finest
    laid = finest if adapt == "hybrid" else spacing
    conditions = tuple(
        replace(
            condition, place=replace(condition.place, rows=max(1, round(condition.place.rows * scene.spacing / laid)))
        )
        for condition in scene.conditions
    )
    rescaled_scene = replace(
        scene, spacing=spacing, zones=zones, refinements=refinements, horizon=ratio, conditions=conditions
    )
    step, old = _stable(scene, ratio, finest), scene.run.time_step or _stable(scene, scene.horizon, scene.finest)
    if not np.isfinite(old) or not np.isfinite(step):
        raise SceneError(f"horizon is {scene.horizon:g}, where bonds have no stiffness; use more (3 is usual)")
    counted = in_steps(scene.run, old)
    steps = int(np.ceil(counted.steps * old / step))
    every = max(1, round(counted.frame_interval * old / step))
    run = msgspec.structs.replace(scene.run, time_step=step, steps=steps, duration=None, every=every, adapt=adapt)
    return replace(rescaled_scene, run=run)


def _stable(scene: Scene, ratio: float, spacing: float) -> float:
    return min(stable_step(material, ratio, spacing) for material in _materials(scene))


def _materials(scene: Scene) -> list[Material]:
    return [material for material in (scene.material, *(part.region.material for part in scene.regions)) if material]


def lines(proposal: Proposal) -> list[str]:
    """A proposal in words, with the options that request it."""
    scene = proposal.scene
    said = [
        f"within {proposal.within:.3g}: {proposal.error:.2g} is promised,"
        f" {'at first order from what was' if proposal.guessed else 'as'} measured on other scenes,"
        f" for {1e3 * proposal.feature:.4g} mm, {proposal.named}",
        f"spacing {scene.finest:.4g} m at its finest, {coarsest(scene):.4g} m at its coarsest; horizon ratio"
        f" {scene.horizon:g}; step {scene.run.time_step:.4g} s x {scene.run.steps}",
    ]
    said += [
        f"zone of {request.spacing:.4g} m within {request.distance:.4g} m of every {request.target}"
        for request in scene.refinements
    ]
    if proposal.adapt == "hybrid":
        said += ["fine near cracks alone, in a zone that goes with them:", "  --adapt hybrid"]
    return said + [f"  --set '{name}={value}'" for name, value in settings(proposal).items()]


def coarsest(scene: Scene) -> float:
    """The largest spacing in the grid, m."""
    return RATIO * scene.finest if scene.run.adapt in ON_ONE_LATTICE else scene.spacing


def described(proposal: Proposal) -> dict[str, Any]:
    """A proposal for JSON."""
    scene = proposal.scene
    return {
        "within": proposal.within,
        "promised": proposal.error,
        "extrapolated": proposal.guessed,
        "feature": proposal.feature,
        "feature_is": proposal.named,
        "finest_spacing": scene.finest,
        "coarsest_spacing": coarsest(scene),
        "adapt": proposal.adapt,
        "horizon_ratio": scene.horizon,
        "time_step": scene.run.time_step,
        "steps": scene.run.steps,
        "refinements": [
            {"around": request.target, "distance": request.distance, "spacing": request.spacing}
            for request in scene.refinements
        ],
        "settings": settings(proposal),
    }


def settings(proposal: Proposal) -> dict[str, str]:
    """The drawing parameters that make the proposal; empty for a scene in Python."""
    scene, parameter_names = proposal.scene, {name.removeprefix(PREFIX) for name, _ in proposal.scene.parameters}
    unit = unit_of(dict(scene.parameters))
    wanted = {
        **{f"Zones/{zone.name}/Spacing": f"{unit.of(zone.spacing):.6g}" for zone in scene.zones},
        "Horizon ratio": f"{scene.horizon:g}",
        "Run/Time step": f"{scene.run.time_step:.6g}",
        "Run/Frame every": str(scene.run.every),
        **{
            f"{FOLDERS[type(condition.action)]}/{condition.action.name}/Rows": str(condition.place.rows)
            for condition in scene.conditions
        },
    }
    return {name: value for name, value in wanted.items() if name in parameter_names}
