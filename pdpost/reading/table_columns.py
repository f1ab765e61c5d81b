"""A table as columns by name; `pandas.DataFrame(table)` accepts it directly, and a notebook shows it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmesh.files import FilePath
from pdmesh.plain_text import for_html
from pdsolve.study.measure_columns import OWN
from pdsolve.study.table import Table

SHOWN = 12  # rows


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


def _array(values: list[Any]) -> NDArray[Any]:
    if all(isinstance(value, int | float | np.generic) for value in values if value is not None):
        if not any(value is None for value in values):
            return np.array(values)
        return np.array([np.nan if value is None else float(value) for value in values])
    return np.array([None if value is None else str(value) for value in values], dtype=object)


def _word(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else "" if value is None else str(value)
