"""Every command of the three programs, in a folder of poisoned modules, settings and programs: nothing of it is used.

The commands are those of the parsers, so that a new one has to be named here.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from hostile_drawings import PLATE

from pdmesh.__main__ import parser as pdmesh
from pdpost.__main__ import parser as pdpost
from pdsolve.__main__ import parser as pdsolve
from pdsolve.model import Model

MODULES = (
    *("argparse", "asyncio", "concurrent", "ctypes", "dask", "distributed", "gmsh", "json", "llvmlite", "matplotlib"),
    *(
        "meshio",
        "msgspec",
        "multiprocessing",
        "numba",
        "numpy",
        "pickle",
        "PIL",
        "pyvista",
        "runpy",
        "scipy",
        "shapely",
    ),
    *(
        "shapely",
        "shtab",
        "signal",
        "sitecustomize",
        "site",
        "socket",
        "sqlite3",
        "ssl",
        "subprocess",
        "tempfile",
        "tqdm",
    ),
    *("usercustomize", "warnings", "yaml", "pdmesh", "pdsolve", "pdpost"),
)
RAN = "import os; os.open({mark!r}, os.O_CREAT)\n"
NUMBA = "opt: nonsense\ncache_dir: {folder}/kernels\ndisable_jit: 1\n"  # an error, once it is read
MATPLOTLIB = "backend: module://poison\nsavefig.format: nonsense\nfigure.figsize: 0.2, 0.2\nnot a setting: 1\n"
RELATIVE = {  # what leads to the current folder, by name, or as an empty entry of a list
    "DASK_CONFIG": "dask.yaml", "LD_LIBRARY_PATH": "/usr/lib:", "MATPLOTLIBRC": "matplotlibrc", "MPLCONFIGDIR": ".",
    "NUMBA_CACHE_DIR": "kernels", "XDG_CACHE_HOME": ".", "XDG_CONFIG_HOME": ".", "PYTHONSTARTUP": "startup.py",
}  # fmt: skip
ALIKE = """damage separation energy displacement velocity acceleration strain stress plastic rotation volume
    concentration content solid temperature nodes bonds watch slice render history balance reaction crack sif fatigue
    report export notch verify"""
WORDS = {  # a call of each command; those that find nothing to show in these results may say so
    "pdmesh build": "plate.geo -o built.json",
    "pdmesh init": "plate.geo",
    "pdmesh info": "plate.json",
    "pdmesh preview": "plate.json -o preview.png",
    "pdmesh plan": "study.toml",
    "pdmesh params": "plate.geo",
    "pdmesh schema": "",
    "pdmesh doctor": "",
    "pdsolve": "plate.json -o run.sqlite",
    "pdsolve study": "study.toml --workers 1",
    "pdsolve fit": "study.toml --measured curve.csv",
    "pdpost boundary": "small.sqlite --box 0,0,10,10mm --depth 2mm",
    "pdpost animate": "small.sqlite -o film.gif",
    "pdpost line": "small.sqlite --from 0,0 --to 0.01,0",
    "pdpost compare": "small.sqlite small.sqlite -o both.png",
    "pdpost tradeoff": "small.sqlite --reference small.sqlite",
    "pdpost sql": "small.sqlite",
    "pdpost view": "small.sqlite --export page.html",
    "pdpost study": "study.sqlite",
    **{f"pdpost {name}": "small.sqlite" for name in ALIKE.split()},
}
REFUSED = {
    "fit",
    "init",
    "plastic",
    "rotation",
    "volume",
    "concentration",
    "content",
    "solid",
    "temperature",
    "slice",
    "render",
    "notch",
    "sif",
    "fatigue",
}
SHORT = (
    "pdmesh build",
    "pdmesh preview",
    "pdsolve",
    "pdpost damage",
)  # of the quick suite


def commands() -> set[str]:
    """The commands of all programs, as their parsers know them."""
    found = {"pdsolve", *(f"pdsolve {word}" for word in pdsolve().others)}
    for program in (pdmesh(), pdpost()):
        for action in program._actions:
            if isinstance(action, argparse._SubParsersAction):
                found |= {f"{program.prog} {word}" for word in action.choices}
    return found


def poison(folder: Path) -> None:
    """Fill a folder with what a library or Python would take for its own."""
    mark = str(folder / "ran")
    for name in MODULES:
        (folder / f"{name}.py").write_text(RAN.format(mark=f"{mark} {name}"))
    (folder / "poison.py").write_text(RAN.format(mark=f"{mark} backend"))
    (folder / "startup.py").write_text(RAN.format(mark=f"{mark} startup"))
    (folder / ".numba_config.yaml").write_text(NUMBA.format(folder=folder))
    (folder / "matplotlibrc").write_text(MATPLOTLIB)
    for name in ("dask.yaml", "distributed.yaml"):
        (folder / name).write_text("distributed:\n  worker:\n    preload: [poison]\n")
    for name in ("ffmpeg", "git", "latex", "uname"):
        (folder / name).write_text(f"#!/bin/sh\necho > '{mark} {name}'\n")
        (folder / name).chmod(0o755)


@pytest.fixture
def poisoned(here: Path, small_plate: Model, small_results: Path) -> Path:
    """The current folder, poisoned, with a drawing, a model, a study, and results."""
    (here / "plate.geo").write_text(PLATE)
    (here / "plate.json").write_text(small_plate.to_json())
    (here / "study.toml").write_text('drawing = "plate.json"\n')
    if not (here / "small.sqlite").exists():
        shutil.copy(small_results, here / "small.sqlite")
    return here


def test_all_commands_are_here() -> None:
    assert commands() == set(WORDS)


@pytest.mark.slow
@pytest.mark.parametrize(
    "command", [pytest.param(name, marks=() if name in SHORT else pytest.mark.slow) for name in sorted(WORDS)]
)
def test_nothing_of_the_folder_is_used(poisoned: Path, command: str) -> None:
    if command == "pdpost study":
        run("pdsolve study", poisoned)
    poison(poisoned)
    ran = run(command, poisoned)
    assert not list(poisoned.glob("ran*"))
    assert not (poisoned / "kernels").exists()
    assert not list(poisoned.rglob("*.nbi"))
    said = ran.stderr
    assert not any(word in said for word in ("Traceback", "matplotlibrc", "numba", "poison", "yaml")), said
    assert ran.returncode == 0 or (command.split()[-1] in REFUSED and ran.returncode == 2), said


def run(command: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """A command as it is installed, run in a folder by somebody whose settings lead there."""
    program, *word = command.split()
    installed = Path(sys.executable).with_name(program)
    assert installed.exists()
    path = f".:{os.environ['PATH']}:"
    words = [str(installed), *word, *WORDS[command].split()]
    environment = {**os.environ, **RELATIVE, "PATH": path}
    return subprocess.run(words, cwd=folder, capture_output=True, text=True, env=environment)
