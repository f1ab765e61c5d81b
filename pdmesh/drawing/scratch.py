"""Temporary folders. A killed run leaves its own behind; the next run removes it.

A run keeps a lock on its folders as long as it lives. A folder without a lock is left over, even if its process number
is in use again.
"""

from __future__ import annotations

import os
import re
import shutil
import stat
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

try:
    import fcntl
except ImportError:  # Windows, where nothing is left to sweep with
    fcntl = None  # type: ignore[assignment]

PREFIX = "pdmesh-scratch-"
OURS = re.compile(re.escape(PREFIX) + r"[a-z0-9_]{8}")
YOUNG = 60.0  # s: a folder may be so new that it is not locked yet


@contextmanager
def scratch() -> Iterator[Path]:
    """A context with an empty folder (0700) that is removed at its end; the first one in a process calls `sweep`."""
    _sweep_once(tempfile.gettempdir())
    with tempfile.TemporaryDirectory(prefix=PREFIX) as folder, _held(folder):
        yield Path(folder)


@cache
def _sweep_once(place: str) -> None:
    sweep(Path(place))


def sweep(place: Path) -> None:
    """Remove the user's scratch folders in `place` that no process has locked."""
    if fcntl is None:
        return
    with suppress(OSError), os.scandir(place) as entries:
        for entry in entries:
            if OURS.fullmatch(entry.name) and _is_left(entry):
                with _held(entry.path) as mine:
                    if mine:
                        shutil.rmtree(entry.path, ignore_errors=True)


def _is_left(entry: os.DirEntry[str]) -> bool:
    """Whether an entry is an old folder of this user that nobody else may access."""
    try:
        status = entry.stat(follow_symlinks=False)
    except OSError:  # gone meanwhile
        return False
    private = stat.S_ISDIR(status.st_mode) and stat.S_IMODE(status.st_mode) == stat.S_IRWXU
    return private and status.st_uid == os.getuid() and time.time() - status.st_mtime > YOUNG


@contextmanager
def _held(folder: str) -> Iterator[bool]:
    """A context that locks a folder; the value is whether the lock was free."""
    if fcntl is None:
        yield True
        return
    try:
        handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    except OSError:
        yield False
        return
    try:
        free = False
        with suppress(OSError):  # another process has the lock, or there are no locks here
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            free = True
        yield free
    finally:
        os.close(handle)
