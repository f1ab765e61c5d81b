"""Heat conduction and thermal stretch in one run: free and clamped bars, and what each law makes of swelling."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from database_contents import contents
from diffusion_models import grid, ids
from messages import naming
from numpy.typing import NDArray

from pdmesh.model.document import (
    Concentration,
    Displacement,
    Horizon,
    InitialConcentration,
    Material,
    Region,
    Run,
    Settings,
    Source,
    Static,
)
from pdmesh.model.medium import Medium
from pdsolve.diffusion import swelling
from pdsolve.diffusion.swelling import Swelling
from pdsolve.estimate import estimate_run
from pdsolve.model import Model, ModelError
from pdsolve.results import Results
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import Options, resume, simulate

H, CELLS, ROWS = 1e-3, 40, 8  # m; nodes along and across
STEEL = Material(E=200e9, rho=8000.0, G0=1e9, micromodulus="constant", alpha=1e-5, T0=300.0)
DT = 100.0  # K
LENGTH = (CELLS - 6) * H  # m, between the layers that are held
HEATER = Source(
    box=(3 * H, -1.0, (CELLS - 3) * H, 1.0), rate=8 * 2.0 * DT / LENGTH**2
)  # K/s: dT in the middle, at last
EVERYWHERE = (-1.0, -1.0, 1.0, 1.0)
ONE = Options(threads=1)


def places(*counts: int) -> NDArray[np.float64]:
    axes = np.meshgrid(*[H * (np.arange(count) + 0.5) for count in counts], indexing="ij")
    return np.column_stack([axis.ravel(order="F") for axis in axes])


def bar(*conditions: object, material: Material = STEEL, D: float = 2.0, counts: tuple[int, ...] = (CELLS, ROWS),
        **run: object) -> Model:  # fmt: skip
    """A bar that begins at T0, but for what the conditions say."""
    began = InitialConcentration(box=EVERYWHERE if len(counts) == 2 else (-1, -1, -1, 1, 1, 1), value=300.0)
    settings = Settings(
        physics="thermoelastic", material=material, medium=Medium(D=D), horizon=Horizon(3.0),
        conditions=(began, *conditions), run=Run(**run),
    )  # fmt: skip
    return Model(grid(places(*counts), H), settings)


def heated(by: float, *conditions: object, **more: object) -> Model:
    """All of the bar hotter by as much, K; little conducts."""
    counts = more.get("counts", (CELLS, ROWS))
    every = ids(np.ones(len(places(*counts)), dtype=bool))  # type: ignore[misc]
    return bar(InitialConcentration(nodes=every, value=300.0 + by), *conditions, **more)  # type: ignore[arg-type]


LAWS = {
    "bonds": (STEEL, (CELLS, ROWS)),
    "bilinear": (msgspec.structs.replace(STEEL, law="bilinear", kr=2.0), (CELLS, ROWS)),
    "ordinary": (msgspec.structs.replace(STEEL, model="ordinary", nu=0.25), (CELLS, ROWS)),
    "correspondence": (msgspec.structs.replace(STEEL, model="correspondence", nu=0.25), (CELLS, ROWS)),
    "neo hooke": (msgspec.structs.replace(STEEL, model="correspondence", nu=0.25, solid="neo hooke"), (CELLS, ROWS)),
    "micropolar": (msgspec.structs.replace(STEEL, model="micropolar", nu=0.25), (CELLS, ROWS)),
    "bonds in space": (STEEL, (12, 6, 6)),
    "ordinary in space": (msgspec.structs.replace(STEEL, model="ordinary", nu=0.25), (12, 6, 6)),
}


SOON = ("bonds", "ordinary", "bonds in space")  # seconds to compile
EACH = [pytest.param(name, marks=() if name in SOON else pytest.mark.slow) for name in LAWS]


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize("name", EACH)
def test_a_free_body_that_swells_evenly_is_free_of_stress(name: str) -> None:
    """At the displacements alpha dT x no law pulls: at most 1e-12 of what it pulls with where it is held instead."""
    material, counts = LAWS[name]
    system, state = prepare(heated(DT, material=material, counts=counts), ONE)
    d, held = len(counts), np.zeros(state.value.shape)
    system.operator.accumulate_force(state, held, 0, 0.0)
    state.value[:, :d] = STEEL.alpha * DT * system.model.grid.position  # type: ignore[operator]
    free = np.zeros(state.value.shape)
    system.operator.accumulate_force(state, free, 0, 0.0)
    assert np.abs(held).max() > 1e9
    # measured: 4.0e-15 of bonds, 1.7e-15 ordinary, 1.9e-15 correspondence, 2.7e-15 micropolar, 3e-16 in space
    assert np.abs(free).max() < 1e-12 * np.abs(held).max()
    assert system.operator.energies(state)[0].max() < 1e-9


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("name", EACH)
def test_a_body_clamped_all_round_holds_what_it_must(name: str) -> None:
    """Away from surfaces W = E (alpha dT)^2 / (1 - nu) in plane stress and 3 E (alpha dT)^2 / 2 (1 - 2 nu) in space."""
    material, counts = LAWS[name]
    counts = (20, 20) if len(counts) == 2 else (14, 14, 14)
    system, state = prepare(heated(DT, material=material, counts=counts), ONE)
    middle = np.argmin(np.linalg.norm(system.model.grid.position - H * np.array(counts) / 2, axis=1))
    nu = material.nu or {2: 1 / 3, 3: 1 / 4}[len(counts)]
    held = 200e9 * 1e-3**2 * (1 / (1 - nu) if len(counts) == 2 else 1.5 / (1 - 2 * nu))
    # measured 2.1 % off of bonds in the plane, 0.5 % in space: their lattice's own; 0.07 % neo hooke, 1e-15 the others
    assert system.operator.energies(state)[0][middle] == pytest.approx(held, rel=0.025)


def test_a_body_begins_at_the_temperature_without_stress() -> None:
    """Each material at its own T0, where no condition says another."""
    other = msgspec.structs.replace(STEEL, T0=350.0)
    half = Region(box=(0.0, -1.0, 4.1 * H, 1.0), material=other)
    settings = Settings(
        physics="thermoelastic", material=STEEL, medium=Medium(D=2.0), horizon=Horizon(3.0), regions=(half,),
        conditions=(InitialConcentration(nodes=(1,), value=310.0),), run=Run(),
    )  # fmt: skip
    system, _ = prepare(Model(grid(places(8, 8), H), settings), ONE)
    T = system.coupled_runs[0].state.value[:, 0].reshape(8, 8)
    assert T[0].tolist() == [310.0, *[350.0] * 3, *[300.0] * 4]
    assert (T[1:] == [350.0] * 4 + [300.0] * 4).all()


def ends(*, clamped: bool) -> tuple[object, ...]:
    """Both ends at T0, heated everywhere between them; held along x at the left end, or at both."""
    place = places(CELLS, ROWS)
    left, right = ids(place[:, 0] < 3 * H), ids(place[:, 0] > (CELLS - 3) * H)
    cold = tuple(Concentration(nodes=nodes, value=300.0) for nodes in (left, right))
    holds = (Displacement(nodes=left, x=0.0), Displacement(nodes=(1,), y=0.0))
    return (*cold, HEATER, *holds, *((Displacement(nodes=right, x=0.0),) if clamped else ()))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*run.damping took")
@pytest.mark.parametrize("clamped", [False, True])
def test_a_heated_bar_stretches_or_pushes(clamped: bool) -> None:
    """At rest T - T0 = q x (L - x) / 2 D, its mean q L^2 / 12 D: the bar is longer by alpha times that, or pushes on
    what clamps it with E alpha times that."""
    model = bar(*ends(clamped=clamped), material=LAWS["ordinary"][0], steps=4_000, every=4_000, damping=5e4)
    with simulate(model, None, ONE) as results:
        T, ux, pushes, summary = (
            results.field("c", 4_000), results.field("ux", 4_000), results.reactions(), results.summary()
        )  # fmt: skip
    x, high = places(CELLS, ROWS).T
    along = (x - 3 * H) / LENGTH
    middle = (along > 0) & (along < 1) & (np.abs(high - ROWS * H / 2) < H)
    assert np.abs(T - 300 - 4 * DT * along * (1 - along))[middle].max() < 0.01 * DT  # measured 0.004
    mean = 2 / 3 * DT
    if clamped:
        push = pushes["force_x"][(pushes["step"] == 4_000) & (pushes["condition"] == 6)]
        assert push == pytest.approx(-200e9 * 1e-5 * mean * ROWS * H, rel=0.04)  # measured 2.8 % less
    else:
        assert ux[x > (CELLS - 3) * H].mean() == pytest.approx(1e-5 * mean * LENGTH, rel=0.01)  # measured 0.5 % more
    assert abs(summary["balance"]) < 1e-6  # measured 5e-9
    assert abs(summary["diffusion"]["balance"]) < 1e-9


@pytest.mark.filterwarnings("ignore:.*energy balance error")  # of a run that has just begun
@pytest.mark.parametrize(
    ("D", "every", "ledger", "expected"),
    [(1e-3, 1000, None, 10), (1e-3, 1000, 35, 10), (0.5, 1000, None, 5), (0.5, 7, None, 5), (2.0, 10, None, 1)],
)
def test_slow_heat_takes_a_step_for_many_of_the_motion(D: float, every: int, ledger: int | None, expected: int) -> None:
    """As many as its stable step allows, at most 10, however many steps there are between two records."""
    stepper = prepare(bar(D=D, steps=2000, every=every, ledger=ledger), ONE).system.stepper
    assert isinstance(stepper, Swelling)
    assert stepper.steps_per_content_step == expected


@pytest.mark.slow
@pytest.mark.parametrize(
    "law",
    [{"G0": 100.0}, {"law": "bilinear", "kr": 2.0}, {"law": "cohesive", "f_t": 6e7, "G0": 60.0}],
    ids=["bonds", "bilinear", "cohesive"],
)
def test_blocks_and_the_list_swell_alike(law: dict[str, Any]) -> None:
    """Displacements, energies, works and breaks of both kernels, of a bar whose middle is cold at once."""
    material, found = msgspec.structs.replace(STEEL, **{"G0": 300.0} | law), []
    for kernel in ("listed", "blocks"):
        system, state = run = prepare(
            bar(*ends(clamped=True), material=material, steps=300), ONE._replace(kernel=kernel)
        )
        system.coupled_runs[0].state.value[100:220] -= 120.0
        assert isinstance(system.stepper, Swelling)
        system.stepper.swell()
        held = system.stepper.energy_density_at_zero_displacement(state)
        run.advance(1, 201)
        assert system.operator.name == kernel
        found.append((held, state.value, *system.operator.energies(state), state.work, state.dissipated))
        steps = np.sort(system.operator.broken().step)
        assert len(steps) > 1000  # measured 1538 to 6080
        found[-1] = (*found[-1], steps.astype(float))
    for listed, blocks in zip(*found, strict=True):
        assert np.abs(blocks - listed).max() <= 1e-9 * np.abs(listed).max()  # measured 1e-11, cohesive 2e-10


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*energy balance error")  # of a run that has just begun
def test_cycles_change_little(monkeypatch: pytest.MonkeyPatch) -> None:
    """A bar heated within 400 steps, which is fast: one step of heat for 10 of the motion, or for each."""
    found = []
    for most in (1, 10):
        monkeypatch.setattr(swelling, "CYCLES", (1, most))
        with simulate(bar(*ends(clamped=False), D=1e-3, steps=400, every=400), None, ONE) as results:
            found.append((results.field("ux", 400).astype(float), results.field("c", 400).astype(float)))
    (u, T), (u10, T10) = found
    assert np.abs(T10 - T).max() < 0.01 * np.abs(T - 300).max()  # measured 0.002
    assert np.abs(u10 - u).max() < 0.1 * np.abs(u).max()  # measured 0.076; by far most where waves begin, at the ends


@pytest.mark.slow
def test_a_stopped_run_goes_on_to_the_same_bits(tmp_path: Path) -> None:
    whole, path = tmp_path / "whole.sqlite", tmp_path / "stopped.sqlite"
    model = bar(*ends(clamped=True), steps=40, every=10, ledger=5)
    simulate(model, whole, ONE).close()
    simulate(model, path, ONE, watch=lambda progress: progress.step >= 13).close()
    resume(path, 1).close()
    assert contents(path) == contents(whole)
    with Results.open(whole) as results:
        assert results.stored(40)[-3:] == ["c", "h", "solid"]
        assert len(results.masses()) == len(results.history()) == 9


@pytest.mark.slow
def test_a_plan_knows_what_heat_costs() -> None:
    """A body that heats takes longer, by how often its heat is booked; one that is ordinary is listed bond by bond."""
    heats, cold = bar(steps=1000), bar(steps=1000).moving_part()
    seldom, cost, less = estimate_run(bar(D=1e-3, steps=1000), ONE), estimate_run(heats, ONE), estimate_run(cold, ONE)
    assert (cost.uses_block_kernels, less.uses_block_kernels) == (True, True)
    ordinary = bar(material=LAWS["ordinary"][0], steps=1000)
    assert not estimate_run(ordinary, ONE).uses_block_kernels
    assert cost.bonds == less.bonds
    assert cost.wall_time > 4 * less.wall_time
    assert seldom.wall_time < cost.wall_time / 2


REFUSED = {
    "alpha without T0": (
        {"material": msgspec.structs.replace(STEEL, T0=None)},
        {},
        naming("material.T0", found="missing"),
    ),
    "a solid": ({"medium": Medium(D=1.0, C_solid=1.0, C_sat=0.1)}, {}, naming("medium.C_solid", found="1")),
    "rest without a step": ({"run": Run(solver="static")}, {}, naming("run.time_step", found="missing")),
    "rest in load steps": (
        {"run": Run(solver="static", time_step=1.0, static=Static(load_steps=3))},
        {},
        naming("run.static.load_steps", found="3", expected="run.time_step"),
    ),
    "softening at rest": (
        {"run": Run(solver="static", time_step=1.0), "material": LAWS["bilinear"][0]},
        {},
        naming("material.law", expected="brittle"),
    ),
    "implicit motion": ({"run": Run(solver="implicit")}, {}, naming("run.solver", found="implicit", expected="static")),
    "cells that split": ({"run": Run(adapt="split")}, {}, naming("run.adapt", found="split", expected="hybrid")),
    "heat of deformation with a moving zone": (
        {"run": Run(adapt="hybrid"), "medium": Medium(D=1.0, heat_capacity=3.5e6, deformation=True, carries="heat")},
        {},
        naming("medium.deformation", found="true", expected="false"),
    ),
    "no medium": ({"medium": None}, {}, naming("$.medium", found="missing", expected="D")),
    "the thesis mode": ({}, {"mode": "thesis"}, naming("mode", found="thesis", expected=("conservative", "physics"))),
    "blocks": ({"material": LAWS["ordinary"][0]}, {"kernel": "blocks"}, naming(found="blocks", expected="listed")),
    "blocks at rest": (
        {"run": Run(solver="static", time_step=1.0, steps=1)},
        {"kernel": "blocks"},
        naming(found="blocks", expected="listed"),
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_swell_is_refused_in_one_line(name: str) -> None:
    settings, options, message = REFUSED[name]
    base = bar()
    with pytest.raises(ModelError, match=message) as refused:
        prepare(
            Model(base.grid, msgspec.structs.replace(base.settings, **settings)),  # type: ignore[arg-type]
            ONE._replace(**options),  # type: ignore[arg-type]
        )
    assert "\n" not in str(refused.value)
