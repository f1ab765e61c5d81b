"""Edges and pre-cracks of a plate that a pressure acts on, as segments with the material on their left."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, TypeVar

import numpy as np
import shapely
from numpy.typing import NDArray

from pdmesh.model.pressed_faces import Faces
from pdmesh.scene.shapes import Curve, SceneError, Surface


class Named(Protocol):
    """A pre-crack."""

    @property
    def name(self) -> str:
        """The name of the pre-crack, which its parts share."""


C = TypeVar("C", bound=Named)
BESIDE = (
    0.03  # of the finest spacing: where it shows whether there is material beside an edge; more than chords are off
)
CRACK = "crack "  # words that name a pre-crack: "crack NAME"


def faces_of_edge(curve: Curve, plate: Surface, finest: float, place: str) -> Faces:
    """The segments of an edge of a plate. Raises SceneError, beginning with `place`, for one inside the plate."""
    segments = _segments(curve)
    way = segments[:, 2:] - segments[:, :2]
    left = BESIDE * finest * np.column_stack([-way[:, 1], way[:, 0]]) / np.hypot(*way.T)[:, None]
    middle = (segments[:, :2] + segments[:, 2:]) / 2
    shapely.prepare(plate)
    on_left, on_right = (shapely.contains_xy(plate, middle + side) for side in (left, -left))
    for at in np.flatnonzero(on_left == on_right)[:1]:
        where = "inside" if on_left[at] else "away from"
        x, y = middle[at]
        expected = "use an edge, or 'crack NAME' for both faces of a pre-crack"
        raise SceneError(f"{place}: ({x:g}, {y:g}) m is {where} the plate; {expected}")
    return tuple(map(tuple, np.where(on_left[:, None], segments, segments[:, [2, 3, 0, 1]]).tolist()))


def faces_of_crack(line: Curve) -> Faces:
    """The segments of both faces of a pre-crack."""
    segments = _segments(line)
    return tuple(map(tuple, np.concatenate([segments, segments[:, [2, 3, 0, 1]]]).tolist()))


def named_crack(words: str, cracks: Sequence[C], place: str) -> list[C]:
    """The pre-cracks, or parts of one, that words "crack NAME" mean. Raises SceneError, beginning with `place`, if
    there is none."""
    name = words.removeprefix(CRACK).strip()
    of_name = [crack for crack in cracks if crack.name == name]
    if not of_name:
        names = ", ".join(dict.fromkeys(crack.name for crack in cracks)) or "none"
        raise SceneError(f"{place}: there is no crack '{name}'; use one of those there are ({names})")
    return of_name


def _segments(curve: Curve) -> NDArray[np.float64]:
    """The segments (f, 4) of all lines of a curve."""
    lines = [shapely.get_coordinates(line) for line in shapely.get_parts(curve)]
    segments = np.concatenate([np.hstack([line[:-1], line[1:]]) for line in lines])
    return np.asarray(segments[(segments[:, :2] != segments[:, 2:]).any(axis=1)])
