"""Cracks fitted to the plate: an end beyond the edge is trimmed, an end that misses a curved edge is moved onto it.

The end may miss the edge by at most the deviation of its chords.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from shapely import LineString

from pdmesh.scene.shapes import CHORD_TOLERANCE, SceneError, Surface

EDGE = 1e-6  # finest spacings: what counts as on the edge
OVERSHOOT = 0.25  # of its length: how much of a crack may be outside at an end
MISSED = 2 * CHORD_TOLERANCE  # coarsest spacings: how far an end inside may be from the edge that it was drawn to
ALONG = 1.0  # coarsest spacings that a crack may stay as near as that to an edge


@dataclass(frozen=True)
class Crack:
    """A pre-crack as drawn: a polyline that no bond may cross. `Scene.slits` holds it fitted to the plate."""

    name: str
    line: LineString


class Slit(NamedTuple):
    """A crack in the plate, and the changes to its ends."""

    name: str
    line: LineString
    notes: tuple[str, ...]


class _Around(NamedTuple):
    """The surroundings of a crack."""

    plate: Surface
    inside: Surface  # the plate and its edge, a little beyond
    near_edge: shapely.Geometry  # what is near to its edge
    coarsest: float  # spacing, m
    finest: float  # m


def slits_of(cracks: Sequence[Crack], plate: Surface, coarsest: float, finest: float) -> tuple[Slit, ...]:
    """The cracks fitted to a plate with these spacings, m. Raises SceneError for one outside, or along an edge."""
    if not cracks:
        return ()
    inside, edge = plate.buffer(EDGE * finest, join_style="mitre"), plate.boundary
    shapely.prepare([inside, edge])
    lines = np.array([crack.line for crack in cracks])
    clear = shapely.covers(inside, lines) & ~shapely.dwithin(edge, lines, MISSED * coarsest)
    around = _Around(plate, inside, edge if clear.all() else edge.buffer(MISSED * coarsest), coarsest, finest)
    return tuple(
        Slit(crack.name, crack.line, ()) if free else _slit(crack, around)
        for crack, free in zip(cracks, clear.tolist(), strict=True)
    )


def _slit(crack: Crack, around: _Around) -> Slit:
    """The slit of a crack with an end outside the plate or near its edge."""
    edge, on, missed = around.plate.boundary, EDGE * around.finest, MISSED * around.coarsest
    line = shapely.remove_repeated_points(crack.line)
    along = max(
        shapely.get_parts(line.intersection(around.near_edge)), key=lambda part: float(part.length), default=line
    )
    if along.length > min(ALONG * around.coarsest, line.length / 2):
        (x0, y0), (x1, y1) = shapely.get_coordinates(along)[[0, -1]]
        raise SceneError(
            f"crack '{crack.name}' runs along the plate's edge from ({x0:g}, {y0:g}) to ({x1:g}, {y1:g}) m; put it"
            " inside the plate"
        )
    if not around.inside.covers(line):  # no more than its ends may be outside
        longest, ends = OVERSHOOT * crack.line.length, shapely.points(shapely.get_coordinates(crack.line)[[0, -1]])
        inside_parts = [part for part in shapely.get_parts(crack.line.intersection(around.plate)) if part.length > 0]
        for part in shapely.get_parts(crack.line.difference(around.inside)):
            if part.length > longest or shapely.distance(part, ends).min() > 0 or len(inside_parts) != 1:
                x, y = shapely.get_coordinates(part)[-1]
                allowed = f", but for ends of at most {longest:g} m" if inside_parts else ""
                raise SceneError(
                    f"crack '{crack.name}' is at ({x:g}, {y:g}) m outside the plate; put all of it inside{allowed}"
                )
        line = inside_parts[0]
    points = shapely.get_coordinates(line)
    for end, before in ((0, 1), (-1, -2)):
        if on < edge.distance(shapely.Point(points[end])) <= missed:
            way = points[end] - points[before]  # straight ahead, else to the nearest place
            ahead = LineString([points[end], points[end] + 2 * missed * way / np.hypot(*way)]).intersection(edge)
            nearest = shapely.shortest_line(shapely.Point(points[end]), edge if ahead.is_empty else ahead)
            points[end] = shapely.get_coordinates(nearest)[-1]
    drawn = shapely.get_coordinates(crack.line)
    notes = tuple(
        f"crack '{crack.name}': its end at ({drawn[end][0]:.7g}, {drawn[end][1]:.7g}) m is put onto the plate's edge,"
        f" at ({points[end][0]:.7g}, {points[end][1]:.7g}) m"
        for end in (0, -1)
        if np.hypot(*(points[end] - drawn[end])) > on
    )
    return Slit(crack.name, LineString(points), notes)
