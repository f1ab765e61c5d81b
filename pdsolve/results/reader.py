"""Reads the database of a run."""

from __future__ import annotations

import json
import sqlite3
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.fields import UNITS
from pdsolve.results.checksums import Row, select
from pdsolve.results.errors import ResultsError, explained
from pdsolve.results.schema import CHUNK, SCHEMA_VERSION, WITHOUT_CHECKSUMS, Breaks, Families, Nodes
from pdsolve.results.tables import Tables


class Results:
    """Reads one run. Arrays are in the order of the model's nodes; steps name frames.

    What is read is compared with its checksums; all methods raise ResultsError where it is not what was written.
    """

    def __init__(self, connection: sqlite3.Connection, name: str) -> None:
        self.connection = connection
        self.name = name
        self._tables = Tables(connection, name)
        self._nodes: Nodes | None = None

    @classmethod
    def open(cls, path: Path) -> Results:
        """The results in the file at `path`, read only. Raises ResultsError if it is not one of ours."""
        if not path.is_file():
            raise ResultsError(f"{path}: found no such file, expected a database of results")
        with explained(path):
            connection = sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)
            try:
                results = cls(connection, str(path))
                results._tables.expect_ours()
            except BaseException:
                connection.close()
                raise
        return results

    def verify(self) -> None:
        """Read all there is. Raises ResultsError where it is not what was written, or where that cannot be said
        because an older version wrote it."""
        if not self._tables.checked:
            raise ResultsError(
                f"{self.name}: found schema version {WITHOUT_CHECKSUMS}, which can be read but not gone on with,"
                f" expected {SCHEMA_VERSION}; solve it anew"
            )
        self._tables.verify()

    def __enter__(self) -> Results:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Let go of the file."""
        self.connection.close()

    def meta(self) -> dict[str, Any]:
        """What the run says of itself: mode, step, versions, status; all but the model."""
        tables, most = self._tables, "WHERE key <> 'model'"
        with tables.snapshot():
            if tables.checked:
                tables.compare("meta", tables.rows(select("meta", columns="key, crc")))
            return {row[0]: row[-1] for row in tables.each("meta", most)}

    def model(self) -> str:
        """The grid file the run was made from, in full. Raises ResultsError if there is none."""
        rows = list(self._tables.each("meta", "WHERE key = 'model'"))
        if not rows:
            raise ResultsError(f"{self.name}: found no model, expected the grid file that was solved")
        return str(rows[0][-1])

    def summary(self) -> dict[str, Any]:
        """The closing summary; empty while the run goes on."""
        summary: dict[str, Any] = json.loads(self.meta().get("summary", "{}"))
        return summary

    def nodes(self) -> Nodes:
        """The nodes of the model, read once: the arrays are shared and cannot be written to."""
        if self._nodes is None:
            table = self._tables.records("node")
            _, ids, x, y, _, *others = (np.ascontiguousarray(table[name]) for name in table.dtype.names or ())
            self._nodes = Nodes(ids, np.column_stack([x, y]), *others)
            for column in self._nodes:
                column.flags.writeable = False
        return self._nodes

    def families(self) -> Families:
        """Who is bonded to whom at the start."""
        counts, neighbours, row = [np.zeros(1, dtype=np.int64)], [np.zeros(0, dtype=np.int64)], 0
        for *_, bonds, further in self._tables.all("family_chunk"):
            packed = bonds, further
            count, ahead = (np.frombuffer(zlib.decompress(blob), dtype="<i4").astype(np.int64) for blob in packed)
            neighbours.append(np.repeat(np.arange(row, row + len(count)), count) + ahead)
            counts.append(count)
            row += len(count)
        return Families(np.cumsum(np.concatenate(counts)), np.concatenate(neighbours))

    def cracks(self) -> NDArray[np.float64]:
        """Segments (k, 4) of pre-cracks x0, y0, x1, y1, m."""
        return np.array(self._tables.all("crack"), dtype=float).reshape(-1, 4)

    def frames(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Steps and times (s) of the frames."""
        rows = self._tables.all("frame")
        return np.array([row[0] for row in rows], dtype=np.int64), np.array([row[1] for row in rows], dtype=float)

    def field(self, name: str, step: int) -> NDArray[np.float32]:
        """A field (n,) of the frame at `step`. Raises ResultsError, naming those there are, if it is not there."""
        rows = list(self._tables.each("field_chunk", "WHERE step = ? AND field = ?", (int(step), name)))
        if not rows:
            self._expect_field(name, step)
        count = self._tables.count("node")
        if count is not None and len(rows) != -(-count // CHUNK):
            self._tables.damaged("field_chunk")
        return np.frombuffer(b"".join(row[-1] for row in rows), dtype="<f4")

    def stored(self, step: int) -> list[str]:
        """The names of the fields that the frame at `step` holds, in the order of the view."""
        if self._tables.checked:
            names = {row[0]: row[2].split() for row in self._tables.all("frame")}.get(int(step), [])
        else:
            rows = self._tables.rows("SELECT DISTINCT field FROM field_chunk WHERE step = ?", (int(step),))
            names = [row[0] for row in rows]
        return [name for name in UNITS if name in names]

    def _expect_field(self, name: str, step: int) -> None:
        """Raises ResultsError, naming those there are, if a frame does not hold a field."""
        steps, _ = self.frames()
        if step not in steps:
            there = f"{len(steps)} frames from {steps[0]} to {steps[-1]}" if len(steps) else "none yet"
            raise ResultsError(f"{self.name}: found no frame of step {step}, expected one of {there}")
        if name not in (stored := self.stored(step)):
            fields = f"{', '.join(stored)} (pdsolve --fields stores others)"
            raise ResultsError(f"{self.name}: found no field '{name}', expected one of {fields}")

    def breaks(self) -> Breaks:
        """All bonds broken so far."""
        table = self._tables.records("bond_break")
        return Breaks(*(np.ascontiguousarray(table[name]) for name in table.dtype.names or ()))

    def history(self) -> NDArray[np.void]:
        """The ledger, a record a row, with fields step, time, kinetic, strain, dissipated, work, momentum_x,
        momentum_y and broken."""
        return self._numbers("history", self._tables.all("history"))

    def probes(self) -> NDArray[np.void]:
        """What was written down at the probes, a record a row, with fields step, time, node, ux ... ay."""
        found = self._numbers("probe", self._tables.all("probe"))
        return found[np.lexsort((found["step"], found["node"]))]

    def reactions(self) -> NDArray[np.void]:
        """What the conditions did, a record a row, with fields step, time, condition, force_x, force_y, displacement_x
        and displacement_y; their kinds are in the model."""
        rows = [(*row[:3], *row[4:]) for row in self._tables.all("reaction")]
        found = self._numbers("reaction", rows, leave_out="kind")
        return found[np.lexsort((found["step"], found["condition"]))]

    def checkpoint(self) -> tuple[int, dict[str, NDArray[np.floating]]]:
        """Step and arrays of the last checkpoint. Raises ResultsError if there is none."""
        rows = self._tables.all("checkpoint")
        if not rows:
            raise ResultsError(f"{self.name}: found no checkpoint, expected one to go on from")
        return rows[0][1], {name: np.frombuffer(data, dtype=kind).copy() for name, _, kind, *_, data in rows}

    def _numbers(self, table: str, rows: Sequence[Row], leave_out: str = "") -> NDArray[np.void]:
        """Rows of a table as records of floats, named as its columns are."""
        names = [row[1] for row in self._tables.rows(f"PRAGMA table_info({table})")]
        return np.array(rows, dtype=[(name, float) for name in names if name != leave_out])
