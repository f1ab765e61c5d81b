"""Databases changed by hand, so that their checksums agree."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from pdsolve.results.checksums import KEYS, Checksum, select, with_crc
from pdsolve.results.schema import TABLES


@contextmanager
def tampered(path: Path) -> Iterator[sqlite3.Connection]:
    """A connection to change the tables of a database with."""
    with closing(sqlite3.connect(path)) as connection:
        yield connection
        for table, at in KEYS.items():
            for rowid, *row in connection.execute(f"SELECT rowid, * FROM {table}").fetchall():
                crc = with_crc(table, [*row[:at], *row[at + 1 :]])[at]
                connection.execute(f"UPDATE {table} SET crc = ? WHERE rowid = ?", (crc, rowid))
        for table in TABLES:
            found = Checksum().of(table, connection.execute(select(table)))
            connection.execute("UPDATE checksum SET rows = ?, crc = ? WHERE name = ?", (*found, table))
        connection.commit()
