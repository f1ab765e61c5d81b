"""A shared library of the current folder, named by a variable, runs in no command."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from hostile_variables import COMMANDS, COMPILER, FORGERIES, FORMS, Variable, plant_library, run_command

from pdmesh.environment_variables import NEVER
from pdsolve.model import Model

LOADED = {  # what a bare library loads, by the variable that leads to it
    "OCL_ICD_VENDORS": ("vendors", "import pyopencl; pyopencl.get_platforms()"),
    "OPENCL_VENDOR_PATH": ("vendors", "import pyopencl; pyopencl.get_platforms()"),
    "OPENCL_LAYERS": ("./libevil.so", "import pyopencl; pyopencl.get_platforms()"),
    "HDF5_PLUGIN_PATH": ("vendors", "import h5py; h5py.h5z.filter_avail(32001)"),
    "PETSC_OPTIONS": ("-dll_prepend ./libevil.so", "import gmsh; gmsh.initialize([])"),
    "MPI4PY_LIBMPI": ("./libevil.so", "from mpi4py import MPI"),
}
pytestmark = [
    pytest.mark.endurance,
    pytest.mark.skipif(COMPILER is None or sys.platform != "linux", reason="compiles a library of Linux"),
]


@pytest.fixture
def marked(here: Path, small_plate: Model, small_results: Path) -> Path:
    """The file that a hostile library of the current folder makes; a model and results are there too."""
    mark = plant_library(here)
    (here / "plate.json").write_text(small_plate.to_json())
    return mark


@pytest.mark.parametrize("name", LOADED)
def test_the_attack_is_one(name: str, here: Path, marked: Path) -> None:
    """The library runs where nothing protects from the variable, and a command says that it is not used."""
    value, code = LOADED[name]
    pytest.importorskip(code.split()[1].rstrip(";"))
    subprocess.run([sys.executable, "-P", "-c", code], cwd=here, env=os.environ | {name: value}, capture_output=True)
    assert marked.exists()
    marked.unlink()
    said = run_command(COMMANDS[0], here, {name: value}).stderr
    assert name in said or name in NEVER
    assert not marked.exists()
    scene = "from pdsolve.numerics.team import team; from pdsolve.device.runtime import devices"
    scene += "; devices(); team()"
    subprocess.run([sys.executable, "-P", "-c", scene], cwd=here, env=os.environ | {name: value, "PMI_RANK": "0"})
    assert not marked.exists()


@pytest.mark.parametrize(("variable", "form"), FORGERIES[::3], ids=lambda one: getattr(one, "name", one))
def test_no_command_is_led_astray(variable: Variable, form: str, here: Path, marked: Path, tmp_path: Path) -> None:
    """One line or an answer, no mark, and nothing but the output is new."""
    value = FORMS[form](variable, here, tmp_path)
    before = {path for path in here.rglob("*")}
    for command in COMMANDS[len(variable.name) % 2 :][:1]:
        ended = run_command(command, here, {variable.name: value})
        assert not marked.exists()
        assert "Traceback" not in ended.stderr
        assert ended.returncode in (0, 2), ended.stderr
    after = {path.name for path in set(here.rglob("*")) - before}
    assert after <= {"run.sqlite", "small.png"}, after
