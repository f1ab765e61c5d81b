"""One run at a time writes to a database: a lock that the system lets go of when its holder ends, however it ends.

It is on a file beside the database and not on the database itself: closing a second handle of that would drop the
locks that SQLite holds, and a run that is started anew replaces it. The file goes with the run; one that a killed run
has left behind is not locked.
"""

from __future__ import annotations

import errno
import os
import socket
import stat
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from pdsolve.results.errors import BusyError, ResultsWarning, WriteError

if sys.platform == "win32":
    import msvcrt

    BEHIND = 1 << 30  # bytes: where the lock is, behind what others may read

    def _lock(handle: int) -> None:
        os.lseek(handle, BEHIND, os.SEEK_SET)
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
        os.lseek(handle, 0, os.SEEK_SET)
else:
    import fcntl

    def _lock(handle: int) -> None:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


HELD = (errno.EWOULDBLOCK, errno.EAGAIN, errno.EACCES, errno.EDEADLK)


@contextmanager
def writing_to(path: Path | None) -> Iterator[None]:
    """Keeps other runs from writing to the database at `path`; None is one in memory.

    Raises BusyError if another run writes to it, WriteError where nothing can be written.
    """
    if path is None:
        yield
        return
    place = Path(f"{os.path.realpath(path)}-lock")
    handle = _locked(path, place)
    try:
        yield
    finally:
        if handle is not None:
            _let_go(handle, place)


def _locked(path: Path, place: Path) -> int | None:
    """A handle that holds the lock; None where the file system has no locks."""
    while True:
        try:
            handle = os.open(place, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o666)
        except OSError as error:
            raise WriteError(f"{path}: cannot be written, nor {place.name} beside it: {error.strerror}") from None
        try:
            _lock(handle)
        except OSError as error:
            holder = os.read(handle, 200).decode(errors="replace").strip() if error.errno in HELD else ""
            os.close(handle)
            if error.errno in HELD:
                raise BusyError(
                    f"{path}: found a run writing to it{f' ({holder})' if holder else ''}, expected none;"
                    " wait for its end, or stop it"
                ) from None
            warnings.warn(
                f"{path}: cannot be locked here ({error.strerror}); see to it that no second run writes to it",
                ResultsWarning,
                stacklevel=4,
            )
            return None
        if _is_at(handle, place):
            break
        os.close(handle)  # of a run that has ended in this moment
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        raise WriteError(f"{place}: found no regular file, expected one, or none, for the lock of {path.name}")
    with suppress(OSError):  # a full disk: the name is missing, the lock holds
        os.ftruncate(handle, 0)
        os.write(handle, f"process {os.getpid()} on {socket.gethostname()}\n".encode())
    return handle


def _is_at(handle: int, place: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), os.stat(place))
    except FileNotFoundError:
        return False


def _let_go(handle: int, place: Path) -> None:
    """First the file, then the lock, so that no one locks a file that is about to go; Windows wants it closed."""
    if sys.platform == "win32":
        os.close(handle)
        with suppress(OSError):
            place.unlink()
        return
    with suppress(OSError):
        place.unlink()
    os.close(handle)
