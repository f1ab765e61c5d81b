"""Opens databases: a journal left by a killed program is rolled back before, in memory where they are only read."""

from __future__ import annotations

import os
import sqlite3
import struct
import time
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

from pdsolve.results.errors import ResultsError
from pdsolve.results.side_files import (
    INDEX,
    JOURNAL,
    LOG,
    LOGS,
    VERSION,
    expect_sound,
    is_logged,
    only_truncates,
    roll_back,
    rolled_back,
)

LITTLE, MASK = 0x82, 0xFFFFFFFF  # the byte of a log whose checksums are of little-endian words; of a word
HEADER, FRAME = 32, 24  # bytes: at the head of a log, and of each page in it
PATIENCE, PAUSE = 5.0, 0.05  # s of waiting for another program that rolls back, as SQLite waits; s between two looks


def connect(path: Path | None, how: str = "", **options: Any) -> sqlite3.Connection:
    """A connection to the file at `path`, in memory if None; `how` are the words of SQLite's URI, such as mode=ro.

    SQLite joins no other database, trusts no schema, and looks at each page before it uses it. Raises sqlite3.Error.
    """
    place = ":memory:" if path is None else f"{Path(os.path.realpath(path)).as_uri()}?{how}"
    connection: sqlite3.Connection = sqlite3.connect(place, uri=path is not None, **options)
    connection.setlimit(sqlite3.SQLITE_LIMIT_ATTACHED, 0)
    connection.execute("PRAGMA trusted_schema = OFF")
    connection.execute("PRAGMA cell_size_check = ON")
    configure = getattr(connection, "setconfig", None)  # Python 3.12
    if configure is not None:
        configure(getattr(sqlite3, "SQLITE_DBCONFIG_DEFENSIVE"), True)  # noqa: B009
    return connection


def read_only(path: Path) -> sqlite3.Connection:
    """A read-only connection to the file at `path`, or to a copy in memory if a killed program has left a journal.

    Raises sqlite3.Error. Raises ResultsError for files beside it that SQLite has not left there, if the log cannot be
    read because the folder is write-protected, or if it belongs to another name of the file.
    """
    expect_sound(path)
    _expect_own_name(path)
    if _is_empty(path):  # SQLite would remove what is beside it
        return _opened(path, "mode=ro&immutable=1")
    until = time.monotonic() + PATIENCE
    while True:
        try:
            return _opened(path, "mode=ro")
        except sqlite3.OperationalError as error:
            if error.sqlite_errorcode & 0xFF not in (sqlite3.SQLITE_READONLY, sqlite3.SQLITE_CANTOPEN):
                raise
            hot = error.sqlite_errorcode == sqlite3.SQLITE_READONLY_ROLLBACK
        data = rolled_back(path, _is_intact_without_journal(path)) if hot else None
        if data is not None:
            connection = connect(None)
            if data:  # without the mark of a log, which a database in memory cannot have
                connection.deserialize(data[:18] + b"\1\1" + data[20:])
            return connection
        if not hot or time.monotonic() > until:
            break
    for side_file in _beside(os.path.realpath(path)):
        raise ResultsError(
            f"{path}: {os.path.basename(side_file)} of a run that was killed cannot be put back here; copy both files"
            " to a folder that can be written to"
        )
    return _opened(path, "mode=ro&immutable=1")


def for_writing(path: Path | None, **options: Any) -> sqlite3.Connection:
    """A connection that writes to the file at `path`, new or not, in memory if None; otherwise as `read_only`."""
    if path is not None:
        recover(path)
    return connect(path, "mode=rwc", **options)


def recover(path: Path) -> None:
    """Check the files beside a database that is going to be written, and roll back its journal.

    Raises as `read_only` does, and ResultsError if it cannot be rolled back.
    """
    expect_sound(path)
    if _is_empty(path) or not os.path.exists(path):
        return
    until = time.monotonic() + PATIENCE
    while os.path.exists(os.path.realpath(path) + JOURNAL) and _is_hot(path):
        try:
            roll_back(path, _is_intact_without_journal(path))
        except OSError as error:
            raise ResultsError(f"{path}: {_name(path, JOURNAL)} cannot be put back: {error}") from None
        if time.monotonic() > until:
            raise ResultsError(f"{path}: {_name(path, JOURNAL)} is in use; close the other program")
        time.sleep(PAUSE)


def _is_intact_without_journal(path: Path) -> bool:
    """Whether a journal would take pages away from a database that is undamaged without it.

    All of a new database was written then but the end of its journal; or the journal is forged, and empties it.
    """
    if not only_truncates(path):
        return False
    try:
        with closing(_opened(path, "mode=ro&immutable=1")) as connection:
            (count,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
            return bool(count) and connection.execute("PRAGMA integrity_check(1)").fetchone() == ("ok",)
    except sqlite3.Error:
        return False


def _is_hot(path: Path) -> bool:
    """Whether a killed program has left pages to put back."""
    try:
        _opened(path, "mode=ro").close()
    except sqlite3.OperationalError as error:
        return error.sqlite_errorcode == sqlite3.SQLITE_READONLY_ROLLBACK
    return False


def _is_empty(path: Path) -> bool:
    return path.is_file() and not path.stat().st_size


def _name(path: Path, end: str) -> str:
    """The name of a file beside the database at `path`."""
    return os.path.basename(os.path.realpath(path)) + end


def _beside(name: str) -> list[str]:
    """Names of the database's journal and log files that are not empty."""
    names = [f"{name}{end}" for end in (JOURNAL, LOG)]
    return [side_file for side_file in names if os.path.exists(side_file) and os.path.getsize(side_file)]


def _expect_own_name(path: Path) -> None:
    """Raise ResultsError if a file has several names (hard links) and SQLite's files belong to another one.

    Under this name SQLite would open it without them: outdated or half written.
    """
    try:
        status = path.stat()
        if status.st_nlink < 2 or _beside(real := os.path.realpath(path)):
            return
        logged = is_logged(real)
        others = [entry.path for entry in os.scandir(os.path.dirname(real)) if entry.inode() == status.st_ino]
    except OSError:
        return
    side_file = next((side_file for linked_name in others for side_file in _beside(linked_name)), None)
    if side_file or logged:
        at = f"beside another name of it, {os.path.basename(side_file)}" if side_file else "beside another name of it"
        raise ResultsError(
            f"{path} is a hard link to a database that is not complete without the file {at}; read or resume it by"
            " the name that its run was given"
        )


def _opened(path: Path, how: str) -> sqlite3.Connection:
    """A connection that has successfully read something."""
    connection = connect(path, how)
    try:
        connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    except BaseException:
        connection.close()
        raise
    return connection


class Log(NamedTuple):
    """SQLite's log beside a database without a writer: transactions not yet in the database itself."""

    read: int = 0  # transactions that can be read
    lost: int = 0  # transactions behind a damaged place, which SQLite leaves out without a word


def log_of(connection: sqlite3.Connection, path: Path) -> Log:
    """How far the log of the database at `path` can be read over an open connection.

    A transaction interrupted by the end of the program has no end mark and does not count. Raises sqlite3.Error.
    """
    connection.execute("SELECT count(*) FROM sqlite_master").fetchone()  # SQLite has looked for the end of the log now
    real = os.path.realpath(path)
    try:
        with open(real + LOG, "rb") as log, open(real + INDEX, "rb") as index:
            version, _, _, _, pages = struct.unpack("=5I", index.read(20))
            header = log.read(HEADER)
            if version != VERSION or len(header) < HEADER or header[:4] not in LOGS:
                return Log()
            _, _, size, _, *salt = struct.unpack_from(">6I", header)
            first_sum = second_sum = 0  # of the header: whether its checksum is correct
            words = "<" if header[3] == LITTLE else ">"
            for first, second in struct.iter_unpack(f"{words}2I", header[:24]):
                first_sum = (first_sum + first + second_sum) & MASK
                second_sum = (second_sum + second + first_sum) & MASK
            salt_known = (first_sum, second_sum) == struct.unpack_from(">2I", header, 24)
            ends = []  # of each page of this round of the log, whether it is the last of a transaction
            while len(head := log.read(FRAME)) == FRAME:
                page, end, *frame_salt = struct.unpack_from(">4I", head)
                if not page:  # never written: a log may be a file of nothing, and long
                    break
                if not salt_known:
                    salt, salt_known = frame_salt, True
                ends.append(end > 0 and frame_salt == salt)
                log.seek(size, os.SEEK_CUR)
    except (OSError, struct.error):
        return Log()
    return Log(sum(ends[:pages]), sum(ends[pages:]))
