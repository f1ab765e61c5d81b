"""The walls by themselves: what each stops, and that all attacks come to nothing where the list is switched off."""

from __future__ import annotations

import contextlib
import json
import os
import platform
import subprocess
import sys
from pathlib import Path

import pytest
from hostile_drawings import ATTACKS, PLATE, REAL
from messages import mentions
from plates import MESH

pytest.importorskip("gmsh", exc_type=(ImportError, OSError))

from pdmesh import SceneError
from pdmesh.__main__ import main
from pdmesh.drawing import mesh_checks
from pdmesh.drawing.sandbox import child
from pdmesh.drawing.sandbox.child import read_copies
from pdmesh.drawing.sandbox.copies import Copy
from pdmesh.drawing.sandbox.walls import warn_of_missing

WRITING = {
    "write",
    "create",
    "create and read",
    "append",
    "remove",
    "rename",
    "make a folder",
    "make a link",
    "make a pipe",
}
STOPS = {  # deeds, by the wall that stops them
    "seccomp": WRITING
    | {"change a mode", "run a program", "become a program", "fork", "start a thread", "signal another", "be traced"}
    | {"open a socket", "be a server", "fill a disk"},
    "landlock": WRITING - {"append"}
    | {"append", "read elsewhere", "list elsewhere", "run a program", "be a server", "fill a disk"},
    "limits": {"take memory", "fill a disk", "be let start processes"},
}


def tried(folder: Path, *walls: str) -> dict[str, list[str]]:
    """Which walls stood, and what could be done behind them."""
    for name in ("kept", "old"):
        (folder / name).write_text("", encoding="utf-8")
    command = [sys.executable, "-P", str(Path(__file__).with_name("deeds.py")), *walls]
    ended = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True, timeout=60)
    found: dict[str, list[str]] = json.loads(ended.stdout)
    return found


@pytest.mark.process
@pytest.mark.skipif(platform.system() != "Linux", reason="the deeds are those of Linux")
def test_without_walls_all_can_be_done(tmp_path: Path) -> None:
    """Else what the walls stop would be stopped by something else."""
    done = tried(tmp_path)["done"]
    assert {"read here", "compute"} < set(done)
    assert set().union(*STOPS.values()) <= set(done)


@pytest.mark.slow
@pytest.mark.skipif(platform.system() != "Linux", reason="the deeds are those of Linux")
@pytest.mark.parametrize("wall", STOPS)
def test_each_wall_stops_its_deeds(wall: str, tmp_path: Path) -> None:
    found = tried(tmp_path, wall)
    if wall not in found["raised"]:
        pytest.skip(f"this kernel has no {wall}")
    assert not STOPS[wall] & set(found["done"])
    assert {"read here", "compute"} < set(found["done"])


@pytest.mark.slow
@pytest.mark.parametrize("name", [one for one in REAL if "plate.geo" in ATTACKS[one.values[0]].files])
def test_attacks_where_the_list_is_switched_off(name: str, here: Path) -> None:
    touched = here / "touched"
    files = {file.replace("plate.geo", "0.geo"): str(text) for file, text in ATTACKS[name].files.items()}
    copies = {
        file: Copy(Path(file), files[file].replace("touched", str(touched)).encode())
        for file in sorted(files, key=lambda file: file != "0.geo")
    }
    with contextlib.suppress(SceneError):
        found = read_copies(copies, [], 3.0)
        if not {"seccomp", "landlock"} & set(found["walls"]):
            pytest.skip("this system has neither seccomp nor Landlock")
    assert not touched.exists()


@pytest.mark.process
def test_an_honest_drawing_is_read_behind_them() -> None:
    found = read_copies({"0.geo": Copy(Path("plate.geo"), PLATE.encode())}, [], 60.0)
    assert "limits" in found["walls"] or os.name == "nt"
    assert [group["name"] for group in found["groups"]] == ["zone:plate"]
    if platform.system() == "Linux" and platform.machine() == "x86_64":
        assert "seccomp" in found["walls"]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["plate.geo", "plate.msh"])
def test_a_missing_wall_is_said_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    """By a command, however many files it reads; not where it trusts them."""
    monkeypatch.chdir(tmp_path)
    Path("plate.geo").write_text(PLATE)
    Path("plate.msh").write_text(MESH)
    stands: list[tuple[str, ...]] = [("limits", "landlock", "seccomp"), ("limits", "landlock")]

    def twice(path: Path, _: object) -> None:
        warn_of_missing(path, stands[-1])
        warn_of_missing(path, stands[-1])

    for module in (child, mesh_checks):
        monkeypatch.setattr(module, "warn_of_missing", twice)
    for words in ([], ["--force", "-q"]):
        assert main(["build", name, *words]) == 0
        (line,) = [line for line in capsys.readouterr().err.splitlines() if "read without" in line]
        assert mentions(line, "pdmesh: warning", name, "seccomp", "elsewhere")
    assert main(["build", name, "--force", "--trust"]) == 0
    stands.reverse()
    assert main(["build", name, "--force"]) == 0
    assert "read without" not in capsys.readouterr().err
