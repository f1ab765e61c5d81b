"""Reads regular files only, so that a pipe cannot block; writes files so that they are complete or untouched."""

from __future__ import annotations

import errno
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from pdmesh import stopping

FilePath = str | os.PathLike[str]  # what functions for scripts take

KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
    stat.S_IFSOCK: "a socket",
}
LARGE = 2**23  # bytes; larger files are read by calls that may hold the interpreter's lock for long
LARGEST = 2**34  # bytes that are read; more than any model that fits into a memory


def check_regular(path: Path, largest: int = LARGEST) -> None:
    """Raise OSError, with a message in ``strerror``, unless there is a regular file of at most `largest` bytes."""
    try:
        status = os.stat(path)
    except FileNotFoundError:
        raise FileNotFoundError(errno.ENOENT, "there is no such file; check its name and folder", str(path)) from None
    if stat.S_ISDIR(status.st_mode):
        raise IsADirectoryError(errno.EISDIR, "is a folder; name a file", str(path))
    kind = KINDS.get(stat.S_IFMT(status.st_mode))
    if kind:
        raise OSError(errno.EINVAL, f"is {kind}; name a regular file", str(path))
    if status.st_size > largest:
        raise OSError(errno.EFBIG, f"has {status.st_size} bytes; at most {largest} are read", str(path))
    if status.st_size > LARGE:
        stopping.expect_long_call()


def read_bytes(path: Path, largest: int = LARGEST) -> bytes:
    """Content of the file at `path`. Raises OSError with a message in ``strerror``."""
    check_regular(path, largest)
    return path.read_bytes()


def irregular(path: Path) -> str | None:
    """Kind of the object at `path`, or behind a link there, if it is not a regular file. Raises OSError."""
    try:
        kind = stat.S_IFMT(path.stat().st_mode)
    except (FileNotFoundError, NotADirectoryError):
        return None
    return None if kind == stat.S_IFREG else KINDS.get(kind, "no file")


def write_atomically(path: Path, data: bytes) -> None:
    """Write `data` to the file at `path` in one atomic step. Raises OSError as `replacing` does."""
    with replacing(path) as part:
        part.write_bytes(data)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A context with a temporary file that finally replaces the file at `path`, or the one a link there leads to.

    Raises OSError that names `path`, leaving nothing behind. Only a regular file is replaced.
    """
    from tempfile import mkstemp  # slow to import

    irregular_kind = irregular(path)
    if irregular_kind is not None:
        raise OSError(errno.EEXIST, f"is {irregular_kind}; name a regular file", str(path))
    target, part = Path(os.path.realpath(path)), None
    try:
        handle, part = mkstemp(dir=target.parent, prefix=".", suffix=".part")
        stopping.begin_file(part)
        os.close(handle)
        yield Path(part)
        umask = os.umask(0)
        os.umask(umask)
        os.chmod(part, 0o666 & ~umask)
        os.replace(part, target)
    except BaseException as error:
        if part is not None:
            Path(part).unlink(missing_ok=True)
        if isinstance(error, OSError) and (part is None or error.filename in (None, part)):
            raise OSError(error.errno, error.strerror or str(error), str(path)) from None
        raise
    finally:
        if part is not None:
            stopping.finish_file(os.path.realpath(part))
