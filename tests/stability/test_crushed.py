"""Plates that are crushed.

Bonds break in tension only, and contact is between nodes that no intact bond joins.
"""

from __future__ import annotations

from collections.abc import Callable

import msgspec
import numpy as np
from failure_cases import Said
from messages import mentions
from plates import plate, square_grid

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh.model.document import Contact, Run, Velocity
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

DELTA = 2.0**-10  # m: of a kind that sums without rounding


def pressed(speed: float, **run: object) -> Model:
    """A plate of 12 x 8 nodes, its outer columns held at this speed (m/s) towards each other."""
    sides = (
        Velocity(box=(-1.0, -1.0, 0.1 * DELTA, 1.0), x=speed),
        Velocity(box=(10.9 * DELTA, -1.0, 1.0, 1.0), x=-speed),
    )
    return plate(square_grid(12, 8, DELTA), 3, conditions=sides, run=Run(**run))  # type: ignore[arg-type]


def test_velocities_that_crush(failure: Callable[..., None], pdsolve: Callable[..., Said]) -> None:
    """Prescribed velocities that crush a plate.

    The force of a bond is linear down to zero length, where it is finite, and then reverses its direction. Nodes pass
    through each other, the energy stays finite, and nothing looks wrong.
    """
    said = pdsolve(pressed(1000.0, steps=200, every=10))
    assert said.code == 0
    assert len(said.err) == 1
    assert mentions(said.err[0], "inside out", "intact")
    work = prepare(pressed(1000.0, steps=200), Options(threads=1))
    work.advance(1, 61)
    gap = np.diff(work.state.value.reshape(8, 12, 2)[..., 0].mean(axis=0)) / DELTA + 1
    assert gap.min() < 0  # measured -7.8: a column has passed its neighbour
    pushed = pressed(1000.0, steps=200)
    settings = msgspec.structs.replace(pushed.settings, contact=Contact())
    contact = prepare(Model(pushed.grid, settings), Options(threads=1))
    contact.advance(1, 61)
    touched = np.diff(contact.state.value.reshape(8, 12, 2)[..., 0].mean(axis=0)) / DELTA + 1
    assert touched.min() < 0  # -6.5: contact does not act where bonds are intact
    energy = compute_energy_balance_row(*work, 60)
    assert np.isfinite(energy.strain)
    gentle = pdsolve(pressed(5.0, steps=226, every=10))
    shorter = 2 * 5.0 * 226 * work.system.time_step / (11 * DELTA)
    assert (gentle.code, gentle.err) == (0, [])
    failure(
        fails=f"Edges driven against each other at 1000 m/s: neighbouring columns end {gap.min():.1f} spacings apart, "
        "in reverse order, and the energy is finite.",
        noticed="By a warning at the first check that finds a triangle of nodes turned inside out with its bonds "
        "intact.",
        says=said.err,
        cure="None: contact does not act between nodes that intact bonds join, and with it the columns end "
        f"{touched.min():.1f} spacings apart. "
        f"Use lower speeds: at 5 m/s, up to a shortening of {100 * shorter:.0f} "
        "%, there is no warning.",
    )


def test_two_nodes_that_meet(failure: Callable[..., None], pdsolve: Callable[..., Said]) -> None:
    """Two nodes that meet at one point.

    A bond of zero length has no direction: its force is 0 / 0.
    """
    steps, dt = 64, 2.0**-23
    speed = DELTA / 2 / (steps * dt)
    halves = (
        Velocity(box=(-1.0, -1.0, 4 * DELTA, 1.0), x=speed, y=0.0),
        Velocity(box=(5 * DELTA, -1.0, 1.0, 1.0), x=-speed, y=0.0),
    )
    run = Run(time_step=dt, steps=100, every=16)
    said = pdsolve(plate(square_grid(10, 6, DELTA), 3, conditions=halves, run=run))
    assert said.code == 3
    assert len(said.err) == 1
    for part in (
        f"unstable at step {steps},",
        "energy is nan times",
        "the step is not the cause",
    ):
        assert part in said.err[0]
    later = tuple(Velocity(box=half.box, x=0.999 * half.x, y=0.0) for half in halves)  # type: ignore[operator]
    missed = pdsolve(plate(square_grid(10, 6, DELTA), 3, conditions=later, run=run))
    assert missed.code == 0
    assert "turned inside out" in missed.err[0]
    failure(
        fails=f"Two halves of a plate, moved so that their edges meet exactly at step {steps}: displacements are NaN.",
        noticed="The run stops (exit code 3) and says that the time step is not the cause; earlier frames are kept.",
        says=said.err,
        cure="Speeds 0.1 % lower miss the point: the run goes on, with the warning about triangles turned inside out.",
    )
