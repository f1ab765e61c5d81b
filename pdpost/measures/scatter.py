"""How the runs of a study scatter: a measure against a parameter, the runs of each value together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdpost.reading.studies import Read, label
from pdsolve.study.description import StudyError

# Those drawn by default, from what cracks do to what there is where nothing breaks
FIRST = (
    "start", "branching", "speed", "fork_angle", "direction", "length", "dissipated",
    "largest_displacement", "largest_stretch", "strain", "work",
)  # fmt: skip
HOW = ("kernel", "precision", "run.adapt")  # how a run is solved: what it takes is of interest too
PANELS = 4


class Spread(NamedTuple):
    """The runs with one value of the parameter, all else being the same but disturbances."""

    series: str  # the values of what else was varied
    value: Any  # of the parameter; None where it was not given
    numbers: list[int]  # of the runs (k,), in the table
    measured: NDArray[np.float64]  # (k,) SI units; NaN where it did not happen

    @property
    def known(self) -> NDArray[np.float64]:
        """The values (m,) of the runs that have one."""
        return self.measured[np.isfinite(self.measured)]

    @property
    def median(self) -> float:
        """The median of the known values; NaN where there is none."""
        return float(np.median(self.known)) if len(self.known) else float("nan")

    @property
    def ends(self) -> tuple[float, float]:
        """The smallest and the largest known; NaN where there is none."""
        known = self.known
        return (float(known.min()), float(known.max())) if len(known) else (float("nan"), float("nan"))


def spreads(study: Read, measure: str, over: str | None) -> list[Spread]:
    """The runs of a study, those alike together, series by series, in the order of the parameter `over`.

    Without a parameter all runs that are alike are a series of its own.
    """
    others = [name for name in study.varied if name != over]
    together: dict[tuple[str, Any], list[tuple[int, float]]] = {}
    for row in study.rows:
        found = row.values[measure]
        at = (label(row, others), None if over is None else row.values[over])
        together.setdefault(at, []).append((row.number, np.nan if found is None else float(found)))
    series = list(dict.fromkeys(name for name, _ in together))
    ordered = sorted(together, key=lambda at: (series.index(at[0]), _rank(at[1])))
    return [
        Spread(*at, [number for number, _ in together[at]], np.array([value for _, value in together[at]]))
        for at in ordered
    ]


def chosen(study: Read, measures: Sequence[str], over: str | None) -> tuple[list[str], str | None]:
    """The measures and the parameter asked for, or those that say most. Raises StudyError, naming those there are."""
    kinds = {name: column.kind for name, column in study.columns.items()}
    known = [name for name, kind in kinds.items() if kind == "measure"]
    for name in measures:
        if name not in known:
            raise StudyError(f"--measure: found '{name}', expected one of {', '.join(known)}")
    parameters = [name for name, kind in kinds.items() if kind != "measure"]
    if over is not None and over not in parameters:
        raise StudyError(f"--over: found '{over}', expected one of {', '.join(parameters) or 'none'}")
    return list(measures) or _telling(study), over or _axis(study)


def empty(study: Read, measures: Sequence[str]) -> list[str]:
    """What happened in no run: of these measures, or else of those that are drawn where they happen."""
    names = measures or [name for name in FIRST if name in study.columns]
    return [name for name in names if all(row.values[name] is None for row in study.rows)]


def _telling(study: Read) -> list[str]:
    """The measures that say most: that differ between runs, those first that happened in half of them or more."""
    there = ["wall_time"] if set(HOW) & set(study.varied) else []
    there += [name for name in FIRST if name in study.columns]
    values = {name: [value for row in study.rows if (value := row.values[name]) is not None] for name in there}
    known = [name for name in there if values[name]]
    differing = [name for name in known if len(set(values[name])) > 1] or known
    return sorted(differing, key=lambda name: 2 * len(values[name]) < len(study.rows))[:PANELS]


def _axis(study: Read) -> str | None:
    """The parameter with the most values, of those that are numbers if there are any; the first varied of such."""
    values = {name: {row.values[name] for row in study.rows} - {None} for name in study.varied}
    numbers = [name for name in values if all(isinstance(value, int | float) for value in values[name])]
    return max(numbers or values, key=lambda name: len(values[name]), default=None)


def _rank(value: Any) -> tuple[int, float, str]:
    """To sort by: what was not given, numbers, words."""
    if value is None:
        return (0, 0.0, "")
    return (1, float(value), "") if isinstance(value, int | float) else (2, 0.0, str(value))
