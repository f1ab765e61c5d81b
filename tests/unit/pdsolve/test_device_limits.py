"""What an OpenCL device does not have, what it asks for, and how it fails: one line, and nothing is lost."""

from __future__ import annotations

import dataclasses
import sys
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from devices import alike, bar, needs_opencl, without_runtime
from diffusion_models import disc
from kernel_comparison import GRIDS, torn
from messages import mentions, naming
from plates import GLASS, plate, square_grid

from pdmesh.model.document import Run
from pdsolve.device import runtime, source
from pdsolve.errors import DeviceLostError
from pdsolve.model import ModelError, on_device
from pdsolve.results import Results
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import Options, resume, simulate

pytestmark = needs_opencl


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


@pytest.mark.process
def test_bodies_on_no_lattice_are_refused() -> None:
    model = bar(run=Run(device="opencl"))
    moved = model.grid.position + 1e-3 * np.random.default_rng(1).standard_normal(model.grid.position.shape)
    scattered = dataclasses.replace(model, grid=dataclasses.replace(model.grid, position=moved))
    with pytest.raises(ModelError, match=naming("$.run.device", found="lattice", expected="cpu")):
        prepare(scattered, Options())


def test_more_numbers_than_kernels_count_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(runtime, "MOST", 100)
    assert mentions(refused(), found="128", expected="100")


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
    monkeypatch.setattr(runtime, "_library", without_runtime())
    assert mentions(refused(), found="no OpenCL runtime", expected="driver")


@pytest.mark.parametrize(
    ("changes", "word"),
    [({"double": False}, "float64"), ({"memory": 10_000}, "are needed"), ({"largest": 1_000}, "arrays")],
    ids=["no float64", "memory", "one array"],
)
def test_a_device_that_is_not_enough(changes: dict[str, Any], word: str, monkeypatch: pytest.MonkeyPatch) -> None:
    described = runtime._described
    monkeypatch.setattr(runtime, "_described", lambda *given: described(*given)._replace(**changes))
    assert mentions(refused(), word)


LARGE = {
    "bonds that soften": lambda: plate(
        GRIDS["two scales"], material=msgspec.structs.replace(GLASS, law="bilinear", kr=2.0)
    ),
    "motions": lambda: torn(GRIDS["cracked"]),
    "families": lambda: plate(GRIDS["cracked"], material=msgspec.structs.replace(GLASS, model="ordinary", nu=0.2)),
    "a body": lambda: bar(run=Run(time_step=1e-4)),
    "diffusion": lambda: disc(0.25, 600),
}


@pytest.mark.slow
@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("name", LARGE)
def test_as_much_memory_is_asked_for_as_is_taken(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    asked, taken, largest = [], [], []
    put, room_for = runtime.Session.put, runtime.Session.room_for

    def counted(session: runtime.Session, *arrays: int) -> None:
        room_for(session, *arrays)
        asked.append(sum(arrays))
        largest.append(max(arrays))

    def noted(session: runtime.Session, values: Any) -> Any:
        buffer = put(session, values)
        taken.append(buffer.size)
        return buffer

    monkeypatch.setattr(runtime.Session, "room_for", counted)
    monkeypatch.setattr(runtime.Session, "put", noted)
    prepare(on_device(LARGE[name](), "opencl"), Options("conservative"))
    assert sum(asked) == pytest.approx(sum(taken), rel=0.02)  # measured 0.011
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


@pytest.mark.slow
def test_a_kernel_that_does_not_build(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(source, "text_of", lambda name: "no kernel")
    assert mentions(refused(), "compiler", expected="builds")


def test_without_a_linker(monkeypatch: pytest.MonkeyPatch) -> None:
    """PoCL's compiler would end the process."""
    monkeypatch.setattr(
        runtime, "_described", lambda *given, old=runtime._described: old(*given)._replace(platform=runtime.POCL)
    )
    monkeypatch.setenv("PATH", "")
    assert mentions(refused(), "PoCL", expected="ld")


@pytest.mark.slow
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
