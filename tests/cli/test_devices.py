"""pdsolve --device: what it lists, its exit codes, and what a device that is lost leaves behind."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from devices import needs_opencl, without_runtime
from kernel_comparison import GRIDS, torn

from pdmesh.model.document import Run
from pdsolve.__main__ import main
from pdsolve.device import runtime, source
from pdsolve.results import Results

pytestmark = needs_opencl


@pytest.fixture
def plate(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.chdir(tmp_path)
    model = torn(GRIDS["cracked"], run=Run(time_step=40e-9, steps=60, every=20, ledger=10))
    Path("plate.json").write_text(model.to_json())
    return "plate.json"


def test_devices_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(["--device", "list"])
    assert ended.value.code == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("cpu")
    assert lines[1].startswith("opencl:0")
    assert "float64" in lines[1]
    assert "GB" in lines[1]


@pytest.mark.parametrize("found", ["opencl:999", "cuda"])
def test_no_such_device(found: str, plate: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([plate, "--device", found, "-q"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert found in line
    assert not Path("plate.sqlite").exists()


def _described(**changes: Any) -> Callable[[pytest.MonkeyPatch], None]:
    """Let all devices be described with these changes."""
    old = runtime._described
    return lambda patched: patched.setattr(runtime, "_described", lambda *given: old(*given)._replace(**changes))


def _no_package(patched: pytest.MonkeyPatch) -> None:
    patched.setattr(runtime, "_library", runtime._library.__wrapped__)  # looked for anew
    patched.setitem(sys.modules, "pyopencl", None)


FAILING: dict[str, tuple[Callable[[pytest.MonkeyPatch], None], str]] = {
    "no package": (_no_package, "pyopencl"),
    "no runtime": (lambda patched: patched.setattr(runtime, "_library", without_runtime()), "no OpenCL runtime"),
    "no float64": (_described(double=False), "float64"),
    "too little memory": (_described(memory=10_000), "are needed"),
    "an array too large": (_described(largest=1_000), "arrays"),
    "a kernel that does not build": (
        lambda patched: patched.setattr(source, "text_of", lambda name: "no kernel"),
        "compiler",
    ),
}


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize("precision", ["float64", "float32"])
@pytest.mark.parametrize("case", FAILING)
def test_a_device_that_cannot_is_told_of_in_one_line(
    case: str, precision: str, plate: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    fail, word = FAILING[case]
    fail(monkeypatch)
    assert main([plate, "--device", "opencl", "--precision", precision, "-q"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("pdsolve: device")
    assert word in line
    assert not Path("plate.sqlite").exists()


@pytest.mark.parametrize("case", ["no package", "no runtime"])
def test_without_devices_none_are_listed(
    case: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    fail, word = FAILING[case]
    fail(monkeypatch)
    with pytest.raises(SystemExit) as ended:
        main(["--device", "list"])
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert word in line


@pytest.mark.slow
def test_a_device_that_is_lost(plate: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    launch, left = runtime.Session.launch, iter(range(45))

    def launched(session: runtime.Session, kernel: Any, *rest: Any) -> None:
        def gone(*_: Any) -> None:
            raise runtime._library().RuntimeError("clEnqueueNDRangeKernel failed: DEVICE_NOT_AVAILABLE")

        launch(session, kernel if next(left, None) is not None else gone, *rest)

    with monkeypatch.context() as patched:
        patched.setattr(runtime.Session, "launch", launched)
        assert main([plate, "--device", "opencl", "-q"]) == 3
    assert "lost" in capsys.readouterr().err.splitlines()[0]
    assert main(["--resume", "plate.sqlite", "--device", "opencl", "-q"]) == 0
    with Results.open(Path("plate.sqlite")) as results:
        assert results.frames()[0].tolist() == [0, 20, 40, 60]
