"""Environments that would make a library load code of the current folder or of another user."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from pdmesh.environment_variables import SHARED_PLACES


class Variable(NamedTuple):
    """A variable, and the file or folder that its library would read; each library has one at least."""

    name: str
    place: str = "vendors"


VARIABLES = (
    Variable("OCL_ICD_VENDORS"), Variable("OPENCL_VENDOR_PATH"), Variable("OPENCL_LAYERS", "libevil.so"),
    Variable("POCL_CACHE_DIR"), Variable("PYOPENCL_CACHE_DIR"), Variable("CUDA_INJECTION64_PATH", "libevil.so"),
    Variable("VK_LAYER_PATH"), Variable("MPI4PY_LIBMPI", "libevil.so"), Variable("OMPI_MCA_mca_base_component_path"),
    Variable("FI_PROVIDER_PATH"), Variable("HDF5_PLUGIN_PATH"), Variable("NETCDF_RC"), Variable("NUMBA_CACHE_DIR"),
    Variable("LLVM_PROFILE_FILE", "libevil.so"), Variable("OMP_TOOL_LIBRARIES", "libevil.so"),
    Variable("MATPLOTLIBRC"), Variable("MPLCONFIGDIR"), Variable("TCL_LIBRARY"), Variable("QT_PLUGIN_PATH"),
    Variable("CSF_PluginDefaults"), Variable("GMSH_HOME"), Variable("VTK_AUTOLOAD_PATH"), Variable("DASK_CONFIG"),
    Variable("PYTHONPATH"), Variable("PYTHONUSERBASE"), Variable("LD_LIBRARY_PATH"), Variable("LD_AUDIT", "libevil.so"),
    Variable("LD_PRELOAD", "libevil.so"), Variable("GCONV_PATH"), Variable("OPENSSL_CONF", "libevil.so"),
    Variable("FONTCONFIG_FILE"), Variable("XDG_CONFIG_HOME"), Variable("GIO_MODULE_DIR"), Variable("TMPDIR"),
    Variable("HOME"), Variable("PATH"), Variable("TEMP"), Variable("TMP"), Variable("PYTHONPYCACHEPREFIX"),
    Variable("IPYTHONDIR"), Variable("JUPYTER_PATH"), Variable("FREI0R_PATH"), Variable("SQLITE_TMPDIR"),
    Variable("DRI_DRIVERS_PATH"), Variable("PETSC_DIR"),
)  # fmt: skip


def _relative(variable: Variable, here: Path, _: Path) -> str:
    if not (here / variable.place).exists():  # or it is the library that is planted there
        (here / variable.place).mkdir()
    return variable.place


def _dotted(variable: Variable, here: Path, _: Path) -> str:
    return f".{os.sep}{_relative(variable, here, here)}"


def _one_bad_entry(variable: Variable, here: Path, own: Path) -> str:
    (own / "own").mkdir(exist_ok=True)
    return os.pathsep.join([str(own / "own"), _relative(variable, here, own)])


def _an_empty_entry(variable: Variable, here: Path, own: Path) -> str:
    (own / "own").mkdir(exist_ok=True)
    return os.pathsep.join([str(own / "own"), ""])


def _of_all(variable: Variable, here: Path, own: Path) -> str:
    """A folder that everybody may write to."""
    (own / "all").mkdir(exist_ok=True)
    (own / "all").chmod(0o777)
    return str(own / "all")


def _link_to_all(variable: Variable, here: Path, own: Path) -> str:
    (own / "link").symlink_to(_of_all(variable, here, own))
    return str(own / "link")


def _below_all(variable: Variable, here: Path, own: Path) -> str:
    """What does not exist yet in a folder in which everybody may make it."""
    return str(Path(_of_all(variable, here, own)) / "later")


def _link_in_all(variable: Variable, here: Path, own: Path) -> str:
    """A link to a place of one's own, which everybody may replace."""
    (own / "own").mkdir(exist_ok=True)
    link = Path(_of_all(variable, here, own)) / "link"
    link.symlink_to(own / "own")
    return str(link)


def _in_all(variable: Variable, here: Path, own: Path) -> str:
    """A closed folder, which everybody may rename."""
    closed = Path(_of_all(variable, here, own)) / "closed"
    closed.mkdir(mode=0o755)
    return str(closed)


FORMS: dict[str, Callable[[Variable, Path, Path], str]] = {
    "relative": _relative,
    "dotted": _dotted,
    "the current folder": lambda *_: ".",
    "above": lambda *_: "..",
    "empty": lambda *_: "",
    "an entry of a list": _one_bad_entry,
    "an empty entry": _an_empty_entry,
    "of all": _of_all,
    "a link to what is of all": _link_to_all,
    "to be made by anybody": _below_all,
    "a link in what is of all": _link_in_all,
    "a folder in what is of all": _in_all,
}
OF_ALL = {
    "of all",
    "a link to what is of all",
    "to be made by anybody",
    "a link in what is of all",
    "a folder in what is of all",
}
FORGERIES = [
    (variable, form)
    for variable in VARIABLES
    for form in FORMS
    if form not in OF_ALL or variable.name not in SHARED_PLACES
]

COMPILER = shutil.which("cc") or shutil.which("gcc")
MARK = '#include <fcntl.h>\n__attribute__((constructor)) static void mark(void){{ creat("{mark}", 0600); }}\n'
COMMANDS = (  # with a device, and one that draws
    "pdsolve plate.json -o run.sqlite --device opencl --force",
    "pdpost damage small.sqlite -o small.png --force",
)


def plant_library(folder: Path) -> Path:
    """Put a library into a folder, as a driver and a filter too; returns the file that it makes when loaded."""
    mark = folder / "marked"
    (folder / "evil.c").write_text(MARK.format(mark=mark))
    subprocess.run([str(COMPILER), "-shared", "-fPIC", "evil.c", "-o", "libevil.so"], cwd=folder, check=True)
    (folder / "vendors").mkdir()
    (folder / "vendors" / "evil.icd").write_text("./libevil.so\n")
    shutil.copy(folder / "libevil.so", folder / "vendors" / "libh5evil.so")
    return mark


def run_command(command: str, folder: Path, variables: dict[str, str]) -> subprocess.CompletedProcess[str]:
    """Run an installed program in a folder, with some variables."""
    program, *words = command.split()
    installed = Path(sys.executable).with_name(program)
    return subprocess.run(
        [str(installed), *words], cwd=folder, capture_output=True, text=True, env=os.environ | variables, check=False
    )
