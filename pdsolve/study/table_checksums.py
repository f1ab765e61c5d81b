"""Checksums of a study's table: data is read as written, or refused.

The table ``checksum`` has a CRC-32 for each row of ``run``, over its non-NULL values and the names of their columns, so
that a new column changes none. Number 0 holds the checksums of the other tables, and the number of runs.
"""

from __future__ import annotations

import re
import sqlite3
import zlib
from collections.abc import Iterable, Iterator
from typing import Any

import msgspec

from pdsolve.study.measure_columns import OWN

WHOLE = ("study", "column_unit")  # small tables
FILE = re.compile(r"[^/\\\0]+\.runs/\d{4,}\.sqlite")  # of a run: in a folder beside the table, nowhere else


class DamagedTableError(ValueError):
    """A study's table that does not hold what was written to it; the message is what was found."""


def begin(connection: sqlite3.Connection) -> None:
    """Create the checksums of a table without any, within a transaction."""
    connection.execute(
        "CREATE TABLE checksum (name TEXT, number INTEGER, count INTEGER, crc INTEGER, PRIMARY KEY (name, number))"
    )
    seal(connection, [number for (number,) in connection.execute("SELECT number FROM run")])


def has(connection: sqlite3.Connection) -> bool:
    """Whether the table has checksums; older tables have none."""
    return connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'checksum'").fetchone() is not None


def seal(connection: sqlite3.Connection, numbers: Iterable[int] = ()) -> None:
    """Update the checksums of the runs with these numbers and of the small tables, within the changing transaction."""
    ((runs,),) = connection.execute("SELECT count(*) FROM run")
    sums = [(name, 0, *_of_all(connection, name)) for name in WHOLE] + [("run", 0, runs, 0)]
    for number in numbers:
        ((_, crc),) = _of_runs(connection, "WHERE number = ?", number)
        sums.append(("run", number, 1, crc))
    connection.executemany("INSERT OR REPLACE INTO checksum VALUES (?, ?, ?, ?)", sums)


def expect_whole(connection: sqlite3.Connection) -> None:
    """Read and check the whole table. Raises DamagedTableError, sqlite3.Error, UnicodeDecodeError."""
    connection.execute("BEGIN")  # of one moment: another process may write
    try:
        (said,) = connection.execute("PRAGMA integrity_check(1)").fetchone()
        if said != "ok":
            raise DamagedTableError(f"{' '.join(said.split())}")
        kinds = dict(connection.execute("SELECT name, type FROM sqlite_master"))
        for name in (*WHOLE, "run"):
            if kinds.get(name) != "table":
                raise DamagedTableError(f"there is no table {name}")
        columns = [name for _, name, *_ in connection.execute("PRAGMA table_info(run)")]
        units = [name for (name,) in connection.execute("SELECT name FROM column_unit")]
        if missing := [name for name in (*OWN, *units) if name not in columns]:
            raise DamagedTableError(f"there is no column {missing[0]} of run")
        for number, file in connection.execute("SELECT number, file FROM run"):
            if not isinstance(file, str) or not FILE.fullmatch(file):
                raise DamagedTableError(f"the file of run {number} is {str(file)[:60]!r}")
        if has(connection):
            _expect_sums(connection)
    finally:
        connection.execute("ROLLBACK")


def _expect_sums(connection: sqlite3.Connection) -> None:
    sums = {(name, number): rest for name, number, *rest in connection.execute("SELECT * FROM checksum")}
    for name in WHOLE:
        if sums.pop((name, 0), None) != [*_of_all(connection, name)]:
            raise DamagedTableError(f"its {name} is damaged")
    ((runs,),) = connection.execute("SELECT count(*) FROM run")
    if sums.pop(("run", 0), None) != [runs, 0] or len(sums) != runs:
        raise DamagedTableError(f"{runs} runs are there, which are not as many as were written")
    for number, crc in _of_runs(connection):
        if sums.get(("run", number)) != [1, crc]:
            raise DamagedTableError(f"run {number} is damaged")


def _of_all(connection: sqlite3.Connection, name: str) -> tuple[int, int]:
    """Number of rows of a table, and the CRC of all."""
    rows = connection.execute(f"SELECT * FROM {name} NOT INDEXED ORDER BY name").fetchall()
    return len(rows), _crc(rows)


def _of_runs(connection: sqlite3.Connection, where: str = "", *values: Any) -> Iterator[tuple[int, int]]:
    """Number and CRC of rows of ``run``."""
    cursor = connection.execute(f"SELECT * FROM run {where}", values)
    names = [entry[0] for entry in cursor.description]
    for row in cursor:
        row_values = {name: value for name, value in zip(names, row, strict=True) if value is not None}
        yield row_values["number"], _crc(sorted(row_values.items()))


def _crc(value: Any) -> int:
    return zlib.crc32(msgspec.msgpack.encode(value))
