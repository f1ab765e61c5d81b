"""Rigid bodies of a model: which bodies they are, what they weigh, and what they cannot be."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pdmesh.model import node_arrays
from pdmesh.model.document import Acceleration, Displacement, GridError, InitialVelocity, Settings, Velocity
from pdmesh.model.mechanical_conditions import RigidBody, wrong_spin
from pdmesh.model.node_grid import Grid
from pdmesh.model.values_at_places import values_at

OUTSIDE = 1e-6  # of a radius, by which a node may be outside of it


def rigid_bodies(grid: Grid, settings: Settings) -> Iterator[tuple[RigidBody, NDArray[np.int64], int]]:
    """Each rigid body, the rows (k,) of its nodes, and its number among the conditions."""
    for number, condition in enumerate(settings.conditions):
        if isinstance(condition, RigidBody):
            rows = np.flatnonzero(node_arrays.selected(grid, condition.nodes, condition.box))
            yield condition, rows, number


def without_bonds(grid: Grid, settings: Settings, name: str) -> Grid:
    """The grid whose rigid bodies have no bonds. Raises GridError for what no rigid body can be."""
    body_records = tuple(rigid_bodies(grid, settings))
    if not body_records:
        return grid
    numbers = []
    for body, rows, number in body_records:
        place = f"$.conditions[{number}]"
        wrong = contradiction(body, grid.dimension)
        if wrong is not None:
            raise GridError(f"{name}: {place}.{wrong}")
        body_numbers = np.unique(grid.bodies.number[rows]) if grid.bodies is not None else np.zeros(1, dtype=np.int64)
        node_count = len(grid) if grid.bodies is None else int(np.isin(grid.bodies.number, body_numbers).sum())
        if grid.bodies is None or len(body_numbers) != 1 or node_count != len(rows) or body_numbers[0] in numbers:
            raise GridError(f"{name}: {place} has {len(rows)} nodes; give all those of one body")
        if body.radius is not None:  # of a surface that is about a spacing outside of the nodes
            x, cell = grid.position[rows], grid.cells[rows]
            far = float(np.sqrt(((x - cell @ x / cell.sum()) ** 2).sum(axis=1)).max())
            wide = float(np.sqrt(grid.dimension) * grid.delta[rows].max())
            if not far * (1 - OUTSIDE) <= body.radius <= far + wide:
                raise GridError(
                    f"{name}: {place}.radius is {body.radius:g} m; use {far:.4g} to {far + wide:.4g} m, as its nodes"
                    f" are up to {far:.4g} m from their centre"
                )
        # conditions that hold nodes of a rigid body
        for held_number, condition in enumerate(settings.conditions):
            if not isinstance(condition, Displacement | Velocity | Acceleration):
                continue
            if node_arrays.selected(grid, condition.nodes, condition.box)[rows].any():
                raise GridError(
                    f"{name}: $.conditions[{held_number}] has nodes of the rigid body of {place}; leave them out:"
                    " its own 'held' holds it"
                )
        numbers.append(int(body_numbers[0]))
    assert grid.bodies is not None
    return replace(grid, bodies=grid.bodies._replace(rigid=tuple(numbers)))


def contradiction(body: RigidBody, dimension: int) -> str | None:
    """What a rigid body in the plane (2) or in space (3) cannot be: place, found and expected; None if all can be."""
    ways = body.ways(dimension)
    if body.mass is None and not set(ways) <= set(body.held):
        unit = "kg/m" if dimension == 2 else "kg"
        return f"mass is missing for a rigid body that is free; give {unit}, or hold {', '.join(ways)}"
    if not set(body.held) <= set(ways):
        return f"held has z; use {', '.join(ways)} in a plate"
    return wrong_spin(body.spin, dimension)


def densities(grid: Grid, settings: Settings, rho: NDArray[np.float64]) -> NDArray[np.float64]:
    """Densities (n,), kg/m^3, with those of rigid bodies that have a mass."""
    for body, rows, _ in rigid_bodies(grid, settings):
        if body.mass is not None:
            rho[rows] = body.mass / grid.cells[rows].sum()
    return rho


def rigid_velocities(body: RigidBody, x: NDArray[np.float64], mass: NDArray[np.float64]) -> NDArray[np.float64]:
    """Velocities (k, d), m/s, at time 0 of its nodes at x (k, d) with these masses (k,) in any unit."""
    factor = body.profile[0][1] if body.profile else 1.0
    axis_factors = np.where([way in body.held for way in "xyz"], factor, 1.0)
    spin = spin_of(body) * (factor if "spin" in body.held else 1.0)
    return _turning(axis_factors * np.array([body.x, body.y, body.z]), spin, x, mass)


def first_velocities(
    start: InitialVelocity, x: NDArray[np.float64], mass: NDArray[np.float64]
) -> list[NDArray[np.float64] | None]:
    """Velocities (k,), m/s, along each axis at time 0 of nodes at x (k, d) that turn about the centre of these masses
    (k,); None along one that leaves what an earlier condition gave. Raises PlaceError."""
    way = np.column_stack([values_at(value or 0.0, x) for value in (start.x, start.y, start.z)])
    velocities = _turning(way, spin_of(start), x, mass)
    return [velocities[:, axis] if sets else None for axis, sets in enumerate(components_set(start)[: x.shape[1]])]


def components_set(start: InitialVelocity) -> tuple[bool, ...]:
    """Whether an initial velocity sets its component along x, y and z.

    It leaves one that is missing, or 0 beside another that is not, to earlier conditions; a spin sets those across it.
    """
    velocity, spin = (start.x, start.y, start.z), spin_of(start)
    moves = any(value not in (None, 0.0) for value in velocity)
    turns = [bool(np.delete(spin, axis).any()) for axis in range(3)]
    return tuple(
        turn or not (value is None or (value == 0.0 and moves)) for value, turn in zip(velocity, turns, strict=True)
    )


def _turning(
    velocity: NDArray[np.float64], spin: NDArray[np.float64], x: NDArray[np.float64], mass: NDArray[np.float64]
) -> NDArray[np.float64]:
    return np.asarray((velocity + np.cross(spin, wide(x - mass @ x / mass.sum())))[:, : x.shape[1]])


def spin_of(body: RigidBody | InitialVelocity) -> NDArray[np.float64]:
    """The spin of a body as a vector (3,), rad/s."""
    return np.array(body.spin if isinstance(body.spin, tuple) else (0.0, 0.0, body.spin))


def wide(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors (k, d) with three components."""
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))
