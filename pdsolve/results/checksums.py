"""Checksums: what is read is what was written, or it is refused.

A row with large values has a CRC-32 of all the rest of it. The rows of a table, of such ones all but the large values,
have a running one in the table `checksum`, which each transaction brings up to date. So a page that is gone, a bit
that has turned, a table cut short do not pass for results.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterable, Sequence
from itertools import islice
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdsolve.results.schema import TABLES

Row = tuple[Any, ...]
KEYS = {  # how many columns are before the CRC, in tables with large values, which are behind it
    "meta": 1,
    "family_chunk": 1,
    "field_chunk": 3,
    "checkpoint": 3,
}
RECORDS = {  # tables of many rows, which are arrays in memory
    "node": np.dtype("<i8, <i8, <f8, <f8, <f8, <f8, <f8, <i8, <i8, <i8"),
    "node_death": np.dtype("<i8, <i8"),
    "bond_break": np.dtype("<i8, <i8, <i8"),
}
AT_ONCE = 4096  # rows in memory
_packed = msgspec.msgpack.Encoder().encode


class Checksum(NamedTuple):
    """The checksum of some rows, one after the other."""

    rows: int = 0
    crc: int = 0

    def of(self, table: str, rows: Iterable[Row] | NDArray[np.void]) -> Checksum:
        """Goes on with `rows` of the table. Raises TypeError, ValueError or OverflowError for what cannot be in it."""
        if isinstance(rows, np.ndarray):
            return Checksum(self.rows + len(rows), zlib.crc32(rows.tobytes(), self.crc))
        count, crc, left, end = self.rows, self.crc, iter(rows), KEYS.get(table)
        while some := list(islice(left, AT_ONCE)):
            if table in RECORDS:
                packed = np.array(some, dtype=record(table, len(some[0]))).tobytes()
            else:
                packed = b"".join(_packed(row if end is None else row[: end + 1]) for row in some)
            count, crc = count + len(some), zlib.crc32(packed, crc)
        return Checksum(count, crc)


def record(table: str, columns: int) -> np.dtype[np.void]:
    """The type of a row of a table of many that has so many columns; older files have fewer."""
    names = RECORDS[table].names or ()
    return np.dtype([(name, RECORDS[table][name]) for name in names[:columns]])


def with_crc(table: str, row: Row) -> Row:
    """A row of a table with large values, its CRC put in; `row` is one without."""
    key, values = row[: KEYS[table]], row[KEYS[table] :]
    return (*key, _crc(key, values), *values)


def is_whole(table: str, row: Row) -> bool:
    """Whether the CRC of a row with large values is that of the rest."""
    at = KEYS[table]
    return bool(row[at] == _crc(row[:at], row[at + 1 :]))


def _crc(key: Row, values: Row) -> int:
    crc = zlib.crc32(_packed(key))
    for value in values:
        data = memoryview(value if isinstance(value, bytes | memoryview) else _packed(value))
        crc = zlib.crc32(data, zlib.crc32(_packed(data.nbytes), crc))
    return crc


def stored(value: Any) -> Any:
    """A value as SQLite gives it back: there is no -0.0, and what is no number is nothing."""
    if isinstance(value, float):
        return None if value != value else float(value) + 0.0
    return value


def records(table: str, columns: Sequence[NDArray[np.generic]]) -> NDArray[np.void]:
    """The rows (k,) of a table from its columns (k,)."""
    found = np.zeros(len(columns[0]), dtype=RECORDS[table])
    for name, column in zip(found.dtype.names or (), columns, strict=True):
        found[name] = column + 0  # no -0.0
    return found


def select(table: str, where: str = "", columns: str = "*") -> str:
    """SQL for rows of a table in the order that its checksum takes them; rows of two tables are written to again."""
    order = {"meta": "key", "checkpoint": "name"}.get(table, "rowid")
    return f"SELECT {columns} FROM {table} {where} ORDER BY {order}"


def select_schema() -> str:
    """SQL for what the checksum called schema is of: the SQL of our tables and our view."""
    ours = ", ".join(f"'{name}'" for name in (*TABLES, "node_state"))
    return f"SELECT type, name, sql FROM sqlite_master WHERE name IN ({ours}) ORDER BY name"
