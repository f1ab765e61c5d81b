"""Studies: runs grouped by the varied parameters, and the results that a study stands for."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from pdsolve.study.description import StudyError
from pdsolve.study.table import FINISHED, Column, Row, Table, is_study


class Read(NamedTuple):
    """The finished runs of a study."""

    path: Path
    rows: list[Row]
    columns: dict[str, Column]
    varied: list[str]  # parameters that are not the same in all of them
    failed: int
    waiting: int


class Named(NamedTuple):
    """A database of results and its name."""

    name: str
    path: Path


def read(path: Path) -> Read:
    """The study at `path`. Raises StudyError if no run is finished."""
    with Table.open(path) as table:
        rows, columns = table.rows(), table.columns()
    done = [row for row in rows if row.status == FINISHED]
    if not done:
        raise StudyError(f"{path}: no run is finished; at least one of {len(rows)} is needed")
    parameters = [name for name, column in columns.items() if column.kind != "measure"]
    varied = [name for name in parameters if len({row.values[name] for row in done}) > 1]
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
