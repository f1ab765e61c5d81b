"""Elastic bodies followed by the arc length of their path: snap-through."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from database_contents import contents
from messages import naming
from plates import plate

from pdmesh.model.document import Displacement, Load, Material, Run, Static
from pdmesh.model.node_grid import Grid
from pdsolve.measures.forces import read_condition_force_histories, select_condition_force_histories
from pdsolve.model import Model
from pdsolve.rest.controls import PathPoint
from pdsolve.rest.corrector import Aim, Corrector
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import NotConvergedError, Options, resume, simulate

RAMP = ((0.0, 0.0), (1.0, 1.0))
ONE = Options(threads=1)
RUBBER = Material(E=1e6, rho=1000.0, G0=1e9)
HALF, RISE, SIDE = 1.0, 0.3, 0.6  # m: half the span of two bars, their rise, between nodes
pytestmark = pytest.mark.filterwarnings("ignore::pdsolve.model.ModelWarning")


def cloud(position: np.ndarray, delta: float) -> Grid:
    nodes = len(position)
    return Grid(
        ids=np.arange(1, nodes + 1),
        position=position,
        delta=np.full(nodes, delta),
        border=np.zeros(nodes, dtype=bool),
        hole_id=np.full(nodes, -1),
        cracks=np.empty((0, 4)),
    )


def two_bars(force: float, steps: int = 40, **changes: Any) -> Model:
    """Two bonds that meet at a node, which a force pushes down; their other ends are held."""
    grid = cloud(np.array([[-HALF, 0.0], [0.0, RISE], [HALF, 0.0]]), SIDE)
    run = Run(solver="static", static=Static(control="arc", load_steps=steps), **changes)
    held = Displacement(nodes=(1, 3), x=0.0, y=0.0, name="ends", breakable=True)
    push = Load(nodes=(2,), body_force=(0.0, -force / SIDE**2), profile=RAMP, name="push", breakable=True)
    return plate(grid, 2, material=RUBBER, conditions=(held, push), run=run)


def arch(static: Static, *conditions: Any, long: int = 90) -> Model:
    """A shallow arch, `long` by 4 nodes, with both ends clamped."""
    thick, rise = 4, 12.0
    x, row = np.meshgrid(np.arange(long) - (long - 1) / 2, np.arange(thick), indexing="ij")
    y = row + rise * (1 - (2 * x / long) ** 2)
    grid = cloud(1e-3 * np.column_stack([x.ravel(), y.ravel()]), 1e-3)
    first, last = tuple(range(1, 3 * thick + 1)), tuple(range((long - 3) * thick + 1, long * thick + 1))
    held = Displacement(nodes=first + last, x=0.0, y=0.0, name="ends")
    return plate(grid, 3, material=RUBBER, conditions=(held, *conditions), run=Run(solver="static", static=static))


def exact(stiffness: float, y: np.ndarray) -> np.ndarray:
    """The force on two bars of this stiffness, N/m for a unit stretch, at a height of their middle."""
    length, first = np.hypot(HALF, y), np.hypot(HALF, RISE)
    return -2 * stiffness * (length / first - 1) * y / length


@pytest.mark.slow
def test_two_bars_snap_through() -> None:
    """At each equilibrium the load is that of the closed form, whose limits are at cos^3 of the first angle."""
    system, state = prepare(two_bars(1e3), ONE)
    tangent = system.area[1] * system.operator.tangent(state).toarray()[3, 3]
    first = np.hypot(HALF, RISE)
    stiffness = tangent * first**3 / (2 * RISE**2)
    turning = HALF * np.sqrt((first / HALF) ** (2 / 3) - 1)
    limit = float(exact(stiffness, np.array([turning]))[0])
    with simulate(two_bars(4 * limit, 160), None, ONE) as results:
        rows = results.summary()["path_steps"]
        y = RISE + np.array([results.field("uy", row["step"])[1] for row in rows]).astype(float)
    factor = np.array([row["factor"] for row in rows])
    assert 4 * limit * factor == pytest.approx(exact(stiffness, y), abs=1e-5 * limit)  # fields are in single precision
    assert factor.max() == 1
    there = factor[y > 0]
    assert 4 * there.max() == pytest.approx(1.0, abs=2e-3)
    assert factor.min() == pytest.approx(-there.max(), abs=2e-3)  # and through its mirror image
    assert len(rows) < 300


def test_what_does_not_grow_is_there_first() -> None:
    """A pull upwards, against which the load grows: the path still begins with growing loads."""
    model = two_bars(2e4, 20)
    pull = Load(nodes=(2,), body_force=(0.0, 2e3 / SIDE**2), name="pull")
    conditions = (*model.settings.conditions, pull)
    model = Model(model.grid, msgspec.structs.replace(model.settings, conditions=conditions))
    system, state = prepare(model, ONE)
    stiffness = system.area[1] * system.operator.tangent(state).toarray()[3, 3] * np.hypot(HALF, RISE) ** 3
    with simulate(model, None, ONE) as results:
        rows = results.summary()["path_steps"]
        y = RISE + np.array([results.field("uy", row["step"])[1] for row in rows]).astype(float)
    factor = np.array([row["factor"] for row in rows])
    assert factor[0] == 0 < factor[1]
    assert factor[-1] == 1
    assert 2e4 * factor - 2e3 == pytest.approx(exact(stiffness / (2 * RISE**2), y), abs=1.0)


@pytest.mark.slow
def test_an_arch_bears_what_load_steps_by_displacement_say() -> None:
    """Newton's load steps move the middle down; by a force on the same node the path is the same, and falls."""
    node = 45 * 4 + 1
    down = Displacement(nodes=(node,), y=-16e-3, profile=RAMP, name="middle")
    with simulate(arch(Static(load_steps=20), down), None, ONE) as results:
        moved = select_condition_force_histories(read_condition_force_histories(results), ["middle"])[0].displacement[
            :, 1
        ]
        pushed = select_condition_force_histories(read_condition_force_histories(results), ["middle"])[0].force[:, 1]
    most = float(np.abs(pushed).max())
    push = Load(nodes=(node,), body_force=(0.0, -1.1 * most / 1e-6), profile=RAMP, name="middle")
    with simulate(arch(Static(control="arc", load_steps=20), push), None, ONE) as results:
        rows, books = results.summary()["path_steps"], results.history()
        way = np.array([results.field("uy", row["step"])[node - 1] for row in rows]).astype(float)
    factor = np.array([row["factor"] for row in rows])
    load = np.interp(-moved[1:], -way, 1.1 * most * factor)
    assert load == pytest.approx(np.abs(pushed[1:]), abs=0.01 * most)
    falls = factor[factor[way > -10e-3].argmax() :]
    assert falls.min() < 0.6 * falls[0]
    missing = books["strain"] - books["work"]
    assert np.abs(missing).max() < 1e-3 * books["work"].max()


@pytest.mark.slow
def test_prescribed_displacements_reach_their_end_in_few_steps() -> None:
    """From .871 of them a step goes to 1.187: rest at 1 is not found from there, but from between the two."""
    top = 30 * 4 + 4
    down = Displacement(nodes=(top,), x=0.0, y=-20e-3, profile=RAMP, name="top")
    with simulate(arch(Static(control="arc", load_steps=10), down, long=60), None, ONE) as results:
        rows = results.summary()["path_steps"]
        assert results.field("uy", rows[-1]["step"])[top - 1] == pytest.approx(-20e-3, rel=1e-6)
        assert results.meta()["status"] == "finished"
        assert results.summary()["ended"] == "the loads are reached"
    assert rows[-1]["factor"] == 1
    assert len(rows) < 15


def test_an_end_that_is_not_found_halves_the_step(monkeypatch: pytest.MonkeyPatch) -> None:
    found, failed = Corrector.find_equilibrium, []

    def once(corrector: Corrector, guess: PathPoint, aim: Aim | None, *given: Any) -> Any:
        if aim is None and not failed:
            failed.append(guess.load_factor)
            raise NotConvergedError("no rest")
        return found(corrector, guess, aim, *given)

    with simulate(two_bars(1e3), None, ONE) as results:
        before = results.summary()["path_steps"]
    monkeypatch.setattr(Corrector, "find_equilibrium", once)
    with simulate(two_bars(1e3), None, ONE) as results:
        rows = results.summary()["path_steps"]
    assert failed == [1]
    assert rows[-2]["factor"] < rows[-1]["factor"] == before[-1]["factor"] == 1


@pytest.mark.slow
def test_what_flows_spends_energy_along_the_path() -> None:
    """Each step notes what the ledger says is dissipated."""
    steel = Material(E=200e9, rho=7800, G0=1e4, nu=0.3, model="correspondence", solid="j2", failure="none",
                     yield_stress=250e6, hardening=2e9)  # fmt: skip
    down = Displacement(nodes=(15 * 4 + 1,), y=-2e-3, profile=RAMP, name="middle")
    model = arch(Static(control="arc", load_steps=4), down, long=30)
    model = Model(model.grid, msgspec.structs.replace(model.settings, material=steel))
    with simulate(model, None, ONE) as results:
        spent = [row["spent"] for row in results.summary()["path_steps"]]
        dissipated = results.history()["dissipated"]
    assert spent == pytest.approx(dissipated[1:], rel=1e-12)
    assert spent[-1] > spent[0] > 0


@pytest.mark.slow
def test_a_path_goes_on_to_the_same_bits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)
    whole, stopped, model = tmp_path / "whole.sqlite", tmp_path / "stopped.sqlite", two_bars(2e4, 20)
    simulate(model, whole, ONE).close()
    with simulate(model, stopped, ONE, watch=lambda progress: progress.step == 5) as results:
        assert results.meta()["status"] == "interrupted"
    resume(stopped, 1).close()
    assert contents(stopped) == contents(whole)


def test_a_bond_at_its_limit_ends_the_path() -> None:
    """By at most 2 % past it, though a whole step goes to 12 times it; the last but one is before it."""
    weak = msgspec.structs.replace(two_bars(1e6).settings.material, G0=1e2)
    model = two_bars(1e6)
    model = Model(model.grid, msgspec.structs.replace(model.settings, material=weak))
    with simulate(model, None, ONE) as results:
        rows = results.summary()["path_steps"]
        y = RISE + np.array([results.field("uy", row["step"])[1] for row in rows]).astype(float)
        assert "limit" in results.summary()["ended"]
        assert len(results.breaks().step) == 0
    bonds = prepare(model, ONE).system.stepper._breaking  # type: ignore[union-attr]
    over = (np.hypot(HALF, y) / np.hypot(HALF, RISE) - 1) / bonds.limit.min()
    assert 1 < over[-1] < 1.02  # 1.004
    assert over[-2] < 1


@pytest.mark.parametrize(
    ("changes", "place", "found"),
    [
        ({"after": "motion"}, "$.run.duration", "missing"),
        ({"static": Static(control="arc", opening=1e-4)}, "static.opening", "0.0001"),
        ({"static": Static(control="arc", method="relaxation")}, "$.run.static.method", "relaxation"),
        ({"static": Static(control="arc", floating=True)}, "$.run.static.floating", "true"),
    ],
)
def test_what_goes_with_no_arc_length_is_refused(changes: dict[str, Any], place: str, found: str) -> None:
    model = two_bars(1e3)
    run = msgspec.structs.replace(model.settings.run, **changes)
    with pytest.raises(ValueError, match=naming(place, found=found)):
        simulate(Model(model.grid, msgspec.structs.replace(model.settings, run=run)), None, ONE)
