"""The table of a study: one row a run, with its parameters and measures; a plain SQLite file.

    SELECT "Zones/fine/Spacing", branching FROM run WHERE status = 'finished'

The view ``run_in_words`` has the same rows, with columns that say what they are and in which unit.
The table ``run`` has a column for each parameter and each measure, ``column_unit`` describes them, ``study`` holds the
study itself, ``checksum`` detects damage; older tables have none.

Data is read as written, or refused: the table ``checksum`` has a CRC-32 for each row of ``run``, over its non-NULL
values and the names of their columns, so that a new column changes none. Number 0 holds the checksums of the other
tables, and the number of runs.
"""

from __future__ import annotations

import json
import re
import sqlite3
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from pdsolve.results.errors import MOST_SAID, WriteError
from pdsolve.results.opening import for_writing, read_only, recover
from pdsolve.study.description import Case, Study, StudyError
from pdsolve.study.measure_columns import OWN, UNITS, Measure

WHOLE = ("study", "column_unit")  # small tables
FILE = re.compile(r"[^/\\\0]+\.runs/\d{4,}\.sqlite")  # of a run: in a folder beside the table, nowhere else
APPLICATION_ID = 0x70647374  # "pdst"
VIEW = "run_in_words"
WAITING, FINISHED, FAILED = "waiting", "finished", "failed"
FINISHED_RUNS = "SELECT number FROM run WHERE status = ?"


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


class Row(NamedTuple):
    """One run in the table."""

    number: int
    key: str
    status: str
    error: str | None
    file: Path
    repetition: int
    values: dict[str, Any]  # of its parameters and measures, by their columns


class Column(NamedTuple):
    """A column of parameters or measures."""

    kind: str  # drawing, model, options, measure
    unit: str
    meaning: str


def head(name: str, column: Column) -> str:
    """The head of a column in words: its name, what it means and its unit."""
    meaning = f": {column.meaning}" if column.meaning else ""
    return f"{name}{meaning} ({column.unit})" if column.unit else f"{name}{meaning}"


class Table:
    """A study's table, read and written."""

    def __init__(self, connection: sqlite3.Connection, path: Path) -> None:
        self.connection, self.path = connection, path

    @classmethod
    def open(cls, path: Path) -> Table:
        """The table in the file at `path`, read only. Raises StudyError if it is not a study's table, or damaged."""
        if not is_study(path):
            raise StudyError(f"{path} is no table of a study; use one written by pdsolve study")
        with _explained(path):
            table = cls(read_only(path), path)
        table._expect_whole()
        return table

    @classmethod
    def create(cls, path: Path, study: Study, version: str) -> Table:
        """A new table at `path`, or the existing one; `add` adds rows.

        Raises StudyError for another file, a damaged table, or the table of another drawing.
        """
        with _explained(path):
            recover(path)
        new = not path.exists() or path.stat().st_size == 0  # a run that was killed has left nothing in it
        if not new and not is_study(path):
            raise StudyError(
                f"{path} is no table of a study and is not overwritten; name another with -o (if it was a table"
                f" that was damaged: remove it, and it is made anew from the runs in {run_folder(path).name})"
            )
        with _explained(path):
            table = cls(for_writing(path, isolation_level=None), path)
        if not new:
            table._expect_whole()
        with _explained(path), table._transaction():
            if new:
                for statement in (
                    "CREATE TABLE study (name TEXT PRIMARY KEY, value)",
                    "CREATE TABLE column_unit (name TEXT PRIMARY KEY, kind TEXT, unit TEXT, meaning TEXT)",
                    "CREATE TABLE run (number INTEGER PRIMARY KEY, key TEXT UNIQUE NOT NULL, status TEXT NOT NULL,"
                    " error TEXT, file TEXT, repetition INTEGER)",
                    f"PRAGMA application_id = {APPLICATION_ID}",
                ):
                    table.connection.execute(statement)
                begin(table.connection)
            elif not has(table.connection):
                begin(table.connection)
            mark = study.digest
            stored_mark = table.about().get("drawing_sha256", mark)
            if stored_mark != mark:
                raise StudyError(f"{table.path} has runs of another {study.drawing}; use --force to begin anew")
            about = {"program": version, "study": study.text, "drawing": str(study.drawing), "drawing_sha256": mark}
            about |= {"varied": json.dumps(study.varied), "random": json.dumps(study.random)}
            table.connection.executemany("INSERT OR REPLACE INTO study VALUES (?, ?)", list(about.items()))
            seal(table.connection)
        return table

    def _expect_whole(self) -> None:
        try:
            with _explained(self.path):
                expect_whole(self.connection)
        except StudyError:
            self.connection.close()
            raise

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        """A context whose writes are all committed, or none."""
        self.connection.execute("BEGIN IMMEDIATE")
        try:
            yield
            self.connection.execute("COMMIT")
        except BaseException:
            if self.connection.in_transaction:
                self.connection.execute("ROLLBACK")
            raise

    def close(self) -> None:
        """Close the table."""
        self.connection.close()

    def __enter__(self) -> Table:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def about(self) -> dict[str, str]:
        """Metadata of the study: its text, its drawing, the names of varied parameters."""
        with _explained(self.path):
            return dict(self.connection.execute("SELECT name, value FROM study"))

    def add(
        self,
        cases: Sequence[Case],
        described: Mapping[str, tuple[str, str]],
        measures: Mapping[str, Measure],
        runs: Mapping[str, int] = {},
    ) -> dict[str, int]:
        """Add rows for new cases; returns the row number of each case by its key.

        Finished runs wait where a measure is new or measures something else now; their databases are measured then.
        `described` holds unit and meaning of the drawing's parameters, `measures` the measures of each run; `runs` are
        the numbers, by key, of runs whose databases exist already.
        """
        again: set[int] = set()  # finished runs that lack a measure
        with _explained(self.path), self._transaction():
            for case in cases:
                for kind, name, column in case.names:
                    self._column(column, Column(kind, *described.get(name, (UNITS.get(name, ""), ""))))
            for name, measure in measures.items():
                if self._column(name, Column("measure", measure.unit, measure.meaning)):
                    again.update(number for (number,) in self.connection.execute(FINISHED_RUNS, (FINISHED,)))
            self.connection.executemany(
                "UPDATE run SET status = ? WHERE number = ?", [(WAITING, number) for number in again]
            )
            numbers = dict(self.connection.execute("SELECT key, number FROM run"))
            last, new = max([*numbers.values(), *runs.values()], default=0), []
            for case in cases:
                if case.key not in numbers:
                    number = runs.get(case.key, last + 1)
                    last = max(last, number)
                    numbers[case.key] = number
                    first = {"number": number, "key": case.key, "status": WAITING, "repetition": case.repetition}
                    row = first | {"file": f"{run_folder(self.path).name}/{number:04}.sqlite"} | case.values
                    names, marks = ", ".join(map(quoted, row)), ", ".join("?" * len(row))
                    stored = [_stored(value) for value in row.values()]
                    self.connection.execute(f"INSERT INTO run ({names}) VALUES ({marks})", stored)
                    new.append(number)
            self._write_view()
            seal(self.connection, [*new, *again])
        return {case.key: numbers[case.key] for case in cases}

    def _write_view(self) -> None:
        """Write the view whose columns have heads in words."""
        heads = [f"{quoted(name)} AS {quoted(head(name, column))}" for name, column in self.columns().items()]
        self.connection.execute(f"DROP VIEW IF EXISTS {VIEW}")
        self.connection.execute(
            f"CREATE VIEW {VIEW} AS SELECT {', '.join(['number', 'status', 'error', 'repetition', *heads])} FROM run"
        )

    def _column(self, name: str, column: Column) -> bool:
        """Add a column that is not there; returns whether it is new, or a measure of another quantity than before."""
        existing = {known.lower(): known for known in self.columns()}.get(name.lower())
        if existing is None:
            self.connection.execute(f"ALTER TABLE run ADD COLUMN {quoted(name)}")
            self.connection.execute("INSERT INTO column_unit VALUES (?, ?, ?, ?)", (name, *column))
            return True
        if column.kind != "measure" or self.columns()[existing] == column:
            return False
        self.connection.execute(
            "UPDATE column_unit SET unit = ?, meaning = ? WHERE name = ?", (column.unit, column.meaning, existing)
        )
        return True

    def finish(self, number: int, measures: Mapping[str, Any] | None, error: str | None = None) -> None:
        """Store how a run ended: its measures, or its error."""
        values: dict[str, Any] = {"status": FINISHED if error is None else FAILED, "error": error, **(measures or {})}
        places = ", ".join(f"{quoted(name)} = ?" for name in values)
        with _explained(self.path), self._transaction():
            self.connection.execute(
                f"UPDATE run SET {places} WHERE number = ?", [*map(_stored, values.values()), number]
            )
            seal(self.connection, [number])

    def columns(self) -> dict[str, Column]:
        """Parameters, then measures, in the order of their creation."""
        with _explained(self.path):
            rows = self.connection.execute("SELECT name, kind, unit, meaning FROM column_unit ORDER BY rowid")
            return {name: Column(*rest) for name, *rest in rows}

    def rows(self, numbers: Iterable[int] | None = None) -> list[Row]:
        """All runs, or those with these numbers."""
        cursor = self.connection.execute("SELECT * FROM run ORDER BY number")
        names, wanted = [entry[0] for entry in cursor.description], None if numbers is None else set(numbers)
        rows = []
        for values in cursor:
            row = dict(zip(names, values, strict=True))
            number, key, status, error, file, repetition = (row.pop(name) for name in OWN)
            if wanted is None or number in wanted:
                rows.append(Row(number, key, status, error, self.path.parent / file, repetition, row))
        return rows


def run_folder(path: Path) -> Path:
    """The folder with the databases of the study whose table is at `path`."""
    return path.with_suffix(".runs")


@contextmanager
def _explained(path: Path) -> Iterator[None]:
    """A context that turns SQLite's errors, and damage, into one line that names the file and the remedy."""
    try:
        yield
    except (sqlite3.Error, UnicodeDecodeError, DamagedTableError) as error:
        code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT) & 0xFF
        said = " ".join(str(error).split())[:MOST_SAID]
        if code not in (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB, sqlite3.SQLITE_ERROR):
            written = code in (sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR, sqlite3.SQLITE_READONLY)
            raise (WriteError if written else StudyError)(f"{path}: {said}") from None
        raise StudyError(
            f"{path}: {said}; remove it, and pdsolve study makes it anew from the runs in {run_folder(path).name}"
            " (without that folder, it solves them all anew)"
        ) from None


def is_study(path: Path) -> bool:
    """Whether the file at `path` is a study's table."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        head = file.read(72)
    return head.startswith(b"SQLite format 3\0") and head[68:72] == APPLICATION_ID.to_bytes(4, "big")


def quoted(name: str) -> str:
    """A name quoted for SQL."""
    return '"' + name.replace('"', '""') + '"'


def _stored(value: Any) -> Any:
    if isinstance(value, bool) or value is None or isinstance(value, int | float | str):
        return value
    return json.dumps(value)
