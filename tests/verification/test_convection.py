"""Convection of any strength beside Fourier's series: slabs on and across the lattice, corners, discs and balls."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest
import shapely
import shapely.affinity
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import j0, j1

from pdmesh import Body, Box, Medium, Run, Scene, Sphere, box, build
from pdmesh.scene.solids import Sheet
from pdsolve.model import Model
from pdsolve.run.simulation import Options, simulate

pytestmark = pytest.mark.slow

H, D = 1e-3, 1e-6  # m; m^2/s
ROWS = 18  # spacings in half of a slab, or in a radius
STRENGTHS = (0.1, 0.3, 1, 3, 8.5, 9.5, 30, 100)  # Bi = h a / k; 8.5 and 9.5: h spacing / D on both sides of a half
SERIES = 150  # terms

Array = NDArray[np.float64]


class Cooling(NamedTuple):
    """Contents of a body that began at 1, beside an outside of 0."""

    position: Array  # (n, d) m
    share: Array  # (n,) of its volume
    Fo: Array  # (t,) D time / a^2
    content: list[Array]  # (n,) at each


def cooled(scene: Scene | Body, a: float, last: float = 1.0, steps: int = 200) -> Cooling:
    """Solve a body that cools until `last`, in steps of a little more than the trapezoidal rule.

    Contents are those from when heat has come a horizon deep on: before, no scheme of bonds knows more.
    """
    run = Run(solver="implicit", time_step=last * a**2 / D / steps, steps=steps, every=steps // 10, theta=0.51)
    every = box(-1, -1, 1, 1) if isinstance(scene, Scene) else Box((-1, -1, -1), (1, 1, 1))
    built = build(replace(scene.begin(every, 1.0), run=run))  # type: ignore[arg-type]
    with simulate(Model(built.grid, built.settings), None, Options(threads=1)) as results:
        frames, times = results.frames()
        late = np.sqrt(D * times) >= 3 * H
        contents = [results.field("c", int(step)).astype(float) for step in frames[late]]
    cells = built.grid.cells
    return Cooling(built.grid.position, cells / cells.sum(), times[late] * D / a**2, contents)


def slab(X: Array, Fo: float, Bi: float) -> tuple[Array, float]:
    """Contents at X half thicknesses from the middle of a slab, and their mean."""
    b = np.array(
        [brentq(lambda q: q * np.sin(q) - Bi * np.cos(q), k * np.pi, (k + 0.5) * np.pi) for k in range(SERIES)]
    )
    each = 2 * np.sin(b) / (b + np.sin(b) * np.cos(b)) * np.exp(-(b**2) * Fo)
    return np.cos(np.outer(X, b)) @ each, float((each * np.sin(b) / b).sum())


def disc(r: Array, Fo: float, Bi: float) -> tuple[Array, float]:
    """Contents at r radii from the middle of a disc, and their mean: b J1(b) = Bi J0(b)."""
    at = np.linspace(1e-9, np.pi * SERIES, 100 * SERIES)
    change = np.flatnonzero(np.diff(np.sign(at * j1(at) - Bi * j0(at))))
    b = np.array([brentq(lambda q: q * j1(q) - Bi * j0(q), at[k], at[k + 1]) for k in change])
    each = 2 * Bi / ((Bi**2 + b**2) * j0(b)) * np.exp(-(b**2) * Fo)
    return j0(np.outer(r, b)) @ each, float((2 * each * j1(b) / b).sum())


def ball(r: Array, Fo: float, Bi: float) -> tuple[Array, float]:
    """Contents at r radii from the middle of a ball, and their mean: b cot b = 1 - Bi; an infinite Bi holds 0."""
    b = np.pi * np.arange(1.0, SERIES)
    if np.isfinite(Bi):
        ends = (b - np.pi + 1e-9, b - 1e-9)
        b = np.array(
            [brentq(lambda q: q * np.cos(q) - (1 - Bi) * np.sin(q), *both) for both in zip(*ends, strict=True)]
        )
    each = 4 * (np.sin(b) - b * np.cos(b)) / (2 * b - np.sin(2 * b)) * np.exp(-(b**2) * Fo)
    return np.sinc(np.outer(r, b) / np.pi) @ each, float((3 * each * (np.sin(b) - b * np.cos(b)) / b**3).sum())


def errors(cooling: Cooling, exact: list[Array], mean: list[float]) -> tuple[float, float]:
    """The largest error of a content, of the first difference, and of what went out, of itself."""
    off = max(float(np.abs(c - e).max()) for c, e in zip(cooling.content, exact, strict=True))
    lost = [(1 - c @ cooling.share) / (1 - m) - 1 for c, m in zip(cooling.content, mean, strict=True)]
    return off, float(np.abs(lost).max())


@pytest.mark.parametrize("Bi", STRENGTHS)
def test_a_slab_of_any_strength_cools_by_the_series(Bi: float) -> None:
    """Carslaw and Jaeger (1959), 3.11."""
    a = ROWS * H
    scene = Scene(box(0, 0, a, 8 * H), H, medium=Medium(D=D), horizon=3.0)
    cooling = cooled(scene.exchange("left", coefficient=Bi * D / a, outside=0.0), a)
    exact, mean = zip(*(slab(1 - cooling.position[:, 0] / a, Fo, Bi) for Fo in cooling.Fo), strict=True)
    off, lost = errors(cooling, list(exact), list(mean))
    assert off < 0.01  # measured, as listed: .0003, .0009, .0022, .0040, .0054, .0055, .0061, .0063
    assert lost < 0.01  # measured: .0005 at most


@pytest.mark.parametrize("Bi", [1, 9])
@pytest.mark.parametrize(("angle", "rows"), [(0, 17.4), (10, 18), (30, 18)])
def test_a_slab_across_the_lattice_cools_as_one_along_it(angle: float, rows: float, Bi: float) -> None:
    """An edge between nodes, and edges that are stairs: nodes know how far they are from the drawn edge."""
    a, wide = rows * H, 14 * H
    turn = shapely.affinity.rotate
    plate = turn(shapely.box(0, 0, a, wide), angle, origin=(0, 0))
    edge = turn(shapely.LineString([(0, 0), (0, wide)]), angle, origin=(0, 0))
    scene = Scene(plate, H, medium=Medium(D=D), horizon=3.0)
    cooling = cooled(scene.exchange(edge, coefficient=Bi * D / a, outside=0.0), a)
    c, s = np.cos(np.radians(angle)), np.sin(np.radians(angle))
    exact = [slab(1 - cooling.position @ [c, s] / a, Fo, Bi)[0] for Fo in cooling.Fo]
    off, lost = errors(cooling, exact, [float(e @ cooling.share) for e in exact])
    middle = np.abs(cooling.position @ [-s, c] - wide / 2) < wide / 2 - 3 * H
    inside = max(float(np.abs(C - e)[middle].max()) for C, e in zip(cooling.content, exact, strict=True))
    assert inside < 0.02  # measured .0022, .0054; .0031, .0072; .0056, .0100
    assert off < 0.08  # measured the same, .003, .007 and .040, .069 in the two corners
    assert lost < 0.01


@pytest.mark.parametrize("Bi", [1, 9])
def test_a_square_cools_through_its_corners(Bi: float) -> None:
    """The product of two slabs: what two edges take from the nodes in a corner adds up."""
    a = ROWS * H
    scene = Scene(box(-a, -a, a, a), H, medium=Medium(D=D), horizon=3.0)
    for side in ("left", "right", "bottom", "top"):
        scene = scene.exchange(side, coefficient=Bi * D / a, outside=0.0)
    cooling, exact, mean = cooled(scene, a), [], []
    for Fo in cooling.Fo:
        (x, half), (y, _) = (slab(np.abs(along) / a, Fo, Bi) for along in cooling.position.T)
        exact.append(x * y)
        mean.append(half**2)
    off, lost = errors(cooling, exact, mean)
    assert off < 0.01  # measured .0028, .0052
    assert lost < 0.01


@pytest.mark.parametrize("Bi", [0.1, 9, 100])
def test_a_disc_cools_by_the_series(Bi: float) -> None:
    """Carslaw and Jaeger (1959), 7.7."""
    a, turn = ROWS * H, np.linspace(0, 2 * np.pi, 361)
    rim = a * np.column_stack([np.cos(turn), np.sin(turn)])
    scene = Scene(shapely.Polygon(rim), H, medium=Medium(D=D), horizon=3.0)
    cooling = cooled(scene.exchange(shapely.LineString(rim), coefficient=Bi * D / a, outside=0.0), a, 0.5)
    r = np.hypot(*cooling.position.T) / a
    exact, mean = zip(*(disc(r, Fo, Bi) for Fo in cooling.Fo), strict=True)
    off, lost = errors(cooling, list(exact), list(mean))
    assert off < 0.01  # measured .0004, .0043, .0045
    assert lost < 0.01  # measured .0002, .0038, .0033


def surface(body: Body) -> Sheet:
    """The whole surface of a body."""
    faces = build(body).grid.faces
    assert faces is not None
    return Sheet(faces)


@pytest.mark.parametrize("Bi", [1, 9, 100, np.inf])
def test_a_ball_cools_by_the_series(Bi: float) -> None:
    """Carslaw and Jaeger (1959), 9.4 and 9.3: exchange through its surface, and a surface held at 0 (`inf`)."""
    a = 10 * H
    body = Body(Sphere((0, 0, 0), a), H, medium=Medium(D=D), horizon=3.0)
    skin = surface(body)
    body = body.exchange(skin, coefficient=Bi * D / a, outside=0.0) if np.isfinite(Bi) else body.hold(skin, 0.0)
    cooling = cooled(body, a, 0.4, 60)
    r = np.linalg.norm(cooling.position, axis=1) / a
    exact, mean = zip(*(ball(r, Fo, Bi) for Fo in cooling.Fo), strict=True)
    off, lost = errors(cooling, list(exact), list(mean))
    assert off < 0.02  # measured .0045, .0062, .0113, .0145
    assert lost < 0.01  # measured .0035, .0036, .0034, .0072
