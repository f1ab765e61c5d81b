"""Locks a database for one run at a time; the system releases the lock whenever its holder ends.

The lock is on a file beside the database: closing a second handle of the database would drop SQLite's own locks, and a
restarted run replaces the database. The file is removed with the run; a file left by a killed run is unlocked. As that
file may be removed, a run also stores a token in the database and checks it before writing, also where the database was
renamed.
"""

from __future__ import annotations

import errno
import json
import os
import re
import secrets
import socket
import sqlite3
import stat
import sys
import time
import warnings
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from pathlib import Path
from typing import NamedTuple

from pdmesh import stopping
from pdsolve.results.errors import BusyError, GoneError, ResultsError, ResultsWarning, TakenError, WriteError
from pdsolve.results.opening import read_only

KEY = "writer"  # of the token in the table `meta`, while a run writes


class Token(NamedTuple):
    """A writer of a database."""

    mark: str  # of this writer alone
    process: int
    began: int  # of the process, in Linux's ticks since the start of the machine; 0 elsewhere
    host: str
    file: int  # the database's number in its file system: a copy has another, and is not written to

    @classmethod
    def of(cls, path: Path) -> Token:
        """A new token of this process for the database at `path`. Raises OSError."""
        process = os.getpid()
        return cls(secrets.token_hex(8), process, _began(process), socket.gethostname(), path.stat().st_ino)

    @property
    def name(self) -> str:
        """The process in words, with its host if known."""
        return f"process {self.process}" + (f" on {self.host}" if self.host else "")

    def is_of(self, path: Path) -> bool:
        """Whether the database at `path` is the one this token was made for."""
        try:
            return path.stat().st_ino == self.file
        except OSError:
            return False

    def is_alive(self, path: Path) -> bool:
        """Whether another live process on this machine writes to the database at `path`."""
        on_this_machine = self.host == socket.gethostname() and self.process != os.getpid()
        return on_this_machine and 0 < self.began == _began(self.process) and self.is_of(path)

    def expect_in_place(self, path: Path) -> None:
        """Raise GoneError if the database is no longer at `path`."""
        if not self.is_of(path):
            raise GoneError(
                f"{path} was removed or renamed while a run was writing to it; the run stops (one that was renamed"
                " has all until here: pdsolve --resume it)"
            )

    def expect_own(self, connection: sqlite3.Connection, path: Path) -> None:
        """Raise GoneError, or TakenError if another run has started to write to the database."""
        self.expect_in_place(path)
        rows = connection.execute("SELECT value FROM meta WHERE key = ?", (KEY,)).fetchall()
        if rows != [(json.dumps(self),)]:
            raise TakenError(f"{path}: another run is writing to it; this one stops, the other goes on")


def _began(process: int) -> int:
    try:
        said = Path(f"/proc/{process}/stat").read_bytes()
        return int(said.rpartition(b")")[2].split()[19])
    except (OSError, ValueError, IndexError):
        return 0


def token_in(path: Path) -> Token | None:
    """The token in the database at `path`; None without one."""
    with suppress(sqlite3.Error, ResultsError, OSError, ValueError, TypeError):
        if path.is_file():
            with closing(read_only(path)) as connection:
                rows = connection.execute("SELECT value FROM meta WHERE key = ?", (KEY,)).fetchall()
            return Token(*json.loads(rows[0][0])) if rows else None
    return None


if sys.platform == "win32":
    import msvcrt

    BEHIND = 1 << 30  # bytes: where the lock is, behind what others may read

    def _lock(handle: int, shared: bool = False) -> None:
        os.lseek(handle, BEHIND, os.SEEK_SET)
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        os.lseek(handle, 0, os.SEEK_SET)
else:
    import fcntl

    def _lock(handle: int, shared: bool = False) -> None:
        fcntl.flock(handle, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)


LOCK = re.compile(rb"(process \d+( on [^\n]*)?\n?)?")  # what a lock's file holds; cut short on a full disk


HELD = (errno.EWOULDBLOCK, errno.EAGAIN, errno.EACCES, errno.EDEADLK)


TRIES, PAUSE = 10, 0.01  # who only looks whether a lock is held holds it for a moment: how often it is tried, s between


def holder(path: Path) -> str | None:
    """The run that writes to the database at `path`, as "process 12 on host"; None without one."""
    token = token_in(path)
    if token is not None and token.is_alive(path):
        return token.name
    try:
        handle = os.open(_place(path), os.O_RDWR | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0))
    except OSError:
        return None
    try:
        _lock(handle, shared=True)
    except OSError as error:
        return _named(handle) if error.errno in HELD else None
    finally:
        os.close(handle)
    return None


def _place(path: Path) -> Path:
    return Path(f"{os.path.realpath(path)}-lock")


def _named(handle: int) -> str:
    with suppress(OSError):
        return os.read(handle, 200).decode(errors="replace").strip() or "unknown"
    return "unknown"


@contextmanager
def writing_to(path: Path) -> Iterator[None]:
    """A context that keeps other runs from writing to the database at `path`.

    Raises BusyError if another run writes to it, WriteError if the folder cannot be written.
    """
    place = _place(path)
    handle = _locked(path, place)
    name = stopping.begin_file(place)
    try:
        token = token_in(path)
        if token is not None and token.is_alive(path):  # whose lock's file was removed
            raise _busy(path, token.name)
        yield
    finally:
        stopping.finish_file(name)
        if handle is not None:
            ours = _is_at(handle, place)
            if sys.platform == "win32":  # requires closing it before it is removed
                os.close(handle)
            with suppress(OSError):
                if ours:
                    place.unlink()
            if sys.platform != "win32":  # released last, so that nobody locks a file about to vanish
                os.close(handle)


def _busy(path: Path, name: str) -> BusyError:
    return BusyError(f"{path}: a run is writing to it ({name}); wait for its end, or stop it")


def _locked(path: Path, place: Path) -> int | None:
    """A handle that holds the lock; None if the file system has no locks."""
    tries = 0
    while True:
        try:
            handle = os.open(place, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o666)
        except OSError as error:
            raise WriteError(f"{path}: cannot be written, nor {place.name} beside it: {error.strerror}") from None
        try:
            _lock(handle)
        except OSError as error:
            name = _named(handle) if error.errno in HELD else ""
            os.close(handle)
            tries += 1
            if error.errno in HELD and tries < TRIES:
                time.sleep(PAUSE)
                continue
            if error.errno in HELD:
                raise _busy(path, name) from None
            warnings.warn(
                f"{path}: cannot be locked here ({error.strerror}); see to it that no second run writes to it",
                ResultsWarning,
                stacklevel=4,
            )
            return None
        if _is_at(handle, place):
            break
        os.close(handle)  # of a run that has ended in this moment
    # ours has one name, and says a process or nothing
    status = os.fstat(handle)
    is_ours = stat.S_ISREG(status.st_mode) and status.st_nlink <= 1
    if is_ours:
        os.lseek(handle, 0, os.SEEK_SET)
        is_ours = LOCK.fullmatch(os.read(handle, 300)) is not None
    if not is_ours:
        os.close(handle)
        raise WriteError(f"{place} is no lock of pdsolve for {path.name}; move it away")
    with suppress(OSError):  # a full disk: the name is missing, the lock holds
        os.ftruncate(handle, 0)
        host = socket.gethostname()
        on_host = f" on {host}" if host else ""
        os.write(handle, f"process {os.getpid()}{on_host}\n".encode())
    return handle


def _is_at(handle: int, place: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), os.stat(place))
    except FileNotFoundError:
        return False
