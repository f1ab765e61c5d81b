"""Heat."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.special import erf, erfcx

from pdmesh import Heat, Material, Medium, Run, Scene, box, build
from pdsolve.measures import fields
from pdsolve.model import Model
from pdsolve.run.simulation import Options, simulate

A, D, HOT, COLD = 5e-3, 5e-7, 393.0, 293.0  # m, half of the thickness; m^2/s; K
LARGEST = {10: 0.594}  # of E alpha dT at the surface, exact, by Bi


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
            strain = fields.all_field_components(results, "strain", step)["yy"][edge] / (9e-6 * (HOT - COLD))
            stress.append(float((strain + 1 - c).mean()))
    return max(stress) / LARGEST[Bi]


def off(rows: int) -> float:
    """The largest error of the temperature, of the first difference, where heat has come .087 of a slab deep."""
    h, Bi, Fo = A / rows, 10, 0.0075
    run = Run(solver="implicit", theta=0.6, time_step=Fo * A**2 / D / 30, steps=30, every=30)
    scene = Scene(box(0, 0, A, 8 * h), h, medium=Medium(D=D), horizon=3.0, run=run)
    built = build(scene.begin(box(-1, -1, 1, 1), 1.0).exchange("left", coefficient=Bi * D / A, outside=0.0))
    with simulate(Model(built.grid, built.settings), None, Options(threads=1)) as results:
        x, c = results.nodes(0).position[:, 0], results.field("c", 30)
    deep, steep = x / np.sqrt(4 * D * 30 * run.time_step), Bi * np.sqrt(Fo)
    exact = erf(deep) + np.exp(-(deep**2)) * erfcx(deep + steep)
    return float(np.abs(c - exact).max())


@pytest.mark.slow
def test_a_cold_layer_thinner_than_a_horizon(failure: Callable[..., None]) -> None:
    """A cold layer that is thinner than a horizon.

    Bonds reach beyond the cold layer, so that heat leaves it and comes to it from further away than it should.
    """
    coarse, fine = off(16), off(48)
    assert coarse > 0.03
    assert fine < 0.01
    failure(
        fails="A slab is quenched at Bi = 10. When heat has come half a horizon deep, with 16 spacings in half of the"
        f" thickness, temperatures are off by up to {100 * coarse:.1f} % of the first difference.",
        noticed="Not at all.",
        cure="A horizon that is less deep than heat has come when it matters: with 48 spacings they are off by"
        f" {100 * fine:.1f} % then.",
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
