"""Reading a file that is one, not a pipe that nobody writes to or a device; and how a process ended."""

from __future__ import annotations

import errno
import os
import signal
import stat
from pathlib import Path

KINDS = {stat.S_IFIFO: "a pipe", stat.S_IFSOCK: "a socket", stat.S_IFCHR: "a device", stat.S_IFBLK: "a device"}
LARGEST = 2**34  # bytes; more than any model that fits into a memory


def check_regular(path: Path, largest: int = LARGEST) -> None:
    """Raises OSError, whose ``strerror`` is for a message, where there is no file of a bearable size."""
    found = os.stat(path)
    kind = KINDS.get(stat.S_IFMT(found.st_mode))
    if kind:
        raise OSError(errno.EINVAL, f"found {kind}, expected a file", str(path))
    if stat.S_ISDIR(found.st_mode):
        raise IsADirectoryError(errno.EISDIR, "found a folder, expected a file", str(path))
    if found.st_size > largest:
        raise OSError(errno.EFBIG, f"found {found.st_size} bytes, expected at most {largest}", str(path))


def read_bytes(path: Path, largest: int = LARGEST) -> bytes:
    """What is in the file at `path`. Raises OSError, whose ``strerror`` is for a message."""
    check_regular(path, largest)
    return path.read_bytes()


def how_it_ended(code: int) -> str:
    """Words for the exit code of a process."""
    if code < 0:
        return f"was ended by {signal.Signals(-code).name}"
    return f"ended with exit code {code}"
