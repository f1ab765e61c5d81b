"""What makes a model impossible or doubtful, found before it is solved; and what a run must not do unnoticed.

Impossible is a ModelError, doubtful a ModelWarning; each says where, what was found and what was expected.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from itertools import combinations
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.continuum import critical_stretch
from pdmesh.model.document import MOST
from pdmesh.model.full_lattice import lattice_ratios
from pdmesh.model.neighbours import ROUND_OFF, Neighbours, row_chunks
from pdmesh.model.trees import tree_of
from pdmesh.model.triangles import distances
from pdsolve.laws.critical import limits
from pdsolve.model import Model, ModelError, ModelWarning
from pdsolve.state import Broken

LEAST = 1e-30  # of a material's numbers, likewise
SAME = 1e-6  # spacings: nodes this near are at one place but for round-off
CLOSE = 0.1  # spacings: nodes this near make the stable step tiny
JUMP = 2.5  # spacing of a node over that of the nearest: more than the 2 that zones are graded by
ON = 1e-6  # spacings: a crack this near a node passes through it
AROUND = 4  # nodes next to a node, of which two and the node are a triangle to look at
TOGETHER = 1000  # nodes whose bonds are asked for at once
FLAT = 0.1  # of a spacing squared: neighbours that span less are in line with the node
AROUND_ONE = 1.5  # spacings: nearly every node has another this near
FRACTION = 0.005  # of what breaks a bond: displacements must be known to that, as errors add up over steps
LOST = 0.1  # of the energy put in: a symmetric operator that loses more is not being integrated


class Nearest(NamedTuple):
    """The nearest other node of each node (n,)."""

    row: NDArray[np.int64]
    distance: NDArray[np.float64]  # m; infinite where there is no other


def nearest(model: Model) -> Nearest:
    """Who is nearest to whom."""
    position, delta = model.grid.position, model.grid.delta
    found = Nearest(np.zeros(len(position), dtype=np.int64), np.full(len(position), np.inf))
    around = Neighbours(position, delta, AROUND_ONE * delta)
    for rows in row_chunks(len(position)):
        pairs = around.pairs(rows)
        order = np.lexsort((pairs.length, pairs.source))
        row, at = np.unique(pairs.source[order], return_index=True)
        found.row[row], found.distance[row] = pairs.target[order[at]], pairs.length[order[at]]
    lonely = np.flatnonzero(np.isinf(found.distance))
    if len(lonely) and len(position) > 1:
        distance, near = tree_of(position).query(position[lonely], 2)
        found.row[lonely], found.distance[lonely] = near[:, 1], distance[:, 1]
    return found


def refuse(model: Model, partial_cells: bool) -> None:
    """Raises ModelError for a model that has no stiffness, or numbers that nothing can be computed with.

    `partial_cells` says whether the family reaches half a spacing beyond the horizon.
    """
    if model.grid.dimension == 3:
        _refuse_of_plates(model)
    for number, material in enumerate(model.materials):
        place = model.place_of(number)
        for name in ("E", "rho", "G0"):
            value = getattr(material, name)
            if value < LEAST:
                raise ModelError(f"{place}.{name}: found {value:g}, expected {LEAST:g} to {MOST:g} in SI units")
        ratio = model.settings.horizon.ratio
        if not lattice_ratios(ratio, material.micromodulus, material.plane, partial_cells).c11 > ROUND_OFF:
            raise ModelError(
                f"{model.name}: $.horizon.ratio: found {ratio:g}, where bonds of a {material.micromodulus}"
                " micromodulus have no stiffness, expected more than 1 (3 is usual)"
            )


def _refuse_of_plates(model: Model) -> None:
    """Raises ModelError for what only plates can have."""
    if model.settings.run.adapt != "none":
        raise ModelError(
            f"{model.name}: $.run.adapt: found '{model.settings.run.adapt}', expected none in a body in space"
        )
    if model.settings.area_rule == "eq19":
        raise ModelError(f"{model.name}: $.area_rule: found 'eq19', expected cells or square in a body in space")
    for number, material in enumerate(model.materials):
        if material.model == "micropolar":
            raise ModelError(f"{model.place_of(number)}.model: found 'micropolar', expected another in a body in space")


def advise(model: Model, bonds: NDArray[np.int64], partial_cells: bool, symmetric: bool) -> None:
    """Warns of what can be solved but will hardly be what was meant.

    `bonds` (n,) are those each node has, the other two as in `refuse` and `closing`. Raises ModelError for nodes at one
    place.
    """
    stiffest, softest = (extreme(material.E for material in model.materials) for extreme in (max, min))
    if stiffest > softest and not symmetric:
        _warn(
            model,
            f"$.regions: found E from {softest:g} to {stiffest:g} Pa, expected one E in the thesis mode: a bond has the"
            " constants of its own node there, and carries no stress from one material to the other",
        )
    found = nearest(model)
    _digits(model)
    _places(model, found)
    through = _cracks(model)
    _lonely(model, (bonds == 0) & ~through)
    _shapes(model)
    _probes(model)
    ratio = model.settings.horizon.ratio
    for material in model.materials:
        if not lattice_ratios(ratio, material.micromodulus, material.plane, partial_cells).c66 > ROUND_OFF:
            _warn(
                model,
                f"$.horizon.ratio: found {ratio:g}, where only the four nearest nodes pull and nothing resists shear,"
                " expected 1.5 or more (3 is usual)",
            )
            return


def _warn(model: Model, message: str) -> None:
    warnings.warn(f"{model.name}: {message}", ModelWarning, stacklevel=2)


def _named(model: Model, row: int) -> str:
    place = ", ".join(f"{value:.6g}" for value in model.grid.position[row])
    return f"node {model.grid.ids[row]} at ({place}) m"


def _digits(model: Model) -> None:
    """Plates so far from the origin that round-off decides who is within whose horizon."""
    farthest, least = float(np.abs(model.grid.position).max()), float(model.horizons.min())
    known = float(np.spacing(farthest))
    needed = ROUND_OFF * least / 4  # both ends of a bond, up and down
    if known > needed:
        _warn(
            model,
            f"$.nodes: found coordinates up to {farthest:.3g} m, known to {known:.2g} m, expected {needed:.2g} m or"
            f" better for horizons of {least:.3g} m; round-off decides who sees whom, move the plate to the origin",
        )


def _places(model: Model, found: Nearest) -> None:
    """Nodes too near to each other, and spacings that jump."""
    grid = model.grid
    near = found.distance / np.minimum(grid.delta, grid.delta[found.row])
    row = int(near.argmin())
    pair = f"{_named(model, row)} and {_named(model, int(found.row[row]))}"
    if near[row] < SAME:
        raise ModelError(
            f"{model.name}: $.nodes: found {pair}, {found.distance[row]:.3g} m apart, which is the same place but"
            " for round-off, expected them apart"
        )
    if near[row] < CLOSE:
        _warn(
            model,
            f"$.nodes: found {pair}, {near[row]:.2g} spacings apart, expected about one; so stiff a bond makes the"
            " stable time step small",
        )
    jump = np.where(np.isfinite(found.distance), grid.delta / grid.delta[found.row], 1.0)
    jump = np.maximum(jump, 1 / jump)
    row = int(jump.argmax())
    if jump[row] > JUMP:
        _warn(
            model,
            f"$.nodes: found spacings of {grid.delta[row]:g} and {grid.delta[found.row[row]]:g} m next to each other,"
            f" {_named(model, row)}, expected steps of at most 2 (pdmesh grades zones so); the jump reflects waves",
        )


def _cracks(model: Model) -> NDArray[np.bool_]:
    """Which nodes (n,) a pre-crack passes through."""
    grid = model.grid
    hit = np.zeros(len(grid), dtype=bool)
    if grid.dimension == 3:
        return _faces(model)
    segments = grid.cracks.reshape(-1, 2, 2)
    if not len(segments):
        return hit
    import shapely  # here, as a plate without cracks needs none

    cracks, reach = shapely.multilinestrings(segments), ON * float(grid.delta.max())
    shapely.prepare(cracks)
    rows = np.flatnonzero(shapely.dwithin(cracks, shapely.points(grid.position), reach))
    points, spacing = shapely.points(grid.position[rows]), grid.delta[rows]
    for number, segment in enumerate(segments):
        on = rows[shapely.distance(points, shapely.linestrings(segment)) < ON * spacing]
        if len(on):
            _warn(
                model,
                f"$.notch[{number}]: found through {len(on)} nodes, the first {_named(model, int(on[0]))}, expected"
                " between nodes (pdmesh shifts its lattice); all bonds of such a node are cut, or those to one side by"
                " round-off",
            )
        hit[on] = True
    return hit


def _faces(model: Model) -> NDArray[np.bool_]:
    """Which nodes (n,) of a body a pre-crack passes through."""
    grid, triangles = model.grid, model.grid.cracks.reshape(-1, 3, 3)
    hit = np.zeros(len(grid), dtype=bool)
    if len(triangles):
        hit = distances(grid.position, triangles, ON * float(grid.delta.max())) < ON * grid.delta
    if hit.any():
        _warn(
            model,
            f"$.notch: found through {hit.sum()} nodes, the first {_named(model, int(hit.argmax()))}, expected between"
            " nodes; all bonds of such a node are cut",
        )
    return hit


def _probes(model: Model) -> None:
    """Places to be watched that are not on the plate."""
    grid = model.grid
    places = np.reshape(model.settings.run.probes, (-1, grid.dimension))
    if not len(places):
        return
    away, row = tree_of(grid.position).query(places)
    for number in np.flatnonzero(away > grid.delta[row]).tolist():
        place = ", ".join(f"{value:g}" for value in places[number])
        _warn(
            model,
            f"$.run.probes[{number}]: found ({place}) m, off the plate; the nearest node is watched,"
            f" {_named(model, int(row[number]))}",
        )


def _lonely(model: Model, lonely: NDArray[np.bool_]) -> None:
    if lonely.any():
        _warn(
            model,
            f"$.nodes: found {lonely.sum()} without a bond, the first {_named(model, int(lonely.argmax()))}, expected"
            " neighbours within the horizon, inside the plate; nothing holds such a node back",
        )


def _shapes(model: Model) -> None:
    """Plates that are too small to be one."""
    position, widest = model.grid.position, float(model.horizons.max())
    extent = float(np.ptp(position, axis=0).max() + model.grid.delta.max())
    if len(position) < 3:
        return
    if widest > extent / 2 * (1 + ROUND_OFF):
        _warn(
            model,
            f"$.horizon: found {widest:g} m in a plate of {extent:g} m, expected less than half of it; every node is a"
            " surface node, and the plate too stiff",
        )
    middle = position - position.mean(axis=0)
    if np.sqrt(np.linalg.eigvalsh(middle.T @ middle)[0].clip(min=0)) < ON * extent:
        one, more = ("row", "rows") if model.grid.dimension == 2 else ("layer", "layers")
        _warn(
            model,
            f"$.nodes: found all {len(position)} in one {one}, expected several {more}; bonds along a {one} do not"
            " resist motion across it",
        )


class Watch:
    """Looks at the motion of a run now and then; says each thing once."""

    def __init__(self, model: Model, bonds: Callable[[int, int], tuple[NDArray[np.int64], NDArray[np.int64]]]) -> None:
        """`bonds(first, last)` are the rows of the ends of bonds at the start, of the sources `first` to `last` - 1."""
        self._model, self._said, self._vague = model, False, False
        self._bonds = bonds
        self._triangles: _Triangles | None = None  # not asked for while displacements are small
        self._smallest = float(model.grid.delta.min())
        breaking = np.full(len(model.grid), np.inf)
        for number, material in enumerate(model.materials):
            own = model.material_of == number
            stretch = limits(material, critical_stretch(material, model.horizons[own])).peak
            breaking[own] = stretch * model.grid.delta[own]
        self._breaking = float(breaking.min())  # m, lengthening that breaks or softens a bond

    def moved_to(self, other: Watch) -> Watch:
        """`other`, which says nothing again that this one has said."""
        other._said, other._vague = self._said, self._vague
        return other

    def look(self, u: NDArray[np.floating], broken: Broken, step: int) -> None:
        """Warns of bonds turned inside out, and of displacements too large for their digits.

        `u` (n, d) are the displacements, m; `broken` are all bonds that are. Of bodies in space only the digits are
        looked at.
        """
        flat = self._model.grid.dimension == 2
        if flat and not self._said and np.ptp(u, axis=0).max() >= self._smallest:
            self._crushed(u, broken, step)
        known = float(np.finfo(u.dtype).eps * np.abs(u).max(initial=0.0))
        if not self._vague and known > FRACTION * self._breaking:
            self._vague = True
            _warn(
                self._model,
                f"step {step}: found displacements up to {np.abs(u).max():.3g} m, which {u.dtype} knows"
                f" to {known:.2g} m, expected {FRACTION * self._breaking:.2g} m or better: {self._breaking:.2g} m break"
                " a bond",
            )

    def _crushed(self, u: NDArray[np.floating], broken: Broken, step: int) -> None:
        position = self._model.grid.position
        if self._triangles is None:
            self._triangles = _triangles(position, FLAT * self._smallest**2)
        rows, one, other, before = self._triangles
        place = position + u
        now = _cross(place[one] - place[rows], place[other] - place[rows])
        turned = np.flatnonzero(before * now <= 0)
        near = np.zeros(len(position), dtype=bool)
        near[rows[turned]] = True
        gone = (len(position) * broken.source + broken.target)[near[broken.source]]
        for end in (one, other):
            turned = turned[~np.isin(len(position) * rows[turned] + end[turned], gone, assume_unique=True)]
        if len(turned := self._bonded(turned)):
            self._said = True
            names = ", ".join(_named(self._model, int(corner[turned[0]])) for corner in (rows, one, other))
            _warn(
                self._model,
                f"step {step}: found a triangle turned inside out with its bonds intact, {names}, expected less"
                " compression; bonds do not keep nodes apart",
            )

    def _bonded(self, turned: NDArray[np.int64]) -> NDArray[np.int64]:
        """Those of some triangles whose nodes were bonded at the start; the others are forgotten."""
        assert self._triangles is not None
        rows, one, other, before = self._triangles
        nodes, kept = len(self._model.grid), np.zeros_like(turned, dtype=bool)
        for part in np.unique(rows[turned] // TOGETHER).tolist():
            here = np.flatnonzero(rows[turned] // TOGETHER == part)
            source, target = self._bonds(part * TOGETHER, min((part + 1) * TOGETHER, nodes))
            keys, some = nodes * source + target, turned[here]
            bonded = [np.isin(nodes * rows[some] + end[some], keys, assume_unique=True) for end in (one, other)]
            kept[here] = bonded[0] & bonded[1]
        before[turned[~kept]] = np.nan
        return np.asarray(turned[kept])


class _Triangles(NamedTuple):
    """A node and two of its nearest, of each node that has two which are not in line with it; t of them."""

    row: NDArray[np.int64]  # (t,)
    one: NDArray[np.int64]  # (t,)
    other: NDArray[np.int64]  # (t,)
    twice: NDArray[np.float64]  # (t,) twice its area, m^2, with the sign of its sense


def _triangles(position: NDArray[np.float64], flat: float) -> _Triangles:
    """The largest triangle of each node, if it is larger than `flat` (m^2) doubled."""
    near = tree_of(position).query(position, min(AROUND + 1, len(position)))[1][:, 1:]
    one, other = np.zeros((2, len(position)), dtype=np.int64)
    twice = np.zeros(len(position))
    for first, second in combinations(near.T, 2):
        here = _cross(position[first] - position, position[second] - position)
        larger = np.abs(here) > np.abs(twice) * (1 + ROUND_OFF)
        one[larger], other[larger], twice[larger] = first[larger], second[larger], here[larger]
    rows = np.flatnonzero(np.abs(twice) >= flat)
    return _Triangles(rows, one[rows], other[rows], twice[rows])


def _cross(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def closing(model: Model, balance: float, spent: float, symmetric: bool) -> None:
    """Warns at the end of a run whose energy does not add up though its operator is `symmetric`.

    `balance` is that of the last ledger; `spent`, J/m, went into softening and breaking bonds, and into damping.
    """
    if spent < 0:
        _warn(
            model,
            f"found {spent:.3g} J/m spent on breaking bonds, expected no less than 0: bonds went from pressed to broken"
            " within a step, as where a plate is crushed; a smaller time step resolves it",
        )
    if symmetric and abs(balance) > LOST:
        _warn(
            model,
            f"the balance of energy is off by {balance:+.2g} of what was put in, expected {LOST:g} at most; look at"
            " the time step, and at what is held or loaded too suddenly",
        )
