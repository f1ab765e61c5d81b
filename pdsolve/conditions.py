"""Conditions over time: loads on nodes or sources in them, and prescribed components of their motion or content."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol, TypeVar

import msgspec
import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdmesh.model.base_structs import Selection
from pdmesh.model.document import (
    Absorb,
    Acceleration,
    Condition,
    Displacement,
    InitialDisplacement,
    InitialVelocity,
    Load,
    Pin,
    RigidBody,
    Settings,
    Spring,
    Velocity,
)
from pdmesh.model.load_resultants import pressure_forces, shares_of
from pdmesh.model.material_constants import pressure_speed
from pdmesh.model.neighbours import tree_of
from pdmesh.model.rigid_bodies import first_velocities, rigid_velocities
from pdmesh.model.selection import components, given_of
from pdmesh.model.values_at_places import over_time
from pdmesh.model.values_of_place import is_over_time
from pdsolve.model import Model, ModelError

DISPLACEMENT, VELOCITY, ACCELERATION = 0, 1, 2
BESIDE = 1.5  # spacings: on a lattice, no node that is beside another is farther
ABSORBED = 7.0  # damping where a layer ends, times its depth over the speed of P waves
Driving = Load | Displacement | Velocity | Acceleration | RigidBody | Spring | Pin  # what acts throughout a run
HELD = {Displacement: DISPLACEMENT, Velocity: VELOCITY, Acceleration: ACCELERATION}


class Profiles(NamedTuple):
    """Factors over time, concatenated: profile p has the points start[p] to start[p + 1]."""

    start: NDArray[np.int64]  # (p + 1,)
    time: NDArray[np.float64]  # s, increasing within a profile
    factor: NDArray[np.float64]


class Entries(NamedTuple):
    """Components with a condition: e entries, of one node and one axis each."""

    node: NDArray[np.int64]  # (e,) row of the grid
    axis: NDArray[np.int64]  # (e,) 0, 1 or, in space, 2; 0 of a content
    value: NDArray[np.float64]  # (e,) N/m^3, m, m/s or m/s^2; mol/(m^3 s) or mol/m^3; times the factor of its profile
    profile: NDArray[np.int64]  # (e,) that of the condition, or one of the entry, whose data varies with place and time
    kind: NDArray[np.int64]  # (e,) of held motion; 0 for loads and held contents
    condition: NDArray[np.int64]  # (e,) its number among those that drive the model, which is that of its profile


class Drive(NamedTuple):
    """All conditions of a model for the stepper; n nodes."""

    profiles: Profiles
    loads: Entries
    holds: Entries
    varies: bool  # whether any load changes with time
    force: NDArray[np.floating]  # (n, d) body force now, N/m^3; source now, mol/(m^3 s)
    before: NDArray[np.floating]  # (n, d) body force one step ago
    held_force: NDArray[np.float64]  # (holds,) force density on the held component one step ago, N/m^3
    held_speed: NDArray[np.float64]  # (holds,) its velocity one step ago, m/s; both (0,) where contents are held


def unbreakable(model: Model) -> NDArray[np.bool_]:
    """Mask (n,) of nodes with a condition that makes their bonds unbreakable."""
    marked = np.zeros(len(model.grid), dtype=bool)
    for condition in model.settings.conditions:
        if isinstance(condition, Condition | Spring | Pin) and not condition.breakable:
            marked[model.selected(condition)] = True
    return marked


def mask_nodes_with_conditions(model: Model) -> NDArray[np.bool_]:
    """Mask (n,) of nodes with a condition that acts after the start."""
    marked = np.zeros(len(model.grid), dtype=bool)
    for condition in model.settings.conditions:
        if not isinstance(condition, InitialVelocity):
            marked[model.selected(condition)] = True
    return marked


def initial_velocity(model: Model, width: int | None = None) -> NDArray[np.float64]:
    """Velocities (n, d) at time 0, m/s, from initial and prescribed velocities; (n, width) of more components."""
    d = model.grid.dimension
    velocity = np.zeros((len(model.grid), width or d))
    _set_free(model, velocity)
    for condition in model.settings.conditions:
        if isinstance(condition, Velocity):
            factor = condition.profile[0][1] if condition.profile else 1.0
            for axis, value in enumerate(components(condition, d)):
                if value is not None:
                    rows = model.selected(condition)
                    velocity[rows, axis] = factor * model.values(value, rows, 0.0)
    return velocity


def _set_free(model: Model, velocity: NDArray[np.float64]) -> None:
    """Set velocities (n, w) of nodes that are free from time 0 on, and of rigid bodies; later conditions count."""
    d = model.grid.dimension
    for condition in model.settings.conditions:
        if isinstance(condition, InitialVelocity):
            rows = model.selected(condition)
            if len(rows):  # of a rank's window there may be none
                mass = model.rho[rows] * model.grid.cells[rows]
                for axis, values in enumerate(first_velocities(condition, model.grid.position[rows], mass)):
                    if values is not None:
                        velocity[rows, axis] = values
        if isinstance(condition, RigidBody):
            rows = model.selected(condition)
            velocity[rows, :d] = rigid_velocities(condition, model.grid.position[rows], model.grid.cells[rows])


C = TypeVar("C", bound=Selection)


def has_conditions(settings: Settings, *kinds: type) -> bool:
    """Whether there are conditions of one of these kinds."""
    return any(isinstance(condition, kinds) for condition in settings.conditions)


def conditions_of(settings: Settings, *kinds: type[C]) -> list[tuple[int, C]]:
    """The conditions of these kinds, each with its number among all."""
    return [(number, condition) for number, condition in enumerate(settings.conditions) if isinstance(condition, kinds)]


def driving_conditions(model: Model) -> list[tuple[int, Driving]]:
    """The conditions that act throughout a run, each with its number among all."""
    numbered = enumerate(model.settings.conditions)
    return [(number, condition) for number, condition in numbered if isinstance(condition, Driving)]


def initial_displacement(model: Model, drive: Drive | None, width: int) -> NDArray[np.float64]:
    """Displacements (n, width) at time 0, m, from initial ones and from what is prescribed then by a `drive`."""
    displacement = np.zeros((len(model.grid), width))
    for condition in model.settings.conditions:
        if isinstance(condition, InitialDisplacement):
            for axis, value in enumerate(components(condition, model.grid.dimension)):
                if value is not None:
                    rows = model.selected(condition)
                    displacement[rows, axis] = model.values(value, rows)
    if drive is None:
        return displacement
    holds = drive.holds
    is_displacement = holds.kind == DISPLACEMENT
    now = holds.value * factors_at(drive.profiles, 0.0)[holds.profile]
    displacement[holds.node[is_displacement], holds.axis[is_displacement]] = now[is_displacement]
    return displacement


def refuse_layers(model: Model) -> None:
    """Raise ModelError for an absorbing layer that covers all nodes."""
    for number, condition in enumerate(model.settings.conditions):
        if isinstance(condition, Absorb) and len(model.selected(condition)) == len(model.grid):
            raise ModelError(f"{model.name}: $.conditions[{number}] has all nodes; use a layer along an edge")


def damping(model: Model, first: int = 0, last: int | None = None) -> NDArray[np.float64]:
    """Damping coefficients, 1/s, of the rows `first` to `last` - 1: force over mass and velocity, from the run and from
    absorbing layers; 0 of rigid bodies.

    In a layer of depth L it is K (c / L) (d / L), with the P wave speed c and the distance d of a node from those
    outside the layer. Of waves shorter than L, a share exp(-K / 2) returns from its end, and little from its beginning.
    Of several layers, the largest value counts.
    """
    last = len(model.grid) if last is None else last
    coefficients = np.zeros(last - first)
    if model.settings.run.damping:
        coefficients[:] = model.settings.run.damping
    for condition in model.settings.conditions:
        if isinstance(condition, Absorb):
            rows = model.selected(condition)
            speed = np.empty(len(rows))
            for places, material in model.materials_at(rows):
                speed[places] = pressure_speed(material)
            position = model.grid.part(rows).position
            if model.grid.lattice is None:
                others = np.delete(model.grid.position, rows, axis=0)
            else:  # the nearest one is beside a node of these rows
                margin = BESIDE * model.grid.lattice.spacing
                around = model.grid.chosen(None, [*(position.min(axis=0) - margin), *(position.max(axis=0) + margin)])
                others = model.grid.part(np.setdiff1d(around, rows, assume_unique=True)).position
            depth = np.asarray(tree_of(others).query(position)[0])
            layer_depth = condition.depth or depth.max(initial=0.0)
            layer = ABSORBED * speed / layer_depth * np.minimum(depth / layer_depth, 1.0)
            in_range = (rows >= first) & (rows < last)
            rows, layer = rows[in_range] - first, layer[in_range]
            coefficients[rows] = np.maximum(coefficients[rows], model.settings.run.damping + layer)
    for condition in model.settings.conditions:
        if isinstance(condition, RigidBody):
            rows = model.selected(condition)
            coefficients[rows[(rows >= first) & (rows < last)] - first] = 0.0
    return coefficients


class Areas(Protocol):
    """Areas of the cells of nodes, m^2, or volumes, by their rows in the grid."""

    def __getitem__(self, rows: NDArray[np.int64], /) -> NDArray[np.float64]:
        """Areas (k,) of these rows (k,)."""


def drive(
    model: Model,
    areas: Areas,
    exact_total: bool,
    kind: type[np.floating],
    local_rows: slice = slice(None),
    total: Callable[[NDArray[np.float64]], float] = np.sum,
) -> Drive:
    """Conditions of the model, with the body forces of time 0; of a subdomain, those of its `local_rows`.

    A traction becomes traction / (rows delta) at each of its nodes, as in the thesis. With `exact_total`, and if the
    length of the loaded edge (or the area of the loaded face) is known, its nodes share traction times that in
    proportion to their `areas` (n,), m^2, or volumes, whose `total` is that of all windows. A force is always
    shared so.
    """
    d, nodes = model.grid.dimension, len(model.grid)
    begin, end, _ = local_rows.indices(nodes)
    # fine nodes everywhere, and bonds that know of shared loads
    loads_are_shared = exact_total and model.settings.run.adapt == "none" and is_corrected(model)
    driving = driving_conditions(model)
    profiles: list[Sequence[tuple[float, float]]] = []
    loads: list[Entries] = []
    holds: list[Entries] = []
    histories = Histories(len(driving))
    for number, (_, condition) in enumerate(driving):
        rows = model.selected(condition)
        rows = rows[(rows >= begin) & (rows < end)]
        if isinstance(condition, Load) and condition.traction and condition.shares and not loads_are_shared:
            rows = rows[shares_of(condition, model.grid.ids[rows]) == 1.0]  # the first row alone, as a load without
            condition = msgspec.structs.replace(condition, shares=None)
        profiles.append(() if isinstance(condition, Spring | Pin) else condition.profile)
        if isinstance(condition, RigidBody | Spring | Pin):  # operators have their forces
            continue
        if isinstance(condition, Load):
            ((_, vector),) = given_of(condition).items()
            node, axis = np.repeat(rows, d), np.tile(np.arange(d), len(rows))
            common = rows, model, areas, total, exact_total
            if any(map(is_over_time, vector)):
                times, vectors = over_time(vector, model.grid.part(rows).position)
                forces = np.array([_body_force(condition, then, *common) for then in vectors])
                loads.append(histories.entries(node, axis, times, forces.reshape(len(times), -1), number))
            else:
                values = _body_force(condition, model.vectors(vector, rows), *common)
                loads.append(entries(node, axis, values.ravel(), number))
            continue
        for along, value in enumerate(components(condition, d)):
            if value is not None and is_over_time(value):
                times, vectors = over_time([value], model.grid.part(rows).position)
                held = histories.entries(rows, along, times, vectors[..., 0], number, HELD[type(condition)])
                holds.append(held)
            elif value is not None:
                holds.append(entries(rows, along, model.values(value, rows), number, HELD[type(condition)]))
    return drive_of(profiles, loads, holds, (nodes, d), kind, histories)


def entries(
    node: NDArray[np.int64],
    axis: NDArray[np.int64] | int,
    value: NDArray[np.float64] | float,
    condition: int,
    kind: int = DISPLACEMENT,
) -> Entries:
    """A condition on one component of each of these nodes (e,)."""
    axes, numbers, kinds = (np.full(len(node), number, dtype=np.int64) for number in (axis, condition, kind))
    return Entries(node, axes, np.full(len(node), value, dtype=float), numbers, kinds, numbers)


class Histories:
    """Profiles of entries of their own, which come after those of `conditions`: values over time in place of factors.

    Their entries have the value 1.
    """

    def __init__(self, conditions: int = 0) -> None:
        self._next = conditions
        self.count = [np.zeros(0, dtype=np.int64)]  # points of each profile
        self.time, self.value = [np.zeros(0)], [np.zeros(0)]  # s, and what entries have then

    def entries(
        self,
        node: NDArray[np.int64],
        axis: NDArray[np.int64] | int,
        times: NDArray[np.float64],
        values: NDArray[np.float64],
        condition: int,
        kind: int = DISPLACEMENT,
    ) -> Entries:
        """A condition on one component of each of these nodes (e,), with values (t, e) at times (t,), s."""
        self.count.append(np.full(len(node), len(times), dtype=np.int64))
        self.time.append(np.tile(times, len(node)))
        self.value.append(values.T.ravel())
        self._next += len(node)
        own = np.arange(self._next - len(node), self._next)
        return entries(node, axis, 1.0, condition, kind)._replace(profile=own)


def chosen(of: Entries, which: NDArray[np.bool_]) -> Entries:
    """The entries selected by a mask (e,)."""
    profile, kind, condition = of.profile[which], of.kind[which], of.condition[which]
    return Entries(of.node[which], of.axis[which], of.value[which], profile, kind, condition)


def drive_of(
    profiles: Sequence[Sequence[tuple[float, float]]],
    loads: Sequence[Entries],
    holds: Sequence[Entries],
    shape: tuple[int, int],
    kind: type[np.floating] = np.float64,
    histories: Histories | None = None,
) -> Drive:
    """Conditions on components (n, w) of this `shape`, with the body forces of time 0.

    An empty profile is 1 at all times. If two holds prescribe one component, the later one counts.
    """
    points, histories = [profile or ((0.0, 1.0),) for profile in profiles], histories or Histories()
    counts = np.concatenate([[0], [len(amplitude) for amplitude in points], *histories.count])
    table = Profiles(
        np.cumsum(counts, dtype=np.int64),
        np.concatenate([np.array([time for amplitude in points for time, _ in amplitude]), *histories.time]),
        np.concatenate([np.array([factor for amplitude in points for _, factor in amplitude]), *histories.value]),
    )
    nothing = entries(np.zeros(0, dtype=np.int64), 0, 0.0, 0)
    all_loads, prescribed = (
        Entries(*(np.concatenate(column) for column in zip(nothing, *entry_lists, strict=True)))
        for entry_lists in (loads, holds)
    )
    number, last = np.arange(len(prescribed.node)), np.zeros(shape, dtype=np.int64)
    last[prescribed.node, prescribed.axis] = number
    prescribed = chosen(prescribed, last[prescribed.node, prescribed.axis] == number)
    force, before = (np.zeros(shape, dtype=kind) for _ in range(2))  # of which most is never touched
    varies = bool((counts > 1).any())
    result = Drive(table, all_loads, prescribed, varies, force, before, *np.zeros((2, len(prescribed.node))))
    for array in (force, before):
        _add_loads(result, 0.0, array)
    result.held_force[:] = result.force[prescribed.node, prescribed.axis]
    return result


def widened(driven: Drive, width: int) -> Drive:
    """Conditions on all components (n, width); they act only on the displacement."""
    more = ((0, 0), (0, width - driven.force.shape[1]))
    return (
        driven._replace(force=np.pad(driven.force, more), before=np.pad(driven.before, more)) if more[1][1] else driven
    )


def constrained_components(drive: Drive) -> NDArray[np.bool_]:
    """Mask (n, w) of the components with a prescribed motion or value."""
    mask = np.zeros(drive.force.shape, dtype=np.bool_)
    mask[drive.holds.node, drive.holds.axis] = True
    return mask


def prescribe_values(drive: Drive, value: NDArray[np.float64], time: float) -> None:
    """Set the held nodes of a `value` (n,) of one component to what is prescribed at `time`, s."""
    holds = drive.holds
    value[holds.node] = holds.value * factors_at(drive.profiles, time)[holds.profile]


def put_loads(drive: Drive, time: float) -> None:
    """Apply the body forces of `time`, s, once, without compiling `apply_loads`."""
    drive.force[drive.loads.node, drive.loads.axis] = 0
    _add_loads(drive, time, drive.force)


def _add_loads(drive: Drive, time: float, force: NDArray[np.floating]) -> None:
    loads, profiles = drive.loads, drive.profiles
    np.add.at(force, (loads.node, loads.axis), loads.value * factors_at(profiles, time)[loads.profile])


def initial_acceleration(drive: Drive, rho: NDArray[np.floating]) -> NDArray[np.floating]:
    """Accelerations (n, d) at time 0 of an undeformed plate of density `rho` (n,), m/s^2."""
    acceleration = drive.force / rho[:, None]
    holds = drive.holds
    for e in range(len(holds.node)):
        prescribed = holds.value[e] * factor_now(drive.profiles, holds.profile[e], 0.0)
        acceleration[holds.node[e], holds.axis[e]] = prescribed if holds.kind[e] == ACCELERATION else 0.0
    return acceleration


def is_corrected(model: Model) -> bool:
    """Whether the edges of a model can be corrected: those of plain bonds in the plane."""
    return model.grid.dimension == 2 and model.materials[0].model == "bond"


def _body_force(
    load: Load,
    vectors: NDArray[np.float64],
    rows: NDArray[np.int64],
    model: Model,
    areas: Areas,
    total: Callable[[NDArray[np.float64]], float],
    exact_total: bool,
) -> NDArray[np.float64]:
    """Body force (rows, d), N/m^3, of a load with these `vectors` (rows, d), or pressures (rows, 1); `total` adds up
    areas."""
    if load.body_force is not None:
        return vectors
    if load.force is not None:
        return vectors / total(areas[rows])
    if load.pressure is not None:
        return pressure_forces(load, vectors[:, 0], model.grid.part(rows).ids) / areas[rows][:, None]
    extent = load.length if model.grid.dimension == 2 else load.surface
    if exact_total and extent is not None:
        shares = shares_of(load, model.grid.ids[rows]) if load.shares is not None else np.ones(len(rows))
        spread = shares * (extent / total(areas[rows] * shares))
    else:
        spread = 1 / (load.rows * model.grid.delta[rows])
    return np.asarray(spread[:, None] * vectors)


@njit
def factor_at(profiles, p, time):  # type: ignore[no-untyped-def]
    """Factor of profile p at `time`, s: linear between points, constant outside."""
    k, after = profiles.start[p], profiles.start[p + 1] - 1
    if time <= profiles.time[k]:
        return profiles.factor[k]
    if time >= profiles.time[after]:
        return profiles.factor[after]
    while after > k + 1:
        middle = (k + after) // 2
        if time < profiles.time[middle]:
            after = middle
        else:
            k = middle
    t0, t1 = profiles.time[k], profiles.time[after]
    return profiles.factor[k] + (profiles.factor[after] - profiles.factor[k]) * (time - t0) / (t1 - t0)


factor_now = getattr(factor_at, "py_func", factor_at)  # for Python, which asks seldom: compiling it would take longer


def factors_at(profiles: Profiles, time: float) -> NDArray[np.float64]:
    """The factors of all profiles at `time`, s."""
    first, last = profiles.start[:-1], profiles.start[1:] - 1
    k = first + np.add.reduceat(profiles.time <= time, first, dtype=np.int64) - 1
    inside = (k >= first) & (k < last)
    factor = profiles.factor[np.clip(k, first, last)]
    k = k[inside]
    t0, t1 = profiles.time[k], profiles.time[k + 1]
    factor[inside] += (profiles.factor[k + 1] - profiles.factor[k]) * (time - t0) / (t1 - t0)
    return factor


def parts_of_loads(drive: Drive, time: float) -> NDArray[np.float64]:
    """What entries of loads (e,) are at `time`, s, over the factor of their condition's profile."""
    loads, amount = drive.loads, drive.loads.value.copy()
    own = loads.profile != loads.condition
    amount[own] *= factors_at(drive.profiles, time)[loads.profile[own]]
    return amount


def factors(condition: Condition, times: Sequence[float]) -> list[float]:
    """A condition's factors at these times, s."""
    at, factor = np.array(condition.profile or ((0.0, 1.0),), dtype=float).T
    factor_values: list[float] = np.interp(times, at, factor).tolist()
    return factor_values


@njit
def apply_loads(drive, time):  # type: ignore[no-untyped-def]
    """Apply the body forces of `time`, s, and keep the previous ones."""
    loads, force = drive.loads, drive.force
    for e in range(len(loads.node)):
        drive.before[loads.node[e], loads.axis[e]] = force[loads.node[e], loads.axis[e]]
    for e in range(len(loads.node)):
        force[loads.node[e], loads.axis[e]] = 0
    for e in range(len(loads.node)):
        share = loads.value[e] * factor_at(drive.profiles, loads.profile[e], time)
        force[loads.node[e], loads.axis[e]] += share


@njit
def prescribe_held_u_and_v(u, v, a, holds, profiles, held_speed, entry, dt, time):  # type: ignore[no-untyped-def]
    """Set the held component e to its prescribed value at `time`, s; u, v, a are (n, 2)."""
    i, axis = holds.node[entry], holds.axis[entry]
    held_speed[entry] = v[i, axis] - dt / 2 * a[i, axis]
    before = u[i, axis] - dt * v[i, axis]
    if holds.kind[entry] == DISPLACEMENT:
        u[i, axis] = holds.value[entry] * factor_at(profiles, holds.profile[entry], time)
        v[i, axis] = (u[i, axis] - before) / dt
    elif holds.kind[entry] == VELOCITY:
        v[i, axis] = holds.value[entry] * factor_at(profiles, holds.profile[entry], time - dt / 2)
        u[i, axis] = before + dt * v[i, axis]


@njit
def accelerate_held_component_and_book_work(v, a, rho, work, holds, profiles, held_speed, held_force, entry, dt, time):  # type: ignore[no-untyped-def]
    """Set the acceleration of the held component e, and book the work of holding it.

    The hold provides the change of kinetic energy and balances the mean force on the component.
    """
    i, axis = holds.node[entry], holds.axis[entry]
    force, way = rho[i] * a[i, axis], dt * v[i, axis]
    a[i, axis] = 0
    value = holds.value[entry] * factor_at(profiles, holds.profile[entry], time)
    if holds.kind[entry] == ACCELERATION:
        a[i, axis] = value
    elif holds.kind[entry] == VELOCITY:
        v[i, axis] = value
    speed = v[i, axis] + dt / 2 * a[i, axis]
    work[i] += rho[i] / 2 * (speed * speed - held_speed[entry] * held_speed[entry])
    work[i] -= (held_force[entry] + force) / 2 * way
    held_force[entry] = force


@njit
def damp_component_and_return_energy(v, a, previous_v, rho, damping, node, axis, dt):  # type: ignore[no-untyped-def]
    """Damp a component at the end of a step with c, 1/s, as at its beginning; the energy taken, J/m^3.

    v, a and `previous_v`, the velocities one step ago, are (n, d). The energy that Verlet takes out of the motion is
    the mean force of both ends times the displacement between them.
    """
    undamped = a[node, axis]
    middle = v[node, axis] - dt / 2 * undamped
    v[node, axis] /= 1 + damping * dt / 2
    a[node, axis] = undamped - damping * v[node, axis]
    return rho[node] * damping * (previous_v[node, axis] + v[node, axis]) / 2 * (dt * middle)
