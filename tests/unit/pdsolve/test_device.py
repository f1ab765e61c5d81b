"""Bonds on an OpenCL device: the same bits as on the processor, from any start, through breaks and interruptions."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from devices import alike, bar, needs_opencl
from kernel_comparison import DRIVEN, GRIDS, torn
from plates import GLASS, plate
from system_checks import broken, kept

from pdmesh.model.document import Displacement, InitialVelocity, Run, Velocity
from pdsolve.device import runtime, source
from pdsolve.device.families import FamiliesOnDevice
from pdsolve.device.tiles import BlocksOnDevice
from pdsolve.lattice.family_blocks import FamiliesInBlocks
from pdsolve.lattice.family_tiles import FamiliesInTiles
from pdsolve.model import Model, on_device
from pdsolve.results import Results
from pdsolve.run import assembly
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import Options, resume, simulate
from pdsolve.run.system import PreparedRun

pytestmark = needs_opencl
MATERIALS = {
    "brittle": GLASS,
    "bilinear": msgspec.structs.replace(GLASS, law="bilinear", kr=2.0),
    "cohesive": msgspec.structs.replace(GLASS, law="cohesive", f_t=8e7),
    "cohesive, two lines": msgspec.structs.replace(GLASS, law="cohesive", shape="bilinear", f_t=8e7),
    "cohesive, exponential": msgspec.structs.replace(GLASS, law="cohesive", shape="exponential", f_t=8e7),
}
FAR = {name: 2e-6 for name in MATERIALS if name.startswith("cohesive, ")}  # m, of displacements that break bonds
precisions = pytest.mark.parametrize("precision", ["float64", pytest.param("float32", marks=pytest.mark.slow)])


def two(model: Model, mode: str = "conservative", precision: str = "float64") -> tuple[PreparedRun, PreparedRun]:
    """The problem for the processor and for the device."""
    options = Options(mode, precision, threads=1)
    return prepare(model, options), prepare(on_device(model, "opencl"), options)


def same(here: PreparedRun, there: PreparedRun) -> None:
    """Expect all that a checkpoint has, the broken bonds and the energies to be equal to the last bit."""
    own, other = kept(here), kept(there)
    for name in {*own, *other} - {"worst", "worst_edge", "worst_source", "worst_target"}:
        assert np.array_equal(own[name], other[name]), name
    nothing = np.zeros(0)
    ends = [[one.get(f"worst_{end}", nothing) for end in ("target", "source")] for one in (own, other)]
    order = [np.lexsort(each) for each in ends]
    for name in own.keys() & {"worst", "worst_edge"}:
        assert np.array_equal(own[name][order[0]], other[name][order[1]]), name
    assert all(map(np.array_equal, broken(here), broken(there)))
    energies = (one.system.operator.energies(one.state) for one in (here, there))
    assert all(map(np.array_equal, *energies))


@pytest.mark.slow
@precisions
@pytest.mark.parametrize(
    ("name", "law", "mode"),
    [(name, law, mode) for name in GRIDS for law in ("brittle", "bilinear") for mode in ("thesis", "conservative")]
    + [
        pytest.param(name, law, "conservative", marks=pytest.mark.slow)
        for name in GRIDS
        for law in MATERIALS
        if "cohesive" in law
    ],
)
def test_steps_from_anywhere(name: str, mode: str, law: str, precision: str) -> None:
    """Large random displacements: what breaks, softens and is spent, in pieces of some steps."""
    problems = two(plate(GRIDS[name], material=MATERIALS[law]), mode, precision)
    for problem in problems:
        random = np.random.default_rng(3)
        problem.state.value[:] = FAR.get(law, 3e-7) * random.standard_normal(problem.state.value.shape)
        problem.state.rate[:] = 3.0 * random.standard_normal(problem.state.value.shape)
        for first, last in ((1, 2), (2, 3), (3, 8), (8, 12)):
            problem.advance(first, last)
    assert 0 < len(broken(problems[0]).step) < 0.9 * problems[0].system.directed_bond_count
    same(*problems)


SOFTENING = {
    "plate": lambda: plate(GRIDS["two scales"], material=MATERIALS["bilinear"]),
    "body": lambda: bar({"law": "bilinear", "kr": 2.0}, **BENT["loads"]),
}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "size"), [("plate", 1e-6), ("body", 1e-4)])
def test_a_node_a_work_item(name: str, size: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """The form of GPUs, of which a work item is a lane: the same bits as in vectors."""
    described = runtime._described
    monkeypatch.setattr(runtime, "_described", lambda *given: described(*given)._replace(kind="GPU"))
    problems = two(SOFTENING[name]())
    for problem in problems:
        problem.state.value[:] = size * np.random.default_rng(3).standard_normal(problem.state.value.shape)
        problem.advance(1, 8)
    assert 0 < len(broken(problems[0]).step) < 0.9 * problems[0].system.directed_bond_count
    same(*problems)


@pytest.mark.slow
def test_short_bonds_are_summed_in_vectors(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the sum that takes care of bonds one by one, a plate moves as it should while its bonds are short."""
    text_of = source.text_of
    careless = ("STEP_ARGUMENTS, true, pending", "STEP_ARGUMENTS, false, pending")
    monkeypatch.setattr(source, "text_of", lambda name: text_of(name).replace(*careless))
    here, there = two(plate(GRIDS["two scales"]))
    for size, equal in ((1e-9, True), (5e-6, False)):
        for problem in (here, there):
            problem.state.value[:] = size * np.random.default_rng(3).standard_normal(problem.state.value.shape)
            problem.advance(1, 3)
        assert np.array_equal(here.state.rate, there.state.rate) == equal


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@precisions
@pytest.mark.parametrize("how", DRIVEN)
def test_conditions(how: str, precision: str) -> None:
    problems = two(torn(GRIDS["cracked"], **DRIVEN[how]), "conservative", precision)
    for problem in problems:
        for first, last in ((1, 40), (40, 41), (41, 400)):  # factors of profiles are sent 256 steps at a time
            problem.advance(first, last)
    assert len(broken(problems[0]).step) > 0
    same(*problems)


def expect_the_same_elsewhere(model: Model, first: str, then: str, stop: int, folder: Path) -> None:
    """Stop a run on one processor, with broken bonds, and go on with it on another: its file is that of a whole run."""
    stopped, whole = folder / "stopped.sqlite", folder / "whole.sqlite"
    simulate(on_device(model, first), stopped, Options(threads=1), lambda progress: progress.step >= stop).close()
    with Results.open(stopped) as results:
        assert 0 < results.checkpoint()[0] < model.settings.run.steps
        assert len(results.breaks().step) > 0
    resume(stopped, 1, device=then).close()
    simulate(model, whole, Options(threads=1)).close()
    alike(stopped, whole)


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(("first", "then"), [("cpu", "opencl"), ("opencl", "cpu"), ("opencl", "opencl")])
def test_an_interrupted_run_goes_on_elsewhere(
    first: str, then: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fields, ledger, probes, broken bonds and checkpoint of its file are those of a run on the processor."""
    run = Run(time_step=40e-9, steps=90, every=30, ledger=10, probes=((3e-3, 3e-3),))
    model = torn(GRIDS["two scales"], run=run, material=MATERIALS["bilinear"])
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)
    expect_the_same_elsewhere(model, first, then, 37, tmp_path)


BENT = {
    "loads": {"run": Run(time_step=1e-4)},
    "damping": {"run": Run(time_step=1e-4, damping=30.0)},
    "motions": {
        "run": Run(time_step=1e-4),
        "conditions": (
            Displacement(box=(-1, -1, -1, 0.06, 1, 1), x=0.0, y=0.0, z=0.0),
            Velocity(box=(0.64, -1, -1, 2, 1, 1), x=20.0, profile=((0.0, 0.0), (1e-3, 1.0))),
            InitialVelocity(box=(-1, -1, -1, 2, 2, 2), y=1.0),
        ),
    },
}


@pytest.mark.slow
@precisions
@pytest.mark.parametrize(
    "how", ["loads", *(pytest.param(how, marks=pytest.mark.slow) for how in BENT if how != "loads")]
)
def test_bodies(how: str, precision: str) -> None:
    problems = two(bar(**BENT[how]), "conservative", precision)
    for problem in problems:
        for first, last in ((1, 2), (2, 30), (30, 200)):
            problem.advance(first, last)
    assert len(broken(problems[0]).step) > 100
    same(*problems)


@pytest.mark.slow
@precisions
@pytest.mark.parametrize("law", [{}, {"law": "bilinear", "kr": 2.0}], ids=["brittle", "bilinear"])
def test_bodies_of_two_spacings(law: dict[str, Any], precision: str) -> None:
    problems = two(bar(law, 0.025, run=Run(time_step=5e-5)), "conservative", precision)
    assert isinstance(problems[1].system.operator, BlocksOnDevice)
    for problem in problems:
        for first, last in ((1, 2), (2, 60), (60, 400)):
            problem.advance(first, last)
    assert len(broken(problems[0]).step) > 100
    same(*problems)


EXPONENTIAL = {"law": "cohesive", "f_t": 2e3, "shape": "exponential"}


@pytest.mark.slow
@precisions
@pytest.mark.parametrize(
    "law",
    [{"law": "bilinear", "kr": 2.0}, {"law": "cohesive", "f_t": 2e3}, EXPONENTIAL],
    ids=["bilinear", "cohesive", "exponential"],
)
def test_bodies_that_soften(law: dict[str, Any], precision: str) -> None:
    problems = two(bar(law, **BENT["loads"]), "conservative", precision)
    for problem in problems:
        for first, last in ((1, 60), (60, 61), (61, 260)):
            problem.advance(first, last)
    assert len(broken(problems[0]).step) > 100
    assert len(kept(problems[0])["worst"]) > 100
    same(*problems)


@pytest.mark.slow
@pytest.mark.parametrize("law", [{}, {"model": "ordinary", "nu": 0.3}], ids=["brittle", "ordinary"])
@pytest.mark.parametrize(("first", "then"), [("cpu", "opencl"), ("opencl", "cpu")])
def test_a_body_goes_on_elsewhere(
    first: str, then: str, law: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = bar(law, run=Run(time_step=1e-4, steps=120, every=40, ledger=20))
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)
    expect_the_same_elsewhere(model, first, then, 90, tmp_path)


FAMILIES = {
    "for ever": {"failure": "none"},
    "by stretch": {},
    "by energy": {"failure": "energy"},
}


@pytest.mark.slow
@precisions
@pytest.mark.parametrize(
    ("name", "failure"),
    [("two scales", "by stretch")]
    + [
        pytest.param(name, failure, marks=pytest.mark.slow)
        for name in sorted(GRIDS)
        for failure in FAMILIES
        if (name, failure) != ("two scales", "by stretch")
    ],
)
def test_ordinary_families(name: str, failure: str, precision: str) -> None:
    """Bonds that fail are the processor's business, sums the device's."""
    material = msgspec.structs.replace(GLASS, model="ordinary", nu=0.2, **FAMILIES[failure])
    problems = two(plate(GRIDS[name], material=material), "conservative", precision)
    for problem in problems:
        random = np.random.default_rng(3)
        problem.state.value[:] = 2e-7 * random.standard_normal(problem.state.value.shape)
        problem.state.rate[:] = 2.0 * random.standard_normal(problem.state.value.shape)
        for first, last in ((1, 2), (2, 4), (4, 60)):
            problem.advance(first, last)
    assert (len(broken(problems[0]).step) > 0) == (failure != "for ever")
    same(*problems)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::pdsolve.model.ModelWarning")
@pytest.mark.parametrize("law", ["ordinary", "cohesive"])
@pytest.mark.parametrize(("first", "then"), [("cpu", "opencl"), ("opencl", "cpu"), ("opencl", "opencl")])
def test_broken_families_and_softened_bonds_go_on_elsewhere(
    first: str, then: str, law: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = {"ordinary": msgspec.structs.replace(GLASS, model="ordinary", nu=0.2), "cohesive": MATERIALS["cohesive"]}
    run = Run(time_step=40e-9, steps=90, every=30, ledger=10)
    model = torn(GRIDS["two scales"], run=run, material=other[law])
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)
    expect_the_same_elsewhere(model, first, then, 60, tmp_path)


@pytest.mark.slow
@precisions
@pytest.mark.parametrize("how", BENT)
@pytest.mark.parametrize("layout", [FamiliesInTiles, FamiliesInBlocks])
def test_ordinary_bodies(layout: type, how: str, precision: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """In tiles, and in blocks, where there are no tiles; some bonds break under loads."""
    model = bar({"model": "ordinary", "nu": 0.3}, **BENT[how])
    if layout is FamiliesInBlocks:
        monkeypatch.setattr(assembly.family_tiles, "placed", lambda *of: None)
    problems = two(model, "conservative", precision)
    assert isinstance(problems[1].system.operator, FamiliesOnDevice)
    assert isinstance(problems[1].system.operator.layout, layout)
    for problem in problems:
        for first, last in ((1, 2), (2, 30), (30, 200)):
            problem.advance(first, last)
    assert len(broken(problems[0]).step) > 100
    same(*problems)
