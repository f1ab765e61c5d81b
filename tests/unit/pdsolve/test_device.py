"""Bonds on an OpenCL device: the same bits as on the processor, from any start, through breaks and interruptions."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from beside import GRIDS, torn
from devices import needs_opencl
from media import disc
from messages import mentions, naming
from plates import GLASS, plate, square_grid
from systems import broken, kept
from whole import contents

from pdmesh import Body, Box
from pdmesh.drawing.solids import meshed
from pdmesh.grid.building import build
from pdmesh.model.document import Absorb, Acceleration, Displacement, InitialVelocity, Material, Region, Run, Velocity
from pdsolve.errors import DeviceLostError
from pdsolve.model import Model, ModelError, on_device
from pdsolve.operators.device import runtime, source
from pdsolve.operators.device.plane import PlaneOnDevice
from pdsolve.results import Results
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import Options, resume, simulate
from pdsolve.run.system import Prepared

pytestmark = needs_opencl
MATERIALS = {
    "brittle": GLASS,
    "bilinear": msgspec.structs.replace(GLASS, law="bilinear", kr=2.0),
    "cohesive": msgspec.structs.replace(GLASS, law="cohesive", f_t=8e7),
    "cohesive, two lines": msgspec.structs.replace(GLASS, law="cohesive", shape="bilinear", f_t=8e7),
    "cohesive, exponential": msgspec.structs.replace(GLASS, law="cohesive", shape="exponential", f_t=8e7),
}
FAR = {name: 2e-6 for name in MATERIALS if name.startswith("cohesive, ")}  # m, of displacements that break bonds
EVERYWHERE = (-1.0, -1.0, 1.0, 1.0)
precisions = pytest.mark.parametrize("precision", ["float64", pytest.param("float32", marks=pytest.mark.slow)])


def two(model: Model, mode: str = "conservative", precision: str = "float64") -> tuple[Prepared, Prepared]:
    """The problem for the processor and for the device."""
    options = Options(mode, precision, threads=1)
    return prepare(model, options), prepare(on_device(model, "opencl"), options)


def same(here: Prepared, there: Prepared) -> None:
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
            problem.march(first, last)
    assert 0 < len(broken(problems[0]).step) < 0.9 * problems[0].system.bonds
    same(*problems)


def test_a_node_a_work_item(monkeypatch: pytest.MonkeyPatch) -> None:
    """The form of GPUs, of which a work item is a lane: the same bits as in vectors."""
    described = runtime._described
    monkeypatch.setattr(runtime, "_described", lambda *given: described(*given)._replace(kind="GPU"))
    problems = two(plate(GRIDS["two scales"], material=MATERIALS["bilinear"]))
    for problem in problems:
        problem.state.value[:] = 1e-6 * np.random.default_rng(3).standard_normal(problem.state.value.shape)
        problem.march(1, 8)
    assert 0 < len(broken(problems[0]).step) < 0.9 * problems[0].system.bonds
    same(*problems)


def test_short_bonds_are_summed_in_vectors(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the form for one node, a plate moves as it should as long as its bonds are short."""
    source_of = PlaneOnDevice.source
    monkeypatch.setattr(PlaneOnDevice, "source", lambda of: source_of(of) + "\n#define sum_bonds(...) f[0] = f[1] = 0")
    here, there = two(plate(GRIDS["two scales"]))
    for size, alike in ((1e-9, True), (5e-6, False)):
        for problem in (here, there):
            problem.state.value[:] = size * np.random.default_rng(3).standard_normal(problem.state.value.shape)
            problem.march(1, 3)
        assert np.array_equal(here.state.rate, there.state.rate) == alike


DRIVEN = {
    "loads that change": {},
    "damping": {"run": Run(time_step=40e-9, damping=3e5)},
    "motions": {
        "conditions": (
            Displacement(box=(-1.0, 4.4e-3, 1.0, 1.0), y=1e-5, profile=((0.0, 0.0), (2e-6, 1.0))),
            Velocity(box=(-1.0, -1.0, 1.0, -4.4e-3), x=0.0, y=-5.0, profile=((0.0, 0.2), (1e-6, 1.0), (3e-6, 0.5))),
            Acceleration(box=(-1.0, -2e-3, 1e-3, 2e-3), x=-1e8),
            InitialVelocity(box=EVERYWHERE, x=1.0, y=-0.5),
        )
    },
    "a layer that absorbs": {
        "conditions": (
            InitialVelocity(box=EVERYWHERE, y=30.0),
            Absorb(box=(-1.0, -1.0, 6e-3, 1.0)),
            Velocity(box=(15e-3, -1.0, 1.0, 1.0), y=0.0),
        )
    },
}


@precisions
@pytest.mark.parametrize("how", DRIVEN)
def test_conditions(how: str, precision: str) -> None:
    problems = two(torn(GRIDS["cracked"], **DRIVEN[how]), "conservative", precision)
    for problem in problems:
        for first, last in ((1, 40), (40, 41), (41, 400)):  # factors of profiles are sent 256 steps at a time
            problem.march(first, last)
    assert len(broken(problems[0]).step) > 0
    same(*problems)


def alike(found: Path, expected: Path) -> None:
    """Expect files to have the same in all tables but that whose model names its device."""
    rows, others = contents(found), contents(expected)
    assert rows.keys() == others.keys()
    for name in rows.keys() - {"meta"}:
        assert rows[name] == others[name], name


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


@pytest.mark.parametrize(("first", "then"), [("cpu", "opencl"), ("opencl", "cpu"), ("opencl", "opencl")])
def test_an_interrupted_run_goes_on_elsewhere(
    first: str, then: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Fields, ledger, probes, broken bonds and checkpoint of its file are those of a run on the processor."""
    run = Run(time_step=40e-9, steps=90, every=30, ledger=10, probes=((3e-3, 3e-3),))
    model = torn(GRIDS["two scales"], run=run, material=MATERIALS["bilinear"])
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)
    expect_the_same_elsewhere(model, first, then, 37, tmp_path)


def bar(law: dict[str, Any] | None = None, **settings: Any) -> Model:
    """A bar of two materials, bent and pulled until it breaks."""
    brittle = Material(E=1e6, rho=1000.0, G0=3.0, micromodulus="constant", plane="space", **(law or {}))
    body = Body(Box((0, 0, 0), (0.7, 0.5, 0.4)), 0.05, brittle).fix("left").load("right", (4e4, 0, 1e3))
    found = build(meshed(body))
    stiffer = Region(material=msgspec.structs.replace(brittle, E=2e6), box=(0.0, 0.0, 0.0, 0.35, 1.0, 1.0))
    return Model(found.grid, msgspec.structs.replace(found.settings, regions=(stiffer,), **settings))


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


@precisions
@pytest.mark.parametrize("how", BENT)
def test_bodies(how: str, precision: str) -> None:
    problems = two(bar(**BENT[how]), "conservative", precision)
    for problem in problems:
        for first, last in ((1, 2), (2, 30), (30, 200)):
            problem.march(first, last)
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
            problem.march(first, last)
    assert len(broken(problems[0]).step) > 100
    assert len(kept(problems[0])["worst"]) > 100
    same(*problems)


@pytest.mark.parametrize(("first", "then"), [("cpu", "opencl"), ("opencl", "cpu")])
def test_a_body_goes_on_elsewhere(first: str, then: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model = bar(run=Run(time_step=1e-4, steps=120, every=40, ledger=20))
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)
    expect_the_same_elsewhere(model, first, then, 90, tmp_path)


FAMILIES = {
    "for ever": {"failure": "none"},
    "by stretch": {},
    "by energy": {"failure": "energy"},
}


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
    """Steps in which bonds fail are the processor's, those between them the device's."""
    material = msgspec.structs.replace(GLASS, model="ordinary", nu=0.2, **FAMILIES[failure])
    problems = two(plate(GRIDS[name], material=material), "conservative", precision)
    for problem in problems:
        random = np.random.default_rng(3)
        problem.state.value[:] = 2e-7 * random.standard_normal(problem.state.value.shape)
        problem.state.rate[:] = 2.0 * random.standard_normal(problem.state.value.shape)
        for first, last in ((1, 2), (2, 4), (4, 60)):
            problem.march(first, last)
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
def test_ordinary_bodies(how: str, precision: str) -> None:
    problems = two(bar({"model": "ordinary", "nu": 0.3}, **BENT[how]), "conservative", precision)
    for problem in problems:
        for first, last in ((1, 2), (2, 30), (30, 200)):
            problem.march(first, last)
    same(*problems)


REFUSED: dict[str, tuple[dict[str, Any], str]] = {
    "at rest": ({"run": Run(solver="static", device="opencl")}, "solver"),
    "fine zones": ({"run": Run(adapt="hybrid", device="opencl")}, "adapt"),
    "particles": ({"run": Run(cracks="particles", device="opencl")}, "cracks"),
    "families": ({"material": msgspec.structs.replace(GLASS, model="correspondence", nu=0.2)}, "model"),
}


@pytest.mark.parametrize("why", REFUSED)
def test_what_no_device_has_is_refused(why: str) -> None:
    settings, name = REFUSED[why]
    model = plate(square_grid(9, 5), **{"run": Run(device="opencl"), **settings})
    with pytest.raises(ModelError, match=naming(name, "opencl")):
        prepare(model, Options())


def test_nodes_on_no_lattice_and_other_devices_are_refused() -> None:
    grid = square_grid(9, 5)
    moved = grid.position + 1e-4 * np.random.default_rng(1).standard_normal(grid.position.shape)
    scattered = plate(dataclasses.replace(grid, position=moved), run=Run(device="opencl"))
    with pytest.raises(ModelError, match=naming("device", found="lattice", expected="cpu")):
        prepare(scattered, Options())
    with pytest.raises(ModelError, match=naming(found="opencl:999", expected="opencl:0")):
        prepare(plate(grid, run=Run(device="opencl:999")), Options())


def test_bodies_whose_bonds_are_listed_are_refused() -> None:
    model = bar(run=Run(device="opencl"))
    moved = model.grid.position + 1e-3 * np.random.default_rng(1).standard_normal(model.grid.position.shape)
    scattered = dataclasses.replace(model, grid=dataclasses.replace(model.grid, position=moved))
    with pytest.raises(ModelError, match=naming("$.run.device", found="listed", expected="cubic lattice")):
        prepare(scattered, Options())


def test_more_numbers_than_kernels_count_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runtime, "MOST", 100)
    assert mentions(refused(), found="128", expected="100")


class Failing:
    """What stands for pyopencl and fails."""

    def __init__(self, instead: dict[str, Any]) -> None:
        self._library, self._instead = runtime._library(), instead

    def __getattr__(self, name: str) -> Any:
        return self._instead.get(name) or getattr(self._library, name)


def refused() -> str:
    """What is said where a plate is prepared for the device."""
    with pytest.raises(ModelError) as caught:
        prepare(plate(square_grid(9, 5), run=Run(device="opencl")), Options())
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_without_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    runtime._library.cache_clear()
    monkeypatch.setitem(sys.modules, "pyopencl", None)
    assert mentions(refused(), found="pyopencl", expected="pip install")


def test_without_a_runtime(monkeypatch: pytest.MonkeyPatch) -> None:
    library = runtime._library()

    def none() -> list[Any]:
        raise library.LogicError("clGetPlatformIDs failed: PLATFORM_NOT_FOUND_KHR")

    failing = Failing({"get_platforms": none})
    monkeypatch.setattr(runtime, "_library", lambda: failing)
    assert mentions(refused(), found="no OpenCL runtime", expected="driver")


@pytest.mark.parametrize(
    ("changes", "word"),
    [({"double": False}, "float64"), ({"memory": 10_000}, "to take"), ({"largest": 1_000}, "arrays")],
    ids=["no float64", "memory", "one array"],
)
def test_a_device_that_is_not_enough(changes: dict[str, Any], word: str, monkeypatch: pytest.MonkeyPatch) -> None:
    described = runtime._described
    monkeypatch.setattr(runtime, "_described", lambda *given: described(*given)._replace(**changes))
    assert mentions(refused(), word)


LARGE = {
    "bonds that soften": lambda: plate(GRIDS["two scales"], material=MATERIALS["bilinear"]),
    "motions": lambda: torn(GRIDS["cracked"], **DRIVEN["motions"]),
    "families": lambda: plate(GRIDS["cracked"], material=msgspec.structs.replace(GLASS, model="ordinary", nu=0.2)),
    "a body": lambda: bar(**BENT["motions"]),
    "diffusion": lambda: disc(0.25, 600),
}


@pytest.mark.parametrize("name", LARGE)
def test_as_much_memory_is_asked_for_as_is_taken(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    asked, taken, largest = [], [], []
    put, zeros, room_for = runtime.Session.put, runtime.Session.zeros, runtime.Session.room_for

    def counted(session: runtime.Session, *arrays: int) -> None:
        room_for(session, *arrays)
        asked.append(sum(arrays))
        largest.append(max(arrays))

    def made(make: Any) -> Any:
        def noted(session: runtime.Session, of: Any) -> Any:
            buffer = make(session, of)
            taken.append(buffer.size)
            return buffer

        return noted

    monkeypatch.setattr(runtime.Session, "room_for", counted)
    for each, make in (("put", put), ("zeros", zeros)):
        monkeypatch.setattr(runtime.Session, each, made(make))
    prepare(on_device(LARGE[name](), "opencl"), Options("conservative"))
    assert sum(asked) == pytest.approx(sum(taken), rel=0.01)  # measured 0.005
    assert max(largest) == pytest.approx(max(taken), rel=0.01)  # measured 0


def test_arrays_of_a_device() -> None:
    """What is written into a part of one is read from there, and gone once it is cleared."""
    session, found = runtime.Session("opencl"), np.empty(3)
    buffer = session.put(np.arange(5.0))
    session.write(buffer, np.array([7.0, 8.0]), 16)
    session.read(buffer, found, 8)
    assert found.tolist() == [1.0, 7.0, 8.0]
    session.clear(buffer)
    session.read(buffer, found, 16)
    assert found.tolist() == [0.0, 0.0, 0.0]


def test_a_kernel_that_does_not_build(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(source, "text_of", lambda name: "no kernel")
    assert mentions(refused(), "compiler", expected="builds")


def test_a_device_lost_in_mid_run_loses_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What was written stays, and the run goes on from there on the processor."""
    model = torn(GRIDS["cracked"], run=Run(time_step=40e-9, steps=60, every=20, ledger=10))
    lost, whole = tmp_path / "lost.sqlite", tmp_path / "whole.sqlite"
    launch, left = runtime.Session.launch, iter(range(45))

    def launched(session: runtime.Session, kernel: Any, *rest: Any) -> None:
        def gone(*_: Any) -> None:
            raise runtime._library().RuntimeError("clEnqueueNDRangeKernel failed: DEVICE_NOT_AVAILABLE")

        launch(session, kernel if next(left, None) is not None else gone, *rest)

    monkeypatch.setattr(runtime.Session, "launch", launched)
    with pytest.raises(DeviceLostError, match=naming(found="DEVICE_NOT_AVAILABLE")):
        simulate(on_device(model, "opencl"), lost, Options(threads=1))
    with Results.open(lost) as results:
        assert results.meta()["status"] == "failed"
        assert results.frames()[0].max() >= 20
    resume(lost, 1, device="cpu").close()
    simulate(model, whole, Options(threads=1)).close()
    alike(lost, whole)
