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
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import cache
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from pdmesh.environment_variables import library_of, safe_variables

HOME = Path(__file__).resolve().parent.parent  # of these packages: a checkout may be the current folder
READERS = ("dask", "matplotlib", "numba")  # that look for settings in the current folder when they are imported


dropped: list[str] = []  # names of variables that `settle` has removed


class TrustWarning(UserWarning):
    """A protection that is weaker on this system; the message says which, and what to do."""


class SettingsError(Exception):
    """The user's settings of a library cannot be read; the message names the library and what to do."""


def settle() -> None:
    """Exclude the current folder as a source of code, in this process and in those that it starts.

    The names of variables that are not used, as they lead elsewhere than the user may want, are in `dropped`.
    """
    dropped.extend(settle_variables())
    if "PYTHONPYCACHEPREFIX" in dropped:  # Python has read it; compiled modules would come from there
        sys.pycache_prefix = None
    sys.path[:] = [entry for entry in sys.path if _may_hold_code(entry)]
    if not any(isinstance(finder, _Elsewhere) for finder in sys.meta_path):
        sys.meta_path.insert(0, _Elsewhere())


def settle_variables(*libraries: str) -> list[str]:
    """Remove unsafe variables from this process, also as C libraries see them; returns their names.

    With names of `LIBRARIES`, only theirs are removed.
    """
    safe = environment()
    concerned = set(os.environ)
    if libraries:
        concerned = {name for name in concerned if getattr(library_of(name), "name", None) in libraries}
    names = [name for name in safe_variables(os.environ)[1] if name in concerned]
    for name in concerned - safe.keys():
        del os.environ[name]
    os.environ.update(safe if not libraries else {name: safe[name] for name in concerned & safe.keys()})
    return names


def describe_dropped(names: Sequence[str]) -> str:
    """A line on variables that are not used."""
    return (
        f"not used: {', '.join(sorted(set(names)))}: a relative path, or a place that other users may write to;"
        " give an absolute path of your own"
    )


def environment(variables: Mapping[str, str] = os.environ) -> dict[str, str]:
    """The environment for a started process: no variable and no Python path leads to the current folder.

    Absolute paths to what nobody else may write to remain the user's choice.
    """
    safe, _ = safe_variables(variables)
    if "PYTHONPATH" in safe:
        safe["PYTHONPATH"] = os.pathsep.join(filter(_may_hold_code, safe["PYTHONPATH"].split(os.pathsep)))
        if not safe["PYTHONPATH"]:
            del safe["PYTHONPATH"]
    if not os.path.isabs(os.path.expanduser("~")):  # a user without a home: libraries would take "~" for a name
        safe["HOME"] = os.path.abspath(os.sep)
    return safe | {"PYTHONSAFEPATH": "1", "NoDefaultCurrentDirectoryInExePath": "1"}


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
        working_folder = os.path.realpath(os.getcwd())
    except OSError:  # it was removed
        return bool(entry)
    place = os.path.realpath(entry or working_folder)
    return place != working_folder or place == str(HOME)


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
            working_folder = os.getcwd()
        except OSError:  # it was removed: nothing is found there
            execute(module)
            return
        os.chdir(Path(__file__).parent)
        import logging  # slow

        # the error that `SettingsError` says is not logged too
        logging.getLogger("matplotlib").addFilter(lambda record: not str(record.msg).startswith("Cannot decode"))
        try:
            execute(module)
        except ValueError as error:  # UnicodeDecodeError is one: a file of settings in Latin-1
            named = os.environ.get("MATPLOTLIBRC", "") if module.__name__ == "matplotlib" else ""
            file = f" ({named}, by MATPLOTLIBRC)" if named else ""
            raise SettingsError(
                f"{module.__name__}: its settings{file} cannot be read: {error}; save them as UTF-8, or remove them"
            ) from error
        finally:
            os.chdir(working_folder)
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

    user = os.getuid() if hasattr(os, "getuid") else 0  # on Windows, caches are each user's own
    for place in _caches(environment()):
        folder = place / f"pdsuite-{user}"
        with suppress(OSError):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if _is_private(folder):
                return Folder(folder, True)
    temporary = tempfile.TemporaryDirectory(prefix="pdsuite-", ignore_cleanup_errors=True)
    atexit.register(temporary.cleanup)
    return Folder(Path(temporary.name), False)


def _caches(variables: Mapping[str, str]) -> Iterator[Path]:
    """Places for caches, in order of preference."""
    import tempfile

    if "NUMBA_CACHE_DIR" in variables:
        yield Path(variables["NUMBA_CACHE_DIR"])
    home = Path(os.path.expanduser("~"))
    usual = {"darwin": home / "Library" / "Caches", "win32": Path(variables.get("LOCALAPPDATA", home))}
    if home.is_absolute():
        yield Path(variables.get("XDG_CACHE_HOME", usual.get(sys.platform, home / ".cache")))
    temporary = Path(tempfile.gettempdir())
    if temporary.resolve() != Path.cwd().resolve():  # which is the last that Python takes for it
        yield temporary


def _is_private(folder: Path) -> bool:
    """Whether a folder belongs to this user alone; permissions of others are removed.

    A folder that others could write to is emptied, as its content would be executed. Raises OSError.
    """
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode) or (hasattr(os, "getuid") and status.st_uid != os.getuid()):
        return False
    if stat.S_IMODE(status.st_mode) != 0o700:
        folder.chmod(0o700)
        if hasattr(os, "getuid") and status.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            import shutil  # slow

            for path in folder.iterdir():
                if path.is_dir() and not path.is_symlink():
                    shutil.rmtree(path)
                else:
                    path.unlink()
    return os.access(folder, os.R_OK | os.W_OK | os.X_OK)
