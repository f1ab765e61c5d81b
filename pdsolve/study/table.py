"""The table of a study: one row a run, with its parameters and what was measured; a plain SQLite file.

    SELECT "Zones/fine/Spacing", branching FROM run WHERE status = 'finished'

The table ``run`` has a column for each parameter and each measure, ``column_unit`` says what they are, ``study`` holds
the study itself.
"""

from __future__ import annotations

import hashlib
import json
import sqlite3
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from pdsolve.study.columns import OWN, UNITS, Measure
from pdsolve.study.description import Case, Study, StudyError

APPLICATION_ID = 0x70647374  # "pdst"
WAITING, FINISHED, FAILED = "waiting", "finished", "failed"


class Row(NamedTuple):
    """A run of the table."""

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


class Table:
    """A study's table, read and written."""

    def __init__(self, connection: sqlite3.Connection, path: Path) -> None:
        self.connection, self.path = connection, path

    @classmethod
    def open(cls, path: Path) -> Table:
        """The table in the file at `path`, read only. Raises StudyError if it is none."""
        if not is_study(path):
            raise StudyError(f"{path}: found no table of a study, expected one written by pdsolve study")
        return cls(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True), path)

    @classmethod
    def create(cls, path: Path, study: Study, version: str) -> Table:
        """A new table at `path`, or the one that is there, with a row for each run of the study.

        Raises StudyError if something else is there, or the table of another drawing.
        """
        new = not path.exists() or path.stat().st_size == 0  # a run that was killed has left nothing in it
        if not new and not is_study(path):
            raise StudyError(f"{path}: found a file that is no table of a study, expected one or none (-o: another)")
        table = cls(sqlite3.connect(path), path)
        with table.connection:
            if new:
                table._make()
            table._tell(study, version)
        return table

    def close(self) -> None:
        """Let go of the file."""
        self.connection.close()

    def __enter__(self) -> Table:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _make(self) -> None:
        for statement in (
            "CREATE TABLE study (name TEXT PRIMARY KEY, value)",
            "CREATE TABLE column_unit (name TEXT PRIMARY KEY, kind TEXT, unit TEXT, meaning TEXT)",
            "CREATE TABLE run (number INTEGER PRIMARY KEY, key TEXT UNIQUE NOT NULL, status TEXT NOT NULL, error TEXT,"
            " file TEXT, repetition INTEGER)",
            f"PRAGMA application_id = {APPLICATION_ID}",
        ):
            self.connection.execute(statement)

    def _tell(self, study: Study, version: str) -> None:
        """Write down what the study is, and that all is of one drawing. Raises StudyError."""
        mark = hashlib.sha256(study.drawing.read_bytes()).hexdigest()
        known = self.about().get("drawing_sha256", mark)
        if known != mark:
            raise StudyError(f"{self.path}: found runs of another {study.drawing}, expected the same (--force: anew)")
        about = {"program": version, "study": study.text, "drawing": str(study.drawing), "drawing_sha256": mark}
        about["varied"] = json.dumps(study.varied)
        self.connection.executemany("INSERT OR REPLACE INTO study VALUES (?, ?)", list(about.items()))

    def about(self) -> dict[str, str]:
        """What the study says of itself: its text, its drawing, the names of what it varies."""
        return dict(self.connection.execute("SELECT name, value FROM study"))

    def add(
        self, cases: Sequence[Case], described: Mapping[str, tuple[str, str]], measures: Mapping[str, Measure]
    ) -> dict[str, int]:
        """Rows for cases that have none; returns the number of each case's row by its key.

        `described` has unit and meaning of parameters of the drawing, `measures` are those of each run.
        """
        for case in cases:
            for kind, name, column in case.names:
                self._column(column, Column(kind, *described.get(name, (UNITS.get(name, ""), ""))))
        for name, measure in measures.items():
            self._column(name, Column("measure", measure.unit, measure.meaning))
        known = dict(self.connection.execute("SELECT key, number FROM run"))
        with self.connection:
            for case in cases:
                if case.key not in known:
                    known[case.key] = number = len(known) + 1
                    first = {"number": number, "key": case.key, "status": WAITING, "repetition": case.repetition}
                    self._insert(first | {"file": f"{self.runs.name}/{number:04}.sqlite"} | case.values)
        return {case.key: known[case.key] for case in cases}

    def _column(self, name: str, column: Column) -> None:
        if name.lower() in {known.lower() for known in self.columns()}:
            return
        with self.connection:
            self.connection.execute(f"ALTER TABLE run ADD COLUMN {quoted(name)}")
            self.connection.execute("INSERT INTO column_unit VALUES (?, ?, ?, ?)", (name, *column))

    def _insert(self, values: Mapping[str, Any]) -> None:
        names, marks = ", ".join(map(quoted, values)), ", ".join("?" * len(values))
        stored = [_stored(value) for value in values.values()]
        self.connection.execute(f"INSERT INTO run ({names}) VALUES ({marks})", stored)

    def finish(self, number: int, measures: Mapping[str, Any] | None, error: str | None = None) -> None:
        """Write down how a run ended: what was measured, or what went wrong."""
        values: dict[str, Any] = {"status": FINISHED if error is None else FAILED, "error": error, **(measures or {})}
        places = ", ".join(f"{quoted(name)} = ?" for name in values)
        with self.connection:
            self.connection.execute(
                f"UPDATE run SET {places} WHERE number = ?", [*map(_stored, values.values()), number]
            )

    def columns(self) -> dict[str, Column]:
        """Parameters, then measures, as they came."""
        return {
            name: Column(*rest) for name, *rest in self.connection.execute("SELECT * FROM column_unit ORDER BY rowid")
        }

    def rows(self, numbers: Iterable[int] | None = None) -> list[Row]:
        """All runs, or those of these numbers."""
        cursor = self.connection.execute("SELECT * FROM run ORDER BY number")
        names, wanted = [entry[0] for entry in cursor.description], None if numbers is None else set(numbers)
        found = []
        for values in cursor:
            row = dict(zip(names, values, strict=True))
            number, key, status, error, file, repetition = (row.pop(name) for name in OWN)
            if wanted is None or number in wanted:
                found.append(Row(number, key, status, error, self.path.parent / file, repetition, row))
        return found

    @property
    def runs(self) -> Path:
        """The folder of the runs' databases."""
        return runs_of(self.path)


def runs_of(path: Path) -> Path:
    """The folder with the databases of the study whose table is at `path`."""
    return path.with_suffix(".runs")


def is_study(path: Path) -> bool:
    """Whether the file at `path` is a study's table."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        head = file.read(72)
    return head.startswith(b"SQLite format 3\0") and head[68:72] == APPLICATION_ID.to_bytes(4, "big")


def quoted(name: str) -> str:
    """A name as SQL has it."""
    return '"' + name.replace('"', '""') + '"'


def _stored(value: Any) -> Any:
    if isinstance(value, bool) or value is None or isinstance(value, int | float | str):
        return value
    return json.dumps(value)
