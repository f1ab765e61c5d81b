"""Rigid bodies whose surface is a circle or a sphere: they push each node that touches them along their radius.

A lattice has no round face: its nodes lie on steps. A body of `radius` R about its centre of mass X meets a node with
r = x + u - X at the depth p = max(d - |r|, 0), where d is R and half the distance of touch of two nodes like that one.
The energy of the pair is K f p^2 / 2, with K that of two nodes like it and f of the angle between r and the normal of
the node. The force is along r, so that without friction it never turns the body. Friction and restitution are those of
`pdsolve.operators.contact.kernel`; friction acts on the body where its surface is.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.rigid_bodies import wide
from pdsolve.checkpoint_validation import entry
from pdsolve.model import Model, ModelError
from pdsolve.operators.contact.candidates import Joined
from pdsolve.operators.contact.kernel import facing_to
from pdsolve.operators.contact.rigid_motion import RigidMotion
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.state import State

Array = NDArray[np.float64]


class Near(NamedTuple):
    """Nodes that may touch one round body, p of them, in order."""

    rows: NDArray[np.int64]  # (p,)
    touch: Array  # (p,) m, from the centre
    slip: Array  # (p, 3) of friction's spring, m
    drag: Array  # (p, 3) its force on the node one step ago, N
    most: Array  # (p,) largest depth of this touch, m
    short: Array  # (p,) what the force was less than the spring's, N


class Pressed(NamedTuple):
    """What p nodes near a round body do at some displacements."""

    n: Array  # (p, 3) from the centre to the node, of length 1
    depth: Array  # (p,) m
    k: Array  # (p,) N/m


class RoundBodies:
    """The round ones among the rigid bodies of a model of n nodes."""

    def __init__(self, model: Model, volume: Array, stiffness: Array, joined: Joined, rigid: RigidMotion) -> None:
        """`stiffness` (n,) of two equal nodes in touch, N/m."""
        assert model.settings.contact is not None
        self._settings, self._joined, self._rigid, self._k = model.settings.contact, joined, rigid, stiffness
        self._half = model.settings.contact.distance * model.grid.delta / 2
        self._deep = self._half + joined.drawn.beyond
        self._radius = [(b, body.radius) for b, body in enumerate(rigid.bodies) if body.radius is not None]
        self.own = np.zeros(len(volume), dtype=np.bool_)  # nodes of round bodies
        for b, _ in self._radius:
            self.own[rigid.bodies[b].rows] = True
        self._near = [_at_rest(np.zeros(0, dtype=np.int64), np.zeros(0)) for _ in self._radius]
        self._faces = [joined.faces(near.rows) for near in self._near]

    def refuse_overlap(self, model: Model) -> None:
        """Raise ModelError for a node that is inside a round body at the start."""
        bodies = model.grid.bodies
        for near, (b, radius) in zip(self._near, self._radius, strict=True):
            assert bodies is not None
            half = self._half[near.rows]
            depth = (
                radius + self._deep[near.rows] - lengths(self._arm(b, np.zeros_like(self._joined.nodes.x), near.rows))
            )
            if not (depth > half).any():
                continue
            at = int(np.argmax(depth))
            row, body_row = near.rows[at], self._rigid.bodies[b].rows[0]
            first, second = (bodies.names[bodies.number[end]] for end in (body_row, row))
            raise ModelError(
                f"{model.name}: $.bodies: '{first}' and '{second}' are {depth[at]:.3g} m deep in each other at node"
                f" {model.grid.ids[row]}; bodies may touch at most"
            )

    @property
    def rows(self) -> NDArray[np.int64]:
        """Rows (m,) of the nodes that may touch round bodies, in order."""
        return np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *(near.rows for near in self._near)]))

    def search(self, u: NDArray[np.floating], rows: NDArray[np.int64], slack: float, lost: Array) -> None:
        """Find which of these rows (k,) may touch until they come nearer by `slack`, m; none is pressed harder by that.

        What a node holds less than before is added to what it has `lost` (n,), J.
        """
        rows = rows[~self.own[rows] & ~self._joined.behind(rows)]
        for number, (b, radius) in enumerate(self._radius):
            far = lengths(self._arm(b, u, rows))
            close = rows[far < radius + self._deep[rows] + slack]
            pressed = self._pressed(number, u)
            before, energy_before = self._near[number], pressed.k * pressed.depth**2 / 2  # J
            near = _at_rest(close, radius + self._deep[close])
            _, new_rows, old_rows = np.intersect1d(close, before.rows, assume_unique=True, return_indices=True)
            for name in Near._fields[1:]:
                getattr(near, name)[new_rows] = getattr(before, name)[old_rows]
            self._near[number], self._faces[number] = near, self._joined.faces(close)
            now, allowed = self._pressed(number, u), np.zeros(len(close))
            allowed[new_rows] = energy_before[old_rows]
            most = np.sqrt(2 * allowed / np.where(now.k > 0, now.k, np.inf))
            more = np.where(now.k > 0, np.maximum(now.depth - most, 0.0), 0.0)
            near.touch[:] -= more
            near.most[:] = np.maximum(near.most - more, 0.0)
            lost[close] += np.maximum(allowed - now.k * now.depth**2 / 2, 0.0)

    def learn(self) -> None:
        """Take the normals of nodes from the bonds that are intact now."""
        self._faces = [self._joined.faces(near.rows) for near in self._near]

    def push(
        self, state: State, volume: Array, dt: float, out: NDArray[Any], friction_energy: Array, lost: Array
    ) -> None:
        """Add the force densities (n, d), N/m^3, to `out`, and the force and the torque to the bodies.

        Friction's springs go on by `dt` s; minus their work is added to `friction_energy` (n,), J, and what restitution
        takes to `lost`.
        """
        d, mu, e = state.value.shape[1], self._settings.friction, self._settings.restitution
        for number, (b, radius) in enumerate(self._radius):
            near, now = self._near[number], self._pressed(number, state.value)
            speed = wide(state.rate[near.rows].astype(np.float64)) - self._rigid.motion.velocity[b]
            speed -= np.cross(self._rigid.spin(b), radius * now.n)
            near.most[:] = np.where(now.depth > 0, np.maximum(near.most, now.depth), 0.0)
            felt = np.clip((now.depth - (1 - e * e) * near.most) / (e * e), 0.0, now.depth)
            short, rate = now.k * (now.depth - felt), (speed * now.n).sum(axis=1)
            lost[near.rows] += (near.short + short) * rate * dt / 2
            near.short[:] = short
            force = (now.k * felt)[:, None] * now.n
            if mu:
                slip = np.where(now.depth[:, None] > 0, near.slip + dt * speed, 0.0)
                slip -= (slip * now.n).sum(axis=1)[:, None] * now.n
                long, limit = lengths(slip), mu * felt
                near.slip[:] = slip * np.where(long > limit, limit / np.maximum(long, 1e-300), 1.0)[:, None]
                drag = -now.k[:, None] * near.slip
                friction_energy[near.rows] -= ((near.drag + drag) * speed).sum(axis=1) * dt / 2
                near.drag[:] = drag
                force += drag
            out[near.rows] += force[:, :d] / volume[near.rows, None]
            self._rigid.beside[b] = np.concatenate([-force.sum(axis=0), -radius * np.cross(now.n, force).sum(axis=0)])

    def _arm(self, b: int, u: NDArray[Any], rows: NDArray[np.int64]) -> Array:
        centre = self._rigid.bodies[b].centre + self._rigid.motion.way[b]
        return np.asarray(wide(self._joined.nodes.x[rows] + u[rows].astype(np.float64)) - centre)

    def _pressed(self, number: int, u: NDArray[Any]) -> Pressed:
        near, b = self._near[number], self._radius[number][0]
        arm = self._arm(b, u, near.rows)
        far = lengths(arm)
        n, depth, facing = arm / far[:, None], np.maximum(near.touch - far, 0.0), np.zeros(len(far))
        facing_to(self._faces[number], u, n, facing)
        return Pressed(n, np.where(facing > 0, depth, 0.0), self._k[near.rows] * facing)

    def store(self, u: NDArray[Any], node_energy: Array, rubbed: Array) -> None:
        """Add the energies, J, of all springs to `node_energy` (n,), and those of friction to `rubbed`."""
        for number, near in enumerate(self._near):
            now = self._pressed(number, u)
            spring = now.k * (near.slip**2).sum(axis=1) / 2
            node_energy[near.rows] += now.k * now.depth**2 / 2 + spring
            rubbed[near.rows] += spring

    def touching(self, u: NDArray[Any]) -> NDArray[np.int64]:
        """Rows of the nodes that touch round bodies."""
        touching_rows = (near.rows[self._pressed(number, u).depth > 0] for number, near in enumerate(self._near))
        return np.unique(np.concatenate([np.zeros(0, dtype=np.int64), *touching_rows]))

    def checkpoint_arrays(self) -> CheckpointArrays:
        """What is near, for a checkpoint."""
        every = ((f"round_{number}", near._asdict()) for number, near in enumerate(self._near))
        return {f"{body}_{name}": values.copy() for body, near in every for name, values in near.items()}

    def restore(self, checkpoint: CheckpointArrays) -> None:
        """Restore a checkpoint. Raises CheckpointError."""
        for number in range(len(self._near)):
            rows = entry(checkpoint, f"round_{number}_rows", (None,), np.int64, 0, len(self._k) - 1).copy()
            near = _at_rest(rows, np.zeros(len(rows)))
            for name in Near._fields[1:]:
                values = getattr(near, name)
                values[:] = entry(checkpoint, f"round_{number}_{name}", values.shape, np.float64)
            self._near[number] = near
        self.learn()


def lengths(vectors: Array) -> Array:
    """Lengths (k,) of vectors (k, 3)."""
    return np.asarray(np.sqrt((vectors**2).sum(axis=1)))


def _at_rest(rows: NDArray[np.int64], touch: Array) -> Near:
    count = len(rows)
    return Near(rows, touch, np.zeros((count, 3)), np.zeros((count, 3)), np.zeros(count), np.zeros(count))
