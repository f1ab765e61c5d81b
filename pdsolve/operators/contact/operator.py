"""Contact as an operator: bodies, crack faces and fragments push each other apart, and rub.

Forces are those of `pdsolve.operators.contact.kernel`. The stiffness of a pair is that of M. L. Parks, P. Seleson,
S. J. Plimpton, S. A. Silling, R. B. Lehoucq, SAND2011-8253: some micromoduli over their horizon, times both cells, for
a horizon of three spacings, whatever the model's own. Between two faces it is .53 E over the spacing in plane stress,
.57 in plane strain and .24 in space.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Contact
from pdmesh.model.material_constants import STIFFNESS
from pdsolve.checkpoint_validation import entry
from pdsolve.errors import CheckpointError
from pdsolve.model import Model, ModelError
from pdsolve.operators.contact.candidates import EVERY, Joined, candidates
from pdsolve.operators.contact.kernel import WIDE, PairList, Pushes, add_forces, ease, farthest, nearer, pressed_pairs
from pdsolve.operators.contact.pair_matrix import pair_matrix
from pdsolve.operators.contact.rigid_motion import RigidMotion
from pdsolve.operators.contact.round_bodies import RoundBodies
from pdsolve.operators.protocol import CheckpointArrays, Motion, Operator
from pdsolve.operators.together import Together
from pdsolve.operators.unbreakable import UnbreakableOperator
from pdsolve.state import Broken, State, Unknown

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from pdsolve.stepper import Stepper

SPACINGS = 3.0  # in the horizon whose micromodulus counts
SKIN = 0.5  # spacings, of the finest surface nodes: pairs nearer than that and their reach are known
TWO_FACES = 2.0  # that a node touches at most
DEEP = 0.5  # of the distance of touch: nodes of two bodies that are nearer at the start overlap


class PenaltyContact(UnbreakableOperator):
    """Contact of n nodes that `joined` operators hold together; see `Operator`."""

    name = "contact"
    symmetric = True
    drawn_in_space = False  # a ball that spins on few nodes gains energy there, as the normals of its surface turn
    of_round = 1.0  # stiffness of a pair of two bodies at a curved surface over that of others

    def __init__(self, model: Model, volume: NDArray[np.float64], operator: Operator) -> None:
        """`volume` (n,), m^d; raises ModelError for bodies that overlap, or operators of more than displacements."""
        assert model.settings.contact is not None
        grid, self._settings, self.bonded = model.grid, model.settings.contact, operator
        self.unknowns: tuple[Unknown, ...] = (Unknown("u", grid.dimension, 2),)
        use_drawn_faces = grid.dimension == 2 or self.drawn_in_space
        self._joined, self._delta, self._volume = Joined(model, operator, use_drawn_faces), grid.delta, volume
        self._body = None if grid.bodies is None else grid.bodies.number
        self._each = 1 / volume  # 1/m^d
        self._cell, self._k = grid.delta**grid.dimension, pair_stiffness(model, self._settings)
        self._bound, self.rigid = touch_bound(model, volume), RigidMotion(model, volume)
        self._friction_energy, self._lost = np.zeros((2, len(grid)))  # J, on friction, and by springs whose faces broke
        cell = self._k * self._cell**2
        self.round = RoundBodies(model, volume, cell, self._joined, self.rigid)
        self._kept_until: int | None = None  # step before which broken bonds were known in a checkpoint
        self._kept_wait = 0
        self._rows, self._before = np.zeros(0, dtype=np.int64), np.zeros((0, grid.dimension))
        self._pairs = self._listed(*np.zeros((2, 0), dtype=np.int64))
        self._search(np.zeros((len(grid), grid.dimension)))
        _refuse_overlap(model, self._settings, self._pairs)
        self.round.refuse_overlap(model)

    @property
    def stiffness(self) -> float:
        """The largest stiffness of two equal nodes in touch over the volumes of both, N/m^(2 d + 1)."""
        return float(self._k.max())

    def accumulate_force(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Add the force densities (n, w), N/m^3, to `out`; friction's springs go on by `dt` s."""
        self._follow(state, step)
        self.push(state, out, step, dt)

    def push(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Add the force densities as `accumulate_force` does, of a state that `free_steps` has seen."""
        if len(self._pairs.i):
            mu, e = self._settings.friction, self._settings.restitution
            accumulators = out, self._friction_energy, self._lost
            add_forces(self._pairs, self._each, state.value, state.rate, mu, e, dt, *accumulators)
        if len(self.rigid.rows):
            self.round.push(state, self._volume, dt, out, self._friction_energy, self._lost)
            self.rigid.constrain(state, out, step, dt)

    def free_steps(self, state: State, step: int, dt: float) -> int:
        """For how many steps of `dt`, s, from this one on surely nothing touches; 0 if something may.

        No node gets twice as fast meanwhile, nor loses a bond that counts.
        """
        self._follow(state, step)
        if len(self.rigid.rows):  # which move by forces of their own
            return 0
        if len(self._pairs.i) or not len(self._rows):
            return 0 if len(self._pairs.i) else EVERY
        fastest = np.sqrt(farthest(state.rate, self._still, self._rows))
        remaining_way = SKIN * self._finest / 2 - np.sqrt(farthest(state.value, self._before, self._rows))
        most = self._joined.until + self._joined.wait - step
        return most if 2 * fastest * dt * most <= remaining_way else 0

    def pushes(self) -> Pushes:
        """The pairs that `free_steps` has seen, for `push_anew`."""
        limit, (mu, e) = (SKIN * self._finest / 2) ** 2, (self._settings.friction, self._settings.restitution)
        energies = self._friction_energy, self._lost
        return Pushes(self._pairs, self._each, self._rows, self._before, limit, float(mu), float(e), *energies)

    def push_steps(self, step: int) -> int:
        """For how many steps from this one on `push_anew` may push these pairs: rigid bodies move by themselves."""
        return 1 if len(self.rigid.rows) else self._joined.until + self._joined.wait - step

    @property
    def rows(self) -> NDArray[np.int64]:
        """Rows (m,) of the nodes on which forces may act now, in order."""
        if not len(self.rigid.rows):
            return self._pairs.faces.rows
        return np.union1d(np.union1d(self._pairs.faces.rows, self.rigid.rows), self.round.rows)

    def _follow(self, state: State, step: int) -> None:
        """Bring the pairs up to date; none is pressed harder by that alone."""
        self._relearn()
        changed, skin = self._joined.follow(step), SKIN * self._finest
        if changed or farthest(state.value, self._before, self._rows) > (skin / 2) ** 2:
            pair_energy = self._pressed_energies(state)
            new_rows, old_rows = self._search(state.value)
            now = np.full(len(self._pairs.i), 0.0 if changed else np.nan)  # nan: came from afar
            now[new_rows] = pair_energy[old_rows]
            ease(self._pairs, state.value, now, self._lost)

    def _relearn(self) -> None:
        """Bring the pairs of a checkpoint to the bonds that were intact then."""
        if self._kept_until is not None:
            self._joined.forget()
            self._joined.follow(self._kept_until)
            self._joined.wait = self._kept_wait
            self._rows = np.flatnonzero(self._joined.surface)
            if len(self._before) != len(self._rows):
                raise CheckpointError("displacements of the last search are not those of the surface nodes")
            self._finest = float(self._delta[self._rows].min(initial=np.inf))  # where cracks have come, as well
            self._still = np.zeros_like(self._before)
            self._pairs = self._pairs._replace(faces=self._joined.faces(self._pairs.faces.rows))
            self.round.learn()
            self._kept_until = None

    def _pressed_energies(self, state: State) -> NDArray[np.float64]:
        """Energies (p,), J, of the springs of touch."""
        pair_state = self._pressed(state.value)[2]
        return np.asarray(pair_state[:, 0] * pair_state[:, 1] ** 2 / 2)

    def _search(self, u: NDArray[np.floating]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Find the pairs that may touch until a node has moved by half a skin, and how near they were at first.

        Returns the numbers (q,) of those that there were before, now and then.
        """
        self._rows = np.flatnonzero(self._joined.surface)
        delta = self._delta[self._rows]
        self._finest = float(delta.min(initial=np.inf))
        wide = 1.0 if u.shape[1] == 2 else WIDE
        skin = SKIN * self._finest if len(delta) else 0.0
        self._before = u[self._rows].astype(np.float64)
        self._still = np.zeros_like(self._before)
        reach = delta * np.hypot(wide, self._settings.distance) + skin
        reach += 2 * self._joined.drawn.beyond.max(initial=0.0)
        i, j = candidates(self._joined, u, self._rows, reach)
        by_nodes = self.round.own[i] == self.round.own[j]
        by_nodes &= ~(self._parted(i, j) & (self._joined.behind(i) | self._joined.behind(j)))
        before, pairs = self._pairs, self._listed(i[by_nodes], j[by_nodes])
        self.round.search(u, self._rows, SKIN * self._finest, self._lost)
        nodes = len(self._volume)
        key, old = pairs.i * nodes + pairs.j, before.i * nodes + before.j
        _, new_rows, old_rows = np.intersect1d(key, old, assume_unique=True, return_indices=True)
        for name in ("slip", "drag", "most", "short"):
            getattr(pairs, name)[new_rows] = getattr(before, name)[old_rows]
        nearer(pairs)
        self._pairs = pairs
        return new_rows, old_rows

    def _listed(self, i: NDArray[np.int64], j: NDArray[np.int64]) -> PairList:
        """These pairs (p,), at rest."""
        mean, nothing = (self._delta[i] + self._delta[j]) / 2, np.zeros((len(i), self.unknowns[0].width))
        k = 2 / (1 / self._k[i] + 1 / self._k[j]) * self._cell[i] * self._cell[j]
        drawn_faces, parted = self._joined.drawn, self._parted(i, j)
        beyond = np.where(parted, drawn_faces.beyond[i] + drawn_faces.beyond[j], 0.0)
        k *= np.where(parted & (drawn_faces.round[i] | drawn_faces.round[j]), self.of_round, 1.0)
        wide = np.maximum(self._delta[i], self._delta[j])
        rows, ends = np.unique(np.concatenate([i, j]), return_inverse=True)
        first, second = ends.reshape(2, -1)
        x, apart = self._joined.nodes.x, np.zeros((len(i), 3))
        apart[:, : x.shape[1]] = x[j] - x[i]
        touch, faces = self._settings.distance * mean, self._joined.faces(rows)
        most, short = np.zeros((2, len(i)))
        springs = nothing, nothing.copy(), most, short
        return PairList(i, j, k, wide, touch, beyond, apart, *springs, first, second, faces)

    def _parted(self, i: NDArray[np.int64], j: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Mask (p,) of pairs of two bodies."""
        return np.zeros(len(i), dtype=np.bool_) if self._body is None else self._body[i] != self._body[j]

    def _pressed(self, value: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Energies (n,), J, of all springs and of those of friction; stiffness, depth, normal of pairs (p, 2 + d)."""
        self._relearn()
        pairs, nodes = self._pairs, len(self._volume)
        node_energy = np.zeros(nodes)
        rubbed = np.zeros(nodes)
        pair_state = np.zeros((len(pairs.i), 2 + pairs.slip.shape[1]))
        pressed_pairs(pairs, value, node_energy, rubbed, pair_state)
        self.round.store(value, node_energy, rubbed)
        return node_energy, rubbed, pair_state

    def energies(self, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Energy densities (n,), J/m^3: stored in springs of touch and of friction, and lost where faces broke."""
        return self._pressed(state.value)[0] / self._volume, self._lost / self._volume

    def touching(self, state: State) -> int:
        """Number of nodes that touch others."""
        in_touch = self._pressed(state.value)[2][:, 1] > 0
        ends = self._pairs.i[in_touch], self._pairs.j[in_touch], self.round.touching(state.value)
        return len(np.unique(np.concatenate(ends)))

    def friction(self, state: State) -> float:
        """Energy that friction has turned into heat so far, J/m, of a body J."""
        return float(np.sum(self._friction_energy) - np.sum(self._pressed(state.value)[1]))

    def stiffness_bound(self) -> NDArray[np.float64]:
        """A bound (n,) of each node's stiffness, N/m^4, in touch with two faces."""
        return self._bound

    def tangent(self, state: State) -> csr_array:
        """Minus the derivative of the force densities by the values, (n w, n w), N/m^4."""
        from scipy.sparse import diags_array

        lightness = diags_array(1 / np.repeat(self._volume, state.value.shape[1]))
        matrix: csr_array = (lightness @ self.stiffness_matrix(state.value)).tocsr()
        return matrix

    def stiffness_matrix(self, value: NDArray[Any]) -> csr_array:
        """Minus the derivative of the forces by the displacements, (n d, n d), at constant normals and weights.

        N/m^2, in space N/m.
        """
        pair_state, pairs = self._pressed(value)[2], self._pairs
        pressed_rows = np.flatnonzero(pair_state[:, 1] > 0)
        n = pair_state[pressed_rows, 2:]
        block = pair_state[pressed_rows, 0, None, None] * n[:, :, None] * n[:, None, :]
        return pair_matrix(pairs.i[pressed_rows], pairs.j[pressed_rows], block, len(self._volume))

    def checkpoint_arrays(self) -> CheckpointArrays:
        """The pairs and their springs for a checkpoint, where nodes were at the last search, and the heat booked."""
        self._relearn()
        pairs = self._pairs
        return {
            "slip": pairs.slip.copy(),
            "drag": pairs.drag.copy(),
            "touch": pairs.touch.copy(),
            "most": pairs.most.copy(),
            "short": pairs.short.copy(),
            "slip_source": pairs.i.copy(),
            "slip_target": pairs.j.copy(),
            "searched": self._before.copy(),
            "followed": np.array([self._joined.until, self._joined.wait]),
            "rubbed": self._friction_energy.copy(),
            "lost": self._lost.copy(),
            **self.rigid.checkpoint_arrays(),
            **self.round.checkpoint_arrays(),
        }

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Restore a checkpoint. Raises CheckpointError."""
        nodes, d = len(self._volume), self.unknowns[0].width
        slip = entry(checkpoint, "slip", (None, d), np.float64)
        drag = entry(checkpoint, "drag", slip.shape, np.float64)
        touch, most, short = (entry(checkpoint, name, (len(slip),), np.float64) for name in ("touch", "most", "short"))
        ends = (entry(checkpoint, f"slip_{end}", (len(slip),), np.int64, 0, nodes - 1) for end in ("source", "target"))
        i, j = ends
        if (np.diff(i * nodes + j) <= 0).any() or (i >= j).any():
            raise CheckpointError("'slip_source' and 'slip_target' are not pairs in order")
        self._friction_energy[:] = entry(checkpoint, "rubbed", (nodes,), np.float64)
        self._lost[:] = entry(checkpoint, "lost", (nodes,), np.float64)
        self._before = entry(checkpoint, "searched", (None, d), np.float64).copy()
        self._kept_until, self._kept_wait = map(int, entry(checkpoint, "followed", (2,), np.int64))
        self.rigid.restore(checkpoint)
        self.round.restore(checkpoint)
        self._pairs = self._listed(i, j)._replace(
            slip=slip.copy(), drag=drag.copy(), touch=touch.copy(), most=most.copy(), short=short.copy()
        )

    def bytes(self) -> int:
        """Memory of all arrays, bytes."""
        arrays = (
            *self._joined.nodes,
            *self._pairs[:-1],
            *self._pairs.faces,
            self._joined.intact,
            self._bound,
            self._each,
            self._friction_energy,
        )
        return sum(array.nbytes for array in arrays) + 8 * len(self._joined.intact)


class BondsInContact(Together):
    """Contact and the operator of the bonds that it acts beside."""

    def __init__(self, contact: PenaltyContact, bonds: Operator) -> None:
        super().__init__(contact, bonds)
        self._contact, self._bonds = contact, bonds

    def march(self, motion: Motion) -> Stepper | None:
        """The march of the bonds, which takes contact with it; None if they have none."""
        return self._bonds.march(motion._replace(contact=self._contact))


def pair_stiffness(model: Model, contact: Contact) -> NDArray[np.float64]:
    """Stiffness (n,) of two equal nodes in touch over the volumes of both, N/m^(2 d + 1)."""
    modulus = STIFFNESS[model.materials[0].plane, "constant"] * model.node_values("E")
    horizon = SPACINGS * model.grid.delta
    return np.asarray(contact.stiffness * modulus / horizon ** (model.grid.dimension + 2))


def touch_bound(model: Model, volume: NDArray[np.float64]) -> NDArray[np.float64]:
    """What contact adds to the bound (n,) of each node's stiffness, N/m^4; 0 without it.

    A node touches two faces at most, of nodes like it or of the stiffest material; they push each other apart with
    1 / e^2 times the stiffness that they meet with, for a restitution e. `volume` (n,), m^d.
    """
    if model.settings.contact is None:
        return np.zeros(len(volume))
    cell, k = model.grid.delta**model.grid.dimension, pair_stiffness(model, model.settings.contact)
    E = model.node_values("E")
    k /= model.settings.contact.restitution**2
    return np.asarray(TWO_FACES * k * 2 / (1 + E / E.max()) * cell * cell / volume)


def _refuse_overlap(model: Model, contact: Contact, pairs: PairList) -> None:
    """Raise ModelError for two bodies that overlap at the start."""
    grid = model.grid
    if grid.bodies is None:
        return
    pair_rows = np.flatnonzero(grid.bodies.parted(pairs.i, pairs.j))
    i, j = pairs.i[pair_rows], pairs.j[pair_rows]
    touch = contact.distance * (grid.delta[i] + grid.delta[j]) / 2
    depth = touch + pairs.beyond[pair_rows] - np.sqrt(((grid.position[j] - grid.position[i]) ** 2).sum(axis=1))
    if not len(pair_rows) or not (depth > (1 - DEEP) * touch).any():
        return
    at = int(np.argmax(depth))
    first, second = (grid.bodies.names[grid.bodies.number[end]] for end in (i[at], j[at]))
    raise ModelError(
        f"{model.name}: $.bodies: '{first}' and '{second}' are {depth[at]:.3g} m deep in each other at nodes"
        f" {grid.ids[i[at]]} and {grid.ids[j[at]]}; bodies may touch at most"
    )
