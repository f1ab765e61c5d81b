"""Environment variables that can make a library load code, and which of their values are used.

A library that these programs load reads variables of its own. A value of such a variable is used if it is a number or
a switch, an absolute path that nobody else may write to, or, for libraries that take words, a word that names nothing
in the current folder. Anything else is not passed on. Variables that none of these libraries reads stay.
"""

from __future__ import annotations

import os
import re
import stat
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple


class Library(NamedTuple):
    """The variables of a library, by the beginnings of their names, and what they can lead to."""

    name: str
    prefixes: tuple[str, ...]
    loads: str  # what a value of these variables can load, as the page says it
    takes_words: bool = False  # whether values may also be words, or names that the system's loader looks up


LIBRARIES = (
    Library("OpenCL loader", ("OCL_", "OPENCL_", "CL_CONFIG"), "drivers and layers: shared libraries"),
    Library("PoCL", ("POCL_",), "compiled kernels, its own parts, the linker that it runs", True),
    Library("pyopencl", ("PYOPENCL_",), "compiled programs", True),
    Library(
        "drivers of GPUs",
        ("CUDA_", "HSA_", "ROCM_", "RUSTICL_", "MESA_", "GALLIUM_", "IGC_", "NEO_", "ONEAPI_", "SYCL_", "ZE_"),
        "shared libraries",
        True,
    ),
    Library(
        "OpenGL, EGL, Vulkan", ("LIBGL_", "GBM_", "EGL_", "__EGL_", "__GLX_", "VK_", "DRI_"), "drivers and layers", True
    ),
    Library("mpi4py", ("MPI4PY_",), "the MPI library", True),
    Library(
        "MPICH, Open MPI and their transports",
        (
            "MPICH_",
            "MPIR_",
            "MPIEXEC_",
            "HYDRA_",
            "OMPI_",
            "OPAL_",
            "PMIX_",
            "PRTE_",
            "UCX_",
            "FI_",
            "HWLOC_",
            "I_MPI_",
            "MV2_",
            "PSM3_",
            "IBV_",
            "RDMAV_",
        ),
        "plug-ins and starters of processes",
        True,
    ),
    Library("HDF5", ("HDF5_",), "filters: shared libraries"),
    Library("NetCDF", ("NETCDF_", "NCZARR_", "NCRCENV_"), "settings and filters"),
    Library("Numba", ("NUMBA_",), "settings and compiled kernels", True),
    Library("LLVM", ("LLVM_", "LLVMLITE_"), "options of the compiler", True),
    Library("BLAS and OpenMP", ("OPENBLAS_", "MKL_", "OMP_", "GOMP_", "KMP_"), "tools: shared libraries", True),
    Library("Matplotlib", ("MPL", "MATPLOTLIB"), "settings and back ends", True),
    Library("Tcl and Tk", ("TCL_LIBRARY", "TK_LIBRARY", "TCLLIBPATH"), "scripts"),
    Library("Qt", ("QT_", "QML_", "QML2_"), "plug-ins: shared libraries", True),
    Library("OpenCASCADE", ("CSF_", "CASROOT"), "plug-ins and settings"),
    Library("Gmsh", ("GMSH",), "settings", True),
    Library("PETSc in Gmsh", ("PETSC_",), "shared libraries"),
    Library("VTK and PyVista", ("VTK_", "PYVISTA_"), "plug-ins and settings", True),
    Library("Dask", ("DASK_", "DISTRIBUTED_"), "settings that name modules"),
    Library("IPython and Jupyter", ("IPYTHON", "JUPYTER_"), "settings: Python files", True),
    Library("FFmpeg", ("FFREPORT", "FREI0R_PATH", "LADSPA_PATH"), "filters: shared libraries; files of reports"),
    Library("SQLite", ("SQLITE_",), "temporary files", True),
    Library("Python", ("PYTHON",), "modules and scripts", True),
    Library("the loader of libraries", ("LD_", "DYLD_"), "shared libraries"),
    Library("the C library", ("GCONV_PATH", "LOCPATH", "NLSPATH"), "converters and tables"),
    Library("OpenSSL", ("OPENSSL_", "SSL_CERT_"), "engines: shared libraries"),
    Library("Fontconfig", ("FONTCONFIG_",), "settings"),
    Library("desktop", ("XDG_", "GIO_", "GTK_", "GDK_", "GI_TYPELIB_PATH"), "settings, plug-ins", True),
    Library(
        "places of files and programs", ("HOME", "TMPDIR", "TEMP", "TMP", "PATH", "TERMINFO"), "settings and programs"
    ),
)

WHOLE_NAMES = frozenset({"HOME", "TMPDIR", "TEMP", "TMP", "PATH", "TERMINFO"})  # of which other names begin alike
MOST_LINKS = 40  # of a path, as Linux follows them
# Code where nobody asks for any; options of PETSc may name libraries anywhere in a line, also by their addresses
NEVER = ("PETSC_OPTIONS", "PETSC_OPTIONS_YAML", "PYTHONBREAKPOINT", "PYTHONINSPECT", "PYTHONSTARTUP")
# Places in which private folders are made, or files that are not run: others may write beside these
SHARED_PLACES = frozenset({
    "NUMBA_CACHE_DIR", "SQLITE_TMPDIR", "TEMP", "TMP", "TMPDIR", "XDG_CACHE_HOME", "XDG_DATA_DIRS", "XDG_RUNTIME_DIR",
})  # fmt: skip
# Lists that the user's system sets, of places that administrators' groups and other accounts may own
PATHS = frozenset({"DYLD_INSERT_LIBRARIES", "DYLD_LIBRARY_PATH", "LD_LIBRARY_PATH", "LD_PRELOAD", "PATH", "PYTHONPATH"})
PLACE = re.compile(r"(DIRS?|PATH|HOME|FILE|RC|ROOT|CONF|CONFIG|USERBASE|EXECUTABLE|PYCACHEPREFIX)$")  # never a word
SEPARATORS = re.compile(r"[\s,;=]+")  # between the words of a value, each of which may name something here
PLAIN = re.compile(r"[-+]?[\d.,:e]*\d[\d.,:e]*|true|false|on|off|yes|no|none", re.IGNORECASE)  # a number or a switch


def library_of(name: str) -> Library | None:
    """The library that reads a variable; None if it is none that these programs load."""
    is_whole_name = name in WHOLE_NAMES
    for library in LIBRARIES:
        for prefix in library.prefixes:
            if name == prefix or (not is_whole_name and prefix not in WHOLE_NAMES and name.startswith(prefix)):
                return library
    return None


def safe_variables(variables: Mapping[str, str]) -> tuple[dict[str, str], list[str]]:
    """Choose the variables that lead to no code of the current folder or of other users.

    Parameters
    ----------
    variables
        An environment, by name.

    Returns
    -------
    tuple
        The variables to use, lists without unsafe entries, and the names of those that lost a value.

    Examples
    --------
    >>> safe_variables({"OCL_ICD_VENDORS": "vendors", "OMP_NUM_THREADS": "2", "LANG": "C"})
    ({'OMP_NUM_THREADS': '2', 'LANG': 'C'}, ['OCL_ICD_VENDORS'])
    """
    used: dict[str, str] = {}
    dropped = []
    for name, value in variables.items():
        if name in NEVER:
            continue
        library = library_of(name)
        if library is None or (name not in WHOLE_NAMES and PLAIN.fullmatch(value) and not os.path.lexists(value)):
            used[name] = value
            continue
        entries = value.replace(":", " ").split() if name == "LD_PRELOAD" else value.split(os.pathsep)
        safe = [entry for entry in entries if _is_safe(entry, name, library)]
        if safe == entries:
            used[name] = value
        elif safe:
            used[name] = (" " if name == "LD_PRELOAD" else os.pathsep).join(safe)
        if any(entry and entry not in safe for entry in entries):  # an empty entry is a slip, and is no loss
            dropped.append(name)
    return used, dropped


def _is_safe(entry: str, name: str, library: Library) -> bool:
    """Whether an entry is a safe place, or a word that the library may take and that is no place."""
    if os.path.isabs(entry) and (os.path.lexists(entry) or not is_safe_place(entry, name)):
        return is_safe_place(entry, name)
    if not library.takes_words or PLACE.search(name):
        return os.path.isabs(entry)
    words = SEPARATORS.split(entry)
    return bool(words[0]) and all(_is_safe_word(word, name) for word in words)


def _is_safe_word(word: str, name: str) -> bool:
    """Whether a word of a value is a safe place, or begins with nothing that is in the current folder."""
    if os.path.isabs(word):
        return is_safe_place(word, name)
    begins = word.replace("\\", "/").split("/")[0]
    return begins not in (".", "..") and not (begins and os.path.lexists(begins))


def is_safe_place(place: str, name: str = "") -> bool:
    """Whether a path is absolute and, for a variable `name` that loads code, nobody else may write to it."""
    if not os.path.isabs(place):
        return False
    if name in SHARED_PLACES or not hasattr(os, "getuid") or place == os.devnull:  # PoCL sets one to that
        return True
    if name == "HOME" and _is_home(place):  # without the variable, libraries would look there too
        return True
    steps = _steps(place)
    if steps is None:
        return False
    *parents, last = steps
    for mode in map(_mode, parents):
        if stat.S_ISDIR(mode) and mode & stat.S_IWOTH and not mode & stat.S_ISVTX:
            return False  # everybody may remove or rename what is in it
    if name in PATHS:
        return not _mode(last) & stat.S_IWOTH
    complete = os.path.lexists(os.path.realpath(place))  # if not, whoever may make the rest decides what it holds
    if not complete and _mode(last) & stat.S_IWOTH:
        return False
    return all(_is_of_the_user(step, is_parent=step != last) for step in steps)


def _is_home(place: str) -> bool:
    """Whether a path is the home that the system has of this user."""
    import pwd

    try:
        return os.path.realpath(place) == os.path.realpath(pwd.getpwuid(os.getuid()).pw_dir)
    except KeyError:  # a user whom the system does not know
        return False


def _steps(place: str) -> list[Path] | None:
    """The folders, links and the file that exist on the way to a path, in order; None of links without an end."""
    rest = list(Path(place).parts[1:])
    path = Path(Path(place).anchor)
    steps, links = [path], 0
    while rest:
        part = rest.pop(0)
        if part == os.pardir:
            path = path.parent
            steps.append(path)
            continue
        path /= part
        if not os.path.lexists(path):
            break
        steps.append(path)
        if path.is_symlink():
            links += 1
            if links > MOST_LINKS:
                return None
            target = Path(os.readlink(path))
            path = Path(target.anchor) if target.is_absolute() else path.parent
            rest[:0] = target.parts[1:] if target.is_absolute() else target.parts
            steps.append(path)  # so that the last step is never a link
    return steps


def _mode(path: Path) -> int:
    try:
        return path.lstat().st_mode
    except OSError:
        return 0


def _is_of_the_user(path: Path, is_parent: bool) -> bool:
    """Whether only the user and the administrator may write to a path, or remove it from a parent folder."""
    try:
        status = path.lstat()
    except OSError:
        return False
    if status.st_uid not in (0, os.getuid()):
        return False
    if stat.S_ISLNK(status.st_mode):  # its mode says nothing
        return True
    if is_parent and status.st_mode & stat.S_ISVTX:  # others' files there are not theirs to replace
        return True
    is_private_group = status.st_gid == os.getgid() == os.getuid()  # as systems make one for each user
    by_group = status.st_mode & stat.S_IWGRP and not is_private_group and status.st_uid != 0
    return not (status.st_mode & stat.S_IWOTH or by_group)
