"""Sources of executable code: the installation, and what the user's settings name by absolute paths.

Nothing in the current folder is executed: no module, settings, compiled kernel or program. `settle` ensures it for the
process of a command, `environment` for the processes it starts, `private_folder` for compiled code. A Python scene is
code too: pdmesh/drawing/script.py asks whether it is trusted.
"""

from __future__ import annotations

import atexit
import os
import stat
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import cache
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

HOME = Path(__file__).resolve().parent.parent  # of these packages: a checkout may be the current folder
# Variables that name places from where Python, the libraries and the system's loader take code or settings
PLACES = (
    "DASK_CONFIG", "DASK_ROOT_CONFIG", "GCONV_PATH", "HOME", "MATPLOTLIBRC", "MPLCONFIGDIR", "NUMBA_CACHE_DIR",
    "OPENSSL_CONF", "PYTHONEXECUTABLE", "PYTHONHOME", "PYTHONPYCACHEPREFIX", "PYTHONUSERBASE", "TMPDIR",
    "XDG_CACHE_HOME", "XDG_CONFIG_HOME",
)  # fmt: skip
LISTS = ("DYLD_INSERT_LIBRARIES", "DYLD_LIBRARY_PATH", "LD_AUDIT", "LD_LIBRARY_PATH", "PATH", "PYTHONPATH")
NEVER = ("PYTHONBREAKPOINT", "PYTHONINSPECT", "PYTHONSTARTUP")  # code where nobody asks for any
READERS = ("dask", "matplotlib", "numba")  # that look for settings in the current folder when they are imported


class TrustWarning(UserWarning):
    """A protection that is weaker on this system; the message says which, and what to do."""


def settle() -> None:
    """Exclude the current folder as a source of code, in this process and in those that it starts."""
    found = environment()
    for name in os.environ.keys() - found.keys():
        del os.environ[name]
    os.environ.update(found)
    sys.path[:] = [entry for entry in sys.path if _may_hold_code(entry)]
    if not any(isinstance(finder, _Elsewhere) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Elsewhere())


def environment(given: Mapping[str, str] = os.environ) -> dict[str, str]:
    """The environment for a started process: no variable and no Python path leads to the current folder.

    Absolute paths remain the user's choice.
    """
    found = {name: value for name, value in given.items() if name not in NEVER}
    for name in PLACES:
        if name in found and not os.path.isabs(found[name]):
            del found[name]
    for name in LISTS:
        if name in found:
            entries = [entry for entry in found[name].split(os.pathsep) if os.path.isabs(entry)]
            if name == "PYTHONPATH":
                entries = [entry for entry in entries if _may_hold_code(entry)]
            found[name] = os.pathsep.join(entries)
            if not entries:
                del found[name]
    preloaded = [name for name in found.get("LD_PRELOAD", "").replace(":", " ").split() if os.path.isabs(name)]
    found.pop("LD_PRELOAD", None)
    more = {"LD_PRELOAD": " ".join(preloaded)} if preloaded else {}
    if not os.path.isabs(os.path.expanduser("~")):  # a user without a home: libraries would take "~" for a name
        more["HOME"] = os.path.abspath(os.sep)
    return found | more | {"PYTHONSAFEPATH": "1", "NoDefaultCurrentDirectoryInExePath": "1"}


@contextmanager
def child_environment() -> Iterator[None]:
    """A context in which started processes inherit the protected environment."""
    before = dict(os.environ)
    os.environ.clear()
    os.environ.update(environment(before))
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


def _may_hold_code(entry: str) -> bool:
    """Whether an entry of Python's path is not the current folder, or holds these packages."""
    try:
        here = os.path.realpath(os.getcwd())
    except OSError:  # it was removed
        return bool(entry)
    place = os.path.realpath(entry or here)
    return place != here or place == str(HOME)


class _Elsewhere:
    """An import hook that imports libraries from this package's folder, where they find no settings."""

    def find_spec(self, name: str, path: Any = None, target: ModuleType | None = None) -> ModuleSpec | None:
        spec = PathFinder.find_spec(name, path, target) if name in READERS else None
        if spec is not None and spec.loader is not None:
            spec.loader.exec_module = _elsewhere(spec.loader.exec_module)  # type: ignore[assignment, method-assign]
        return spec


def _elsewhere(execute: Callable[[ModuleType], None]) -> Callable[[ModuleType], None]:
    def execute_elsewhere(module: ModuleType) -> None:
        try:
            here = os.getcwd()
        except OSError:  # it was removed: nothing is found there
            execute(module)
            return
        os.chdir(Path(__file__).parent)
        try:
            execute(module)
        finally:
            os.chdir(here)
            config: Any = sys.modules.get("numba.core.config")
            if config is not None:
                config._config_fname = ""  # it looks for them again when it compiles

    return execute_elsewhere


# ---- a folder that nobody else writes to


class Folder(NamedTuple):
    """A folder, and whether the next process will find it too."""

    path: Path
    stays: bool


@cache
def private_folder() -> Folder:
    """A folder (0700) for compiled code that belongs to the user alone.

    It is in the first possible place of: ``NUMBA_CACHE_DIR``, the user's caches, the folder for temporary files.
    Otherwise it is a new one, removed with this process.
    """
    import tempfile  # slow

    for place in _caches(environment()):
        folder = place / f"pdsuite-{_user()}"
        with suppress(OSError):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if _is_private(folder):
                return Folder(folder, True)
    temporary = tempfile.TemporaryDirectory(prefix="pdsuite-", ignore_cleanup_errors=True)
    atexit.register(temporary.cleanup)
    return Folder(Path(temporary.name), False)


def _caches(given: Mapping[str, str]) -> Iterator[Path]:
    """Places for caches, in order of preference."""
    import tempfile

    if "NUMBA_CACHE_DIR" in given:
        yield Path(given["NUMBA_CACHE_DIR"])
    home = Path(os.path.expanduser("~"))
    usual = {"darwin": home / "Library" / "Caches", "win32": Path(given.get("LOCALAPPDATA", home))}
    if home.is_absolute():
        yield Path(given.get("XDG_CACHE_HOME", usual.get(sys.platform, home / ".cache")))
    temporary = Path(tempfile.gettempdir())
    if temporary.resolve() != Path.cwd().resolve():  # which is the last that Python takes for it
        yield temporary


def _user() -> int:
    return os.getuid() if hasattr(os, "getuid") else 0  # on Windows, caches are each user's own


def _is_private(folder: Path) -> bool:
    """Whether a folder belongs to this user alone; permissions of others are removed.

    A folder that others could write to is emptied, as its content would be executed. Raises OSError.
    """
    found = folder.lstat()
    if not stat.S_ISDIR(found.st_mode) or (hasattr(os, "getuid") and found.st_uid != os.getuid()):
        return False
    if stat.S_IMODE(found.st_mode) != 0o700:
        folder.chmod(0o700)
        if hasattr(os, "getuid") and found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            _empty(folder)
    return os.access(folder, os.R_OK | os.W_OK | os.X_OK)


def _empty(folder: Path) -> None:
    import shutil  # slow

    for path in folder.iterdir():
        if path.is_dir() and not path.is_symlink():
            shutil.rmtree(path)
        else:
            path.unlink()
