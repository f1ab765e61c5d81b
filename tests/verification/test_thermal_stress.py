"""Stress of bodies that heat: free and clamped bars, in plane stress and plane strain, as pdpost has it."""

from __future__ import annotations

import numpy as np
import pytest

from pdmesh import Circle, Material, Medium, Run, Scene, box, build
from pdsolve.measures.embedded_model import expect_mechanics
from pdsolve.measures.fields import all_field_components
from pdsolve.model import Model
from pdsolve.results import Results, ResultsError
from pdsolve.run.simulation import Options, simulate

E, ALPHA, T0, DT, LONG, HIGH = 200e9, 1e-5, 300.0, 100.0, 0.04, 0.02
STEEL = Material(E=E, rho=8000.0, G0=1e12, micromodulus="constant", alpha=ALPHA, T0=T0)
NU = {"stress": 1 / 3, "strain": 1 / 4}  # of bonds


def heated(plane: str, *, clamped: bool, fields: tuple[str, ...] | None = None) -> Results:
    """A bar hotter by DT everywhere, at rest; held along x at its left end, or at both."""
    material = Material(E=E, rho=8000.0, G0=1e12, micromodulus="constant", alpha=ALPHA, T0=T0, plane=plane)  # type: ignore[arg-type]
    run = Run(solver="static", time_step=1.0, steps=1, every=1, **({"fields": fields} if fields else {}))  # type: ignore[arg-type]
    scene = (
        Scene(box(0, 0, LONG, HIGH), 1e-3, material, medium=Medium(D=1e-5), run=run)
        .initial_temperature(box(-1, -1, 1, 1), T0 + DT)
        .fix("left", y=None, rows=1)
        .fix(box(-1e-4, -1e-4, 1e-4, 1e-4), x=None)
    )
    built = build(scene.fix("right", y=None, rows=1) if clamped else scene)
    return simulate(Model(built.grid, built.settings), None, Options(threads=1))


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("plane", ["stress", "strain"])
def test_a_free_bar_has_no_stress_in_its_plane(plane: str) -> None:
    """It grows by alpha dT in plane stress, by 1 + nu times that in plane strain, where E alpha dT pushes along z."""
    with heated(plane, clamped=False) as results:
        stress, strain = all_field_components(results, "stress", 1), all_field_components(results, "strain", 1)
    scale = E * ALPHA * DT
    within = max(np.abs(stress[name]).max() for name in ("xx", "yy", "xy"))
    assert within < 5e-6 * scale  # measured 1.1e-6: fields are in single precision
    grown = ALPHA * DT * (1 if plane == "stress" else 1 + NU[plane])
    assert np.abs(strain["xx"] - grown - grown**2 / 2).max() < 5e-6 * grown
    assert np.abs(stress["zz"] + (0.0 if plane == "stress" else scale)).max() < 5e-6 * scale


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(("plane", "expected"), [("stress", 1.0), ("strain", 4 / 3)])
def test_a_clamped_bar_pushes(plane: str, expected: float) -> None:
    """E alpha dT in plane stress, that over 1 - nu in plane strain."""
    with heated(plane, clamped=True) as results:
        push = float(results.reactions()[-1]["force_x"])
        middle = np.argmin(np.hypot(*(results.nodes(1).position - [LONG / 2, HIGH / 2]).T))
        stress = all_field_components(results, "stress", 1)["xx"][middle]
    assert push / HIGH == pytest.approx(-expected * E * ALPHA * DT, rel=0.01)  # measured 0.65 and 0.66 % less
    assert stress == pytest.approx(-expected * E * ALPHA * DT, rel=0.06)  # measured 5.5 % less: ends are softer


@pytest.mark.slow
def test_stress_asks_for_the_temperature_and_crack_tips_are_refused() -> None:
    with heated("stress", clamped=False, fields=("ux", "uy")) as results:
        with pytest.raises(ResultsError, match="'c'"):
            all_field_components(results, "stress", 1)
        with pytest.raises(ResultsError, match="thermoelastic"):
            expect_mechanics(results)


RADIUS, HEATED = 0.03, 0.01  # m


@pytest.mark.slow
def test_a_disc_with_a_hot_middle() -> None:
    """E alpha dT (a / R)^2 around the rim, and E alpha dT (1 - (a / R)^2) / 2 of pressure in the middle."""
    scene = (
        Scene(
            Circle(0, 0, RADIUS),
            1.5e-3,
            STEEL,
            medium=Medium(D=1e-12),
            run=Run(solver="static", time_step=1.0, steps=1),
        )
        .initial_temperature(Circle(0, 0, HEATED), T0 + DT)
        .fix(box(-1e-4, -1e-4, 1e-4, 1e-4))
        .fix(box(RADIUS / 2 - 1e-4, -1e-4, RADIUS / 2 + 1e-4, 1e-4), x=None)
    )
    built = build(scene)
    with simulate(Model(built.grid, built.settings), None, Options(threads=1)) as results:
        nodes, stress, T = results.nodes(1), all_field_components(results, "stress", 1), results.field("c", 1)
        u = np.column_stack([results.field(name, 1).astype(float) for name in ("ux", "uy")])
    r = np.hypot(*nodes.position.T)
    share = nodes.area[T > T0 + DT / 2].sum() / nodes.area.sum()  # of the disc that is hot
    assert share == pytest.approx((HEATED / RADIUS) ** 2, rel=0.1)
    scale, middle = E * ALPHA * DT, stress["xx"][r < HEATED / 2].mean()
    rim = stress["largest"][r > RADIUS - 2e-3].mean()
    assert middle == pytest.approx(-scale * (1 - share) / 2, rel=0.03)  # measured 1.2 % more
    assert rim == pytest.approx(scale * share, rel=0.1)  # measured 5.0 % more, in rows of steps
    outer, size = r > RADIUS - 2e-3, nodes.area.sum() / np.pi
    exact = ALPHA * DT * share / 2 * ((1 + NU["stress"]) * size / r[outer] ** 2 + 1 - NU["stress"])
    hoop = (u * nodes.position).sum(axis=1)[outer] / r[outer] ** 2  # E times it is the tension of a free cold rim
    assert (hoop / exact).mean() == pytest.approx(1, rel=0.02)  # measured .985


@pytest.mark.slow
@pytest.mark.parametrize("below", [12, 8])
def test_a_strip_of_two_materials_bends(below: int) -> None:
    """S. P. Timoshenko, J. Opt. Soc. Am. 11 (1925) 233-255; `below` of 24 rows are the first material: m, of
    thicknesses, is 1 or .48, n = E1 / E2."""
    high, rows, hotter = 0.002, 23, 10.0  # m; spacings across, the border between two rows; K
    h, long = high / rows, 8 * high
    soft = Material(E=100e9, rho=8000.0, G0=1e12, micromodulus="constant", alpha=2e-5, T0=T0)
    stiff = Material(E=200e9, rho=8000.0, G0=1e12, micromodulus="constant", alpha=1e-5, T0=T0)
    run = Run(solver="static", time_step=1.0, steps=1)
    scene = (
        Scene(box(0, 0, long, high), h, soft, medium=Medium(D=1e-6), run=run)
        .region(box(-1, (below - 0.5) * h, 1, 1), stiff)
        .initial_temperature(box(-1, -1, 1, 1), T0 + hotter)
        .fix(box(-h / 4, -h / 4, h / 4, h / 4))
        .fix(box(-h / 4, high - h / 4, h / 4, high + h / 4), x=0, y=None)
    )
    built = build(scene)
    with simulate(Model(built.grid, built.settings), None, Options(threads=1)) as results:
        (x, y), u = results.nodes(1).position.T, results.field("uy", 1).astype(float)
    middle = (np.abs(y - high / 2) < h) & (np.abs(x - long / 2) < long / 4)
    curvature = 2 * np.polyfit(x[middle], u[middle], 2)[0]
    m, n = (below - 0.5) / (rows + 0.5 - below), 100 / 200  # rows at the edges have half a cell
    exact = 6 * 1e-5 * hotter * (1 + m) ** 2 / (high * (3 * (1 + m) ** 2 + (1 + m * n) * (m**2 + 1 / (m * n))))
    assert abs(curvature) == pytest.approx(exact, rel=0.03)  # measured: 1.0000 and 1.0028
