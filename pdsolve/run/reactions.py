"""Reactions: the resultant force of each load, and the force that holds prescribed nodes."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model import node_arrays
from pdmesh.model.document import Pin, RigidBody, Selection, Spring
from pdmesh.model.neighbours import lengths
from pdsolve.conditions import Driving, factor_now
from pdsolve.operators.ground_supports import supports_of
from pdsolve.run.system import System
from pdsolve.state import State

RIGID = str(RigidBody.__struct_config__.tag)
GROUND = tuple(str(kind.__struct_config__.tag) for kind in (Spring, Pin))


class ForceConditionWithNodes(NamedTuple):
    """A condition that acts throughout a run, and its nodes."""

    condition_number: int  # in the model's list of conditions
    condition_kind: str
    node_rows: NDArray[np.int64]  # of the grid


class ConditionForceRow(NamedTuple):
    """Force and displacement of a condition at a step, per unit thickness."""

    step: int
    time: float  # s
    condition: int  # in the model's list of conditions
    kind: str
    force_x: float  # N/m, on the plate
    force_y: float
    displacement_x: float  # m, mean of its nodes
    displacement_y: float
    force_z: float = 0.0  # N, of a body, of which those along x and y are in N too
    displacement_z: float = 0.0


def list_force_conditions_with_nodes(system: System) -> tuple[ForceConditionWithNodes, ...]:
    """All conditions with forces, in the model's order, which is that of the profiles of `Drive`."""
    return tuple(
        ForceConditionWithNodes(
            number, str(condition.__struct_config__.tag), _find_nodes_of_condition(system, condition)
        )
        for number, condition in enumerate(system.requested_model.settings.conditions)
        if isinstance(condition, Driving)
    )


def _find_nodes_of_condition(system: System, condition: Selection) -> NDArray[np.int64]:
    """Current nodes of a condition; the nearest one if it acts between nodes."""
    grid, full_model = system.model.grid, system.requested_model
    rows = np.flatnonzero(node_arrays.selected(grid, condition.nodes, condition.box))
    if len(rows):
        return rows
    place = full_model.grid.part(full_model.selected(condition)).position.mean(axis=0)
    return np.array([lengths(grid.position - place).argmin()])


def compute_condition_forces(
    conditions: tuple[ForceConditionWithNodes, ...], system: System, state: State, step: int, time: float
) -> list[ConditionForceRow]:
    """External force of each grip after `step`.

    A hold balances bonds and loads on its components and provides their acceleration. The acceleration of a prescribed
    displacement or velocity is taken as 0: only the inertia of the held nodes is neglected while their speed changes.
    The force of a rigid body is that on what it touches.
    """
    condition_count = len(conditions)
    if system.moving_zone_operator is not None:
        pulls = system.moving_zone_operator.constraint_force_by_profile(condition_count)
        pushes = system.moving_zone_operator.load_force_by_profile(condition_count)
    else:
        drive, area, rho = system.drive, system.area, system.model.rho
        holds, loads = drive.holds, drive.loads
        pull = area[holds.node] * (
            rho[holds.node] * state.second[holds.node, holds.axis].astype(float) - drive.held_force
        )
        push = area[loads.node] * loads.value
        d = system.model.grid.dimension
        # What holds each condition, and its loads at factor 1, N/m (in a body N)
        pulls, pushes = (
            np.bincount(d * entries.profile + entries.axis, values, d * condition_count).reshape(-1, d).astype(float)
            for entries, values in ((holds, pull), (loads, push))
        )
    reaction_rows, at = [], system.profile_time_or_load_factor(step)
    supports = supports_of(system.operator) if any(grip.condition_kind in GROUND for grip in conditions) else None
    for profile, grip in enumerate(conditions):
        force = (pulls[profile] + float(factor_now(system.drive.profiles, profile, at)) * pushes[profile]).tolist()
        if grip.condition_kind == RIGID and system.contact is not None:
            force = (-system.contact.rigid.force_of(grip.node_rows, len(force))).tolist()
        if grip.condition_kind in GROUND and supports is not None:
            force = supports.forces_of(grip.node_rows, system.area, state).tolist()
        mean = state.value[grip.node_rows, : len(force)].astype(float).mean(axis=0).tolist()
        plane = *force[:2], *mean[:2]
        reaction_rows.append(
            ConditionForceRow(step, time, grip.condition_number, grip.condition_kind, *plane, *force[2:], *mean[2:])
        )
    return reaction_rows
