"""One bond led along a path by the solver: envelope, unloading, compression, and what it spends."""

from __future__ import annotations

from itertools import pairwise

import msgspec
import numpy as np
import pytest
from plates import GLASS, plate, square_grid
from system_checks import bonds_of, broken, forces, worst

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh.model.document import Displacement, Material, Run
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun

DELTA, STEP = 1e-3, 1e-8
KR = 2.5


def led(material: Material, mode: str, path: tuple[float, ...]) -> PreparedRun:
    """Two nodes, the first held, the second led through stretches in sqrt(s_p s_0), 1000 steps from one to the next."""
    grid = square_grid(2, 1, DELTA)
    bare = bonds_of(prepare(plate(grid, 2, material=material, run=Run(time_step=STEP)), Options(mode, threads=1)))
    unit = float(np.sqrt(bare.peak[0] * bare.limit[0])) * DELTA
    profile = tuple((1000 * STEP * k, share) for k, share in enumerate(path))
    holds = (
        Displacement(nodes=(1,), x=0.0, y=0.0, breakable=True),
        Displacement(nodes=(2,), x=unit, y=0.0, profile=profile, breakable=True),
    )
    model = plate(grid, 2, material=material, conditions=holds, run=Run(time_step=STEP))
    return prepare(model, Options(mode, threads=1))


def force(problem: PreparedRun) -> tuple[float, float]:
    """Stretch, and force of the bond over its stiffness."""
    u = problem.state.value
    return float((u[1, 0] - u[0, 0]) / DELTA), float(forces(problem, dt=STEP)[0, 0] / bonds_of(problem).stiffness[0])


BRITTLE = msgspec.structs.replace(GLASS, micromodulus="constant")
BILINEAR = msgspec.structs.replace(BRITTLE, law="bilinear", kr=KR)


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("mode", ["thesis", "conservative"])
@pytest.mark.parametrize("keep", [True, False])
def test_the_envelope(mode: str, keep: bool) -> None:
    """Pulled until it is gone, the force is linear to s_p and falls linearly to nothing at s_0."""
    problem = led(msgspec.structs.replace(BILINEAR, keep_G0=keep), mode, (0.0, 2.0))
    bonds = bonds_of(problem)
    peak, limit = bonds.peak[0], bonds.limit[0]
    assert limit / peak == pytest.approx(KR, rel=1e-14)
    for step in range(1, 1001, 10):
        problem.advance(step, step + 10)
        stretch, found = force(problem)
        expected = np.interp(stretch, [0, peak, limit], [0, peak, 0])
        assert found == pytest.approx(expected, abs=1e-12 * peak)  # measured 6e-13
    assert len(broken(problem).step) == problem.system.directed_bond_count == 2


def test_unloading_goes_to_the_origin_and_on_into_compression() -> None:
    """Up past the peak, down into compression, up again: the same line both ways, then the envelope."""
    problem = led(BILINEAR, "conservative", (0.0, 1.0, -1.0, 1.0, 1.3))
    bonds = bonds_of(problem)
    peak, limit = bonds.peak[0], bonds.limit[0]
    worst = float(np.sqrt(peak * limit))  # s_c, where the path turns
    secant = peak * (limit - worst) / (limit - peak) / worst
    assert 0.2 < secant < 0.8
    problem.advance(1, 1001)
    assert force(problem) == pytest.approx((worst, secant * worst), rel=1e-12)
    for step in range(1001, 3001, 50):  # down to -s_c and up again
        problem.advance(step, step + 50)
        stretch, found = force(problem)
        assert found == pytest.approx(secant * stretch, abs=1e-12 * peak)  # measured 6e-16
    for step in range(3001, 4001, 50):
        problem.advance(step, step + 50)
        stretch, found = force(problem)
        assert found == pytest.approx(peak * (limit - stretch) / (limit - peak), rel=1e-10)  # measured 9e-16
    assert len(broken(problem).step) == 0


def test_below_the_peak_nothing_is_spent() -> None:
    problem = led(BILINEAR, "conservative", (0.0, 0.6, -3.0, 0.6, 0.0))
    problem.advance(1, 4001)
    found = compute_energy_balance_row(*problem, 4000)
    assert found.dissipated == 0
    assert not worst(problem).any()
    assert found.work == pytest.approx(found.kinetic, rel=1e-9)  # measured 2e-10


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("mode", ["thesis", "conservative"])
@pytest.mark.parametrize("keep", [True, False])
def test_a_bond_spends_half_c_xi_peak_limit(mode: str, keep: bool) -> None:
    """Both directed halves together, by a way with turns: c xi s_p s_0 / 2 times both areas, to round-off; or 1 / kr
    of the brittle law's where G0 is not kept."""
    material = msgspec.structs.replace(BILINEAR, keep_G0=keep)
    problem = led(material, mode, (0.0, 0.9, -0.5, 1.1, 0.2, 2.0))
    bonds, area = bonds_of(problem), problem.system.area
    c = bonds.stiffness[0] / area[1]
    expected = c * DELTA * bonds.peak[0] * bonds.limit[0] / 2 * area[0] * area[1]
    spent = []
    for first, last in pairwise(range(0, 5001, 50)):
        problem.advance(first + 1, last + 1)
        spent.append(compute_energy_balance_row(*problem, last).dissipated)
    assert len(broken(problem).step) == problem.system.directed_bond_count == 2
    assert spent[-1] == pytest.approx(expected, rel=1e-12)  # measured 2e-16
    assert (np.diff(spent) >= -1e-14 * expected).all()  # nothing is given back
    brittle = bonds_of(prepare(plate(square_grid(2, 1), 2, material=BRITTLE, run=Run(time_step=STEP)), Options(mode)))
    whole = brittle.stiffness[0] * DELTA * brittle.limit[0] ** 2 / 2 * area[0]
    assert spent[-1] == pytest.approx(whole / (1 if keep else KR), rel=1e-12)  # measured 2e-16


@pytest.mark.parametrize("law", ["brittle", "bilinear"])
def test_the_work_of_the_hold_is_what_the_bond_took(law: str) -> None:
    """Half the way to its end and then all of it: reaction work = held + spent, of second order in the step."""
    problem = led(BRITTLE if law == "brittle" else BILINEAR, "conservative", (0.0, 0.5, 2.0))
    problem.advance(1, 1001)
    bonds, area, u = bonds_of(problem), problem.system.area, problem.state.value
    mass, stretch = GLASS.rho * area[1], (u[1, 0] - u[0, 0]) / DELTA
    found = compute_energy_balance_row(*problem, 1000)
    held = float(np.sum(area * bonds.stiffness * DELTA / 4 * stretch**2))
    assert found.strain == pytest.approx(held, rel=1e-12)  # measured 4e-16
    assert found.work == pytest.approx(found.strain + found.dissipated + found.kinetic, rel=1e-9)  # measured 6e-16
    problem.advance(1001, 2001)
    found = compute_energy_balance_row(*problem, 2000)
    kinetic = mass / 2 * problem.state.rate[1, 0] ** 2
    assert found.kinetic == pytest.approx(kinetic, rel=1e-12)
    assert found.work == pytest.approx(found.dissipated + kinetic, rel=1e-6)  # measured 5e-7


def test_a_material_of_kr_1_breaks_like_the_brittle_one() -> None:
    """The limit of no softening: the same bonds, the same bits."""
    runs = []
    for material in (BRITTLE, msgspec.structs.replace(BILINEAR, kr=1.0)):
        problem = led(material, "conservative", (0.0, 1.2))
        problem.advance(1, 1001)
        runs.append([column.tobytes() for column in (*problem.state, *broken(problem))])
    assert runs[0] == runs[1]
