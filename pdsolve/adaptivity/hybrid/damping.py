"""Damping of nodes: c m v against the motion, and the energy that it takes.

Leapfrog has velocities half a step before. With the force F at the displacements, (F - c m v) / (1 + c dt / 2) is what
moves a node then: the damping is that of the velocity at the step, as in `pdsolve.steppers.verlet`. The energy taken
from one step to the next is the mean damping force of both times the displacement between them.
"""

from __future__ import annotations

from typing import Any

from numba.extending import overload

from pdsolve.adaptivity.hybrid.node_constants import node_constant_at_place
from pdsolve.codegen.inner_functions import INNER, is_none
from pdsolve.codegen.vector_code import ROW
from pdsolve.zone.cells import FREE


def _is_damped_type(nodes: Any) -> bool:
    """Whether these nodes, a type, are damped."""
    return not is_none(nodes.types[nodes.fields.index("damping")])


def damp_forces(nodes: Any, p: Any, count: Any, velocity_lag: Any, lane_sums: Any) -> None:
    """Turn sums of forces on nodes from p on into what moves them; velocities are half of `velocity_lag`, s, old."""


@overload(damp_forces, jit_options=INNER)
def _overload_damp_forces(nodes, p, count, velocity_lag, lane_sums):  # type: ignore[no-untyped-def]
    if not _is_damped_type(nodes):
        return lambda nodes, p, count, velocity_lag, lane_sums: None

    def damp_forces_of_lanes(nodes, p, count, velocity_lag, lane_sums):  # type: ignore[no-untyped-def]
        for axis in range(2):
            for k in range(count):
                c, at = nodes.damping[axis, p + k], axis * ROW + k
                lane_sums[at] = (lane_sums[at] - c * nodes.mass[p + k] * nodes.v[axis, p + k]) / (
                    1 + c * velocity_lag / 2
                )

    return damp_forces_of_lanes


def record_damped_energy(
    nodes: Any, p: Any, count: Any, dt: Any, lane_sums: Any, first_half_step: Any, second_half_step: Any
) -> None:
    """Book the energy taken in half a step `first_half_step` and `second_half_step` from nodes moved by s, from p on.

    With `first_half_step`, velocities are those of half a step ago, else of now.
    """


@overload(record_damped_energy, jit_options=INNER)
def _overload_record_damped_energy(nodes, p, count, dt, lane_sums, first_half_step, second_half_step):  # type: ignore[no-untyped-def]
    if not _is_damped_type(nodes):
        return lambda nodes, p, count, dt, lane_sums, first_half_step, second_half_step: None

    def record_damping_of_lanes(nodes, p, count, dt, lane_sums, first_half_step, second_half_step):  # type: ignore[no-untyped-def]
        for at in range(p, p + count):
            first, last, half = 0.0, 0.0, dt / 2 * nodes.mass[at]
            for axis in range(2):
                kick = dt / 2 * (lane_sums[axis * ROW + at - p] * nodes.inverse_mass[at])
                speed = nodes.v[axis, at]
                middle = speed + kick if first_half_step else speed
                pull = nodes.damping[axis, at] * middle
                first += pull * speed
                last += pull * (middle + kick)
            if first_half_step:
                nodes.damped_energy[at] += half * first
            if second_half_step:
                nodes.damped_energy[at] += half * last

    return record_damping_of_lanes


def set_damping_of_node(lattice: Any, nodes: Any, p: Any, fine_place: Any) -> None:
    """Give node p the damping of a fine place, or none if it has no motion of its own."""


@overload(set_damping_of_node, jit_options=INNER)
def _overload_set_damping_of_node(lattice, nodes, p, fine_place):  # type: ignore[no-untyped-def]
    if not _is_damped_type(nodes):
        return lambda lattice, nodes, p, fine_place: None

    def copy_damping(lattice, nodes, p, fine_place):  # type: ignore[no-untyped-def]
        nodes.damping[0, p] = nodes.damping[1, p] = (
            node_constant_at_place(lattice.node_constants, lattice.node_constants.damping, fine_place)
            if nodes.node_kinds[p] == FREE
            else 0.0
        )

    return copy_damping


def remove_damping_of_component(nodes: Any, p: Any, axis: Any) -> None:
    """Take the damping from a held component."""


@overload(remove_damping_of_component, jit_options=INNER)
def _overload_remove_damping_of_component(nodes, p, axis):  # type: ignore[no-untyped-def]
    if not _is_damped_type(nodes):
        return lambda nodes, p, axis: None

    def clear_damping(nodes, p, axis):  # type: ignore[no-untyped-def]
        nodes.damping[axis, p] = 0.0

    return clear_damping
