"""A square plate with a hole of radius 1 in tension along x, E = 1, whose outer nodes move as in an infinite plate."""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from plates import plate, square_grid
from static_solution import settled

from pdmesh.model.document import Material
from pdsolve.fracture.gradients import gradients_of
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun


class Found(NamedTuple):
    """What is found of such a plate."""

    error: float  # relative L2 error of the displacement, inside
    stress: float  # xx, on the y axis, a horizon from the hole
    exact: float


def classical(position: NDArray[np.float64], nu: float, plane: str) -> NDArray[np.float64]:
    """Displacements (n, 2) of an infinite plate under unit tension (Kirsch)."""
    G, kappa = 1 / (2 * (1 + nu)), 3 - 4 * nu if plane == "strain" else (3 - nu) / (1 + nu)
    r, angle = np.hypot(*position.T), np.arctan2(position[:, 1], position[:, 0])
    cos, sin = np.cos(2 * angle), np.sin(2 * angle)
    radial = ((kappa - 1) * r + 2 * r * cos + 2 / r * (1 + (kappa + 1) * cos - cos / r**2)) / (8 * G)
    around = -(2 * r + 2 / r * (kappa - 1 + 1 / r**2)) * sin / (8 * G)
    x, y = np.cos(angle), np.sin(angle)
    return np.column_stack([radial * x - around * y, radial * y + around * x])


def holed(fineness: int, m: float, material: Material) -> PreparedRun:
    """The plate of half-width 3 with `fineness` nodes a radius."""
    delta, side = 1 / fineness, 6 * fineness
    full = square_grid(side, side, delta)
    position = delta * (np.column_stack([np.arange(side**2) % side, np.arange(side**2) // side]) - (side - 1) / 2)
    keep, angle = np.hypot(*position.T) >= 1, 2 * np.pi * np.arange(360) / 360
    grid = dataclasses.replace(
        full,
        **{name: getattr(full, name)[keep] for name in ("ids", "delta", "border", "hole_id")},
        position=position[keep],
        outline=(3.0 * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]]),),
        holes=(np.column_stack([np.cos(angle), np.sin(angle)]),),
    )
    return prepare(plate(grid, m, material=material), Options(threads=1))


def solved(fineness: int, m: float, material: Material) -> Found:
    """At rest."""
    nu = material.nu or 0.0
    (system, state), delta = holed(fineness, m, material), 1 / fineness
    position = system.model.grid.position
    exact = classical(position, nu, material.plane)
    outer = np.abs(position).max(axis=1) > 3 - 2 * m * delta
    held = np.column_stack([outer, outer])
    state.value[:] = settled(system.operator, system.area, held, exact)
    source, target = system.operator.bonds()
    start = np.searchsorted(source, np.arange(len(position) + 1))
    H = gradients_of(position, system.area, state.value, start, target)
    xx, yy = H[:, 0, 0], H[:, 1, 1]
    if material.plane == "stress":
        stress = (xx + nu * yy) / (1 - nu**2)
    else:
        stress = ((1 - nu) * xx + nu * yy) / ((1 + nu) * (1 - 2 * nu))
    y = 1 + m * delta
    near = (np.abs(position[:, 0]) < delta) & (np.abs(position[:, 1] - y) < 0.9 * delta)
    rows = np.unique(np.round(position[near, 1], 9))
    found = np.interp(y, rows, [stress[near & np.isclose(position[:, 1], row)].mean() for row in rows])
    q = 1 / y**2
    error = float(np.linalg.norm((state.value - exact)[~outer]) / np.linalg.norm(exact[~outer]))
    return Found(error, float(found), float((1 + q) / 2 + (1 + 3 * q**2) / 2))
