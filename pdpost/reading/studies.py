"""Studies: runs grouped by the varied parameters, and the results that a study stands for; tables of runs and cracks.

A table has columns by name; `pandas.DataFrame(table)` accepts it directly, and a notebook shows it.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.files import FilePath
from pdmesh.plain_text import for_csv, for_html
from pdsolve.measures.crack_summary import crack, path_point_table
from pdsolve.results import Results
from pdsolve.study.description import StudyError
from pdsolve.study.measure_columns import OWN
from pdsolve.study.table import FINISHED, Column, Row, Table, head, is_study

SHOWN = 12  # rows


class Read(NamedTuple):
    """The finished runs of a study."""

    path: Path
    rows: list[Row]
    columns: dict[str, Column]
    varied: list[str]  # parameters that are not the same in all of them, but for random ones
    failed: int
    waiting: int


class Named(NamedTuple):
    """A database of results and its name."""

    name: str
    path: Path


def read(path: Path) -> Read:
    """The study at `path`. Raises StudyError if no run is finished."""
    with Table.open(path) as table:
        rows, columns, random = table.rows(), table.columns(), json.loads(table.about().get("random", "[]"))
    done = [row for row in rows if row.status == FINISHED]
    if not done:
        raise StudyError(f"{path}: no run is finished; at least one of {len(rows)} is needed")
    parameters = [name for name, column in columns.items() if column.kind != "measure"]
    varied = [name for name in parameters if name not in random and len({row.values[name] for row in done}) > 1]
    failed = sum(row.error is not None for row in rows)
    return Read(path, done, columns, varied, failed, len(rows) - len(done) - failed)


def label(row: Row, names: Sequence[str], units: Mapping[str, str] | None = None) -> str:
    """A run's label: the values of these parameters, named by the last part of their names, with their `units`."""
    values = {name: row.values[name] for name in names}
    with_unit = {name: (units or {}).get(name, "") for name, value in values.items() if isinstance(value, int | float)}
    return ", ".join(
        f"{short(name)} {value_of(value)} {with_unit.get(name, '')}".rstrip() for name, value in values.items()
    )


def short(name: str) -> str:
    """The last part of a parameter's name: G0 of material.G0, Spacing of Zones/fine/Spacing."""
    return name.replace("/", ".").rsplit(".", 1)[-1]


def value_of(value: Any) -> str:
    """A value as text; a parameter that a run was not given is the drawing's own."""
    if value is None:
        return "as drawn"
    return f"{value:g}" if isinstance(value, int | float) else str(value)


def stands_for(paths: Sequence[Path]) -> list[Named]:
    """The databases that files stand for; a study stands for all its finished runs. Raises StudyError."""
    databases = []
    for path in paths:
        if not is_study(path):
            databases.append(Named(path.stem, path))
            continue
        study = read(path)
        for row in study.rows:
            again = f" ({row.repetition})" if row.repetition else ""
            databases.append(Named(f"{label(row, study.varied) or f'run {row.number}'}{again}", row.file))
    return databases


__all__ = ["Named", "Read", "StudyError", "is_study", "label", "read", "short", "stands_for", "value_of"]


class TableColumns(dict[str, NDArray[Any]]):
    """Arrays (k,) of equal length, by column name."""

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(next(iter(self.values()), ()))

    def _repr_html_(self) -> str:
        """The first rows as an HTML table."""
        head = "".join(f"<th>{for_html(name)}</th>" for name in self)
        lines = [
            "<tr>" + "".join(f"<td>{for_html(_word(column[row]))}</td>" for column in self.values()) + "</tr>"
            for row in range(min(self.rows, SHOWN))
        ]
        more = f"<p>and {self.rows - SHOWN} more rows</p>" if self.rows > SHOWN else ""
        return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(lines)}</tbody></table>{more}"


def columns_of(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> TableColumns:
    """A table of rows as columns: numbers as floats with NaN where missing, anything else as objects."""
    listed = list(rows)
    return TableColumns({name: _array([row[at] for row in listed]) for at, name in enumerate(header)})


def crack_table(results: Results) -> TableColumns:
    """Every point of a run's crack paths as columns: time, place, length, speed. Raises ResultsError."""
    return columns_of(*path_point_table(crack(results)))


def study_table(path: FilePath) -> TableColumns:
    """All runs of the study at `path`: number, status, repetition, parameters, measures.

    Raises StudyError.
    """
    with Table.open(Path(path)) as table:
        rows, names = table.rows(), list(table.columns())
    run_columns = [name for name in OWN if name != "key"]
    return columns_of(
        [*run_columns, *names],
        [[*(getattr(row, name) for name in run_columns), *(row.values[name] for name in names)] for row in rows],
    )


def runs_csv(path: FilePath) -> bytes:
    """All runs of the study at `path` as CSV: heads in words with units, SI values. Raises StudyError."""
    with Table.open(Path(path)) as table:
        rows, columns = table.rows(), table.columns()
    run_columns = ("number", "status", "error", "repetition")
    lines: list[list[Any]] = [[*run_columns, *(head(name, column) for name, column in columns.items())]]
    lines += [[*(getattr(row, name) for name in run_columns), *(row.values[name] for name in columns)] for row in rows]
    return "".join(",".join(map(for_csv, line)) + "\n" for line in lines).encode()


def _array(values: list[Any]) -> NDArray[Any]:
    if all(isinstance(value, int | float | np.generic) for value in values if value is not None):
        if not any(value is None for value in values):
            return np.array(values)
        return np.array([np.nan if value is None else float(value) for value in values])
    return np.array([None if value is None else str(value) for value in values], dtype=object)


def _word(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else "" if value is None else str(value)
