"""Materials of very different stiffness."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import msgspec
import numpy as np
import pytest
from failure_cases import saying
from periodic_plates import joined
from plates import GLASS, plate, square_grid
from scipy.sparse.linalg import spsolve
from system_checks import at_step, matrix

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh.model.document import Region, Run
from pdsolve.estimate import estimate_run
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun

UNBREAKABLE = msgspec.structs.replace(GLASS, G0=1e12)
ROWS, MIDDLE = 40, 19.5e-3  # m: the materials meet half way between two rows


def layers(contrast: float) -> Model:
    """Glass below, a material `contrast` times softer above."""
    soft = msgspec.structs.replace(UNBREAKABLE, E=GLASS.E / contrast)
    region = Region(box=(-1.0, MIDDLE, 1.0, 1.0), material=soft)
    return plate(square_grid(32, ROWS), 3, material=UNBREAKABLE, regions=(region,), run=Run(steps=1))


def strip(mode: str, contrast: float) -> PreparedRun:
    """The layers without sides."""
    whole = prepare(layers(contrast), Options(mode, threads=1, kernel="listed"))
    return joined(whole, (10e-3, -np.inf, 22e-3, np.inf))


class Stretched(NamedTuple):
    """The layers, their ends held apart."""

    strains: float  # of the soft one over that of the stiff one
    boundary: float  # m: where the straight lines of both displacements meet


def stretched(mode: str, contrast: float) -> Stretched:
    """In series the strain of the soft layer is `contrast` times that of the stiff one, from y = 19.5 mm on."""
    problem = strip(mode, contrast)
    y = problem.system.model.grid.position[:, 1]
    held = np.column_stack([np.ones(len(y), dtype=bool), (y < 3.1e-3) | (y > y.max() - 3.1e-3)])
    free = ~held.ravel()
    u = np.where(held, np.column_stack([0 * y, 1e-6 * y]), 0.0).ravel()
    K = matrix(problem)
    u[free] += spsolve(K[free][:, free].tocsc(), -(K @ u)[free])
    rows = u.reshape(-1, 2)[:, 1].reshape(ROWS, -1).mean(axis=1)
    stiff, soft = (rows[13] - rows[7]) / 6e-3, (rows[32] - rows[26]) / 6e-3
    boundary = (rows[10] - stiff * 10e-3 - rows[29] + soft * 29e-3) / (soft - stiff)
    return Stretched(float(soft / stiff), float(boundary))


def growth(mode: str, contrast: float) -> float:
    """Energy after 2e4 steps of 0.8 of Silling and Askari's bound over that of random velocities at the start."""
    problem = strip(mode, contrast)
    share = 0.8 if mode == "thesis" else 0.8 / np.sqrt(2)
    problem = at_step(problem, share * problem.system.stable_time_step)
    problem.state.rate[:] = 1e-4 * np.random.default_rng(1).standard_normal(problem.state.rate.shape)
    start = compute_energy_balance_row(*problem, 0).kinetic
    problem.advance(1, 20_001)
    found = compute_energy_balance_row(*problem, 20_000)
    return (found.kinetic + found.strain) / start


@pytest.mark.slow
def test_two_materials_in_the_thesis_mode(failure: Callable[..., None]) -> None:
    """Two materials with one-sided bonds.

    Each end of a bond uses the constants of its own node. In a uniform stretch the sum of every node vanishes, whatever
    its constants are. That is equilibrium without any stress passed on from one material to the other.
    """
    thesis, conservative = stretched("thesis", 10), stretched("conservative", 10)
    assert thesis.strains == pytest.approx(1, abs=1e-9)
    assert conservative.strains == pytest.approx(10, rel=1e-3)  # measured 10.003
    energy = {mode: growth(mode, 1e6) for mode in ("thesis", "conservative")}
    assert energy["thesis"] > 1000  # measured 3890
    assert energy["conservative"] == pytest.approx(1.030, abs=0.01)
    says = {}
    for mode in ("thesis", "conservative"):
        with saying() as says[mode]:
            estimate_run(layers(10), Options(mode, threads=1))
    assert len(says["thesis"]) == 1
    assert says["thesis"][0].startswith("model: $.regions: E goes from 6.5e+09 to 6.5e+10 Pa")
    assert says["conservative"] == []
    failure(
        fails="Two layers in series, one ten times softer: the thesis mode stretches both alike (ratio "
        f"{thesis.strains:.2f}). With a contrast of 1:1e6 random motion has {energy['thesis']:.0e} times its initial "
        "energy "
        "after 2e4 steps.",
        noticed="By a warning before the run.",
        says=says["thesis"],
        cure="In the conservative mode each end contributes half of a bond: the ratio is "
        f"{conservative.strains:.2f}, the "
        f"energy {energy['conservative']:.1f} times the first.",
    )


@pytest.mark.slow
def test_a_contrast_of_a_million(failure: Callable[..., None]) -> None:
    """A contrast of 1:1e6.

    Bonds across the boundary have half the stiffness of the stiff side and move its soft neighbours along.
    """
    with saying() as says:
        estimate_run(layers(1e6), Options(threads=1))
    assert says == []
    found = {contrast: 1e3 * (MIDDLE - stretched("conservative", contrast).boundary) for contrast in (10, 1e3, 1e6)}
    assert [abs(shift) < 0.15 for shift in found.values()] == [True] * 3  # measured -0.07, 0.11 and 0.14 spacings
    steps = {contrast: strip("conservative", contrast).system.stable_time_step for contrast in (1, 1e6)}
    soft = steps[1] * 1e3
    assert steps[1e6] == pytest.approx(steps[1], rel=1e-12)
    failure(
        fails="The interface is blurred over a horizon. The stable step is that of the stiff side, "
        f"{steps[1e6]:.2g} s; the soft side alone would allow {soft:.2g} s, a thousand times as much.",
        noticed="Not at all, as nothing is wrong; `pdsolve --dry-run` shows the step.",
        cure=f"None needed: layers in series meet within {max(abs(shift) for shift in found.values()):.2f} spacings "
        "of where they are drawn, for contrasts of 10, 1e3 and 1e6.",
    )
