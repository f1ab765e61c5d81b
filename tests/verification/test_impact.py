"""Bars that meet, beside what characteristics give: duration, force, velocities, energy and momentum.

In units of the bar: length L = 1, wave speed c, density 1, impedance Z = c. Two equal bars push each other with
Z dv / 2 for 2 L / c and change velocities; one that hits one of twice its length comes to rest; a mass M on a fixed bar
of mass m is Saint-Venant's M v' = -Z (v + 2 sum_k v(t - 2 k L / c)).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import msgspec
import numpy as np
import pytest
from contact_bars import bar, grid_of, moving, struck

from pdmesh.model.document import Displacement, Horizon, Material, RigidBody, Run
from pdmesh.model.mechanical_conditions import Contact
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

N, V = 200, 1e-3  # nodes of a bar; m/s
HELD = 3  # nodes that hold the end of a bar: all that reach into it
ROW = (
    1.16267182  # Pa: of a single row of nodes, which the surface correction makes as stiff as a plate strained one way
)
C = ROW**0.5


@pytest.mark.slow
def test_a_row_is_as_stiff_as_its_tests_take_it_to_be() -> None:
    system, state = prepare(moving(grid_of([bar(0, 1, 1 / N)], 1 / N), (0.0,), None), Options(threads=1))
    state.value[:, 0] = 1e-6 * system.model.grid.position[:, 0]
    held, _ = system.operator.energies(state)
    assert 2 * held[N // 2] / 1e-12 == pytest.approx(ROW, rel=1e-8)


@pytest.mark.slow
def test_equal_bars_change_velocities() -> None:
    grid = grid_of([bar(0, 1, 1 / N), bar(1, 1, 1 / N)], 1 / N)
    model = moving(grid, (V / 2, -V / 2), Contact(), Run(time_step=0.3 / N))
    found, plateau = struck(model, 3 / C), C * V / 2 / N
    on = (found.time * C > 0.4) & (found.time * C < 1.6)
    assert found.lasts(plateau / 2) * C == pytest.approx(2.0, abs=0.04)  # 2.001
    assert found.force[on].mean() / plateau == pytest.approx(1.0, abs=0.02)  # 1.003
    assert found.velocity[-1] / (V / 2) == pytest.approx([-1, 1], abs=0.015)  # -.991, .991
    assert np.abs(found.momentum).max() < 1e-13 * V  # 4e-17
    assert found.drift < 1e-3  # 1.4e-4


@pytest.mark.slow
def test_a_bar_that_hits_one_of_twice_its_length_stops() -> None:
    grid = grid_of([bar(0, 1, 1 / N), bar(1, 2, 1 / N)], 1 / N)
    found = struck(moving(grid, (V, 0.0), Contact(), Run(time_step=0.3 / N)), 3.2 / C)
    assert found.lasts(C * V / 4 / N) * C == pytest.approx(2.0, abs=0.04)  # 2.02
    assert found.velocity[-1] / V == pytest.approx([0.0, 0.5], abs=0.02)  # -.005, .502


def saint_venant(ratio: float, width: float) -> tuple[float, float, float]:
    """End of contact, rebound and largest mean force within `width` of a mass on a bar, in L / c, v and Z v."""
    dt, v = 1e-4, [1.0]
    back, force = round(2 / dt), []
    for step in range(round(8 / dt)):
        push = v[step] + 2 * sum(v[step - k * back] for k in range(1, step // back + 1))
        force.append(push)
        if push < 0:
            break
        v.append(v[step] - dt * push / ratio)
    window = round(width / dt)
    return step * dt, v[-1], float(np.convolve(force, np.full(window, 1 / window), "valid").max())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ratio", "end", "rebound"), [(0.5, 2.505, -0.729), (1.0, 3.068, -0.688), (2.0, 4.709, -0.925), (4.0, 5.9, -0.817)]
)
def test_a_mass_on_a_fixed_bar_bounces_as_saint_venant_has_it(ratio: float, end: float, rebound: float) -> None:
    """Measured: ends 2.505, 3.078, 4.722, 5.909; rebounds .733, .690, .926, .818; forces 1.4, 1.0, .2, .7 % low.

    The mass is a rigid block. The force jumps where a wave comes back, and a lattice overshoots: means over .3 L / c
    are compared.
    """
    count, width = 600, 0.3
    h = 1 / count
    expected = saint_venant(ratio, width)
    assert expected[:2] == pytest.approx((end, rebound), abs=2e-3)
    grid = grid_of([bar(-HELD * h, 1 + HELD * h, h), bar(1, 4 * h, h)], h)
    model = moving(grid, (0.0, 0.0), Contact(), Run(time_step=0.3 * h))
    held = Displacement(nodes=tuple(range(1, HELD + 1)), x=0.0, y=0.0)
    block = RigidBody(nodes=tuple(grid.ids[-4:].tolist()), mass=ratio * h, x=-V)
    settings = msgspec.structs.replace(model.settings, conditions=(held, block))
    found, scale = struck(replace(model, settings=settings), (end + 0.5) / C), C * V / count
    took, window = found.lasts(1e-3 * scale), round(width / C / found.time[0])
    parted = found.velocity[np.searchsorted(found.time, took + 0.01), 1] / -V
    mean = np.convolve(found.force, np.full(window, 1 / window), "valid") / scale
    assert took * C == pytest.approx(end, rel=0.02)
    assert parted == pytest.approx(rebound, rel=0.02)
    assert mean.max() == pytest.approx(expected[2], rel=0.02)


def waves(model: Model) -> float:
    """Speed of waves in the first bar of a plane over that of its material: by its energy at free sides, stretched."""
    system, state = prepare(model, Options(threads=1))
    x, energy, ways = system.model.grid.position, [], (0.0, 0.5, 1.0)
    middle = np.abs(x[:, 0] - 0.5) < 0.2
    for narrow in ways:
        state.value[:] = 1e-6 * x * [1, -narrow]
        held, _ = system.operator.energies(state)
        energy.append(2e12 * float(held[middle].mean()))
    return float(np.sqrt(np.min(np.polyval(np.polyfit(ways, energy, 2), np.linspace(0, 1, 1001)))))


@pytest.mark.slow
@pytest.mark.parametrize(("ratio", "micromodulus"), [(3.0, "constant"), (6.0, "conical")])
def test_bars_of_a_plane_touch_as_long_as_bars_of_a_row(
    ratio: float, micromodulus: Literal["conical", "constant"]
) -> None:
    """In units of the bar, which its edges make stiffer: waves are 1.030 and 1.013 times as fast as in the material."""
    count, rows = 100, 20
    h = 1 / count
    grid = grid_of([bar(0, 1, h, rows), bar(1, 1, h, rows)], h)
    model = moving(grid, (V / 2, -V / 2), Contact(), Run(time_step=0.35 * h))
    material = Material(E=1.0, rho=1.0, G0=1e9, micromodulus=micromodulus)
    plane = replace(
        model, settings=msgspec.structs.replace(model.settings, horizon=Horizon(ratio=ratio), material=material)
    )
    c = waves(plane)
    found, plateau = struck(plane, 3.0), c * V / 2 * rows * h
    on = (found.time > 0.4) & (found.time < 1.4)
    assert c * found.lasts(plateau / 2, gap=0.2) == pytest.approx(2.0, abs=0.06)  # 1.954, 1.975
    assert found.force[on].mean() / plateau == pytest.approx(1.0, abs=0.02)  # 1.003, 1.002
    assert np.abs(found.momentum).max() < 1e-13 * V
    assert found.drift < 1e-3  # 3e-4
