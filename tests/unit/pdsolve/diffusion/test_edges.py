"""Fluxes through edges leave linear fields exact; a slab that is quenched on both sides."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
import shapely
from diffusion_models import ids, lattice, model, row
from numpy.typing import NDArray
from scipy.optimize import brentq

from pdmesh import Body, Box, Heat, Material, Medium, Run, Scene, box, build
from pdmesh.model.document import Concentration, Exchange
from pdmesh.scene.solids import Sheet
from pdsolve.diffusion.edges import beside_edge, outward, parts
from pdsolve.diffusion.system import prepare
from pdsolve.diffusion.walls import Bonds
from pdsolve.measures import fields
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


@pytest.mark.slow
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
    one, volume = np.ones(20), np.full(20, 2.0)
    bonds = cast(Bonds, SimpleNamespace(position=x, delta=one, reach=3.5 * one, diffusivity=one))
    rows, share, _ = beside_edge(bonds, volume, np.zeros((20, 2)), np.array([7, 8]), 1.0)
    assert (rows.tolist(), share.tolist()) == ([7, 8], [0.5, 0.5])
    gain = np.zeros((20, 2))
    gain[:3, 0] = 0.5, 0.7, -0.2
    rows, share, _ = beside_edge(bonds, volume, gain, np.array([0]), 1.0)
    assert rows.tolist() == [0, 1, 2]
    assert share == pytest.approx([0.5, 0.7, -0.2])


def test_cells_of_nested_spacings_have_the_edge_beside_them() -> None:
    """Four cells of a half beside two whole ones: a third of the edge would be theirs by their areas."""
    delta = np.array([0.5, 0.5, 0.5, 0.5, 1.0, 1.0])
    part, depth = parts(delta**2, delta)
    assert part == pytest.approx(delta / 4)
    assert depth / 4 == pytest.approx(delta)


def test_an_edge_is_free_where_nothing_is_beyond_it() -> None:
    x = H * (np.column_stack([axis.ravel() for axis in np.meshgrid(np.arange(8), np.arange(8))]) + 0.5)
    delta, last, inside = (
        np.full(64, H),
        np.flatnonzero(x[:, 0] > 7 * H),
        np.flatnonzero(np.abs(x[:, 0] - 4.5 * H) < H / 4),
    )
    normal, free, inner = outward(x, delta, 2 * delta, last)
    assert normal == pytest.approx(np.tile([1.0, 0.0], (8, 1)))
    assert free.all()
    assert not inner.any()
    _, free, inner = outward(x, delta, 2 * delta, inside)
    assert not free.any()
    assert not inner.any()
    two = np.flatnonzero(x[:, 0] > 6 * H)
    _, free, inner = outward(x, delta, 2 * delta, two)
    assert (free == (x[two, 0] > 7 * H)).all()
    assert (inner == ~free).all()


def test_fluxes_through_nested_spacings_are_linear() -> None:
    """A quarter of the edge has nodes of half the spacing."""
    scene = plate().supply("left", flux=2e-3).hold("right", 5.0).zone(box(0, 15 * H, 5 * H, 25 * H), H / 2)
    with solved(scene) as results:
        (x, y), c = results.nodes(0).position.T, results.field("c", 3)
    off = np.abs(c - 5.0 - 2e-3 * (20 * H - x) / 1e-6)
    assert off[np.abs(y - 20 * H) < 10 * H].max() < 0.05 * 40  # measured: .035; .13 where cells share by their areas


def series(X: NDArray[np.float64], Fo: float, Bi: float) -> tuple[NDArray[np.float64], float]:
    """The temperature of a slab at X of its half thickness and its mean, over what it began with."""
    roots = np.array(
        [brentq(lambda q: q * np.tan(q) - Bi, k * np.pi + 1e-9, (k + 0.5) * np.pi - 1e-9) for k in range(60)]
    )
    fading = 2 * np.sin(roots) / (roots + np.sin(roots) * np.cos(roots)) * np.exp(-(roots**2) * Fo)
    return np.cos(np.outer(X, roots)) @ fading, float((fading * np.sin(roots) / roots).sum())


@pytest.mark.parametrize(("Bi", "spacings"), [(10, 16), (1000, 16)])
def test_an_exchange_of_any_strength_leaves_what_the_series_says(Bi: float, spacings: int) -> None:
    """Contents of half a slab within a horizon of its edge, when heat has come that deep: one scheme for both."""
    a, D = spacings * H, 1e-6
    run = Run(solver="implicit", time_step=1e-3 * a**2 / D, steps=40, every=40, theta=0.6)
    scene = (
        Scene(box(0, 0, a, 8 * H), H, medium=Medium(D=D), horizon=3.0, run=run)
        .begin(box(-1, -1, 1, 1), 1.0)
        .exchange("left", coefficient=Bi * D / a, outside=0.0)
    )
    with solved(scene) as results:
        x, c = results.nodes(0).position[:, 0], results.field("c", 40)
    off = np.abs(c - series((x - a) / a, 0.04, Bi)[0])
    assert off.max() < 0.015, off.max()


def test_rows_behind_each_other_share_an_exchange() -> None:
    """Of nodes that a file lists without an edge, in several rows, each gives off its part of the whole."""
    position = lattice(H, 6 * H, 2)
    every = Exchange(nodes=ids(position[:, 0] < 9), coefficient=1e-4, length=0.02)
    system, _ = prepare(model(position, H, Medium(D=1e-6), conditions=(every,), run=LONG), 1)
    operator = system.operator
    assert float((operator.outside * operator.volume).sum()) == pytest.approx(1e-4 * 0.02)
    assert np.ptp(operator.outside) < 1e-9 * operator.outside[0]


def test_a_strong_exchange_leaves_explicit_steps_long() -> None:
    """Nodes on an edge take the outside to be a quarter of a spacing away in explicit steps, not in implicit ones."""
    bounds, rates = [], []
    for solver in ("explicit", "implicit"):
        run = Run(solver=solver, time_step=1e-3, steps=1)  # type: ignore[arg-type]
        scene = Scene(box(0, 0, 8 * H, 8 * H), H, medium=Medium(D=1e-6), horizon=3.0, run=run)
        built = build(scene.exchange("left", coefficient=1e3, outside=0.0))
        system, _ = prepare(Model(built.grid, built.settings), 1)
        bounds.append(system.bound)
        rates.append(float(system.operator.outside.max()))
    free = Scene(box(0, 0, 8 * H, 8 * H), H, medium=Medium(D=1e-6), horizon=3.0)
    built = build(free)
    assert bounds[0] > 0.1 * prepare(Model(built.grid, built.settings), 1)[0].bound
    assert rates[1] > 1e4 * rates[0]


@pytest.mark.parametrize("along", [-0.5, 0.0])
@pytest.mark.parametrize("condition", [Concentration, Exchange])
def test_ways_across_a_bar_are_left_out(condition: type[Concentration] | type[Exchange], along: float) -> None:
    """The edge at the end of a row is as far as its way along the row says, beside its node or on it."""
    system, straight = (prepare(bar_with_end(condition, (along, across)), 1)[0] for across in (0.9, 0.0))
    is_prescribed = condition is Concentration and along == 0.0
    assert system.free.tolist() == straight.free.tolist() == [not is_prescribed, *[True] * 19]
    assert (system.operator.outside > 0).any() != is_prescribed
    assert system.operator.outside.tobytes() == straight.operator.outside.tobytes()
    assert system.operator.total.tobytes() == straight.operator.total.tobytes()


def bar_with_end(condition: type[Concentration] | type[Exchange], way: tuple[float, float]) -> Model:
    """20 nodes in a row, the first of which has an edge at this way, m."""
    exchange = {"coefficient": 2.0, "length": 1.0} if condition is Exchange else {}
    end = condition(nodes=(1,), value=1.0, edge=(way,), **exchange)  # type: ignore[arg-type]
    medium = Medium(D=1.0, surface_correction=True)
    return model(row(20, 1.0), 1.0, medium, conditions=(end,), run=LONG)


def test_a_weak_exchange_of_listed_nodes_takes_its_whole_extent() -> None:
    """Without an edge in the file it is where cells end: a disc loses h 2 pi a times the difference, to 1e-4."""
    position = lattice(H, 10 * H, 2)
    radius = np.linalg.norm(position, axis=1)
    rim = Exchange(nodes=ids(radius > 9 * H), coefficient=1e-9, length=20 * np.pi * H)
    system, _ = prepare(model(position, H, Medium(D=1e-6), conditions=(rim,), run=LONG), 1)
    operator = system.operator
    assert float((operator.outside * operator.volume).sum()) == pytest.approx(1e-9 * 20 * np.pi * H, rel=1e-4, abs=0)
    assert operator.outside.min() >= 0


def test_a_weak_exchange_of_a_drawn_edge_takes_its_whole_extent() -> None:
    """Nodes along stairs are beside more edge than is drawn: by 2.2 %, if each took what its own images say."""
    turn = np.linspace(0, 2 * np.pi, 361)
    rim = shapely.LineString(10 * H * np.column_stack([np.cos(turn), np.sin(turn)]))
    scene = Scene(shapely.Polygon(rim), H, medium=Medium(D=1e-6), horizon=3.0, run=LONG)
    built = build(scene.exchange(rim, coefficient=1e-9, outside=0.0))
    operator = prepare(Model(built.grid, built.settings), 1)[0].operator
    assert float((operator.outside * operator.volume).sum()) == pytest.approx(
        1e-9 * rim.length, rel=1e-5, abs=0
    )  # 7e-7 off


def test_a_strip_thinner_than_two_horizons_gives_off_heat_through_both_edges() -> None:
    """Its nodes see walls on opposite sides, which exact linear fields leave open: their images say what each gives."""
    a, D, Bi = 2 * H, 1e-6, 0.3
    run = Run(solver="implicit", time_step=1e-2 * a**2 / D, steps=100, every=10, theta=0.51)
    scene = Scene(box(0, 0, 2 * a, 16 * H), H, medium=Medium(D=D), horizon=3.0, run=run).begin(box(-1, -1, 1, 1), 1.0)
    for side in ("left", "right"):
        scene = scene.exchange(side, coefficient=Bi * D / a, outside=0.0)
    with solved(scene) as results:
        x, y = results.nodes(0).position.T
        middle = np.abs(y - 8 * H) < 3 * H
        for step in range(40, 101, 10):
            off = results.field("c", step) - series(x / a - 1, step / 100, Bi)[0]
            assert np.abs(off[middle]).max() < 0.02  # measured .016; .037 if images gave as much from both sides


@pytest.mark.slow
@pytest.mark.parametrize(
    ("Bi", "Fo", "spacings", "steps", "peak"),
    [(1, 0.25, 16, 16, 0.208), (10, 0.06, 18, 16, 0.594), (100, 0.0075, 32, 20, 0.850)],
)
def test_a_quenched_slab_is_as_cold_and_stressed_as_the_series_says(
    Bi: float, Fo: float, spacings: int, steps: int, peak: float
) -> None:
    """Temperature and largest stress at the surface, over E alpha dT, within 2 %; half of the slab, in plane stress.

    An edge is free across: it is stressed by E times the strain along it less that of heat.
    """
    a, D, long = spacings * H, 1e-6, 8
    run = Run(solver="static", time_step=Fo * a**2 / D / steps, steps=steps, every=2, theta=0.6)
    glass = Material(E=70e9, rho=2500, G0=1e9, alpha=1e-5, T0=400.0)
    point, up = H / 4, long * a / 2
    scene = (
        Scene(box(0, 0, a, long * a), H, glass, 3.0, run, medium=Heat(k=2.0, c=800.0))
        .initial_temperature(box(-1, -1, 1, 1), 400.0)
        .convection("left", h=2.0 * Bi / a, outside=300.0)
        .fix("right", y=None)
        .fix(box(a - point, up - point, a + point, up + point), x=None, name="middle")
    )
    with solved(scene) as results:
        steps_, times = results.frames()
        x, y = results.nodes(0).position.T
        face = np.flatnonzero((x < H) & (np.abs(y - up) < 2 * H))
        stressed, fitted, exact, off = [], [], [], []
        for step, time in zip(steps_[1:].tolist(), times[1:].tolist(), strict=True):
            theta, mean = series((x[face] - a) / a, time * D / a**2, Bi)
            c = (results.field("T", step)[face] - 300) / 100
            strain = fields.all_field_components(results, "strain", step)["yy"][face] / (1e-5 * 100)
            fitted.append(fields.all_field_components(results, "stress", step)["yy"][face].mean() / (70e9 * 1e-5 * 100))
            stressed.append((strain + 1 - c).mean())
            exact.append(mean - theta.mean())
            off.append(np.abs(c - theta).max())
    assert max(exact) == pytest.approx(peak, abs=2e-3)
    assert off[int(np.argmax(exact))] < 0.02  # of the difference; measured: .002, .004, .002
    assert max(stressed) == pytest.approx(max(exact), rel=0.02)  # measured: .994, .994, .998
    assert max(fitted) == pytest.approx(max(exact), rel=0.06)  # measured: .964, .964, .973, by both strains
