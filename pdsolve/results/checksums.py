"""Checksums: data is read as written, or refused.

A row with large values has a CRC-32 of the rest of the row. The rows of a table (without the large values) have a
running checksum in the table `checksum`, updated by each transaction. A missing page, a flipped bit or a truncated
table is therefore not taken for results.
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
POLYNOMIAL = 0xEDB88320  # of CRC-32, lowest bit first
_packed = msgspec.msgpack.Encoder().encode


class Checksum(NamedTuple):
    """Checksum of consecutive rows."""

    rows: int = 0
    crc: int = 0

    def of(self, table: str, rows: Iterable[Row] | NDArray[np.void]) -> Checksum:
        """The checksum continued with `rows` of the table.

        Raises TypeError, ValueError or OverflowError for invalid values.
        """
        if isinstance(rows, np.ndarray):
            return Checksum(self.rows + len(rows), zlib.crc32(rows.tobytes(), self.crc))
        count, crc, remaining, end = self.rows, self.crc, iter(rows), KEYS.get(table)
        while batch := list(islice(remaining, AT_ONCE)):
            if table in RECORDS:
                packed = np.array(batch, dtype=record(table, len(batch[0]))).tobytes()
            else:
                packed = b"".join(_packed(row if end is None else row[: end + 1]) for row in batch)
            count, crc = count + len(batch), zlib.crc32(packed, crc)
        return Checksum(count, crc)


def record(table: str, columns: int) -> np.dtype[np.void]:
    """Record type of a table of many rows with so many columns; older files have fewer."""
    names = RECORDS[table].names or ()
    return np.dtype([(name, RECORDS[table][name]) for name in names[:columns]])


def with_crc(table: str, row: Row) -> Row:
    """A row with large values, with its CRC inserted; `row` has none."""
    key, values = row[: KEYS[table]], row[KEYS[table] :]
    return (*key, _crc(key, values), *values)


def is_whole(table: str, row: Row) -> bool:
    """Whether the CRC of a row with large values matches the rest."""
    at = KEYS[table]
    return bool(row[at] == _crc(row[:at], row[at + 1 :]))


def _crc(key: Row, values: Row) -> int:
    crc = zlib.crc32(_packed(key))
    for value in values:
        data = memoryview(value if isinstance(value, bytes | memoryview) else _packed(value))
        crc = zlib.crc32(data, zlib.crc32(_packed(data.nbytes), crc))
    return crc


def crc_of(key: Row, size: int, crc: int) -> int:
    """The CRC of a row of one large value of `size` bytes, from the CRC of that."""
    return crc_joined(zlib.crc32(_packed(size), zlib.crc32(_packed(key))), crc, size)


def crc_joined(first: int, second: int, size: int) -> int:
    """The CRC-32 of some bytes and `size` others, from those of both.

    A CRC is linear over bits: that of the first bytes is put forward by as many zeros, by squaring the step of one bit.
    """
    step = [POLYNOMIAL, *(1 << bit for bit in range(31))]  # of one zero bit, as the images of all bits
    for _ in range(3):
        step = _twice(step)  # of a byte
    while size:
        if size & 1:
            first = _image(step, first)
        step, size = _twice(step), size >> 1
    return first ^ second


def _twice(step: list[int]) -> list[int]:
    return [_image(step, image) for image in step]


def _image(step: list[int], value: int) -> int:
    """What becomes of a CRC under a linear map, given as the images of all bits."""
    xor_sum = 0
    for image in step:
        if not value:
            return xor_sum
        if value & 1:
            xor_sum ^= image
        value >>= 1
    return xor_sum


def stored(value: Any) -> Any:
    """A value as SQLite returns it: -0.0 becomes 0.0, and NaN becomes None."""
    if isinstance(value, float):
        return None if value != value else float(value) + 0.0
    return value


def records(table: str, columns: Sequence[NDArray[np.generic]]) -> NDArray[np.void]:
    """The rows (k,) of a table from its columns (k,)."""
    rows = np.zeros(len(columns[0]), dtype=RECORDS[table])
    for name, column in zip(rows.dtype.names or (), columns, strict=True):
        rows[name] = column + 0  # no -0.0
    return rows


def select(table: str, where: str = "", columns: str = "*") -> str:
    """SQL for rows of a table in the order of its checksum; rows of two tables are rewritten in place."""
    order = {"meta": "key", "checkpoint": "name"}.get(table, "rowid")
    return f"SELECT {columns} FROM {table} {where} ORDER BY {order}"


def checked(table: str) -> str:
    """The columns of a table that its checksum is made of: all but large values."""
    names = [column.split()[0] for column in TABLES[table].split(" --")[0].split(",")]
    return ", ".join(names[: KEYS[table] + 1]) if table in KEYS else "*"


def select_schema() -> str:
    """SQL for the content of the checksum called schema: the SQL of our tables and our view."""
    ours = ", ".join(f"'{name}'" for name in (*TABLES, "node_state"))
    return f"SELECT type, name, sql FROM sqlite_master WHERE name IN ({ours}) ORDER BY name"
