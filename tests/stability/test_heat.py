"""Heat."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from pdmesh import Heat, Material, Run, Scene, box, build
from pdpost.measures import fields
from pdsolve.model import Model
from pdsolve.run.simulation import Options, simulate

A, D, HOT, COLD = 5e-3, 5e-7, 393.0, 293.0  # m, half of the thickness; m^2/s; K
LARGEST = {10: 0.594, 100: 0.850}  # of E alpha dT at the surface, exact, by Bi


def largest(rows: int, Bi: int, *, steps: int, last: float) -> float:
    """The largest stress at the edge of a quenched slab over the exact one, in steps until `last` of A^2 / D."""
    h, long = A / rows, 6 * A
    glass = Material(E=70e9, rho=2500.0, G0=1e6, alpha=9e-6, T0=HOT)
    run = Run(solver="static", time_step=last * A**2 / D / steps, steps=steps, every=1)
    scene = (
        Scene(box(0, 0, A, long), h, glass, 3.0, run, medium=Heat(k=1.0, c=800.0))
        .initial_temperature(box(-1, -1, 1, 1), HOT)
        .convection("left", h=Bi / A, outside=COLD)
        .fix("right", y=None)
        .fix(box(A - h / 4, long / 2 - h / 4, A, long / 2 + h), x=None, name="level")
    )
    built = build(scene)
    with simulate(Model(built.grid, built.settings), None, Options(threads=1)) as results:
        x, y = results.nodes(0).position.T
        edge = (x < h / 2) & (np.abs(y - long / 2) < 2 * h)
        stress = []
        for step in range(1, steps + 1):
            c = (results.field("T", step)[edge] - COLD) / (HOT - COLD)
            strain = fields.components(results, "strain", step)["yy"][edge] / (9e-6 * (HOT - COLD))
            stress.append(float((strain + 1 - c).mean()))
    return max(stress) / LARGEST[Bi]


@pytest.mark.slow
def test_a_cold_layer_thinner_than_a_horizon(failure: Callable[..., None]) -> None:
    """A cold layer that is thinner than a horizon.

    A strong exchange cools the surface before the inside knows of it. Bonds reach beyond the cold layer.
    """
    coarse, fine = (largest(rows, 100, steps=20, last=0.01) for rows in (8, 24))
    assert coarse < 0.6
    assert fine == pytest.approx(1.0, abs=0.02)
    failure(
        fails="A slab is quenched at Bi = 100. Its surface is stretched most when the cold layer is less than a tenth"
        f" of half the thickness. With 8 spacings in that half the largest stress is {coarse:.2f} of the exact one.",
        noticed="Not at all.",
        cure=f"More spacings: with 24 it is {fine:.3f}.",
    )


@pytest.mark.slow
def test_steps_of_conduction_that_are_long(failure: Callable[..., None]) -> None:
    """Steps of conduction that are long.

    Implicit steps of conduction are stable at any length, and the body comes to rest after each. What happens within
    one is not seen.
    """
    long, short = (largest(10, 10, steps=steps, last=0.09) for steps in (1, 24))
    assert long < 0.9
    assert short == pytest.approx(1.0, abs=0.05)
    failure(
        fails="A slab is quenched at Bi = 10, in one step to twice the time at which its stress is largest: that stress"
        f" is {long:.2f} of the exact one.",
        noticed="Not at all.",
        cure=f"Steps that are short beside that time: in 24 steps it is {short:.2f}.",
    )
