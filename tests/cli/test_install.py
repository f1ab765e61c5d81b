"""An installation with something missing: what works all the same, and what is said."""

from __future__ import annotations

import json
import os
import re
import select
import shutil
import subprocess
import sys
import time
import tomllib
from pathlib import Path

import pytest
from devices import needs_opencl
from messages import mentions
from plates import GEOMETRIES, MESH, ROOT

from pdmesh import VERSION, commandline, trust
from pdmesh.__main__ import main
from pdmesh.reports import doctor
from pdpost.__main__ import main as pdpost
from pdsolve.__main__ import main as pdsolve


@pytest.fixture
def gmshless(here: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty current folder, where neither this process nor one that it starts can import Gmsh."""
    (here / "blocked").mkdir()
    (here / "blocked" / "gmsh.py").write_text("raise ModuleNotFoundError(\"No module named 'gmsh'\", name='gmsh')\n")
    path = os.pathsep.join([str(here / "blocked"), os.environ.get("PYTHONPATH", "")])
    monkeypatch.setenv("PYTHONPATH", path)
    monkeypatch.setitem(sys.modules, "gmsh", None)
    return here


@pytest.mark.slow
def test_without_gmsh_everything_but_its_drawings_works(gmshless: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = str(GEOMETRIES / "duran50_one_scale.py")
    small = ["--trust", "--set", "spacing=4e-3"]
    assert main(["build", scene, *small, "-o", "plate.json"]) == 0
    assert main(["build", "plate.json", "--trust", "--set", "traction=2e7", "-o", "again.json"]) == 0
    for command in ("info", "plan", "params", "preview"):
        assert main([command, scene, *small, "-o", f"{command}.{'png' if command == 'preview' else 'json'}"]) == 0
    Path("part.msh").write_text(MESH)
    material = [word for name in ("E=7e10", "rho=2e3", "G0=10") for word in ("--set", f"Material/{name}")]
    assert main(["build", "part.msh", *material]) == 0
    assert pdsolve(["plate.json", "--set", "run.steps=20", "--threads", "1"]) == 0
    for words in (["damage"], ["crack"], ["export"]):
        assert pdpost([*words, "plate.sqlite"]) == 0
    capsys.readouterr()
    assert main(["build", str(GEOMETRIES / "duran50.geo")]) == 2
    error = capsys.readouterr().err
    assert mentions(error, "Gmsh", "Python", "module 'gmsh'", "pip install gmsh")
    assert error.count("\n") == 1


@pytest.mark.slow
def test_the_doctor_says_what_is_missing_and_how_to_get_it(
    gmshless: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(doctor, "find_spec", lambda name: None)
    monkeypatch.setattr(trust, "private_folder", lambda: trust.Folder(gmshless, False))
    monkeypatch.setenv("NUMBA_NUM_THREADS", "1")
    assert main(["doctor", "--json"]) == 1
    found = {one["name"]: one for one in json.loads(capsys.readouterr().out)["findings"]}
    assert [name for name, one in found.items() if one["needed"] and not one["good"]] == ["Gmsh"]
    assert found["Gmsh"]["cure"] == "pip install gmsh"
    assert found["ffmpeg"]["found"] == "not on the PATH"
    assert "NUMBA_CACHE_DIR" in found["compiled kernels"]["cure"]
    assert not found["compiled kernels"]["good"]
    assert not found["distributed"]["good"]
    assert "1 are (NUMBA_NUM_THREADS)" in found["cores"]["found"]
    assert doctor.lines([doctor.Finding("a", False, "none", "get it"), doctor.Finding("b", True, "1", "x")]) == [
        "MISSING  a: none; get it",
        "ok       b: 1",
        "missing: a",
    ]


@pytest.mark.slow
@needs_opencl
def test_the_doctor_knows_opencl_devices() -> None:
    found = doctor._devices()
    assert (found.good, found.needed) == (True, False)
    for word in ("opencl:0", "float64", "GB"):
        assert word in found.detail


BROKEN = {
    "no package": ("raise ModuleNotFoundError(\"No module named 'pyopencl'\", name='pyopencl')", "pip install"),
    "a library": ("raise OSError('libOpenCL.so.1: cannot open shared object file')", "libOpenCL.so.1"),
    "a driver that crashes": ("import os; os.kill(os.getpid(), 11)", "-11"),
}


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
@pytest.mark.parametrize("how", BROKEN)
def test_the_doctor_says_why_there_are_no_devices(here: Path, how: str, monkeypatch: pytest.MonkeyPatch) -> None:
    program, word = BROKEN[how]
    Path("blocked").mkdir()
    Path("blocked/pyopencl.py").write_text(program)
    monkeypatch.setenv("PYTHONPATH", str(here / "blocked"))
    found = doctor._devices()
    assert (found.good, found.needed) == (False, False)
    assert word in found.detail
    assert "--device opencl" in doctor.lines([found])[0]


@pytest.mark.process
def test_a_library_that_cannot_be_loaded_is_told_from_one_that_is_not_there(
    here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    Path("blocked").mkdir()
    Path("blocked/gmsh.py").write_text("raise OSError('libGLU.so.1: cannot open shared object file')")
    monkeypatch.setenv("PYTHONPATH", str(here / "blocked"))
    found = doctor._gmsh()
    assert mentions(found.detail, "OSError", "libGLU.so.1")
    assert mentions(found.cure, "apt-get install libgl1")


@pytest.mark.parametrize("program", [main, pdsolve, pdpost])
@pytest.mark.parametrize("shell", commandline.SHELLS)
def test_a_shell_can_complete(program, shell: str, capsys: pytest.CaptureFixture[str]) -> None:  # type: ignore[no-untyped-def]
    pytest.importorskip("shtab")
    with pytest.raises(SystemExit) as stop:
        program(["--completion", shell])
    assert stop.value.code == 0
    printed = capsys.readouterr()
    assert not printed.err
    for word in ("shtab", "trust" if program is main else "output"):
        assert word in printed.out


COMPLETED = (
    ("pdpost cra", "crack"),
    ("pdpost crack pla", "plate.sqlite"),
    ("pdpost crack --al", "--along"),
    ("pdsolve stu", "study"),
    ("pdsolve fi", "fit"),
    ("pdsolve pla", "plate.sqlite"),
    ("pdsolve study --work", "--workers"),
    ("pdsolve study pla", "plate.sqlite"),
    ("pdsolve fit pla", "plate.sqlite"),
    ("pdsolve fit --meas", "--measured"),
)


@pytest.fixture
def completions(request: pytest.FixtureRequest, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Scripts _pdpost and _pdsolve of a shell in a folder with one database."""
    pytest.importorskip("shtab")
    for name, program in (("pdpost", pdpost), ("pdsolve", pdsolve)):
        with pytest.raises(SystemExit):
            program(["--completion", request.param])
        Path(f"_{name}").write_text(capsys.readouterr().out)
    Path("plate.sqlite").touch()


@pytest.mark.process
@pytest.mark.parametrize("completions", ["bash"], indirect=True)
@pytest.mark.usefixtures("completions")
def test_bash_completes_a_command_and_a_file() -> None:
    for line, found in COMPLETED:
        name, *words = line.split()
        given = f"COMP_WORDS=({line}); COMP_CWORD={len(words)}"
        script = f"source ./_{name}; {given}; _shtab_{name} {name}; echo ${{COMPREPLY[@]}}"
        ran = subprocess.run(["bash", "-c", script], capture_output=True, text=True, check=True)
        assert ran.stdout.split() == [found]


@pytest.mark.process
@pytest.mark.skipif(not shutil.which("fish"), reason="without fish")
@pytest.mark.parametrize("completions", ["fish"], indirect=True)
@pytest.mark.usefixtures("completions")
def test_fish_completes_a_command_and_a_file() -> None:
    for line, found in COMPLETED:
        script = f"source _{line.split()[0]}; complete -C '{line}'"
        ran = subprocess.run(["fish", "--no-config", "-c", script], capture_output=True, text=True, check=True)
        (offered,) = ran.stdout.splitlines()
        assert offered.split("\t")[0] == found, line


@pytest.mark.parametrize("completions", ["powershell"], indirect=True)
@pytest.mark.usefixtures("completions")
def test_powershell_is_told_of_all_commands_and_files() -> None:
    """Its script registers the programs; strings and braces of it end, as PowerShell reads them."""
    for name, words in (("pdpost", ("'crack'", "'--along'")), ("pdsolve", ("'--measured'", "'--workers'"))):
        script = Path(f"_{name}").read_text()
        assert f"Register-ArgumentCompleter -Native -CommandName {name} " in script
        assert all(word in script for word in words)
        code = re.sub(r"'(?:[^'\n]|'')*'|\"(?:[^\"`]|`(?s:.))*\"|(?m:#.*$)", "", script)
        assert not set("'\"") & set(code)
        assert (code.count("{"), code.count("(")) == (code.count("}"), code.count(")"))
    assert "'_shtab_pdsolve_pos_0' = '_words_and_files'" in script
    assert "('study fit' -split ' ') -like" in script
    assert "_shtab_pdsolve_pos_2" not in script  # the file of a study, behind either word


SHOW = """fpath=($PWD $fpath); autoload -Uz compinit; compinit -D -u; bindkey '^I' complete-word
show() { print -r -- "<$BUFFER>"; BUFFER=; zle accept-line }; zle -N show; bindkey '^X' show; print rea""dy
"""


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("zsh"), reason="without zsh")
@pytest.mark.parametrize("completions", ["zsh"], indirect=True)
@pytest.mark.usefixtures("completions")
def test_zsh_completes_a_command_and_a_file() -> None:
    terminal, end = os.openpty()
    shell = subprocess.Popen(["zsh", "-f", "-i"], stdin=end, stdout=end, stderr=end, start_new_session=True)
    os.close(end)
    try:
        os.write(terminal, SHOW.encode())
        _until(terminal, b"ready\r")
        for line, found in COMPLETED:
            os.write(terminal, line.encode() + b"\t\x18")
            shown = _until(terminal, b">\r").rpartition(b"<")[2]
            assert shown.split()[-2].decode() == found, line
    finally:
        shell.kill()
        shell.wait()
        os.close(terminal)


def _until(terminal: int, end: bytes) -> bytes:
    """What a terminal prints up to `end`."""
    said, limit = b"", time.monotonic() + 60
    while end not in said:
        assert time.monotonic() < limit, said
        if select.select([terminal], [], [], 1)[0]:
            said += os.read(terminal, 4096)
    return said.partition(end)[0] + end


def test_without_the_extra_completion_names_it(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "shtab", None)
    with pytest.raises(SystemExit) as stop:
        main(["--completion", "bash"])
    assert stop.value.code == 2
    assert mentions(capsys.readouterr().err, found=("package", "shtab"), expected="pip install 'pdsuite[completion]'")


def test_the_libraries_are_those_of_the_project() -> None:
    needed = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    assert [name.split(">=")[0] for name in needed] == list(commandline.LIBRARIES)


def test_the_version_is_one_everywhere() -> None:
    assert re.search(r"^version: (.*)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)[1] == VERSION  # type: ignore[index]
    assert f"\n## [{VERSION}] - " in (ROOT / "CHANGELOG.md").read_text()
