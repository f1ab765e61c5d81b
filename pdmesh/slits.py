"""Cracks as they are in the plate. An end that overshoots the edge is cut off there; one that misses it by no more than
the chords of a curved edge are off is put onto it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely import LineString

from pdmesh.shapes import CHORD_TOLERANCE, SceneError, Surface

if TYPE_CHECKING:
    from pdmesh.scene import Crack, Scene

EDGE = 1e-6  # finest spacings: what counts as on the edge
OVERSHOOT = 0.25  # of its length: how much of a crack may be outside at an end
MISSED = 2 * CHORD_TOLERANCE  # coarsest spacings: how far an end inside may be from the edge that it was drawn to
ALONG = 1.0  # coarsest spacings that a crack may stay as near as that to an edge


class Slit(NamedTuple):
    """A crack in the plate, and what was done to its ends."""

    name: str
    line: LineString
    notes: tuple[str, ...]


def slits_of(scene: Scene) -> tuple[Slit, ...]:
    """The cracks of the scene as they are in its plate. Raises SceneError for one outside, or along an edge."""
    if not scene.cracks:
        return ()
    inside, edge = scene.shape.buffer(EDGE * scene.finest, join_style="mitre"), scene.shape.boundary
    shapely.prepare([inside, edge])
    lines = np.array([crack.line for crack in scene.cracks])
    clear = shapely.covers(inside, lines) & ~shapely.dwithin(edge, lines, MISSED * scene.spacing)
    beside = edge if clear.all() else edge.buffer(MISSED * scene.spacing)
    return tuple(
        Slit(crack.name, crack.line, ()) if free else _slit(crack, scene, inside, beside)
        for crack, free in zip(scene.cracks, clear.tolist(), strict=True)
    )


def _slit(crack: Crack, scene: Scene, inside: Surface, beside: Surface) -> Slit:
    """The slit of a crack with an end outside the plate or, in what is `beside` its edge, near to it."""
    edge, on, missed = scene.shape.boundary, EDGE * scene.finest, MISSED * scene.spacing
    line = shapely.remove_repeated_points(crack.line)
    along = max(shapely.get_parts(line.intersection(beside)), key=lambda part: float(part.length), default=line)
    if along.length > min(ALONG * scene.spacing, line.length / 2):
        (x0, y0), (x1, y1) = shapely.get_coordinates(along)[[0, -1]]
        raise SceneError(
            f"crack '{crack.name}': found along the plate's edge from ({x0:g}, {y0:g}) to ({x1:g}, {y1:g}) m,"
            " expected inside the plate"
        )
    points = shapely.get_coordinates(line if inside.covers(line) else _trimmed(crack, scene, inside))
    for end, before in ((0, 1), (-1, -2)):
        if on < edge.distance(shapely.Point(points[end])) <= missed:
            points[end] = _on_edge(points[end], points[before], edge, missed)
    return Slit(crack.name, LineString(points), _notes(crack, points, on))


def _notes(crack: Crack, points: NDArray[np.float64], slack: float) -> tuple[str, ...]:
    drawn = shapely.get_coordinates(crack.line)
    return tuple(
        f"crack '{crack.name}': its end at ({drawn[end][0]:.7g}, {drawn[end][1]:.7g}) m is put onto the plate's edge,"
        f" at ({points[end][0]:.7g}, {points[end][1]:.7g}) m"
        for end in (0, -1)
        if np.hypot(*(points[end] - drawn[end])) > slack
    )


def _trimmed(crack: Crack, scene: Scene, inside: Surface) -> LineString:
    """The crack without its ends outside. Raises SceneError if more than those are."""
    line, longest = crack.line, OVERSHOOT * crack.line.length
    ends = shapely.points(shapely.get_coordinates(line)[[0, -1]])
    kept = [part for part in shapely.get_parts(line.intersection(scene.shape)) if part.length > 0]
    for part in shapely.get_parts(line.difference(inside)):
        if part.length > longest or shapely.distance(part, ends).min() > 0 or len(kept) != 1:
            x, y = shapely.get_coordinates(part)[-1]
            raise SceneError(
                f"crack '{crack.name}': found ({x:g}, {y:g}) m outside the plate, expected all of it inside, but for"
                f" ends of at most {longest:g} m"
            )
    return kept[0]


def _on_edge(end: Any, before: Any, edge: shapely.Geometry, missed: float) -> Any:
    """The place of the edge (2,), m, that the end of a crack is to be moved to: straight on, or the nearest."""
    ahead = LineString([end, end + 2 * missed * (end - before) / np.hypot(*(end - before))]).intersection(edge)
    return shapely.get_coordinates(shapely.shortest_line(shapely.Point(end), edge if ahead.is_empty else ahead))[-1]
