"""A Python scene runs by `--trust` alone, whoever names it: a command, a study, a model, a script."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from messages import mentions, naming

from pdmesh import SceneError
from pdmesh.__main__ import main as pdmesh
from pdmesh.__main__ import parser
from pdmesh.drawing import file_reading
from pdmesh.drawing.script import read_script, script_parameters
from pdpost.__main__ import main as pdpost
from pdsolve import StudyError, read_study, solve_study
from pdsolve.__main__ import main as pdsolve
from pdsolve.study.command import parser as study_parser

SCENE = """
from pathlib import Path
from pdmesh import Material, Run, Scene, box
spacing = 1e-3  # m: between nodes
Path("ran").touch()
scene = Scene(box(0, 0, 0.02, 0.012), spacing, Material(E=65e9, rho=2235, G0=204), run=Run(steps=20, every=20))
"""
STUDIES = {  # by name: what it says
    "of a scene": 'drawing = "scene.py"\n',
    "that varies a scene": 'drawing = "scene.py"\nvary.drawing.spacing = [1e-3]\n',
    "that builds a model again": 'drawing = "model.json"\nvary.drawing.spacing = [1e-3]\n',
    "of other case": 'drawing = "OTHER.PY"\n',
}
CHANGED = ("--set", "spacing=2e-3")
COMMANDS: dict[str, tuple[Callable[[list[str]], int], list[str]]] = {
    "build": (pdmesh, ["build", "scene.py", "-o", "new.json"]),
    "build a model again": (pdmesh, ["build", "model.json", "-o", "new.json"]),
    "build in capitals": (pdmesh, ["build", "OTHER.PY", "-o", "new.json"]),
    "build of more nodes": (pdmesh, ["build", "scene.py", "--adapt", "hybrid", "-o", "new.json"]),
    "info": (pdmesh, ["info", "scene.py"]),
    "info of a changed model": (pdmesh, ["info", "model.json", *CHANGED]),
    "preview": (pdmesh, ["preview", "scene.py", "-o", "new.png"]),
    "preview of a changed model": (pdmesh, ["preview", "model.json", *CHANGED, "-o", "new.png"]),
    "plan": (pdmesh, ["plan", "scene.py"]),
    "plan of a model": (pdmesh, ["plan", "model.json"]),
    "plan within": (pdmesh, ["plan", "scene.py", "--within", "20%"]),
    **{f"plan of a study {name}": (pdmesh, ["plan", f"{name}.toml"]) for name in STUDIES},
    **{f"study {name}": (pdsolve, ["study", f"{name}.toml", "--workers", "1", "-o", "new.sqlite"]) for name in STUDIES},
}
SOLVED = [f"study {name}" for name in STUDIES][1:]  # in processes of their own; the first stays among the quick tests


@pytest.fixture(scope="module")
def laid(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a scene that leaves a trace, a model that was built from it, and studies of both."""
    folder = tmp_path_factory.mktemp("laid")
    for name in ("scene.py", "OTHER.PY"):
        (folder / name).write_text(SCENE)
    for name, text in STUDIES.items():
        (folder / f"{name}.toml").write_text(text)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        assert pdmesh(["build", "scene.py", "--trust", "-o", "model.json", "-q"]) == 0
    (folder / "ran").unlink()
    return folder


@pytest.fixture
def scene(laid: Path, here: Path) -> Path:
    """A copy of that folder, as the current one."""
    shutil.copytree(laid, here, dirs_exist_ok=True)
    return here


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_runs_no_program_that_is_not_trusted(
    name: str, scene: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    program, words = COMMANDS[name]
    there = set(scene.iterdir())
    assert program(words) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    named = [word for word in words if Path(word).exists()] + ["$.drawing"] * ("study" in name)
    assert mentions(err, *named, found="Python program", expected=("drawing", "--trust"))
    assert set(scene.iterdir()) == there


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name in SOLVED else ()) for name in COMMANDS]
)
def test_a_command_runs_one_that_is_trusted(name: str, scene: Path) -> None:
    program, words = COMMANDS[name]
    assert program([*words, "--trust", "-q"]) == 0
    assert Path("ran").exists()


@pytest.mark.slow
def test_parameters_are_read_of_a_trusted_program_alone(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """They are read without running it, by the same rule."""
    assert pdmesh(["params", "scene.py"]) == 2
    err = capsys.readouterr().err
    assert mentions(err, "scene.py", found="Python program", expected="--trust")
    assert err.count("\n") == 1
    assert pdmesh(["params", "scene.py", "--trust"]) == 0
    assert "between nodes" in capsys.readouterr().out
    assert not Path("ran").exists()


@pytest.mark.slow
def test_a_model_that_was_built_runs_nothing(scene: Path) -> None:
    for program, *words in (
        (pdmesh, "info", "model.json"),
        (pdmesh, "params", "model.json", *CHANGED),
        (pdmesh, "preview", "model.json", "-o", "new.png"),
        (pdsolve, "model.json", "-o", "new.sqlite"),
        (pdpost, "report", "new.sqlite"),
    ):
        assert program([*words, "-q"]) == 0
    assert not Path("ran").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    "read",
    [
        file_reading.build_file,
        file_reading.read_scene,
        file_reading.file_parameters,
        read_script,
        script_parameters,
    ],
)
def test_the_library_refuses_as_the_commands_do(read: Callable[..., object], scene: Path) -> None:
    with pytest.raises(SceneError, match=naming("scene.py", found="Python program", expected=("drawing", "--trust"))):
        read(Path("scene.py"))
    assert not Path("ran").exists()
    read(Path("scene.py"), trust=True)


def test_a_study_in_a_script_refuses_too(scene: Path) -> None:
    study = read_study(Path("of a scene.toml"))
    said = naming("of a scene.toml", "$.drawing", "scene.py", found="Python program", expected="--trust")
    with pytest.raises(StudyError, match=said):
        solve_study(study, Path("new.sqlite"))
    assert not Path("ran").exists()
    assert not Path("new.sqlite").exists()


def test_a_missing_scene_is_said_to_be_missing(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert pdmesh(["build", "missing.py"]) == 2
    assert mentions(capsys.readouterr().err, "missing.py", "cannot be read")


def test_who_solves_a_scene_is_told_how_to_build_it(scene: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert pdsolve(["scene.py"]) == 2
    assert "`pdmesh build scene.py --trust`" in capsys.readouterr().err


def test_the_option_says_both_things(capsys: pytest.CaptureFixture[str]) -> None:
    for program, words in ((parser(), ["build", "--help"]), (study_parser(), ["--help"])):
        with pytest.raises(SystemExit):
            program.parse_args(words)
        told = " ".join(capsys.readouterr().out.split())
        told = told[told.rindex("--trust") :]
        assert mentions(told, "Python", "drawing", "commands", "files")


@pytest.mark.slow
def test_a_shell_completes_it() -> None:
    pytest.importorskip("shtab")
    for program, times in (("pdmesh", 5), ("pdsolve", 1)):
        words = [sys.executable, "-P", "-m", program, "--completion", "bash"]
        said = subprocess.run(words, capture_output=True, text=True, check=True).stdout
        assert sum("option_strings=" in line and " --trust" in line for line in said.splitlines()) == times
