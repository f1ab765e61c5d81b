"""Bars of one body each that meet, and what they push each other with."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh.model.document import Contact, InitialVelocity, Material, Region, Run, Settings
from pdmesh.model.node_grid import Bodies, Grid
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.measures import EnergyBalanceRow
from pdsolve.run.prepare import prepare

USUAL = Run()
UNIT = Material(E=1.0, rho=1.0, G0=1e9, micromodulus="constant")


def grid_of(parts: list[NDArray[np.float64]], delta: float) -> Grid:
    """Nodes (n, d) of each body, in the middles of their squares or cubes."""
    position, number = np.round(np.concatenate(parts), 12), np.repeat(np.arange(len(parts)), list(map(len, parts)))
    nodes, d = position.shape
    names = tuple(f"body {part}" for part in range(len(parts)))
    return Grid(
        ids=np.arange(1, nodes + 1),
        position=position,
        delta=np.full(nodes, delta),
        border=np.zeros(nodes, dtype=bool),
        hole_id=np.full(nodes, -1),
        cracks=np.zeros((0, 4 if d == 2 else 9)),
        areas=np.full(nodes, delta**d),
        bodies=Bodies(number, names),
    )


def bar(start: float, length: float, delta: float, rows: int = 1) -> NDArray[np.float64]:
    """Nodes of a bar along x from `start` on, m."""
    count = round(length / delta)
    x = start + delta * (np.arange(count) + 0.5)
    return np.column_stack([np.tile(x, rows), np.repeat(delta * (np.arange(rows) + 0.5), count)])


def moving(
    grid: Grid, speeds: tuple[float, ...], contact: Contact | None, run: Run = USUAL, rho: tuple[float, ...] = ()
) -> Model:
    """Bodies of one material, but for their densities, with speeds along x at time 0, m/s."""
    assert grid.bodies is not None
    nodes = [tuple(grid.ids[grid.bodies.number == number].tolist()) for number in range(len(speeds))]
    starts = (InitialVelocity(nodes=own, x=speed) for own, speed in zip(nodes, speeds, strict=True) if speed)
    heavy = (
        Region(nodes=own, material=Material(E=1.0, rho=density, G0=1e9, micromodulus="constant"))
        for own, density in zip(nodes, rho, strict=False)
    )
    return Model(
        grid, Settings(material=UNIT, regions=tuple(heavy), conditions=tuple(starts), contact=contact, run=run)
    )


class Impact(NamedTuple):
    """An impact along x; s steps, 2 bodies."""

    time: NDArray[np.float64]  # (s,) s
    force: NDArray[np.float64]  # (s,) on the last body, N/m
    velocity: NDArray[np.float64]  # (s, bodies) mean, m/s
    momentum: NDArray[np.float64]  # (s,) N s/m
    first: EnergyBalanceRow
    last: EnergyBalanceRow
    drift: float  # largest change of the energy, over that at the start

    def lasts(self, level: float, gap: float = 0.02) -> float:
        """From the first time at which the force is above a level to that from which on it is not for a `gap`, s."""
        on = np.flatnonzero(self.force > level)
        gaps = np.flatnonzero(np.diff(self.time[on], append=np.inf) > gap)
        return float(self.time[on[gaps[0]]] - self.time[on[0]])


def struck(model: Model, duration: float, threads: int = 1) -> Impact:
    """The motion of a model for some seconds."""
    system, state = prepared = prepare(model, Options(threads=threads))
    assert model.grid.bodies is not None
    mass, number = system.area * model.rho, model.grid.bodies.number
    first, drift, time, force, velocity = compute_energy_balance_row(system, state, 0), 0.0, [], [], []
    for step in range(1, int(duration / system.time_step) + 1):
        prepared.advance(step, step + 1)
        time.append(step * system.time_step)
        pull = mass * state.second[:, 0]
        force.append(float(pull[number == number.max()].sum()))
        velocity.append(np.bincount(number, mass * state.rate[:, 0]) / np.bincount(number, mass))
        if step % 10 == 0:
            now = compute_energy_balance_row(system, state, step)
            drift = max(drift, abs(now.kinetic + now.strain - now.work - first.kinetic) / first.kinetic)
    found = np.array(velocity)
    momentum = found @ np.bincount(number, mass)
    return Impact(
        np.array(time), np.array(force), found, momentum, first, compute_energy_balance_row(system, state, step), drift
    )
