"""Plane shapes for outlines, holes, cracks and places. Lengths in metres."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString, MultiLineString, MultiPolygon, Polygon

from pdmesh.model.base_structs import PlainFields, plain
from pdmesh.model.document import LARGEST

NOTHING = 1e-100  # m
MOST_CHORDS = 2**16  # of a quarter circle
CHORD_TOLERANCE = 0.01  # of the local spacing: how far a chord may be off its curve
ROUND = 16  # segments a quarter circle of a grown shape has
CIRCUMSCRIBED = 1 / np.cos(np.pi / (4 * ROUND))  # such a shape, made to contain the true one

Points: TypeAlias = Sequence[tuple[float, float]]
Surface: TypeAlias = Polygon | MultiPolygon
Curve: TypeAlias = LineString | MultiLineString


class SceneError(ValueError):
    """An invalid scene; the message names the place, what was found and what was expected."""


class UntrustedError(SceneError):
    """A program in place of a scene, without permission to run it; it was not run."""


@contextmanager
def errors_at(place: object) -> Iterator[None]:
    """A context whose SceneErrors begin with a place, such as the file that is read."""
    try:
        yield
    except SceneError as error:
        raise SceneError(f"{place}: {error}") from None


@dataclass(frozen=True)
class Circle(PlainFields):
    """A disc; its chords adapt to the spacing of the nodes around it."""

    x: float
    y: float
    radius: float  # m

    def polygon(self, spacing: float) -> Polygon:
        """The disc as a polygon whose chords deviate by at most CHORD_TOLERANCE of `spacing`, m."""
        sagitta = float(np.clip(CHORD_TOLERANCE * spacing / self.radius, 1e-15, 0.25))
        quarter = min(max(int(np.ceil(np.pi / 4 / np.arccos(1 - sagitta))), 4), MOST_CHORDS)
        return shapely.Point(self.x, self.y).buffer(self.radius, quad_segs=quarter)


Shape: TypeAlias = Polygon | MultiPolygon | Circle | Points


def surface(shape: Shape, spacing: float, place: str) -> Surface:
    """The shape as a polygon. Raises SceneError, beginning with `place`."""
    if isinstance(shape, Circle):
        x, y, radius = _checked(np.array([shape.x, shape.y, shape.radius], dtype=float), place).tolist()
        if not radius > 0:
            raise SceneError(f"{place} is {shape}; use a positive radius")
        return Circle(x, y, radius).polygon(checked_spacing(spacing, place))
    if not isinstance(shape, Polygon | MultiPolygon):
        points = coordinates(shape, 3, place)
        shape = Polygon(points)
    shape = shapely.transform(shape, lambda points: _checked(points, place))
    if not shape.is_valid:
        raise SceneError(f"{place}: {shapely.is_valid_reason(shape)}; use an outline that does not cross itself")
    if shape.is_empty or not shape.area > 0:
        raise SceneError(f"{place} has an area of {shape.area:g} m^2; use a shape with an inside")
    return shape


def polyline(points: Curve | Points, place: str) -> Curve:
    """The points as a polyline. Raises SceneError."""
    line = points if isinstance(points, LineString | MultiLineString) else LineString(coordinates(points, 2, place))
    line = shapely.transform(line, lambda points: _checked(points, place))
    if not line.length > 0:
        raise SceneError(f"{place} has a length of {line.length:g} m; use more than 0")
    return line


def coordinates(points: Iterable[Sequence[float]], least: int, place: str) -> NDArray[np.float64]:
    """At least `least` points as an array (n, 2). Raises SceneError."""
    try:
        array = np.array([(float(x), float(y)) for x, y in points]).reshape(-1, 2)
    except (TypeError, ValueError):
        raise SceneError(f"{place} is {points!r:.80}; use a list of points (x, y) in metres") from None
    _checked(array, place)
    if len(array) < least:
        raise SceneError(f"{place} has {len(array)} points; use at least {least}")
    return array


def _checked(numbers: NDArray[np.float64], place: str) -> NDArray[np.float64]:
    """Coordinates in the allowed range, with negligible ones set to 0. Raises SceneError."""
    if not np.isfinite(numbers).all():
        raise SceneError(f"{place} has a coordinate that is not finite; use metres")
    largest = float(np.abs(numbers).max(initial=0.0))
    if largest > LARGEST:
        raise SceneError(f"{place} has a coordinate of {largest:g}; use metres, at most {LARGEST:g}")
    return np.where(np.abs(numbers) < NOTHING, 0.0, numbers)


def checked_spacing(value: float, place: str) -> float:
    """A positive and finite length, m. Raises SceneError."""
    number = plain(value)
    if not isinstance(number, float | int) or not 0 < number < np.inf:
        raise SceneError(f"{place} is {number!r}; use more than 0 m")
    return number


def parts(shape: shapely.Geometry) -> tuple[Polygon, ...]:
    """The polygons of a geometry."""
    return tuple(part for part in shapely.get_parts(shape) if isinstance(part, Polygon))


def grown(shape: shapely.Geometry, reach: float) -> Surface:
    """All points within `reach` (m) of the shape, with a small margin."""
    return shape.buffer(reach * CIRCUMSCRIBED, quad_segs=ROUND)


def concave_points(shape: Surface) -> NDArray[np.float64]:
    """The points (k, 2), m, at which the exterior of the shape turns inwards: notch roots, re-entrant corners."""
    points = [np.empty((0, 2))]
    for part in parts(shape):
        ring = shapely.get_coordinates(shapely.geometry.polygon.orient(part).exterior)[:-1]
        before, after = ring - np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0) - ring
        turn = before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]
        points.append(ring[turn < -1e-6 * np.hypot(*before.T) * np.hypot(*after.T)])
    return np.concatenate(points)


def near(
    points: NDArray[np.float64], geometry: shapely.Geometry, reach: float | NDArray[np.float64]
) -> NDArray[np.bool_]:
    """Mask (n,) of points (n, 2) within `reach`, a number or (n,), of the geometry; all in m."""
    close = np.zeros(len(points), dtype=bool)
    if geometry.is_empty or not len(points):
        return close
    reach = np.broadcast_to(np.asarray(reach, dtype=np.float64), close.shape)
    low, high = np.reshape(geometry.bounds, (2, 2))
    candidates = np.flatnonzero(((points >= low - reach[:, None]) & (points <= high + reach[:, None])).all(axis=1))
    shapely.prepare(geometry)
    close[candidates] = shapely.dwithin(geometry, shapely.points(points[candidates]), reach[candidates])
    return close
