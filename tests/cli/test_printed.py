"""What reaches the terminal: no control characters, a line for what is wrong; how a program ends that cannot print."""

from __future__ import annotations

import dataclasses
import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import msgspec
import pytest
from messages import mentions, naming

from pdmesh.__main__ import main as pdmesh
from pdpost.__main__ import main as pdpost
from pdsolve.__main__ import main as pdsolve
from pdsolve.model import Model, ModelError
from pdsolve.run.assembly import choose_time_step

NODE = {"id": 1, "border": "true", "position": [0, 0, 0], "hole_id": -1, "delta": [1, 1, 1]}
GRID = {"notch": [], "nodes": [NODE], "material": {"E": 1.0, "rho": 1.0, "G0": 1.0}}
WILD = "\x1b]0;x\x07\r\u202e"


def one_line(capsys: pytest.CaptureFixture[str]) -> str:
    """What was said, which is a line that a terminal does not obey."""
    said = capsys.readouterr().err
    assert said.count("\n") == 1, said
    assert said.rstrip("\n").isprintable(), said
    return said


@pytest.mark.parametrize("main", [pdmesh, pdsolve, pdpost])
def test_names_with_control_characters_are_escaped(
    main: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of files, and of what is in them."""
    monkeypatch.chdir(tmp_path)
    path = Path(f"{WILD}.json")
    path.write_text(json.dumps({**GRID, WILD: 1}))
    words = {pdmesh: ["info"], pdsolve: [], pdpost: ["sql"]}[main]  # type: ignore[index]
    assert main([*words, str(path)]) == 2  # type: ignore[operator]
    assert "\\x1b]0;x\\x07" in one_line(capsys)


def test_what_is_told_of_a_model_is_escaped_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "grid.json"
    condition = {"kind": "load", "name": f"top{WILD}\n", "nodes": [1], "body_force": [0, 1]}
    path.write_text(json.dumps({**GRID, "conditions": [condition]}))
    assert pdmesh(["info", str(path)]) == 0
    said = capsys.readouterr().out
    assert "\\x1b]0;x\\x07" in said
    assert said.replace("\n", "").isprintable()


def test_a_name_that_is_no_text(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert pdpost(["sql", f"{tmp_path}/\udce9.sqlite"]) == 2
    assert mentions(one_line(capsys), "/\\xe9.sqlite", found="no such file")


@pytest.mark.parametrize(
    ("name", "value"),
    [("NUMBA_NUM_THREADS", each) for each in ("0", "-1", "many", "1e3")] + [("SOURCE_DATE_EPOCH", "junk")],
)
def test_variables_that_libraries_would_stumble_over(
    name: str, value: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(name, value)
    assert pdsolve(["nowhere.json"]) == 2
    assert mentions(one_line(capsys), name, found=f"'{value}'", expected=("whole", "number"))


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("encoding", ["utf-8", "ascii"])
def test_a_pipe_that_is_closed_and_a_full_disk(encoding: str, tmp_path: Path) -> None:
    """After the work is done: 0 where nobody listens any more, 1 where the disk behind stdout is full."""
    words = [sys.executable, "-P", "-m", "pdmesh", "schema"]
    environment = {"PYTHONIOENCODING": encoding, "PATH": "/usr/bin:/bin", "HOME": str(tmp_path)}
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=environment) as closed:
        closed.stdout.close()  # type: ignore[union-attr]
        assert (closed.stderr.read(), closed.wait()) == (b"", 0)  # type: ignore[union-attr]
    if Path("/dev/full").exists():
        with open("/dev/full", "wb") as full:
            done = subprocess.run(words, stdout=full, stderr=subprocess.PIPE, env=environment, check=False)
        assert (done.returncode, done.stderr) == (1, b"pdmesh: stdout: No space left on device\n")


@pytest.mark.parametrize("behind", [None, MemoryError(), OSError("lib.so: failed to map segment from shared object")])
def test_too_little_memory_is_a_line(
    behind: Exception | None, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Also where a library makes another error of it, as llvmlite does."""

    def greedy(*_: object) -> None:
        if behind is None:
            raise MemoryError
        try:
            raise behind
        except Exception:
            raise OSError("Could not find/load shared object file")  # noqa: B904

    monkeypatch.setattr("pdmesh.model.document.read_file", greedy)
    assert pdmesh(["info", "grid.json"]) == 1
    assert mentions(one_line(capsys), found="memory", expected="ulimit -v")


@pytest.mark.process
def test_a_limit_of_memory_that_libraries_do_not_end_at(here: Path, capfd: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("resource")  # not on Windows
    Path("grid.json").write_text(json.dumps(GRID))
    words = f"ulimit -v 400000 && exec {shlex.quote(sys.executable)} -m pdsolve grid.json --dry-run"
    assert subprocess.run(["sh", "-c", words], timeout=120, check=False).returncode == 1
    out, err = capfd.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert mentions(err, "pdsolve", "memory")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"areas": [1e300]}, re.escape("$.areas[0] is 1e+300")),
        ({"areas": [1e-320]}, re.escape("$.areas[0]")),
        ({"run": {"time_step": 1e-320}}, naming("$.run.time_step", found="9.99989e-321", expected="1e-100")),
    ],
)
def test_numbers_with_which_nothing_can_be_computed(
    change: dict[str, object], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "grid.json"
    path.write_text(json.dumps({**GRID, **change}))
    assert pdsolve([str(path), "--dry-run"]) == 2
    assert re.search(said, one_line(capsys))


def test_a_body_has_no_plane(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "body.json"
    path.write_text(json.dumps({**GRID, "version": 2}))
    assert pdsolve([str(path), "--dry-run", "--set", "material.plane=stress"]) == 2
    assert mentions(one_line(capsys), "material.plane", found="'stress'", expected="space")


@pytest.mark.parametrize(("text", "said"), [("", "is empty"), ("{}", ".notch is missing")])
def test_files_that_say_nothing(text: str, said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "grid.json"
    path.write_text(text)
    assert pdmesh(["info", str(path)]) == 2
    assert said in one_line(capsys)


def test_damping_that_stops_all_motion_is_refused(small_plate: Model) -> None:
    for damping in (1e30, 2.1 / 50e-9):
        run = msgspec.structs.replace(small_plate.settings.run, damping=damping)
        with pytest.raises(ModelError, match=naming("$.run.damping", expected="4e+07")):
            choose_time_step(
                dataclasses.replace(small_plate, settings=msgspec.structs.replace(small_plate.settings, run=run)), 1.0
            )
    run = msgspec.structs.replace(small_plate.settings.run, damping=1.9 / 50e-9)
    model = dataclasses.replace(small_plate, settings=msgspec.structs.replace(small_plate.settings, run=run))
    assert choose_time_step(model, 1.0) == 50e-9


@pytest.mark.slow
def test_settings_of_matplotlib_that_are_no_utf_8(small_results: Path) -> None:
    settings = small_results.with_name("matplotlibrc")
    settings.write_bytes("savefig.format: png  # größe\n".encode("latin-1"))
    words = [str(Path(sys.executable).with_name("pdpost")), "damage", str(small_results), "-o", "x.png"]
    environment = os.environ | {"MATPLOTLIBRC": str(settings)}
    ended = subprocess.run(
        words, cwd=small_results.parent, capture_output=True, text=True, env=environment, check=False
    )
    assert (ended.returncode, ended.stderr.count("\n")) == (2, 1)
    assert str(settings) in ended.stderr
    assert "UTF-8" in ended.stderr
