"""SQLite's files beside a database: a journal, a log and its index, validated before SQLite sees them.

A database may come from anyone, and so may the files beside it. SQLite trusts them: it unlinks the super-journal that a
journal names, overwrites an index that is a hard link to another file, and waits for ever for a pipe. Runs of ours
never join databases, so that a journal with a super-journal is not one of ours.

A journal is rolled back here, not by SQLite, as the file may be another one between the check and its use: in memory by
who reads, in the file by who is going to write. No name in a file is ever followed. The format is that of https://www.sqlite.org/fileformat2.html#the_rollback_journal.
"""

from __future__ import annotations

import os
import stat
import struct
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from pathlib import Path
from typing import BinaryIO, NamedTuple

from pdsolve.results.errors import ResultsError

JOURNAL, LOG, INDEX = "-journal", "-wal", "-shm"
MAGIC = bytes.fromhex("d9d505f920a163d7")  # of a journal's headers, and at the end of a super-journal's name
LOGS = (bytes.fromhex("377f0682"), bytes.fromhex("377f0683"))  # first bytes of a log
LOGGED = b"\2\2"  # in a database's header: its newest pages may be in a log
VERSION = 3007000  # of an index
BLOCK, LEAST = 4096, 3  # bytes: an index grows by blocks, and begins with so few
HEADER = struct.Struct(">8s5I")  # of a journal: magic, records, nonce, pages, bytes of a sector, bytes of a page
UNKNOWN = 0xFFFFFFFF  # records: as many as there are in the file
WHOLE = "which must be put back first: it is of a run that was killed; move it away, or ask for another copy"
STRIDE = 200  # bytes between those of a page that its checksum adds up
MOST = 2**31 - 2**16  # bytes of a database that is put back in memory
LOCKS = 0x40000000, 512  # the first byte that SQLite locks in a database, and how many: an exclusive lock


def expect_sound(path: Path) -> None:
    """Raise ResultsError unless each file beside the database at `path` is one that SQLite may have left there."""
    real = os.path.realpath(path)
    for end in (JOURNAL, LOG, INDEX):
        name = os.path.basename(real) + end
        wrong = _wrong(real, end)
        if wrong is not None:
            raise ResultsError(f"{path}: {name} beside it is {wrong}; move {name} away, or ask for another copy")


def _wrong(real: str, end: str) -> str | None:
    """What is wrong with a file beside the database at `real`."""
    try:
        handle = os.open(real + end, os.O_RDONLY | _flag("O_NOFOLLOW") | _flag("O_NONBLOCK") | _flag("O_BINARY"))
    except FileNotFoundError:
        return None
    except OSError as error:
        link = os.path.islink(real + end)
        return f"{'a link' if link else f'unreadable ({error.strerror})'}, not a regular file"
    try:
        status = os.fstat(handle)
        if not stat.S_ISREG(status.st_mode):
            return "no regular file"
        if status.st_nlink > 1:
            return "a hard link to another file"
        head, size = os.read(handle, HEADER.size), status.st_size
        if not head[: len(MAGIC)].strip(b"\0"):  # not written yet, or not in use
            return None
        if end == INDEX:
            ours = size <= LEAST or (size % BLOCK == 0 and struct.unpack_from("=I", head)[0] == VERSION)
            return None if ours else "no index of a log"
        if end == JOURNAL:
            ours = head.startswith(MAGIC) or _is_unsynchronized(head)
            return None if ours else "no journal of SQLite"
        if head[:4] not in LOGS:
            return "no log of SQLite"
        # its writer may just have ended
        if os.path.exists(real) and not is_logged(real) and os.path.exists(real + end):
            return "a log although the database has none"
        return None
    finally:
        os.close(handle)


def _flag(name: str) -> int:
    """A flag for opening files, 0 where the system has none of this name."""
    return getattr(os, name, 0)


def _is_unsynchronized(head: bytes) -> bool:
    """Whether a journal has a part of its magic alone: SQLite writes that last, before it changes the database."""
    magic = head[: len(MAGIC)].rstrip(b"\0")
    return 0 < len(magic) < len(MAGIC) and MAGIC.startswith(magic) and len(head) == HEADER.size


def is_logged(real: str) -> bool:
    """Whether the header of a database says that it has a log; not of a file that is no regular one."""
    with _opened(real, os.O_RDONLY) as file:
        return stat.S_ISREG(os.fstat(file.fileno()).st_mode) and file.read(20)[18:] == LOGGED


class Original(NamedTuple):
    """The pages that a journal puts back."""

    size: int  # bytes of a page
    pages: int | None  # of the database; None if the journal was not finished, and nothing has changed
    places: list[tuple[int, int]]  # number of each page, and the byte in the journal where it is


def only_truncates(path: Path) -> bool:
    """Whether the hot journal of the database at `path` puts nothing back, but takes pages away.

    That is so of a new database, and of a forged journal. False if the journal is gone. Raises as `roll_back` does.
    """
    real = os.path.realpath(path)
    try:
        with _opened(real, os.O_RDONLY) as database, _opened(real + JOURNAL, os.O_RDONLY) as journal:
            original = _original(path, journal, os.fstat(database.fileno()).st_size)
    except FileNotFoundError:
        return False
    return original.pages is not None and not original.places


def roll_back(path: Path, intact: bool = False) -> bool:
    """Put back the pages in the hot journal of the database at `path`, unless it is `intact`, and remove the journal.

    False if another program uses the database. Raises ResultsError for a journal that no run of ours can have left,
    OSError if the database cannot be written.
    """
    real = os.path.realpath(path)
    with _opened(real, os.O_RDWR) as database, _locked(database.fileno()) as alone:
        if not alone:
            return False
        try:
            with _opened(real + JOURNAL, os.O_RDONLY) as journal:
                original = _original(path, journal, os.fstat(database.fileno()).st_size)
                if not intact:
                    _put_back(original, journal, database)
                same = os.path.samestat(os.fstat(journal.fileno()), os.lstat(real + JOURNAL))
        except FileNotFoundError:  # rolled back by another program meanwhile
            return True
        if same:
            os.unlink(real + JOURNAL)
            if hasattr(os, "O_DIRECTORY"):  # the disk is to know that the file is gone
                folder = os.open(os.path.dirname(real), os.O_RDONLY | os.O_DIRECTORY)
                try:
                    os.fsync(folder)
                finally:
                    os.close(folder)
    return same


def rolled_back(path: Path, intact: bool = False) -> bytes | None:
    """The database at `path` with the pages in its hot journal put back unless it is `intact`; no file changes.

    None if the journal is gone. Raises as `roll_back` does.
    """
    real = os.path.realpath(path)
    try:
        with _opened(real, os.O_RDONLY) as database, _opened(real + JOURNAL, os.O_RDONLY) as journal:
            size = os.fstat(database.fileno()).st_size
            if size > MOST:
                raise ResultsError(
                    f"{path}: the journal of a run that was killed is beside {size / 2**30:.0f} GiB; put it back"
                    " first, by pdsolve --resume"
                )
            image = BytesIO(database.read())
            if not intact:
                _put_back(_original(path, journal, size), journal, image)
            return image.getvalue()
    except FileNotFoundError:
        return None


def _opened(name: str, how: int) -> BinaryIO:
    """A file that is no link; opening a pipe does not wait."""
    handle = os.open(name, how | _flag("O_NOFOLLOW") | _flag("O_NONBLOCK") | _flag("O_BINARY"))
    return os.fdopen(handle, "r+b" if how & os.O_RDWR else "rb")


@contextmanager
def _locked(database: int) -> Iterator[bool]:
    """A context with SQLite's exclusive lock; the value is whether it was free. Closing the file releases it, too."""
    if sys.platform == "win32":
        import msvcrt

        os.lseek(database, LOCKS[0], os.SEEK_SET)
        try:
            msvcrt.locking(database, msvcrt.LK_NBLCK, LOCKS[1])
        except OSError:
            yield False
            return
        yield True
        os.lseek(database, LOCKS[0], os.SEEK_SET)
        msvcrt.locking(database, msvcrt.LK_UNLCK, LOCKS[1])
    else:
        import fcntl

        try:
            fcntl.lockf(database, fcntl.LOCK_EX | fcntl.LOCK_NB, LOCKS[1], LOCKS[0])
        except (BlockingIOError, PermissionError):
            yield False
            return
        yield True


def _original(path: Path, journal: BinaryIO, size: int) -> Original:
    """The pages that a journal puts back, as SQLite reads them: up to the first record that is not whole.

    `size` is that of the database. Raises ResultsError.
    """
    status = os.fstat(journal.fileno())
    name, length = f"{os.path.basename(os.path.realpath(path))}{JOURNAL}", status.st_size
    if not stat.S_ISREG(status.st_mode) or status.st_nlink != 1:
        raise ResultsError(f"{path}: {name} is no regular file of one name; {WHOLE}")
    head = _read(journal, HEADER.size, 0)
    unsynchronized = _is_unsynchronized(head)
    if not (head.startswith(MAGIC) or unsynchronized) or len(head) < HEADER.size:
        raise ResultsError(f"{path}: {name} is without the header of a journal; {WHOLE}")
    _, _, _, pages, sector, page = HEADER.unpack(head)
    if not _is_power(sector, 32) or not _is_power(page, 512):
        raise ResultsError(f"{path}: {name} has sectors of {sector} bytes and pages of {page}; {WHOLE}")
    if unsynchronized:
        return Original(page, None, [])
    records = list(_records(journal, length, sector, page))
    joined = any(number == LOCKS[0] // page + 1 for number, _ in records)  # the record before such a name
    if joined or _read(journal, len(MAGIC), max(length - len(MAGIC), 0)) == MAGIC:
        raise ResultsError(
            f"{path}: {name} names a super-journal, a file for SQLite to delete; {WHOLE} (do not open it with other"
            " programs)"
        )
    places = [(number, at) for number, at in records if number <= pages]
    if pages * page > size + len(places) * page:
        raise ResultsError(f"{path}: {name} is of a database of {pages} pages, which are in neither file; {WHOLE}")
    return Original(page, pages, places)


def _records(journal: BinaryIO, length: int, sector: int, page: int) -> Iterator[tuple[int, int]]:
    """Number and place of each page in a journal of so many bytes, up to the first record that is not whole."""
    at = 0
    while at + max(sector, HEADER.size) <= length:
        magic, records, nonce, *_ = HEADER.unpack(_read(journal, HEADER.size, at))
        if magic != MAGIC:
            return
        at += sector
        for _ in range((length - at) // (page + 8) if records == UNKNOWN else records):
            record = _read(journal, page + 8, at)
            number = int.from_bytes(record[:4])
            if number == LOCKS[0] // page + 1:
                yield number, at + 4
            checksum = (nonce + sum(record[page + 4 - STRIDE : 4 : -STRIDE])) & 0xFFFFFFFF
            if len(record) < page + 8 or not number or checksum != int.from_bytes(record[-4:]):
                return
            yield number, at + 4
            at += page + 8
        at = -(-at // sector) * sector


def _read(file: BinaryIO, size: int, at: int) -> bytes:
    file.seek(at)
    return file.read(size)


def _is_power(number: int, least: int) -> bool:
    """Whether a number is a power of two from `least` to 65536."""
    return least <= number <= 65536 and number & (number - 1) == 0


def _put_back(original: Original, journal: BinaryIO, database: BinaryIO) -> None:
    """Write the original pages into the database, a file or in memory."""
    size = original.size
    if original.pages is None:
        return
    database.truncate(original.pages * size)
    for number, at in original.places:
        database.seek((number - 1) * size)
        database.write(_read(journal, size, at))
    database.flush()
    if not isinstance(database, BytesIO):
        os.fsync(database.fileno())
