"""Motion of rigid bodies under what pushes them: leapfrog of the centre of mass and of the rotation.

The centre X of a body of mass M moves by M V' = F, its rotation q (a unit quaternion) by L' = T about the centre, with
the spin w = Q I^-1 Q^T L of the inertia I and the rotation matrix Q of q. V and L are known half way between steps, X
and q at steps; what is held has a given V or w. A node's displacement is X - X_0 + Q r - r with its arm r from the
centre. It becomes the force density with which velocity Verlet takes the node there: the stepper knows nothing of rigid
bodies. Their inertia is that of their nodes. All vectors here have three components.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.mechanical_conditions import RigidBody
from pdmesh.model.rigid_bodies import rigid_bodies, spin_of, wide
from pdsolve.checkpoint_validation import entry
from pdsolve.conditions import Drive, Driving, factor_now
from pdsolve.model import Model
from pdsolve.operators.protocol import CheckpointArrays
from pdsolve.state import State

Array = NDArray[np.float64]

NO_INERTIA = 1e-12  # of the largest: about the line of a row of nodes


class Body(NamedTuple):
    """What does not change of a rigid body of k nodes."""

    rows: NDArray[np.int64]  # (k,) of its nodes
    cell: Array  # (k,) areas, m^2, in space volumes, m^3
    rho: Array  # (k,) kg/m^3
    arm: Array  # (k, 3) from the centre of mass at time 0, m
    centre: Array  # (3,) of mass at time 0, m
    radius: float | None  # m, of its surface about the centre; None: that of its nodes
    mass: float  # kg/m, in space kg
    compliance: Array  # (3, 3) inverse of the inertia, m/(kg m^2), in space 1/(kg m^2); 0 about axes without inertia
    inertia: Array  # (3, 3) kg m, in space kg m^2
    velocity: Array  # (3,) m/s, at time 0 and, where held, at factor 1
    spin: Array  # (3,) rad/s, likewise
    held: NDArray[np.bool_]  # (3,) which components of the velocity are
    turns: bool  # whether the spin is held
    profile: int  # number of the condition among those that have one


class Motion(NamedTuple):
    """What changes of b rigid bodies; the first two are those of the next step."""

    way: Array  # (b, 3) of the centre since time 0, m
    turn: Array  # (b, 4) rotation, a unit quaternion
    velocity: Array  # (b, 3) from this step to the next, m/s
    momentum: Array  # (b, 3) angular, about the centre, kg m/s, in space kg m^2/s
    force: Array  # (b, 3) of contact on the body at this step, N/m, in space N
    hold: Array  # (b, 6) force and torque that hold it at this step


class RigidMotion:
    """The rigid bodies of a model of n nodes."""

    def __init__(self, model: Model, volume: Array) -> None:
        """`volume` (n,), m^d."""
        numbers = [
            number for number, condition in enumerate(model.settings.conditions) if isinstance(condition, Driving)
        ]
        body_entries = rigid_bodies(model.grid, model.settings)
        self.bodies = tuple(
            _body(model, volume, condition, rows, numbers.index(number)) for condition, rows, number in body_entries
        )
        count = len(self.bodies)
        self.beside = np.zeros((count, 6))  # force and torque of contact now that no node of the body has
        self.motion = Motion(*(np.zeros((count, width)) for width in (3, 4, 3, 3, 3, 6)))
        self.motion.turn[:, 0] = 1.0
        self.rows = np.sort(np.concatenate([np.zeros(0, dtype=np.int64), *(body.rows for body in self.bodies)]))
        self._drive: Drive | None = None

    def start(self, state: State, drive: Drive, dt: float) -> None:
        """Set the accelerations of time 0, after the velocities; `drive` are the conditions of the march."""
        self._drive, motion = drive, self.motion
        for b, body in enumerate(self.bodies):
            force, torque = self._loads(body, body.arm)
            factor, free = self._factor(body, dt / 2), ~body.held
            motion.velocity[b] = np.where(free, body.velocity + dt / 2 * force / body.mass, factor * body.velocity)
            motion.momentum[b] = body.inertia @ body.spin + dt / 2 * torque
            motion.hold[b, :3], motion.hold[b, 3:] = np.where(free, 0.0, -force), -torque if body.turns else 0.0
            goal, d = self._advance(b, body, dt, dt / 2), state.value.shape[1]
            state.second[body.rows] = 2 / dt**2 * (goal[:, :d] - dt * state.rate[body.rows].astype(np.float64))

    def constrain(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Turn the force densities (n, d), N/m^3, of contact on all rigid nodes into those that keep them rigid."""
        assert self._drive is not None
        d, motion = state.value.shape[1], self.motion
        for b, body in enumerate(self.bodies):
            rows, arm = body.rows, body.arm @ _matrix(motion.turn[b]).T
            pushed = wide(out[rows].astype(np.float64)) * body.cell[:, None]
            motion.force[b] = pushed.sum(axis=0) + self.beside[b, :3]
            force, torque = self._loads(body, arm)
            force, torque = force + motion.force[b], torque + np.cross(arm, pushed).sum(axis=0)
            torque += self.beside[b, 3:]
            before, spin, hold = motion.velocity[b].copy(), self.spin(b), motion.hold[b].copy()
            factor, momentum = self._factor(body, (step + 0.5) * dt), motion.momentum[b].copy()
            prescribed_velocity = factor * body.velocity
            motion.velocity[b] = np.where(body.held, prescribed_velocity, before + dt / body.mass * force)
            motion.momentum[b] += dt * torque
            goal = self._advance(b, body, dt, (step + 0.5) * dt)
            motion.hold[b, :3] = np.where(body.held, body.mass / dt * (motion.velocity[b] - before) - force, 0.0)
            motion.hold[b, 3:] = (motion.momentum[b] - momentum) / dt - torque if body.turns else 0.0
            work = (hold + motion.hold[b]) / 2 @ np.concatenate([before, spin]) * dt
            state.work[rows[0]] += work / body.cell[0]
            way = goal[:, :d] - state.value[rows].astype(np.float64)
            second = (way / dt - state.rate[rows].astype(np.float64)) / dt
            out[rows] = body.rho[:, None] * second - self._drive.force[rows]

    def _factor(self, body: Body, time: float) -> float:
        assert self._drive is not None
        return float(factor_now(self._drive.profiles, body.profile, time))

    def _loads(self, body: Body, arm: Array) -> tuple[Array, Array]:
        """Force and torque (3,) of loads now."""
        assert self._drive is not None
        load = wide(self._drive.force[body.rows].astype(np.float64)) * body.cell[:, None]
        return load.sum(axis=0), np.cross(arm, load).sum(axis=0)

    def spin(self, b: int) -> Array:
        """Spin (3,) of the momentum and the rotation of body b, rad/s."""
        Q = _matrix(self.motion.turn[b])
        return np.asarray(Q @ (self.bodies[b].compliance @ (Q.T @ self.motion.momentum[b])))

    def _advance(self, b: int, body: Body, dt: float, time: float) -> Array:
        """Take a body to the next step; returns the displacements (k, 3) of its nodes there. `time` is half way."""
        motion = self.motion
        motion.way[b] += dt * motion.velocity[b]
        if body.turns:
            spin = self._factor(body, time) * body.spin
            motion.turn[b] = _turned(motion.turn[b], dt * spin)
            Q = _matrix(motion.turn[b])
            motion.momentum[b] = Q @ (body.inertia @ (Q.T @ spin))
        else:
            before = motion.turn[b].copy()
            motion.turn[b] = _turned(before, dt / 2 * self.spin(b))
            motion.turn[b] = _turned(before, dt * self.spin(b))
        return np.asarray(motion.way[b] + body.arm @ _matrix(motion.turn[b]).T - body.arm)

    def checkpoint_arrays(self) -> CheckpointArrays:
        """Their motion for a checkpoint."""
        return {f"rigid_{name}": values.copy() for name, values in self.motion._asdict().items()}

    def restore(self, checkpoint: CheckpointArrays) -> None:
        """Restore a checkpoint. Raises CheckpointError."""
        for name, values in self.motion._asdict().items():
            values[:] = entry(checkpoint, f"rigid_{name}", values.shape, np.float64)

    def force_of(self, rows: NDArray[np.int64], dimension: int) -> Array:
        """Force (d,) of contact on the body of these rows, N/m, in space N."""
        number = next(b for b, body in enumerate(self.bodies) if body.rows[0] == rows[0])
        return np.asarray(self.motion.force[number, :dimension])


def _body(model: Model, volume: Array, body: RigidBody, rows: NDArray[np.int64], profile: int) -> Body:
    rho, cell = model.rho[rows], volume[rows]
    mass = rho * cell
    x = model.grid.position[rows]
    centre = mass @ x / mass.sum()
    arm = wide(x - centre)
    inertia = np.eye(3) * (mass @ (arm**2).sum(axis=1)) - (mass[:, None] * arm).T @ arm
    spin, constrained = spin_of(body), np.array([way in body.held for way in "xyz"])
    velocity = np.array([body.x, body.y, body.z])
    compliance = np.linalg.pinv(inertia, rcond=NO_INERTIA, hermitian=True)
    of = rows, cell, rho, arm, wide(centre[None])[0], body.radius, float(mass.sum()), compliance, inertia
    return Body(*of, velocity, spin, constrained, "spin" in body.held, profile)


def _turned(turn: Array, way: Array) -> Array:
    """A rotation (4,) followed by one about the axis of `way` (3,) by its length, rad."""
    angle = float(np.sqrt(way @ way))
    w, v = np.cos(angle / 2), np.sinc(angle / (2 * np.pi)) / 2 * way
    first, rest = turn[0], turn[1:]
    rotation = np.array([w * first - v @ rest, *(w * rest + first * v + np.cross(v, rest))])
    return np.asarray(rotation / np.sqrt(rotation @ rotation))


def _matrix(turn: Array) -> Array:
    """Rotation matrix (3, 3) of a unit quaternion (4,)."""
    w, x, y, z = turn
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
