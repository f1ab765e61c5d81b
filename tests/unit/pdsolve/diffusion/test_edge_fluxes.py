"""Fluxes through edges leave linear fields exact; a slab that is quenched on both sides."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq

from pdmesh import Body, Box, Heat, Material, Medium, Run, Scene, box, build
from pdmesh.scene.solids import Sheet
from pdpost.measures import fields
from pdsolve.diffusion.edge_fluxes import Cloud, beside_edge
from pdsolve.model import Model
from pdsolve.results import Results
from pdsolve.run.simulation import Options, simulate

ONE, H = Options(threads=1), 1e-3
LONG = Run(solver="implicit", time_step=1e6, steps=3, every=3)


def solved(scene: Scene | Body) -> Results:
    built = build(scene)
    return simulate(Model(built.grid, built.settings), None, ONE)


def plate() -> Scene:
    return Scene(box(0, 0, 20 * H, 40 * H), H, medium=Medium(D=1e-6), horizon=3.0, run=LONG)


def test_a_flux_through_a_plate_is_linear() -> None:
    scene = plate().supply("left", flux=2e-3).hold("right", 5.0)
    with solved(scene) as results:
        (x, y), c = results.nodes(0).position.T, results.field("c", 3)
    off = c - 5.0 - 2e-3 * (20 * H - x) / 1e-6
    middle = np.abs(y - 20 * H) < 5 * H
    assert np.abs(off[middle]).max() < 2e-3 * 40  # measured: 5e-4; where the outer row takes all, .045
    assert np.abs(off).max() < 0.12 * 40  # measured: .099, at the nodes in the corners


def test_exchange_through_a_plate_is_linear() -> None:
    """The outside is as far off as 1 / h of the thickness is."""
    scene = plate().exchange("left", coefficient=1e-4, outside=1.0).hold("right", 0.0)
    with solved(scene) as results:
        (x, y), c = results.nodes(0).position.T, results.field("c", 3)
    exact = (20 * H - x) / (20 * H + 1e-6 / 1e-4)
    middle = np.abs(y - 20 * H) < 5 * H
    assert np.abs(c - exact)[middle].max() < 0.01  # measured: .004; where the outer row takes all, .041


def test_a_flux_through_the_face_of_a_block_is_linear() -> None:
    corners = 12 * H * np.array([(0, 0, 0), (0, 1, 0), (0, 1, 1), (0, 0, 1)])
    left = Sheet(corners[[[0, 1, 2], [0, 2, 3]]])
    block = Body(Box((0, 0, 0), (12 * H, 12 * H, 12 * H)), H, medium=Medium(D=1e-6), run=LONG)
    with solved(block.supply(left, flux=2e-3).hold("right", 0.0)) as results:
        (x, y, z), c = results.nodes(0).position.T, results.field("c", 3)
    middle = (np.abs(y - 6 * H) < 2 * H) & (np.abs(z - 6 * H) < 2 * H)
    off = np.abs(c - 2e-3 * (12 * H - x) / 1e-6)[middle].max()
    assert off < 0.025 * 24  # measured: .021, .007 in a block of 20 rows; where the outer row takes all, .05


def test_shares_of_what_is_inside_are_by_cells() -> None:
    """Nodes that lack nothing hand nothing on; the whole of a flux arrives."""
    x = np.column_stack([np.arange(20.0), np.zeros(20)])
    cloud = Cloud(x, np.full(20, 2.0), np.ones(20), np.full(20, 3.5), np.ones(20), np.zeros((20, 2)))
    found = beside_edge(cloud, np.array([7, 8]), 1.0)
    assert (found.rows.tolist(), found.share.tolist()) == ([7, 8], [0.5, 0.5])
    gain = np.zeros((20, 2))
    gain[:3, 0] = 0.5, 0.7, -0.2
    found = beside_edge(cloud._replace(gain=gain), np.array([0]), 1.0)
    assert found.rows.tolist() == [0, 1, 2]
    assert found.share == pytest.approx([0.5, 0.7, -0.2])


def series(X: NDArray[np.float64], Fo: float, Bi: float) -> tuple[NDArray[np.float64], float]:
    """The temperature of a slab at X of its half thickness and its mean, over what it began with."""
    roots = np.array(
        [brentq(lambda q: q * np.tan(q) - Bi, k * np.pi + 1e-9, (k + 0.5) * np.pi - 1e-9) for k in range(60)]
    )
    fading = 2 * np.sin(roots) / (roots + np.sin(roots) * np.cos(roots)) * np.exp(-(roots**2) * Fo)
    return np.cos(np.outer(X, roots)) @ fading, float((fading * np.sin(roots) / roots).sum())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("Bi", "Fo", "peak", "colder", "less", "free"),
    [(1, 0.3, 0.208, 0.01, 0.02, 0.025), (10, 0.09, 0.594, 0.04, 0.03, 0.07)],
)
def test_a_quenched_slab_is_as_cold_and_stretched_as_the_series_says(
    Bi: float, Fo: float, peak: float, colder: float, less: float, free: float
) -> None:
    """The largest stress at the surface over E alpha dT is .208 and .594; 16 spacings in half of the thickness."""
    a, D, long, steps = 16e-3, 1e-6, 8, 24
    run = Run(solver="static", time_step=Fo * a**2 / D / steps, steps=steps, every=3, theta=0.5)
    glass = Material(E=70e9, rho=2500, G0=1e9, alpha=1e-5, T0=400.0)
    half, up = H / 2, long * a / 2
    scene = (
        Scene(box(0, 0, 2 * a, long * a), H, glass, 3.0, run, medium=Heat(k=2.0, c=800.0))
        .initial_temperature(box(-1, -1, 1, 1), 400.0)
        .convection("left", h=2.0 * Bi / a, outside=300.0)
        .convection("right", h=2.0 * Bi / a, outside=300.0)
        .fix(box(a - half, up - half, a + half, up + half), name="middle")
        .fix(box(a - half, up + a - half, a + half, up + a + half), y=None, name="turn")
    )
    with solved(scene) as results:
        steps_, times = results.frames()
        x, y = results.nodes(0).position.T
        row = np.flatnonzero(np.abs(y - up) < half)
        stresses, pulled, exact = [], [], []
        for step, time in zip(steps_[1:].tolist(), times[1:].tolist(), strict=True):
            theta, mean = series((x[row] - a) / a, time * D / a**2, Bi)
            c = (results.field("c", step)[row] - 300) / 100
            if time > Fo * a**2 / D / 3:
                assert np.abs(c - theta)[[0, -1]].max() < colder  # measured: .0054 and .037
            stress = fields.components(results, "stress", step)["yy"][row] / (70e9 * 1e-5 * 100)
            stresses.append(stress[x[row].argmin()])
            strain = fields.components(results, "strain", step)["yy"][row] / (1e-5 * 100)
            pulled.append((strain + 1 - c)[x[row].argmin()])  # by E times which an edge is stressed that is free across
            exact.append(mean - theta[x[row].argmin()])
    assert max(exact) == pytest.approx(peak, abs=2e-3)
    assert max(stresses) == pytest.approx(max(exact), rel=less)  # measured: .985 and 1.024
    assert max(pulled) == pytest.approx(max(exact), rel=free)  # measured: 1.018 and 1.066
