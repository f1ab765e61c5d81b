"""Contact at rest: the pairs of `PenaltyContact`, with normals and weights that stay during one equilibrium.

`see` takes normals, weights and pairs from displacements that are nearly those of the equilibrium; then forces are
piecewise linear and the tangent is exact, so that Newton's method finds which pairs touch in a few iterations. Friction
is a return mapping from the last equilibrium, which `begin` takes over:

    K    k w f, N/m, of a pair     g = r . n     p = max(d - g, 0)     force K p n
    s    slip that was there and what has come along the face since; shorter than mu p, or cut to it; force -K s

The symbols are those of `pdsolve.operators.contact.kernel`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.checkpoint_validation import entry
from pdsolve.model import Model
from pdsolve.operators.contact.contact_widths import Pressed, Width, round_widths
from pdsolve.operators.contact.kernel import PairList, geometry
from pdsolve.operators.contact.operator import SKIN, PenaltyContact
from pdsolve.operators.contact.pair_matrix import pair_matrix
from pdsolve.operators.protocol import CheckpointArrays, Operator
from pdsolve.state import Broken, State

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.float64]

ALL = np.iinfo(np.int64).max  # step before which bonds broke: all that are
TOUCHES = 1e-9  # of the distance of touch: pairs that near count as pressed in the tangent
HOLDS = 0.05  # of it: bodies that near hold each other


class Touch(NamedTuple):
    """What p pairs do at some displacements."""

    depth: Array  # (p,) m, of those that touch above 0
    slip: Array  # (p, d) m, of friction's spring
    cut: Array  # (p,) share of the slip there would be without a limit


class RestingContact(PenaltyContact):
    """Contact of n nodes at rest; see `Operator`.

    Pairs at round surfaces are four times as stiff as in motion, where they bound the step: their own depth would be an
    eighth of that of a contact with a half-width of four spacings, and spread its pressure.
    """

    drawn_in_space = True
    of_round = 4.0

    def __init__(self, model: Model, volume: Array, operator: Operator) -> None:
        """`volume` (n,), m^d; raises ModelError for bodies that overlap, or operators of more than displacements."""
        self._closing: Array | None = None  # (bodies, bodies) m, gap of nodes of bodies that touch as drawn
        super().__init__(model, volume, operator)
        self.symmetric = not self._settings.friction
        if self._joined.drawn.round.any():
            self._bound = self.of_round * self._bound
        self._at = np.zeros((len(volume), model.grid.dimension))  # m, displacements of the last equilibrium
        self.seen = self._at.copy()  # m, those of normals and weights
        self._stiffness, self._normal = np.zeros(0), np.zeros((0, model.grid.dimension))
        self.widths: dict[tuple[int, int], Width] = {}  # of round bodies, under their largest force
        self.see(self._at)
        if self._joined.drawn.round.any():
            # The nearest nodes of round bodies that hold each other touch: they lie beside where the drawing does
            assert self._body is not None
            pairs, drawn_faces = self._pairs, self._joined.drawn
            gap = self._gap(self.seen) - pairs.touch
            near = self._parted(pairs.i, pairs.j) & (drawn_faces.round[pairs.i] | drawn_faces.round[pairs.j])
            near &= (self._stiffness > 0) & (gap < HOLDS * pairs.touch)
            first, second = self._body[pairs.i[near]], self._body[pairs.j[near]]
            bodies = int(self._body.max()) + 1
            least = np.full((bodies, bodies), np.inf)
            np.minimum.at(least, (first, second), gap[near])
            np.minimum.at(least, (second, first), gap[near])
            self._closing = np.where(np.isfinite(least), np.maximum(least, 0.0), 0.0)
            self.see(self._at)

    def _listed(self, i: NDArray[np.int64], j: NDArray[np.int64]) -> PairList:
        """These pairs (p,), at rest."""
        pairs = super()._listed(i, j)
        if self._closing is not None and self._body is not None:
            curved = self._joined.drawn.round[i] | self._joined.drawn.round[j]
            pairs.beyond[:] += np.where(curved, self._closing[self._body[i], self._body[j]], 0.0)
        return pairs

    def begin(self, state: State) -> None:
        """Take this equilibrium over: friction's springs go on from it. Books their heat."""
        if self._settings.friction:
            now = self._touch(state.value)
            drag = -self._stiffness[:, None] * now.slip
            work = ((self._pairs.drag + drag) / 2 * self._along(state.value)).sum(axis=1)
            for end in (self._pairs.i, self._pairs.j):
                self._friction_energy -= np.bincount(end, work / 2, len(self._friction_energy))
            self._pairs.slip[:] = now.slip
        self.measure_widths(state)
        self._at = state.value.astype(np.float64)
        self.see(self._at)
        self._pairs.drag[:] = -self._stiffness[:, None] * self._touch(state.value).slip

    def measure_widths(self, state: State) -> None:
        """Take over the widths of contact of round bodies that are pressed harder than before."""
        if self._body is None:
            return
        force = self._stiffness * self._touch(state.value).depth
        pressed = np.flatnonzero(force > 0)
        i, j, drawn_faces = self._pairs.i[pressed], self._pairs.j[pressed], self._joined.drawn
        place = (self._joined.nodes.x[i] + self._joined.nodes.x[j]) / 2
        first, second = np.sort([self._body[i], self._body[j]], axis=0)
        curved = drawn_faces.round[i] | drawn_faces.round[j]
        widths = round_widths(Pressed(place, force[pressed], self._pairs.h[pressed], first, second, curved))
        for pair, width in widths.items():
            if pair not in self.widths or width.force > self.widths[pair].force:
                self.widths[pair] = width

    def moved(self, value: NDArray[Any]) -> float:
        """The farthest that a surface node has come since the last look, over the finest spacing there."""
        rows = self._rows
        way = value[rows].astype(np.float64) - self.seen[rows]
        return float(np.sqrt((way**2).sum(axis=1).max(initial=0.0)) / self._finest) if len(rows) else 0.0

    def see(self, u: Array) -> None:
        """Take pairs, normals and weights from these displacements (n, d), m."""
        self._joined.forget()
        self._joined.follow(ALL)
        self._search(u)
        pair_geometry = np.zeros((len(self._pairs.i), 1 + u.shape[1]))
        geometry(self._pairs, u, SKIN * self._finest if len(pair_geometry) else 0.0, pair_geometry)
        self.seen, self._stiffness, self._normal = u.copy(), pair_geometry[:, 0], pair_geometry[:, 1:]

    def holding(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Rows (k,) of the nodes of pairs that touch where they were looked at last, or nearly so."""
        depth = self._pairs.touch - self._gap(self.seen)
        is_holding = (self._stiffness > 0) & (depth > -HOLDS * self._pairs.touch)
        return self._pairs.i[is_holding], self._pairs.j[is_holding]

    def _gap(self, u: Array) -> Array:
        i, j, x = self._pairs.i, self._pairs.j, self._joined.nodes.x
        return np.asarray(((x[j] - x[i] + (u[j] - u[i])) * self._normal).sum(axis=1) - self._pairs.beyond)

    def _along(self, u: Array) -> Array:
        """Way (p, d) along the face since the last equilibrium, m."""
        i, j = self._pairs.i, self._pairs.j
        way = (u[j] - self._at[j]) - (u[i] - self._at[i])
        return np.asarray(way - (way * self._normal).sum(axis=1)[:, None] * self._normal)

    def _touch(self, value: NDArray[Any]) -> Touch:
        u, mu = value.astype(np.float64), self._settings.friction
        depth = np.where(self._stiffness > 0, np.maximum(self._pairs.touch - self._gap(u), 0.0), 0.0)
        slip, cut = np.zeros_like(self._normal), np.zeros(len(depth))
        if mu:
            before = self._pairs.slip
            before = before - (before * self._normal).sum(axis=1)[:, None] * self._normal
            slip = before + self._along(u)
            length = np.sqrt((slip**2).sum(axis=1))
            cut = np.where(length > mu * depth, mu * depth / np.maximum(length, 1e-300), 1.0)
            slip *= cut[:, None]
        return Touch(depth, slip, cut)

    def accumulate_force(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Add the force densities (n, d), N/m^3, to `out`."""
        out += self.forces(state.value) / self._volume[:, None]

    def forces(self, value: NDArray[Any]) -> Array:
        """Forces (n, d), N/m, in space N, at displacements (n, d), m."""
        pairs, now = self._pairs, self._touch(value)
        force = self._stiffness[:, None] * (now.depth[:, None] * self._normal - now.slip)
        out = np.zeros(value.shape)
        for a in range(force.shape[1]):
            out[:, a] = np.bincount(pairs.j, force[:, a], len(out)) - np.bincount(pairs.i, force[:, a], len(out))
        return out

    def energies(self, state: State) -> tuple[Array, Array]:
        """Energy densities (n,), J/m^3: stored in springs of touch and of friction; nothing is dissipated here."""
        now = self._touch(state.value)
        of_pairs = self._stiffness * (now.depth**2 + (now.slip**2).sum(axis=1)) / 2
        ends, nodes = (self._pairs.i, self._pairs.j), len(self._volume)
        energy = np.asarray(sum(np.bincount(end, of_pairs / 2, nodes) for end in ends))  # half and half
        return energy / self._volume, np.zeros(nodes)

    def touching(self, state: State) -> int:
        """Number of nodes that touch others."""
        in_touch = self._touch(state.value).depth > 0
        return len(np.unique(np.concatenate([self._pairs.i[in_touch], self._pairs.j[in_touch]])))

    def friction(self, state: State) -> float:
        """Energy that friction has turned into heat so far, J/m, of a body J."""
        now = self._touch(state.value)
        drag = self._pairs.drag - self._stiffness[:, None] * now.slip
        friction_energy = np.sum(self._friction_energy) - (drag / 2 * self._along(state.value)).sum()
        return float(friction_energy - (self._stiffness * (now.slip**2).sum(axis=1) / 2).sum())

    def stiffness_matrix(self, value: NDArray[Any]) -> csr_array:
        """Minus the derivative of the forces by the displacements, (n d, n d), N/m^2, in space N/m."""
        pairs, now, n = self._pairs, self._touch(value), self._normal
        u = value.astype(np.float64)
        near_pairs = np.flatnonzero((self._stiffness > 0) & (pairs.touch - self._gap(u) > -TOUCHES * pairs.touch))
        n, d, mu = n[near_pairs], n.shape[1], self._settings.friction
        nn = n[:, :, None] * n[:, None, :]
        block = nn.copy()
        if mu:
            slip, cut = now.slip[near_pairs], now.cut[near_pairs]
            length = np.sqrt((slip**2).sum(axis=1))
            way = slip / np.maximum(length, 1e-300)[:, None]
            slides = (cut < 1)[:, None, None]
            across = np.eye(d) - nn
            block += np.where(slides, cut[:, None, None] * (across - way[:, :, None] * way[:, None, :]), across)
            block -= np.where(slides, mu * way[:, :, None] * n[:, None, :], 0.0)
        block *= self._stiffness[near_pairs, None, None]
        return pair_matrix(pairs.i[near_pairs], pairs.j[near_pairs], block, len(self._volume))

    def checkpoint_arrays(self) -> CheckpointArrays:
        """Friction's springs, and the displacements of the last equilibrium and of the last look, for a checkpoint."""
        return {**super().checkpoint_arrays(), "at": self._at.copy(), "seen": self.seen.copy()}

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Restore a checkpoint. Raises CheckpointError."""
        super().restore(checkpoint, broken)
        self._at = entry(checkpoint, "at", self._at.shape, np.float64).copy()
        self.see(entry(checkpoint, "seen", self.seen.shape, np.float64).copy())
