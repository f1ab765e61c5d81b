"""Reads the tables of a database and compares them with their checksums."""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from pdsolve.results.checksums import KEYS, RECORDS, Checksum, Row, is_whole, record, select, select_schema
from pdsolve.results.errors import DamagedError, EmptyError, ResultsError, explained
from pdsolve.results.schema import (
    APPLICATION_ID,
    SCHEMA_VERSION,
    TABLES,
    WITHOUT_CHECKSUMS,
    WITHOUT_EPOCHS,
    WITHOUT_SPACE,
)
from pdsolve.results.validation import checked_rows, table_columns, wrong_schema

OPERATIONS = 100_000  # of SQLite's machine between two looks whether a query goes on for too long
LONGEST = 2**31 - 1  # bytes of a value that SQLite may be asked for
LEAST, PER_BYTE = 10**7, 64  # operations that a query may take, and how many more for each byte of the file


class Meta(dict[str, Any]):
    """Metadata of a run. Raises ResultsError for a missing key."""

    def __init__(self, rows: Mapping[str, Any], name: str) -> None:
        super().__init__(rows)
        self.name = name

    def __missing__(self, key: str) -> Any:
        raise ResultsError(f"{self.name}: table meta: {key} is missing, which pdsolve writes of a run")


class Tables:
    """The tables of a database called `name`. All methods raise ResultsError, for damage DamagedError."""

    def __init__(self, connection: sqlite3.Connection, name: str, path: Path | None = None) -> None:
        """`path` is a file that may come from anyone; None: a database written by this process."""
        self.connection = connection
        self.name = name
        self.path = path
        self.version: int
        self._look_at_version()

    def _look_at_version(self) -> None:
        ((self.version,),) = self.rows("PRAGMA user_version")
        self.checked = self.version != WITHOUT_CHECKSUMS
        self.space = self.version > WITHOUT_SPACE  # whether there may be bodies in it
        self.epochs = self.version > WITHOUT_EPOCHS  # whether nodes have a birth and a death
        self.particles = self.version > WITHOUT_SPACE  # whether cracks may be particles

    def expect_ours(self) -> None:
        """Check that this is a database of results with its original tables; it may still be under construction."""
        with self.snapshot():
            ((application,),) = self.rows("PRAGMA application_id")
            names = {name for (name,) in self.rows("SELECT name FROM sqlite_master")}
            self._look_at_version()
            if not names:
                raise EmptyError(
                    f"{self.name} has nothing in it: its run has just begun, or was stopped before its first frame"
                    " (solve it anew), or it was renamed without its log (NAME-wal)"
                )
            if application != APPLICATION_ID:
                raise ResultsError(f"{self.name} is a database of another program; use one written by pdsolve")
            if not WITHOUT_CHECKSUMS <= self.version <= SCHEMA_VERSION:
                raise ResultsError(
                    f"{self.name} has schema version {self.version}; this version reads {SCHEMA_VERSION}"
                )
            newer = {"checksum": self.checked, "epoch": self.epochs, "crack_particle": self.particles}
            if any(expected != (name in names) for name, expected in newer.items()):
                self.damaged("schema")
            self.compare("schema", self.rows(select_schema()))
            with self._bounded():
                wrong = wrong_schema(self.connection, self.version == SCHEMA_VERSION)
            if wrong is not None:
                raise DamagedError(f"{self.name}: {wrong}")

    @property
    def size(self) -> int | None:
        """Size of the file and of SQLite's files beside it, bytes; None in memory."""
        if self.path is None:
            return None
        return sum(os.path.getsize(file) for file in (self.path, f"{self.path}-wal") if os.path.exists(file))

    @contextmanager
    def _bounded(self) -> Iterator[None]:
        """A context that ends queries with more operations, or larger values, than the file's size can justify.

        The pages of a damaged file may form a loop.
        """
        with explained(Path(self.name)):
            size = self.size
            if size is None:
                yield
                return
            left = (LEAST + PER_BYTE * size) // OPERATIONS

            def too_long() -> bool:
                nonlocal left
                left -= 1
                return left < 0

            self.connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, min(max(size, 10**6), LONGEST))
            self.connection.set_progress_handler(too_long, OPERATIONS)
            try:
                yield
            finally:
                self.connection.set_progress_handler(None, 0)

    def verify(self) -> None:
        """Read everything and compare it with the checksums."""
        with self.snapshot():
            ((message,), *_) = self.rows("PRAGMA integrity_check(1)")
            if message != "ok":
                raise DamagedError(f"{self.name}: {' '.join(message.split())}; use a whole database")
            names = {name for (name,) in self.rows("SELECT name FROM sqlite_master")}
            for table in TABLES:
                if table != "checksum" and table in names:
                    self.compare(table, self.each(table))

    @contextmanager
    def snapshot(self) -> Iterator[None]:
        """A context in which a run's later writes are invisible."""
        if self.connection.in_transaction:
            yield
            return
        with explained(Path(self.name)):
            self.connection.execute("BEGIN")
        try:
            yield
        finally:
            if self.connection.in_transaction:  # an error may have ended it
                self.connection.execute("ROLLBACK")

    def rows(self, query: str, values: Row = ()) -> list[Row]:
        """Result of a query, without comparing checksums."""
        with self._bounded(), closing(self.connection.execute(query, values)) as cursor:
            return cursor.fetchall()

    def each(self, table: str, where: str = "", values: Row = ()) -> Iterator[Row]:
        """Rows of a table in order, with values of their columns' types; large values are compared with their CRC.

        Large values are in the last columns.
        """
        columns = None if table in RECORDS else table_columns(self.connection, table)
        with self._bounded(), closing(self.connection.execute(select(table, where), values)) as rows:
            for row in rows if columns is None else checked_rows(rows, columns):
                if isinstance(row, str):
                    self.impossible(table, row)
                if self.checked and table in KEYS and not is_whole(table, row):
                    self.damaged(table)
                yield row

    def all(self, table: str) -> list[Row]:
        """All rows of a table in their order."""
        with self.snapshot():
            rows = list(self.each(table))
            self.compare(table, rows)
        return rows

    def records(self, table: str) -> NDArray[np.void]:
        """All rows of a table of many rows, with columns named f0, f1 and so on."""
        with self.snapshot():
            ((count,),) = self.rows(f"SELECT count(*) FROM {table}")
            kind = record(table, len(self.rows(f"PRAGMA table_info({table})")))
            try:
                rows = np.fromiter(self.each(table), kind, count)
            except ResultsError:
                raise
            except (TypeError, ValueError, OverflowError):
                self.damaged(table)
            self.compare(table, rows)
        return rows

    def count(self, table: str) -> int | None:
        """Number of rows written to a table; None if unknown."""
        rows = self.rows("SELECT rows FROM checksum WHERE name = ?", (table,)) if self.checked else []
        count, size = rows[0][0] if rows else None, self.size
        if rows and (not isinstance(count, int) or count < 0 or (size is not None and count > size)):
            self.damaged("checksum")
        return count

    def compare(self, table: str, rows: Iterable[Row] | NDArray[np.void]) -> None:
        """Raise DamagedError unless these are all rows of the table, as written."""
        if not self.checked:
            return
        expected = self.rows("SELECT rows, crc FROM checksum WHERE name = ?", (table,))
        try:
            checksum = Checksum().of(table, rows)
        except ResultsError:
            raise
        except (TypeError, ValueError, OverflowError):
            self.damaged(table)
        if expected != [checksum]:
            self.damaged(table)

    def expect(self, table: str, wrong: str | None) -> None:
        """Raise DamagedError if `wrong` is not None."""
        if wrong is not None:
            self.impossible(table, wrong)

    def impossible(self, table: str, wrong: str) -> NoReturn:
        """Raise DamagedError for content that no run writes, although checksums may match."""
        raise DamagedError(f"{self.name}: table {table}: {wrong}")

    def damaged(self, table: str) -> NoReturn:
        """Raise DamagedError for a table whose checksum does not match."""
        raise DamagedError(f"{self.name}: its {table} is damaged and does not match its checksum; use a whole copy")
