"""pdsolve --device: what it lists, its exit codes, and what a device that is lost leaves behind."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from beside import GRIDS, torn
from devices import needs_opencl

from pdmesh.model.document import Run
from pdsolve.__main__ import main
from pdsolve.operators.device import runtime
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
