"""Pressure in a thick-walled cylinder (G. Lame) and in cracks (I. N. Sneddon)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from messages import naming
from numpy.typing import NDArray
from pressure_cracks import MATERIAL, NU, A, E, P, exact_of_penny, line_crack, opening_of_line, penny, solved

from pdmesh import Circle, Material, Run, Scene, Static, box, build, friedlander
from pdsolve.measures.intensities_3d import compute_front_intensities
from pdsolve.measures.loaded_faces import loaded_faces_at
from pdsolve.measures.stress_intensities import follow_tip_intensities
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.results import Results, ResultsError
from pdsolve.run.simulation import resume, simulate


@pytest.mark.slow
@pytest.mark.parametrize(("fineness", "inner", "outer"), [(10, 0.012, -0.026), (20, -0.008, -0.029)])
def test_a_thick_cylinder_has_lames_displacements(fineness: int, inner: float, outer: float) -> None:
    """b = 2 a: u E / (p a) is 2 at the inner edge and 4/3 at the outer one; free edges of bonds are too stiff."""
    ring = Scene(Circle(0, 0, 2 * A), A / fineness, MATERIAL, run=Run(solver="static")).hole(Circle(0, 0, A))
    ring = ring.load("hole nearest 0,0", pressure=P)
    ring = ring.roller(0, 2 * A, "y").roller(0, -2 * A, "y").roller(2 * A, 0, "x")
    position, u = solved(ring)
    r = np.hypot(*position.T)
    moved = (u * position).sum(axis=1) / r

    def off(at: float) -> float:
        near = np.abs(r - at) < 0.5 * A / fineness
        exact = P * (r[near] * 2 / 3 + 16 / 3 * A**2 / r[near]) / (3 * E)
        return float((moved[near] / exact).mean() - 1)

    assert off(A) == pytest.approx(inner, abs=3e-3)
    assert off(2 * A) == pytest.approx(outer, abs=3e-3)
    assert off(1.5 * A) == pytest.approx(0, abs=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(("fineness", "middle", "area"), [(10, -0.006, 0.021), (20, -0.011, 0.003)])
def test_a_line_crack_opens_as_sneddons(fineness: int, middle: float, area: float) -> None:
    """w(0) = 4 p a / E and area 2 pi p a^2 / E of plane stress, at the nodes beside the crack, within 2 %; outer
    nodes move as in an infinite plate."""
    position, u = solved(line_crack(fineness))
    x, exact = opening_of_line(position)

    def opening(of: NDArray[np.float64]) -> NDArray[np.float64]:
        across = np.sort(np.unique(np.abs(position[:, 1])))[0]
        above, below = (np.isclose(position[:, 1], side * across) & (np.abs(x) < A) for side in (1, -1))
        return np.asarray(of[above, 1] - of[below, 1])

    wide, wide_exact = opening(u), opening(exact)
    assert wide.max() / wide_exact.max() - 1 == pytest.approx(middle, abs=2e-3)
    assert wide.sum() / wide_exact.sum() - 1 == pytest.approx(area, abs=2e-3)
    assert wide_exact.max() == pytest.approx(4 * P * A / E, rel=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(("fineness", "K_off", "J_off"), [(10, -0.0014, -0.028), (20, 0.001, -0.014)])
def test_a_line_crack_has_sneddons_intensity(fineness: int, K_off: float, J_off: float) -> None:
    """K = p sqrt(pi a), whatever the ring: the pressure on the faces within it counts."""
    built = build(line_crack(fineness))
    with simulate(Model(built.grid, built.settings), None, Options(threads=1)) as results:
        tips = follow_tip_intensities(results, [1])
    K = P * np.sqrt(np.pi * A)
    for tip in tips:
        assert tip.value["K1"][0] / K - 1 == pytest.approx(K_off, abs=1e-3)
        assert tip.value["J"][0] * E / K**2 - 1 == pytest.approx(J_off, abs=2e-3)
        assert tip.high["J"][0] / tip.low["J"][0] < 1.005
        assert abs(tip.value["K2"][0]) < 1e-3 * K
        assert abs(tip.value["T"][0]) < 0.02 * P


@pytest.mark.slow
def test_a_penny_has_sneddons_opening_volume_and_intensity() -> None:
    """w(0) = 8 p a / (pi E'), V = 16 p a^3 / (3 E') and K = 2 p sqrt(a / pi) within 2 %, at 8 spacings in the radius;
    outer nodes move as in an infinite body."""
    built = build(penny(8, 2.5))
    with simulate(Model(built.grid, built.settings), None, Options(threads=2)) as results:
        (front,) = compute_front_intensities(results, 1)
        uz = results.field("uz", 1)
    position, exact = built.grid.position, exact_of_penny(built.grid.position)[:, 2]
    inside, near = np.hypot(*position[:, :2].T) < A, np.abs(position[:, 2]).min()
    above, below = (inside & np.isclose(position[:, 2], side * near) for side in (1, -1))
    wide, wide_exact = (of[above] - of[below] for of in (uz, exact))
    assert wide.max() / wide_exact.max() - 1 == pytest.approx(-0.0163, abs=2e-3)
    assert wide.sum() / wide_exact.sum() - 1 == pytest.approx(0.018, abs=2e-3)
    K = 2 * P * np.sqrt(A / np.pi)
    known = front.points_with_values
    assert len(known) == len(front.points)
    assert front.value["K1"][known].mean() / K - 1 == pytest.approx(0.0148, abs=2e-3)
    assert np.ptp(front.value["K1"][known]) < 0.005 * K
    assert front.value["J"][known].mean() * E / (1 - 1 / 16) / K**2 - 1 == pytest.approx(-0.015, abs=3e-3)


def tube(following: bool) -> Scene:
    """A tube of nearly incompressible rubber with b = 2 a, whose pressure grows to 0.23337 of its shear modulus."""
    shear, nu, rho = 1e6, 0.49, 1000.0
    rubber = Material(
        E=2 * shear * (1 + nu), nu=nu, rho=rho, G0=1e9, model="correspondence", solid="neo hooke", plane="strain"
    )
    period = 8 * A / np.sqrt(shear / rho)
    run = Run(duration=6 * period, damping=2 * np.pi / period, every=10**6)
    ring = Scene(Circle(0, 0, 2 * A), A / 8, rubber, run=run).hole(Circle(0, 0, A))
    ramp = ((0.0, 0.0), (2 * period, 1.0))
    return ring.load("hole nearest 0,0", pressure=0.23337 * shear, profile=ramp, following=following)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*run.damping took")
@pytest.mark.parametrize(("following", "widened"), [(True, 1.1960), (False, 1.1632)])
def test_a_pressure_that_follows_widens_a_rubber_tube(following: bool, widened: float) -> None:
    """r(a) / a = 1.2 of an incompressible neo-Hookean tube; a dead pressure loses the factor r(a) / a."""
    built = build(tube(following))
    with simulate(Model(built.grid, built.settings), None, Options(threads=1)) as results:
        step = int(results.frames()[0][-1])
        u = np.column_stack([results.field(name, step) for name in ("ux", "uy")])
        books = results.history()[-1]
    r, moved = np.hypot(*built.grid.position.T), np.hypot(*(built.grid.position + u).T)
    near = r < 1.125 * A
    assert np.sqrt(1 + (moved**2 - r**2)[near].mean() / A**2) == pytest.approx(widened, abs=1e-3)
    left = books["strain"] + books["kinetic"] + books["damped"]
    assert books["work"] == pytest.approx(left, rel=1e-6)


@pytest.mark.slow
def test_a_run_with_a_following_pressure_resumes_bit_identically(tmp_path: Path) -> None:
    ring = Scene(Circle(0, 0, 2 * A), A / 8, MATERIAL, run=Run(steps=40, every=20)).hole(Circle(0, 0, A))
    built = build(ring.load("hole nearest 0,0", pressure=1e9, following=True, profile=((0.0, 0.0), (1e-5, 1.0))))
    model, path = Model(built.grid, built.settings), tmp_path / "stopped.sqlite"
    simulate(model, path, Options(threads=1), lambda progress: progress.step == 23).close()
    resume(path, threads=1).close()
    with simulate(model, None, Options(threads=1)) as whole, Results.open(path) as again:
        assert np.array_equal(whole.field("ux", 40), again.field("ux", 40))
        assert np.array_equal(whole.history(), again.history())


@pytest.mark.slow
def test_a_plate_under_blast_takes_up_its_impulse() -> None:
    """Momentum is the impulse of the pressure, with its suction; the middle of a plate that cannot widen moves with
    p / (rho c) as the wave passes, within 5 %."""
    blast = friedlander(4e-5, 1.0)
    plate = Scene(box(0, 0, 0.2, 0.04), 1e-3, MATERIAL, 4, run=Run(duration=6e-5, every=5))
    plate = plate.fix("top", x=None).fix("bottom", x=None).load("left", pressure=P, profile=blast)
    built = build(plate)
    with simulate(Model(built.grid, built.settings), None, Options(threads=1)) as results:
        books, steps = results.history(), results.frames()[0]
        middle = np.flatnonzero((np.abs(results.nodes(0).position - [0.1, 0.02]) < [1e-4, 6e-3]).all(axis=1))
        speed = np.array([results.field("vx", int(step))[middle].mean() for step in steps])
        time = steps * float(results.meta()["time_step"])
    at = np.linspace(0, books["time"], 4001)
    impulse = 0.04 * P * np.trapezoid(np.interp(at, *np.array(blast).T), at, axis=0)
    assert books["momentum_x"][1:] == pytest.approx(impulse[1:], rel=5e-3)
    c = np.sqrt(E / (1 - NU**2) / 2500)
    passing = (time > 0.1 / c + 5e-6) & (time < 0.1 / c + 3e-5)
    exact = P / (2500 * c) * np.interp(time - 0.1 / c, *np.array(blast).T)
    assert speed[passing].mean() / exact[passing].mean() == pytest.approx(0.954, abs=0.01)  # the lattice is stiffer


@pytest.mark.slow
def test_intensities_along_an_equilibrium_path_are_refused_under_pressure() -> None:
    """The load factor of a path is not in the results."""
    soft = Material(E=E, rho=2500, G0=1e3, law="bilinear", kr=2.0)
    plate = Scene(box(0, 0, 0.02, 0.016), 1e-3, soft, run=Run(solver="static", static=Static(load_steps=1)))
    plate = plate.crack([(0.0065, 0.0085), (0.0135, 0.0085)], "slit").load("crack slit", pressure=P).fix("bottom")
    built = build(plate)
    said = naming("pressure", "load factor", expected="load steps")
    results = simulate(Model(built.grid, built.settings), None, Options(threads=1))
    with results, pytest.raises(ResultsError, match=said):
        loaded_faces_at(results, 1)
