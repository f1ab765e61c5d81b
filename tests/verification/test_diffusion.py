"""Diffusion beside solutions in closed form: waves that die out, a half-space, a disc that gives off heat."""

from __future__ import annotations

import numpy as np
import pytest
from diffusion_models import ids, lattice, model, row
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import erfc, j0, j1

from pdmesh.model.document import Concentration, Exchange, InitialConcentration, Run
from pdmesh.model.medium import Medium
from pdsolve.diffusion.system import prepare

UNIT = Medium(D=1.0)


@pytest.mark.parametrize("power", [0, 1, 2])
def test_waves_die_out_by_the_symbol_of_the_lattice(power: int) -> None:
    """Deep inside a step takes 1 - dt S(k) of cos k x, to 1e-13; S(k) is D k^2 but for 0.3 to 0.4 % at k horizon = 0.3.

    By the continuum's exp(-D k^2 t) it is 0.1 % off.
    """
    position, steps, k = lattice(1.0, 30.0, 2), 6, 0.1
    medium = Medium(D=1.0, power=power)  # type: ignore[arg-type]
    system, state = prepare(model(position, 1.0, medium, run=Run(steps=steps)), 1)
    x, inside = position[:, 0], np.linalg.norm(position, axis=1) < 4
    middle = int(np.linalg.norm(position, axis=1).argmin())
    row = -system.operator.tangent(state)[[middle]].toarray()[0]
    g, xi = np.delete(row, middle), np.delete(x, middle) - x[middle]
    symbol = float((g * (1 - np.cos(k * xi))).sum())
    assert symbol == pytest.approx(k**2, rel=5e-3)
    state.value[:, 0][:] = np.cos(k * x)
    system.stepper.advance(state, 1, steps + 1)
    expected = (1 - system.time_step * symbol) ** steps * np.cos(k * x)
    assert state.value[:, 0][inside] == pytest.approx(expected[inside], rel=1e-13)
    continuum = np.exp(-(k**2) * steps * system.time_step) * np.cos(k * x)
    assert state.value[:, 0][inside] == pytest.approx(continuum[inside], rel=2e-3)


def half_space(spacing: float, corrected: bool) -> float:
    """RMS of what a bar held at 1 in a layer at its end is off by from erfc, at D t = 0.01."""
    medium = Medium(D=1.0, surface_correction=corrected)
    position = row(round(1 / spacing), spacing, before=4)
    held = Concentration(nodes=ids(position[:, 0] < 0), value=1.0)
    steps = round(0.01 / (0.4 * spacing**2))
    run = Run(time_step=0.01 / steps, steps=steps)
    system, state = prepare(model(position, spacing, medium, conditions=(held,), run=run), 1)
    system.stepper.advance(state, 1, steps + 1)
    x, C = position[4:, 0], state.value[:, 0][4:]
    return float(np.sqrt(np.mean((C - erfc(x / 0.2)) ** 2)))


def test_a_layer_that_is_held_is_of_first_order() -> None:
    """The half-space: an independent program has 3.3e-2, 1.7e-2 and 8.4e-3 at spacings of 0.02, 0.01 and 0.005."""
    off = [half_space(spacing, False) for spacing in (0.02, 0.01, 0.005)]
    assert off == pytest.approx([3.3e-2, 1.7e-2, 8.4e-3], rel=0.02)


def test_a_wall_that_is_held_is_of_second_order() -> None:
    """A quarter with half the spacing: 34 to 140 times nearer than with a layer that holds at its nodes."""
    off = [half_space(spacing, True) for spacing in (0.02, 0.01, 0.005)]
    assert off == pytest.approx([9.88e-4, 2.45e-4, 6.09e-5], rel=0.01)


def ring(spacing: float, corrected: bool) -> tuple[float, float]:
    """RMS of what a ring between held discs is off by from log r at rest, and the flux over the exact one."""
    position = lattice(spacing, 1 + 4 * spacing, 2)
    position = position[np.linalg.norm(position, axis=1) > 0.3 - 4 * spacing]
    r = np.linalg.norm(position, axis=1)
    held = Concentration(nodes=ids(r < 0.3), value=1.0), Concentration(nodes=ids(r >= 1), value=0.0)
    run, medium = Run(solver="implicit", time_step=1e4, steps=3), Medium(D=1.0, surface_correction=corrected)
    system, state = prepare(model(position, spacing, medium, conditions=held, run=run), 1)
    system.stepper.advance(state, 1, 4)
    out = np.zeros(len(r))
    system.operator.rates(state.value[:, 0], out)
    off = (state.value[:, 0] - np.log(r) / np.log(0.3))[system.free]
    flux = -float((system.operator.volume * out)[r < 0.3].sum()) * np.log(1 / 0.3) / (2 * np.pi)
    return float(np.sqrt(np.mean(off**2))), flux


def test_a_ring_between_walls_that_are_held() -> None:
    """Walls that are stairs: 3.6e-3 off and 0.9992 of the flux at a spacing of 0.05; uncorrected 3.7e-2 and 0.869."""
    off, flux = ring(0.05, True)
    assert off == pytest.approx(3.65e-3, rel=0.02)
    assert flux == pytest.approx(1.0, abs=2e-3)
    assert ring(0.05, False)[1] == pytest.approx(0.869, abs=1e-3)


def roots(count: int, Bi: float) -> NDArray[np.float64]:
    """The first roots of b J1(b) = Bi J0(b)."""
    at = np.linspace(1e-6, 4 * count, 200 * count)
    value = at * j1(at) - Bi * j0(at)
    change = np.flatnonzero(np.diff(np.sign(value)))[:count]
    return np.array([brentq(lambda b: b * j1(b) - Bi * j0(b), at[k], at[k + 1]) for k in change])


def test_a_disc_gives_off_heat_through_its_edge() -> None:
    """H. S. Carslaw, J. C. Jaeger, Conduction of Heat in Solids (1959), 7.7: Bi = 1; what is left of it within 1 %."""
    spacing, Bi = 0.05, 1.0
    position = lattice(spacing, 1.0, 2)
    radius = np.linalg.norm(position, axis=1)
    edge = Exchange(nodes=ids(radius > 1 - spacing), coefficient=Bi, length=2 * np.pi)
    begun = InitialConcentration(nodes=ids(radius < 2), value=1.0)
    run = Run(solver="implicit", theta=0.5, time_step=0.01, steps=100)
    system, state = prepare(model(position, spacing, UNIT, conditions=(edge, begun), run=run), 1)
    left, b = [], roots(30, Bi)
    for step in range(1, 101):
        system.stepper.advance(state, step, step + 1)
        left.append(state.value[:, 0].mean())
    t = 0.01 * np.arange(1, 101)
    series = (4 * Bi**2 / (b**2 * (Bi**2 + b**2)) * np.exp(-np.outer(t, b**2))).sum(axis=1)
    off = np.abs(np.array(left) - series)
    assert off.max() < 0.01, off.max()
    supplied = float((system.operator.volume * state.work).sum())
    whole = len(position) * spacing**2
    assert whole + supplied == pytest.approx(float((system.operator.volume * state.value[:, 0]).sum()), rel=1e-13)


@pytest.mark.slow
def test_a_sphere_gives_off_heat_through_its_surface() -> None:
    """H. S. Carslaw, J. C. Jaeger, Conduction of Heat in Solids (1959), 9.4: Bi = 1; what is left within 1 %."""
    spacing, Bi = 1 / 14, 1.0
    position = lattice(spacing, 1.0, 3)
    radius = np.linalg.norm(position, axis=1)
    edge = Exchange(nodes=ids(radius > 1 - spacing), coefficient=Bi, surface=4 * np.pi)
    begun = InitialConcentration(nodes=ids(radius < 2), value=1.0)
    run = Run(solver="implicit", theta=0.5, time_step=0.01, steps=60)
    system, state = prepare(model(position, spacing, UNIT, conditions=(edge, begun), run=run), 1)
    left = []
    for step in range(1, 61):
        system.stepper.advance(state, step, step + 1)
        left.append(state.value[:, 0].mean())
    b = np.pi * (np.arange(30) + 0.5)  # of b cot b = 1 - Bi
    t = 0.01 * np.arange(1, 61)
    series = (6 * Bi**2 / (b**2 * (b**2 + Bi * (Bi - 1))) * np.exp(-np.outer(t, b**2))).sum(axis=1)
    off = np.abs(np.array(left) - series)
    assert off.max() < 0.01, off.max()


@pytest.mark.parametrize(("theta", "order"), [(1.0, 1), (0.5, 2)])
def test_implicit_steps_converge(theta: float, order: int) -> None:
    """To the exponential of the tangent, halving steps by 2^order (measured 1.02 and 2.00); no step is too long."""
    from scipy.sparse.linalg import expm_multiply

    position = lattice(1.0, 6.0, 2)
    radius = np.linalg.norm(position, axis=1)
    begun = InitialConcentration(nodes=ids(radius < 3), value=1.0)
    off = []
    for steps in (8, 16):
        run = Run(solver="implicit", theta=theta, time_step=8.0 / steps, steps=steps)
        system, state = prepare(model(position, 1.0, UNIT, conditions=(begun,), run=run), 1)
        exact = expm_multiply(-8.0 * system.operator.tangent(state), state.value[:, 0])
        system.stepper.advance(state, 1, steps + 1)
        off.append(float(np.abs(state.value[:, 0] - exact).max()))
    assert np.log2(off[0] / off[1]) == pytest.approx(order, abs=0.25)
