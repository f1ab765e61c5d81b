"""Interfaces between spacings.

Duran glass, conical micromodulus; fine nodes of 1 mm left of x = 0, coarse ones to the right.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import msgspec
import numpy as np
import pytest
from failure_cases import saying
from numpy.typing import NDArray
from periodic_plates import joined
from plates import GLASS, interface_grid, plate, square_grid
from scipy.special import erf
from system_checks import accelerate, at_step, bonds_of, broken, equilibrium, sources

from pdmesh.model.document import Load, Material, Run
from pdmesh.model.material_constants import critical_stretch
from pdmesh.model.node_grid import Grid
from pdsolve.estimate import estimate_run
from pdsolve.options import Options
from pdsolve.run.measures import compute_node_damage
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun

UNBREAKABLE = msgspec.structs.replace(GLASS, G0=1e12)
SPEED = (1.125 * GLASS.E / GLASS.rho) ** 0.5  # of P waves, m/s
FIRST = float(critical_stretch(GLASS, np.array([8e-3]))[0])  # stretch at which the first bonds break, the coarse ones


def strip(mode: str, m: int, fine: int, coarse: int) -> PreparedRun:
    """A strip of 1 mm nodes left of x = 0 and of 2 mm ones right of it, repeating itself upwards."""
    rows = 4 * m + 8
    y0 = 2e-3 * (rows // 2)
    # the fast kernel keeps its bonds in blocks, in which a strip joined to itself would show its cut edges
    whole = prepare(plate(interface_grid(fine, coarse, rows), m), Options(mode, threads=1, kernel="listed"))
    return joined(whole, (-np.inf, y0, np.inf, y0 + 2e-3))


def begin(problem: PreparedRun, u: NDArray[np.float64], v: NDArray[np.float64]) -> None:
    """Displacements and velocities (n,) along x, and the accelerations that belong to them."""
    problem.state.value[:, 0], problem.state.rate[:, 0] = u, v
    accelerate(problem)


def torn(mode: str, strain: float, coarse: int = 30) -> int:
    """Bonds that a pulse of this strain, 8 mm wide, breaks on its way from the fine nodes to the coarse ones and
    back."""
    problem = strip(mode, 4, 80, coarse)
    problem = at_step(problem, 0.5 * problem.system.stable_time_step)
    s = (problem.system.model.grid.position[:, 0] + 40e-3) / 8e-3
    begin(problem, strain * 8e-3 * np.sqrt(np.pi) / 2 * erf(s), -SPEED * strain * np.exp(-(s**2)))
    problem.advance(1, int(60e-3 / SPEED / problem.system.time_step) + 1)
    return len(broken(problem).step)


@pytest.mark.slow
def test_a_compression_that_tears(failure: Callable[..., None]) -> None:
    """A compression wave that breaks one-sided bonds.

    Compression breaks no bond. But the softening coefficient of the thesis mode counts nodes: a coarse node at an
    interface has many fine neighbours and becomes half as stiff. A soft layer reflects compression as tension.
    """
    shares = (3.0, 6.0, 8.0)
    thesis, conservative = ([torn(mode, -share * FIRST) for share in shares] for mode in ("thesis", "conservative"))
    assert thesis[0] == 0
    assert thesis[1] > 10  # measured 20
    assert thesis[2] > 150  # measured 236
    assert conservative == [0, 0, 0]
    failure(
        fails="Thesis mode, compression pulses 8 mm wide with strains of 6 and 8 times the critical stretch of "
        "coarse bonds: "
        f"{thesis[1]} and {thesis[2]} bonds break along the interface, a false crack.",
        noticed="Not at all: it looks like spalling.",
        cure="The conservative mode corrects by energy instead of by number, and equally for both ends of a bond: "
        f"{conservative[1]} and {conservative[2]} bonds.",
    )


def concentration(mode: str, m: int) -> float:
    """Largest share of a bond's limit within 5 mm of the interface, over that far from it, in slow tension across
    it."""
    problem = strip(mode, m, 60, 20)
    x = problem.system.model.grid.position[:, 0]
    held = np.zeros((len(x), 2), dtype=bool)
    held[:, 1] = True
    held[:, 0] = (x < x.min() + 2.1e-3 * m) | (x > x.max() - 2.1e-3 * m)
    u = equilibrium(problem, held, np.column_stack([1e-4 * x, 0 * x]))
    bonds, i = bonds_of(problem), sources(bonds_of(problem))
    share = ((u[bonds.neighbour] - u[i]) * bonds.xi).sum(axis=1) / (bonds.xi**2).sum(axis=1) / bonds.limit
    near, far = np.abs(x[i] - 0.75e-3) < 5e-3, np.abs(np.abs(x[i]) - 20e-3) < 5e-3
    return float(share[near].max() / share[far].max())


@pytest.mark.slow
def test_slow_tension_across_an_interface(failure: Callable[..., None]) -> None:
    """Slow tension across an interface with symmetric bonds.

    Symmetric bonds do not pass the patch test: under uniform tension the conservative mode stretches the bonds at an
    interface unevenly. This is the price of conserving momentum. Only `correspondence` has influences that are balanced
    there: its stresses are within 1.4 %, on lattices. Those of `ordinary` are between 0.82 and 1.25 of the load's.
    """
    found = {(mode, m): concentration(mode, m) for mode in ("thesis", "conservative") for m in (3, 4)}
    expected = {("thesis", 3): 1.059, ("thesis", 4): 1.031, ("conservative", 3): 1.133, ("conservative", 4): 1.160}
    assert found == pytest.approx(expected, abs=0.002)
    failure(
        fails="In the conservative mode the stretch of bonds at the interface, over their critical stretch, is "
        f"{found['conservative', 3]:.2f} (m = 3) and "
        f"{found['conservative', 4]:.2f} (m = 4) times that of bonds far from the interface. A plate that is "
        "torn slowly breaks there first.",
        noticed="Not at all.",
        cure="Keep interfaces away from where the plate is to break (`pdmesh` enlarges zones by the horizon for this). "
        f"One-sided bonds do better here: {found['thesis', 3]:.2f} and {found['thesis', 4]:.2f}.",
    )


class Crossing(NamedTuple):
    """A crack that has crossed the line x = 0."""

    tip: float  # m
    stray: int  # bonds broken within 5 mm of the line, but more than 5 mm off the crack


def crossed(mode: str, stress: float, scales: int) -> Crossing:
    """A pre-crack that runs from fine nodes into coarse ones, or over one spacing, for 60 us."""
    rows = 20
    grid = interface_grid(40, 20, rows) if scales == 2 else square_grid(80, 2 * rows, x0=-39e-3)
    height, middle = 2e-3 * rows, (rows - 0.5) * 1e-3
    grid = dataclasses.replace(grid, cracks=np.array([[-1.0, middle, -20e-3, middle]]))
    pull = stress / 4e-3
    loads = (
        Load(box=(-1.0, height - 4.6e-3, 1.0, 1.0), body_force=(0.0, pull)),
        Load(box=(-1.0, -1.0, 1.0, 3.6e-3), body_force=(0.0, -pull)),
    )
    problem = prepare(plate(grid, 4, conditions=loads, run=Run(time_step=5e-8)), Options(mode, threads=1))
    problem.advance(1, 1201)
    x, y = grid.position.T
    off = np.abs(y - middle)
    on_path = (compute_node_damage(problem.system) > 0.35) & (off < 3e-3)
    stray = (np.abs(x - 0.75e-3) < 5e-3) & (off > 5e-3) & (y > 8e-3) & (y < height - 9e-3)
    return Crossing(float(x[on_path].max()), int(stray[broken(problem).source].sum()))


@pytest.mark.slow
def test_a_crack_that_crosses(failure: Callable[..., None]) -> None:
    """A crack that reaches an interface.

    Where a crack crosses an interface, bonds break along the interface to both sides of it that would not break in a
    plate of one spacing.
    """
    one = crossed("conservative", 5e6, 1)
    thesis = crossed("thesis", 5e6 / 0.79, 2)  # as much more as its softening loses of four rows
    conservative = crossed("conservative", 5e6, 2)
    assert min(one.tip, thesis.tip, conservative.tip) > 10e-3  # measured 16, 17.5 and 15.5 mm: all are across
    assert one.stray == 0
    assert thesis.stray == pytest.approx(42, abs=4)
    assert conservative.stray == pytest.approx(13, abs=4)
    failure(
        fails="Thesis mode, its load raised by the share that this mode loses: "
        f"{thesis.stray} bonds break along the interface, "
        "more than 5 mm off the crack.",
        noticed="Not at all; none of their nodes is damaged by more than 0.35.",
        cure=f"The conservative mode: {conservative.stray} bonds, fewer but not none. One spacing: {one.stray}. Better "
        "still, no interface in the path of a crack.",
    )


def layered(spacings: tuple[int, ...], lengths: tuple[int, ...], material: Material = UNBREAKABLE) -> PreparedRun:
    """A strip of zones, one after the other along x, whose cells tile it; mm. It repeats itself upwards."""
    widest, m = max(spacings), 3
    rows = 2 * (m + 1) + 3
    position, delta, edge = [], [], 0
    for spacing, length in zip(spacings, lengths, strict=True):
        y, x = (spacing * (index + 0.5) for index in np.mgrid[0 : widest * rows // spacing, 0 : length // spacing])
        position.append(1e-3 * np.column_stack([edge + x.ravel(), y.ravel()]))
        delta.append(np.full(x.size, 1e-3 * spacing))
        edge += length
    nodes = sum(len(part) for part in delta)
    plain = np.zeros(nodes, dtype=bool)
    ids = np.arange(1, nodes + 1)
    grid = Grid(ids, np.concatenate(position), np.concatenate(delta), plain, ids * 0 - 1, np.empty((0, 4)))
    whole = prepare(plate(grid, m, material=material), Options(threads=1, kernel="listed"))
    y0 = 1e-3 * widest * (rows // 2)
    return joined(whole, (-np.inf, y0, np.inf, y0 + 1e-3 * widest))


def sent_back(spacings: tuple[int, ...], lengths: tuple[int, ...], width: float) -> float:
    """Velocity sent back into the first zone over velocity sent in; the displacement is exp(-(x / width)^2)."""
    problem = layered(spacings, lengths)
    problem = at_step(problem, 0.5 * problem.system.stable_time_step)
    x, first = problem.system.model.grid.position[:, 0], lengths[0] * 1e-3
    s = (x - first / 2) / width
    begin(problem, 1e-6 * np.exp(-(s**2)), 1e-6 * SPEED * 2 * s / width * np.exp(-(s**2)))
    sent = np.abs(problem.state.rate).max()
    way = first + 2e-3 * sum(lengths[1:-1])
    problem.advance(1, round(way / SPEED / problem.system.time_step) + 1)
    return float(np.abs(problem.state.rate[x < first - 10e-3, 0]).max() / sent)


@pytest.mark.slow
def test_spacings_that_jump(failure: Callable[..., None]) -> None:
    """Spacings that jump by 2, 4 and 8.

    A coarse zone cannot carry a wave shorter than its horizon. The larger the jump of horizons, the more it reflects.
    """
    found = {(w, jump): sent_back((1, jump), (160, 160), w * 1e-3) for w in (8, 16) for jump in (2, 4, 8)}
    expected = {(8, 2): 0.0320, (8, 4): 0.296, (8, 8): 0.655, (16, 2): 0.01676, (16, 4): 0.0709, (16, 8): 0.371}
    assert found == pytest.approx(expected, rel=0.03)
    graded = {w: sent_back((1, 2, 4, 8), (160, 24, 48, 160), w * 1e-3) for w in (8, 16)}
    assert graded == pytest.approx({8: 0.307, 16: 0.186}, rel=0.03)
    says = {}
    for spacings, lengths in (((1, 2), (40, 40)), ((1, 4), (40, 40)), ((1, 2, 4, 8), (40, 24, 48, 80))):
        with saying() as says[spacings]:
            estimate_run(layered(spacings, lengths).system.model, Options(threads=1))
    assert [len(lines) for lines in says.values()] == [0, 1, 0]
    assert "spacings of" in says[1, 4][0]
    failure(
        fails="Of a pulse 8 mm wide, steps of 2, 4 and 8 reflect "
        + ", ".join(f"{100 * found[8, jump]:.1f}" for jump in (2, 4, 8))
        + " %; of one 16 mm wide "
        + ", ".join(f"{100 * found[16, jump]:.1f}" for jump in (2, 4, 8))
        + " % (conservative mode, m = 3).",
        noticed="By a warning before the run where neighbouring spacings differ by a factor of more than 2.5.",
        says=says[1, 4],
        cure=f"Steps of 2, as `pdmesh` grades zones: from 1 to 8 they reflect {100 * graded[8]:.0f} and "
        f"{100 * graded[16]:.0f} "
        "%. The rest is what nodes 8 mm apart cannot carry: waves should be several horizons long.",
    )
