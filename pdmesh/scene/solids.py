"""Descriptions of solids in space: boxes, cylinders, cones, spheres, and their unions, differences and intersections.

`pdmesh.drawing.building` has Gmsh triangulate them to a `Shell`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray

from pdmesh.model.base_structs import PlainFields
from pdmesh.model.document import LARGEST
from pdmesh.scene.shapes import SceneError

ROUND_OFF = 1e-12  # of a triangle's longest side squared
Place: TypeAlias = tuple[float, float, float]  # m


class Solid:
    """A solid. ``a + b`` is the union, ``a - b`` the difference, ``a & b`` the intersection."""

    def __add__(self, other: Solid) -> Solid:
        return Joined("BooleanUnion", self, other)

    def __sub__(self, other: Solid) -> Solid:
        return Joined("BooleanDifference", self, other)

    def __and__(self, other: Solid) -> Solid:
        return Joined("BooleanIntersection", self, other)


@dataclass(frozen=True)
class Joined(Solid):
    """Two solids combined by a Boolean operation, with Gmsh's word for it."""

    how: str
    first: Solid
    second: Solid


@dataclass(frozen=True)
class Box(PlainFields, Solid):
    """A box between opposite corners."""

    low: Place  # m
    high: Place  # m


@dataclass(frozen=True)
class Cylinder(PlainFields, Solid):
    """A cylinder between the centres of its ends, or a cone if the second radius differs."""

    start: Place  # m
    end: Place  # m
    radius: float  # m
    end_radius: float | None = None  # m; None: the same


@dataclass(frozen=True)
class Sphere(PlainFields, Solid):
    """A sphere around `centre`."""

    centre: Place  # m
    radius: float  # m


@dataclass(frozen=True)
class Shell(Solid):
    """A solid given by the triangles of its surface."""

    triangles: NDArray[np.float64]  # (t, 3, 3) m; closed
    volume: float  # m^3, exact where it is known

    @property
    def bounds(self) -> NDArray[np.float64]:
        """The lowest and the highest corner (2, 3) of the surface, m."""
        corners = self.triangles.reshape(-1, 3)
        return np.array([corners.min(axis=0), corners.max(axis=0)])


@dataclass(frozen=True)
class NodeSet(Shell):
    """Nodes of a body that has a `NodeCloud`, by their rows."""

    rows: NDArray[np.int64]

    @classmethod
    def of(cls, places: NDArray[np.float64], rows: NDArray[np.int64]) -> NodeSet:
        """The nodes at `places` (k, 3), m, as triangles that have no area."""
        return cls(np.repeat(places[:, None], 3, axis=1), 0.0, rows)


@dataclass(frozen=True)
class NodeCloud:
    """The n nodes of a body that are on no lattice."""

    position: NDArray[np.float64]  # (n, 3) m
    delta: NDArray[np.float64]  # (n,) m, the width of a cube of the usual volume there
    volume: NDArray[np.float64]  # (n,) m^3


def brick(low: Place, high: Place) -> Shell:
    """A box as a shell."""
    ends = np.array([low, high], dtype=float)
    corner = {at: np.array([ends[at >> axis & 1, axis] for axis in range(3)]) for at in range(8)}
    faces = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    halves = [(a, b, c) for a, b, c, _ in faces] + [(a, c, d) for a, _, c, d in faces]
    return Shell(np.array([[corner[at] for at in half] for half in halves]), float(np.prod(ends[1] - ends[0])))


@dataclass(frozen=True)
class Sheet:
    """A part of a surface, or a crack, as triangles."""

    triangles: NDArray[np.float64]  # (t, 3, 3) m

    @property
    def areas(self) -> NDArray[np.float64]:
        """The area (t,) of each triangle, m^2; 0 for a degenerate triangle."""
        a, b, c = self.triangles.transpose(1, 0, 2)
        twice = np.sqrt((np.cross(b - a, c - a) ** 2).sum(axis=1))
        longest = np.max([((p - q) ** 2).sum(axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
        return np.asarray(np.where(twice > ROUND_OFF * longest, twice / 2, 0.0))

    @property
    def area(self) -> float:
        """Total area of the triangles, m^2."""
        return float(self.areas.sum())


def name_of(where: object) -> str:
    """Default name of a condition or region: its side, or the shape and position of its place, m."""
    ends: tuple[Place, ...] = ()
    match where:
        case str():
            return where
        case Box(low, high) | Cylinder(low, high):
            ends = (low, high)
        case Sphere(centre):
            ends = (centre,)
        case Sheet(triangles) | Shell(triangles):
            corners = triangles.reshape(-1, 3)
            ends = (corners.min(axis=0), corners.max(axis=0)) if len(corners) else ()
        case shapely.Point():
            return f"node at ({', '.join(f'{value:g}' for value in where.coords[0])}) m"
    what = "solid" if isinstance(where, Shell | Joined) else type(where).__name__.lower()
    try:
        middle = np.mean(ends, axis=0) if ends else ()
        return what + (f" at ({', '.join(f'{value:g}' for value in middle)}) m" if len(middle) == 3 else "")
    except (TypeError, ValueError):  # no numbers: is said where it is looked at
        return what


def checked(solid: object, place: str) -> Solid:
    """A solid with valid numbers. Raises SceneError, beginning with `place`."""
    if isinstance(solid, Joined):
        checked(solid.first, place)
        checked(solid.second, place)
        return solid
    if not isinstance(solid, Solid):
        raise SceneError(f"{place} is {solid!r:.80}; use a solid: Box, Cylinder, Sphere, or some of them")
    for name, value in vars(solid).items():
        if isinstance(solid, Shell):
            continue
        numbers = np.atleast_1d(np.asarray(0.0 if value is None else value, dtype=float))
        if not np.isfinite(numbers).all() or np.abs(numbers).max() > LARGEST:
            raise SceneError(f"{place}: {name} is {value}; use metres, at most {LARGEST:g}")
        if "radius" in name and value is not None and not (value > 0 or (name == "end_radius" and value == 0)):
            raise SceneError(f"{place}: {name} is {value:g} m; use more than 0 m")
        if "radius" not in name and numbers.shape != (3,):
            raise SceneError(f"{place}: {name} is {value}; use a place (x, y, z) in metres")
    if isinstance(solid, Box) and not (np.asarray(solid.high) > np.asarray(solid.low)).all():
        raise SceneError(f"{place} is {solid}; put its high corner beyond the low one along x, y and z")
    if isinstance(solid, Cylinder) and solid.start == solid.end:
        raise SceneError(f"{place} is {solid}; use two ends apart")
    return solid
