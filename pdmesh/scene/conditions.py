"""Conditions on a plate, their places and time profiles, before there are nodes.

A traction on an edge is shared by the rows of nodes within a horizon of it. In uniform stretching across an edge, a
node at a depth d lacks the pull of the bonds that would end beyond the edge. A traction that pulls it as much instead
leaves the stretching uniform up to the edge; on the first row alone it would stretch what is near the edge more.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, Self, TypeAlias, TypeVar

import msgspec
import numpy as np
import shapely
from numpy.typing import NDArray

from pdmesh.model.base_structs import PlainFields
from pdmesh.model.document import (
    LARGEST,
    AnyCondition,
    Concentration,
    Exchange,
    Load,
    MediumRegion,
    Point,
    Region,
    Spring,
)
from pdmesh.model.lattice_calibration import has_partial_cells, hu_beta
from pdmesh.model.material import Material
from pdmesh.model.material_constants import micromodulus
from pdmesh.model.pressed_faces import Faces, nodal_areas
from pdmesh.scene.functions_of_place import Function, sampled
from pdmesh.scene.shapes import Circle, Curve, Points, SceneError, Surface, near, polyline

NU = 1 / 3  # contraction across
ROUND_OFF = 1e-6  # of a spacing
Pulls: TypeAlias = tuple[float, ...]  # of the columns of a family, 1, 2, ... spacings from its node
MOST_SPACINGS = 32
SLACK = 1e-6  # of a spacing: what still counts as lying on an edge
DECAYS = 0.5, 20.0  # of a blast, which 100 points per duration follow within 1 %, and which ends
FAINT = 1e-3  # of the peak: suction of a blast that is left out
Profile = tuple[Point, ...]
R = TypeVar("R", Region, MediumRegion)
S = TypeVar("S")  # a scene
W = TypeVar("W")  # where a condition may be: sides, and curves and surfaces of a plate or solids and sheets of a body


def pulls_of(material: Material, ratio: float) -> Pulls:
    """Pulls of the columns of a family on a lattice, in a plate, whose horizon has so many spacings; none where no bond
    pulls across an edge."""
    reach = int(np.ceil(ratio)) + 1
    x, y = (
        coordinate.ravel()
        for coordinate in np.meshgrid(np.arange(1, reach + 1), np.arange(-reach, reach + 1), indexing="ij")
    )
    length, horizon = np.hypot(x, y), np.full(len(x), float(ratio))
    if has_partial_cells(material):
        counted = hu_beta(length, horizon, np.ones(len(x)))
    else:
        counted = np.where(length <= horizon * (1 + ROUND_OFF), 1.0, 0.0)
    along = x / length
    pull = counted * micromodulus(material, length, horizon) * along * (along**2 - NU * (1 - along**2))
    columns = np.bincount(x, pull)[1:]
    return tuple((columns / columns.sum()).tolist()) if (columns > 0).any() else ()


def shares(pulls: Pulls, depth: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shares (k,) of nodes at these depths (k,) below an edge, in spacings, of what a node on it has."""
    if not pulls:
        return np.ones(len(depth))
    column = np.arange(1, len(pulls) + 1)[:, None]
    beyond = (column > depth + ROUND_OFF) + 0.5 * (np.abs(column - depth) <= ROUND_OFF)
    edge_share = np.array(pulls) @ beyond
    return np.where(edge_share > 1 - ROUND_OFF, 1.0, np.where(edge_share > ROUND_OFF, edge_share, 0.0))


class Conditioned(Generic[W]):
    """What conditions can be added to, as `pdmesh.Scene` and `pdmesh.Body` are."""

    def _with(
        self, kind: type[AnyCondition], values: dict[str, Any], where: W, rows: int | None, name: str, **more: Any
    ) -> Self:
        """With a condition of this kind and with these values; `more` are its profile and whether it is breakable."""
        raise NotImplementedError

    def _named(self, where: W, kind: str) -> str:
        """Default name of a condition."""
        raise NotImplementedError


def unchecked(scene: S, **changed: Any) -> S:
    """The scene with changes that are checked already; all that was derived from its shapes stays.

    Scenes check all their parts when they are made, so that n parts added one by one would take n^2 checks.
    """
    changed_scene = object.__new__(type(scene))
    changed_scene.__dict__.update(scene.__dict__ | changed)
    return changed_scene


@dataclass(frozen=True)
class Shift:
    """A lattice that was moved so that no crack meets a node."""

    spacing: float  # m
    offset: tuple[float, float]  # m

    def __str__(self) -> str:
        x, y = self.offset
        return f"lattice of {self.spacing:g} m: shifted by ({x:g}, {y:g}) m, off the cracks"


@dataclass(frozen=True)
class Place(PlainFields):
    """The place of a condition: rows of nodes along a curve, the nodes in a surface, or the one nearest to a point."""

    shape: Curve | Surface | shapely.Point
    rows: int = 1

    def nodes(self, position: NDArray[np.float64], delta: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Mask (n,) of the nodes in this place, at `position` (n, 2) with spacings `delta` (n,), m."""
        if isinstance(self.shape, shapely.Point):
            away = np.hypot(*(position - [self.shape.x, self.shape.y]).T)
            return np.asarray(np.arange(len(position)) == away.argmin())
        if isinstance(self.shape, Curve) and len(np.unique(delta)) > MOST_SPACINGS:  # a mesh, with no rows to speak of
            return near(position, self.shape, self.rows * delta * (1 - SLACK))
        if isinstance(self.shape, Surface):
            area = self.shape.buffer(SLACK * float(delta.min()), join_style="mitre")
            x0, y0, x1, y1 = area.bounds
            x, y = position.T
            inside = np.asarray((x >= x0) & (x <= x1) & (y >= y0) & (y <= y1))
            inside[inside] = shapely.contains_xy(area, position[inside])
            return inside
        inside = np.zeros(len(position), dtype=bool)
        for spacing in np.unique(delta):
            in_level, slack = delta == spacing, SLACK * float(spacing)
            strip = self.shape.buffer(self.rows * float(spacing) - 2 * slack, cap_style="flat", join_style="mitre")
            in_strip = shapely.contains_xy(strip.buffer(slack), position[in_level])
            inside[in_level] = in_strip & near(position[in_level], self.shape, self.rows * float(spacing) * (1 - SLACK))
        return inside


@dataclass(frozen=True)
class PlacedCondition:
    """A condition of the grid file whose nodes are still to be found in `place`."""

    place: Place
    action: AnyCondition
    functions: tuple[Function, ...] = ()  # of place, that give values of the condition
    pulls: Pulls = ()  # by which rows share a traction on an edge; none: all rows have as much
    faces: Faces = ()  # that a pressure acts on
    of_crack: bool = False  # whether these are the faces of a pre-crack

    def on_one_row(self) -> PlacedCondition:
        """The condition with one row in place of those that share a traction."""
        return replace(self, place=replace(self.place, rows=1), pulls=()) if self.pulls else self

    def on(
        self,
        position: NDArray[np.float64],
        delta: NDArray[np.float64],
        shifts: Sequence[Shift] = (),
        areas: NDArray[np.float64] | None = None,
    ) -> AnyCondition:
        """The condition with its nodes' ids, which count from 1; `areas` (n,) of cells, m^2, are squares by default.

        Raises SceneError if it finds no node, which says where the nearest is and, by the lattices' `shifts`, what may
        have moved it.
        """
        rows = np.flatnonzero(self.place.nodes(position, delta))
        parts = shares(self.pulls, shapely.distance(shapely.points(position[rows]), self.place.shape) / delta[rows])
        rows, parts = rows[parts > 0], parts[parts > 0]
        if not len(rows):
            reach = "in its shape" if isinstance(self.place.shape, Surface) else f"within {self.place.rows} rows"
            nearest = _nearest(self.place.shape, position, shifts)
            raise SceneError(
                f"{describe(self.action)}: no node is {reach}, {nearest}; use a larger region, or a point (scene.pin,"
                " shapely.Point, a physical point), which takes the node nearest to it"
            )
        changes: dict[str, object] = {"nodes": tuple((rows + 1).tolist())}
        if isinstance(self.action, Load) and self.action.traction is not None:
            changes |= {"rows": self.place.rows, "length": float(self.place.shape.length)}
            changes |= {"rows": 1, "shares": tuple(parts.tolist())} if self.pulls else {}
        if self.faces:
            cells = (delta**2 if areas is None else areas)[rows] * parts
            vectors = nodal_areas(self.faces, position[rows], delta[rows], cells)
            changes |= {"area_vectors": tuple(map(tuple, vectors.tolist()))}
            changes |= {"shares": tuple(parts.tolist())} if self.pulls else {}
            following = isinstance(self.action, Load) and self.action.following
            changes |= {"faces": self.faces} if following or self.of_crack else {}
        if isinstance(self.action, Spring) and self.action.stiffness is not None:
            changes |= {"rows": self.place.rows, "length": float(self.place.shape.length)}
        if isinstance(self.action, Concentration | Exchange) and isinstance(self.place.shape, Curve):
            at = shapely.points(position[rows])
            feet = shapely.line_interpolate_point(self.place.shape, shapely.line_locate_point(self.place.shape, at))
            changes["edge"] = tuple(map(tuple, (shapely.get_coordinates(feet) - position[rows]).tolist()))
        return sampled(
            msgspec.structs.replace(self.action, **changes), self.functions, position[rows], describe(self.action)
        )


@dataclass(frozen=True)
class PlacedRegion(Generic[R]):
    """A part of the plate with another material or medium; of several with a node, the last one counts."""

    shape: Surface
    region: R

    def on(self, position: NDArray[np.float64], delta: NDArray[np.float64], shifts: Sequence[Shift] = ()) -> R:
        """The region with its nodes' ids. Raises SceneError if it finds no node, as conditions do."""
        rows = np.flatnonzero(Place(self.shape).nodes(position, delta))
        if not len(rows):
            where = _nearest(self.shape, position, shifts)
            raise SceneError(
                f"{self.kind} '{self.region.name}': no node is in its surface, {where}; enlarge it, or use finer nodes"
            )
        return msgspec.structs.replace(self.region, nodes=tuple((rows + 1).tolist()))

    @property
    def kind(self) -> str:
        """The kind of region, in words."""
        return "material" if isinstance(self.region, Region) else "medium"


MaterialRegion = PlacedRegion[Region]


def _nearest(shape: shapely.Geometry, position: NDArray[np.float64], shifts: Sequence[Shift]) -> str:
    """Where the node nearest to a shape is, and how lattices were shifted, for a message."""
    x, y = position[shapely.distance(shapely.points(position), shape).argmin()]
    return ", ".join([f"the nearest is at ({x:g}, {y:g}) m", *map(str, shifts)])


def describe(action: AnyCondition) -> str:
    """The kind and name of a condition, for a message."""
    return f"{action.__struct_config__.tag} '{action.name}'"


def name_of(where: str | Curve | Surface | Circle | shapely.Point | Points, kind: str) -> str:
    """Default name of a condition: its side, or the shape and position (m) of its place.

    Raises SceneError for points that are no curve.
    """
    if isinstance(where, str):
        return where
    if isinstance(where, shapely.Point):
        return f"node at ({where.x:g}, {where.y:g}) m"
    if isinstance(where, Circle):
        return f"circle at ({where.x:g}, {where.y:g}) m"
    if isinstance(where, Surface):
        x0, y0, x1, y1 = where.bounds if not where.is_empty else 4 * (0.0,)
        what = "box" if where.equals(shapely.box(x0, y0, x1, y1)) else "shape"
        return f"{what} at ({(x0 + x1) / 2:g}, {(y0 + y1) / 2:g}) m"
    middle = polyline(where, kind).interpolate(0.5, normalized=True)
    return f"line at ({middle.x:g}, {middle.y:g}) m"


def ramp(duration: float) -> Profile:
    """A profile that grows from 0 to 1 over `duration`, s, and stays."""
    return ((0.0, 0.0), (float(duration), 1.0))


def friedlander(duration: float, decay: float = 1.0) -> Profile:
    """The profile of a blast that arrives at time 0: (1 - t / T) exp(-b t / T), with T = `duration`, s, b = `decay`.

    Its suction after T is included, up to where it is 1e-3 of the peak. Straight lines between 100 points per T follow
    it within 1e-4 for a `decay` of 1. Raises SceneError.
    """
    if not (0 < duration <= LARGEST and DECAYS[0] <= decay <= DECAYS[1]):
        raise SceneError(
            f"friedlander: duration is {duration:g} s and decay {decay:g}; use more than 0 s, and {DECAYS[0]:g} to"
            f" {DECAYS[1]:g}"
        )
    end = 1 + 1 / decay  # of its largest suction
    while (end - 1) * np.exp(-decay * end) > FAINT:
        end += 0.5
    share = np.linspace(0.0, end, round(100 * end) + 1)
    factor = (1 - share) * np.exp(-decay * share)
    factor[-1] = 0.0
    return tuple(zip((duration * share).tolist(), factor.tolist(), strict=True))


def parse_profile(text: str, place: str) -> Profile:
    """A profile from its words: ``constant``, ``ramp 1e-6`` (s), ``friedlander 1e-3 1.5`` (s, decay), or a table
    ``0 0, 1e-6 1, 2e-6 0`` (s, factor).

    Raises SceneError, beginning with `place`.
    """
    words = text.split()
    try:
        if words in ([], ["constant"]):
            return ()
        if words[0] == "ramp":
            (duration,) = words[1:]
            return checked_profile(ramp(float(duration)), place)
        if words[0] == "friedlander":
            duration, decay = words[1:]
            return checked_profile(friedlander(float(duration), float(decay)), place)
        pairs = [part.split() for part in text.split(",")]
        return checked_profile([(float(time), float(factor)) for time, factor in pairs], place)
    except ValueError as error:
        if isinstance(error, SceneError):
            raise
        raise SceneError(
            f"{place}: cannot read '{text}'; use 'constant', 'ramp SECONDS', 'friedlander SECONDS DECAY' or a table"
            " 'TIME FACTOR, TIME FACTOR, ...'"
        ) from None


def checked_profile(points: Sequence[Point], place: str) -> Profile:
    """The points (time in s, factor) of a profile, finite and in the order of time. Raises SceneError."""
    try:
        profile = tuple((float(time), float(factor)) for time, factor in points)
    except (TypeError, ValueError):
        raise SceneError(f"{place} is {points!r:.80}; use pairs (time in s, factor)") from None
    if not np.isfinite(np.array(profile)).all():
        raise SceneError(f"{place} is {profile}; use finite numbers")
    for (before, _), (after, _) in itertools.pairwise(profile):
        if not after > before:
            raise SceneError(f"{place}: time {after:g} s comes after {before:g} s; use times that increase")
    return profile
