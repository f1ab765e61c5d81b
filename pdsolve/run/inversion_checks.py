"""Checks of the motion during a run: inverted triangles of nodes, and loss of digits in displacements."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.kd_trees import tree_of
from pdmesh.model.material_constants import critical_stretch
from pdmesh.model.neighbours import ROUND_OFF
from pdsolve.checks import named, warn
from pdsolve.laws import limits
from pdsolve.laws.bond_limits import Sizes
from pdsolve.model import Model
from pdsolve.state import Broken

AROUND = 4  # nodes next to a node, of which two and the node are a triangle to look at
TOGETHER = 1000  # nodes whose bonds are asked for at once
PART = 2**16  # nodes or triangles that are looked at together
LINES = 2  # of a lattice: nodes on it may be that far from those beside them
ON_LATTICE = 1e-6  # spacings: nodes this near to a lattice are on it
FLAT = 0.1  # of a spacing squared: neighbours that span less are in line with the node
FRACTION = 0.005  # of what breaks a bond: displacements must be known to that, as errors add up over steps


class Extent(NamedTuple):
    """The least and the largest displacement along each axis, m, and their number type."""

    least: tuple[float, ...]
    most: tuple[float, ...]
    kind: str


def extent_of(u: NDArray[np.floating]) -> Extent:
    """The extent of displacements (n, d), m."""
    return Extent(tuple(u.min(axis=0).tolist()), tuple(u.max(axis=0).tolist()), u.dtype.name)


class MotionChecks:
    """Checks the motion of a run from time to time; gives each warning once."""

    def __init__(self, model: Model, bonds: Callable[[int, int], tuple[NDArray[np.int64], NDArray[np.int64]]]) -> None:
        """`bonds(first, last)` returns the rows of both ends of the initial bonds of sources `first` to `last` - 1."""
        self._model, self._said, self._vague = model, False, False
        self._bonds, self._own = bonds, slice(None)
        self._triangles: _Triangles | None = None  # not asked for while displacements are small
        self._smallest = float(model.grid.delta.min())
        breaking, ratio = [np.inf], model.settings.horizon.ratio
        for number, material in enumerate(model.materials):
            spacing = np.unique(model.grid.delta[model.material_of == number])
            sizes = Sizes(critical_stretch(material, ratio * spacing), spacing, ratio * spacing, ratio)
            breaking += (limits(material, sizes).peak * spacing).tolist()
        self._breaking = min(breaking)  # m, lengthening that breaks or softens a bond

    def moved_to(self, other: MotionChecks) -> MotionChecks:
        """`other`, with the warnings already given marked as such."""
        other._said, other._vague = self._said, self._vague
        return other

    def look(self, u: NDArray[np.floating], broken: Broken, step: int) -> None:
        """Warn of inverted triangles, and of displacements too large for their precision.

        `u` (n, d) are the displacements, m; `broken` are all broken bonds. For bodies in space, only the precision is
        checked.
        """
        extent = extent_of(u)
        if self.is_crushed(extent) and (words := self.crushed(u, broken)) is not None:
            self.say_crushed(words, step)
        self.say_vague(extent, step)

    @property
    def lengths(self) -> tuple[float, float]:
        """The smallest spacing, and the lengthening that breaks or softens a bond, m."""
        return self._smallest, self._breaking

    def know(self, lengths: Sequence[tuple[float, float]], own: slice) -> None:
        """Take these lengths of all ranks as known, and look at the triangles of `own` rows alone."""
        self._smallest, self._breaking = (min(column) for column in zip(*lengths, strict=True))
        self._own = own

    def is_crushed(self, extent: Extent) -> bool:
        """Whether triangles may be inverted."""
        wide = max(most - least for least, most in zip(extent.least, extent.most, strict=True))
        return self._model.grid.dimension == 2 and not self._said and wide >= self._smallest

    def say_crushed(self, words: str, step: int) -> None:
        """Warn, once, of an inverted triangle in `words`."""
        self._said = True
        warn(
            self._model,
            f"step {step}: found a triangle turned inside out with its bonds intact, {words}, expected less"
            " compression; bonds do not keep nodes apart",
        )

    def say_vague(self, extent: Extent, step: int) -> None:
        """Warn, once, of displacements too large for their precision."""
        largest = max(abs(value) for value in (*extent.least, *extent.most))
        known = float(np.finfo(extent.kind).eps * largest)
        if not self._vague and known > FRACTION * self._breaking:
            self._vague = True
            warn(
                self._model,
                f"step {step}: found displacements up to {largest:.3g} m, which {extent.kind} knows"
                f" to {known:.2g} m, expected {FRACTION * self._breaking:.2g} m or better: {self._breaking:.2g} m break"
                " a bond",
            )

    def crushed(self, u: NDArray[np.floating], broken: Broken) -> str | None:
        """The nodes of an inverted triangle whose bonds are intact, in words; None if there is none."""
        position = self._model.grid.position
        if self._triangles is None:
            found = _triangles(position, FLAT * self._smallest**2)
            low, high, _ = self._own.indices(len(position))
            own = (found.row >= low) & (found.row < high)
            self._triangles = _Triangles(found.row[own], found.one[own], found.other[own], found.twice[own])
        rows, one, other, before = self._triangles
        turned = np.flatnonzero(before * _twice(lambda some: position[some] + u[some], rows, one, other) <= 0)
        near = np.zeros(len(position), dtype=bool)
        near[rows[turned]] = True
        gone = (len(position) * broken.source + broken.target)[near[broken.source]]
        for end in (one, other):
            turned = turned[
                ~np.isin(len(position) * rows[turned].astype(np.int64) + end[turned], gone, assume_unique=True)
            ]
        if len(turned := self._bonded(turned)):
            return ", ".join(named(self._model, int(corner[turned[0]])) for corner in (rows, one, other))
        return None

    def _bonded(self, turned: NDArray[np.int64]) -> NDArray[np.int64]:
        """The triangles whose nodes were bonded at the start."""
        assert self._triangles is not None
        rows, one, other, before = self._triangles
        nodes, kept = len(self._model.grid), np.zeros_like(turned, dtype=bool)
        for part in np.unique(rows[turned] // TOGETHER).tolist():
            here = np.flatnonzero(rows[turned] // TOGETHER == part)
            source, target = self._bonds(part * TOGETHER, min((part + 1) * TOGETHER, nodes))
            keys, some = nodes * source + target, turned[here]
            own = nodes * rows[some].astype(np.int64)
            bonded = [np.isin(own + end[some], keys, assume_unique=True) for end in (one, other)]
            kept[here] = bonded[0] & bonded[1]
        before[turned[~kept]] = np.nan
        return np.asarray(turned[kept])


class _Triangles(NamedTuple):
    """For each node, a triangle with two of its nearest nodes not in line with it; t of them."""

    row: NDArray[np.integer]  # (t,)
    one: NDArray[np.integer]  # (t,)
    other: NDArray[np.integer]  # (t,)
    twice: NDArray[np.float64]  # (t,) twice its area, m^2, with the sign of its sense


def _triangles(position: NDArray[np.float64], flat: float) -> _Triangles:
    """The largest triangle of each node, if twice its area exceeds `flat` (m^2)."""
    arms = _arms(position)
    if arms is not None:
        one, other = arms
        twice = _twice(position.__getitem__, np.arange(len(position), dtype=np.int32), one, other)
    else:
        near = tree_of(position).query(position, min(AROUND + 1, len(position)))[1][:, 1:]
        one, other = np.zeros((2, len(position)), dtype=np.int32)
        twice = np.zeros(len(position))
        for first, second in combinations(near.T, 2):
            here = _cross(position[first] - position, position[second] - position)
            larger = np.abs(here) > np.abs(twice) * (1 + ROUND_OFF)
            one[larger], other[larger], twice[larger] = first[larger], second[larger], here[larger]
    rows = np.flatnonzero(np.abs(twice) >= flat).astype(np.int32)
    return _Triangles(rows, one[rows], other[rows], twice[rows])


def _twice(
    place: Callable[[NDArray[np.integer]], NDArray[np.floating]],
    rows: NDArray[np.integer],
    one: NDArray[np.integer],
    other: NDArray[np.integer],
) -> NDArray[np.float64]:
    """Twice the areas (t,) of triangles, m^2; `place` returns where rows (k,) are (k, 2), m."""
    found = np.zeros(len(rows))
    for first in range(0, len(rows), PART):
        some = slice(first, first + PART)
        here = place(rows[some])
        found[some] = _cross(place(one[some]) - here, place(other[some]) - here)
    return found


def _keys(position: NDArray[np.float64]) -> tuple[NDArray[np.int64], int] | None:
    """Numbers (n,) of nodes on a square lattice, row by row, and the step from a row to the next; None off one."""
    low = position.min(axis=0)
    along = np.diff(position[:, 0])
    spacing = float(along[along > 0].min(initial=np.inf))
    if not np.isfinite(spacing):
        return None
    stride = int(np.rint((position[:, 0].max() - low[0]) / spacing)) + LINES + 1
    key = np.zeros(len(position), dtype=np.int64)
    for first in range(0, len(position), PART):
        place = (position[first : first + PART] - low) / spacing
        whole = np.rint(place)
        if np.abs(place - whole).max() > ON_LATTICE:
            return None
        key[first : first + PART] = whole[:, 1].astype(np.int64) * stride + whole[:, 0].astype(np.int64)
    return None if (np.diff(key) <= 0).any() else (key, stride)


def _arms(position: NDArray[np.float64]) -> tuple[NDArray[np.int32], NDArray[np.int32]] | None:
    """Nodes (n,) beside each one along x and along y, itself where there are none; None off a square lattice.

    Nodes are row by row on a lattice, of which some may be missing; the nearest one within `LINES` spacings counts.
    """
    keys = _keys(position)
    if keys is None:
        return None
    key, stride = keys
    found = np.zeros((2, len(key)), dtype=np.int32)
    for step, arms in zip((1, stride), found, strict=True):
        for first in range(0, len(key), PART):
            nodes = np.arange(first, min(first + PART, len(key)))
            arm = nodes.copy()
            for far in (way * lines * step for lines in range(1, LINES + 1) for way in (1, -1)):
                left = nodes[arm == nodes]
                wanted = key[left] + far
                at = np.minimum(np.searchsorted(key, wanted), len(key) - 1)
                arm[left - first] = np.where(key[at] == wanted, at, left)
            arms[first : first + PART] = arm
    return found[0], found[1]


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
