"""Scatter of a study: a measure against a parameter, with the runs of each value together."""

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


class StudyRunGroup(NamedTuple):
    """The runs with one value of the parameter that differ only in their disturbances."""

    series: str  # the values of what else was varied
    parameter_value: Any  # of the parameter; None where it was not given
    run_numbers: list[int]  # of the runs (k,), in the table
    measured_values: NDArray[np.float64]  # (k,) SI units; NaN where it did not happen

    @property
    def known_values(self) -> NDArray[np.float64]:
        """Values (m,) of the runs that have one."""
        return self.measured_values[np.isfinite(self.measured_values)]

    @property
    def median_value(self) -> float:
        """Median of the known values; NaN without any."""
        return float(np.median(self.known_values)) if len(self.known_values) else float("nan")

    @property
    def smallest_and_largest_value(self) -> tuple[float, float]:
        """Smallest and largest known value; NaN without any."""
        known_values = self.known_values
        return (
            (float(known_values.min()), float(known_values.max()))
            if len(known_values)
            else (float("nan"), float("nan"))
        )


def group_runs_by_parameter(study: Read, measure: str, parameter: str | None) -> list[StudyRunGroup]:
    """The runs of a study grouped by equal parameters, series by series, in the order of the parameter `parameter`.

    Without a parameter, each group of equal runs is a series of its own.
    """
    others = [name for name in study.varied if name != parameter]
    units = {name: column.unit for name, column in study.columns.items()}
    together: dict[tuple[str, Any], list[tuple[int, float]]] = {}
    for row in study.rows:
        measure_value = row.values[measure]
        at = (label(row, others, units), None if parameter is None else row.values[parameter])
        together.setdefault(at, []).append((row.number, np.nan if measure_value is None else float(measure_value)))
    series = list(dict.fromkeys(name for name, _ in together))
    ordered = sorted(together, key=lambda at: (series.index(at[0]), _parameter_sort_key(at[1])))
    return [
        StudyRunGroup(*at, [number for number, _ in together[at]], np.array([value for _, value in together[at]]))
        for at in ordered
    ]


def choose_measures_and_parameter(
    study: Read, measures: Sequence[str], parameter: str | None
) -> tuple[list[str], str | None]:
    """The measures and the parameter asked for, or the most informative ones.

    Raises StudyError naming the available ones.
    """
    kinds = {name: column.kind for name, column in study.columns.items()}
    available = [name for name, kind in kinds.items() if kind == "measure"]
    for name in measures:
        if name not in available:
            raise StudyError(f"--measure is '{name}'; use one of {', '.join(available)}")
    parameters = [name for name, kind in kinds.items() if kind != "measure"]
    if parameter is not None and parameter not in parameters:
        raise StudyError(f"--over is '{parameter}'; use one of {', '.join(parameters) or 'none'}")
    if not parameter:  # the one with the most values, numeric ones preferred; of several, the first that was varied
        values = {name: {row.values[name] for row in study.rows} - {None} for name in study.varied}
        numbers = [name for name in values if all(isinstance(value, int | float) for value in values[name])]
        parameter = max(numbers or values, key=lambda name: len(values[name]), default=None)
    if not measures:  # those that differ between runs, first those known in at least half of the runs
        candidates = ["wall_time"] if set(HOW) & set(study.varied) else []
        candidates += [name for name in FIRST if name in study.columns]
        known = {name: [value for row in study.rows if (value := row.values[name]) is not None] for name in candidates}
        nonempty = [name for name in candidates if known[name]]
        differing = [name for name in nonempty if len(set(known[name])) > 1] or nonempty
        measures = sorted(differing, key=lambda name: 2 * len(known[name]) < len(study.rows))[:PANELS]
    return list(measures), parameter


def measures_without_values(study: Read, measures: Sequence[str]) -> list[str]:
    """Measures without a value in any run, of those given or else of those drawn if present."""
    names = measures or [name for name in FIRST if name in study.columns]
    return [name for name in names if all(row.values[name] is None for row in study.rows)]


def _parameter_sort_key(value: Any) -> tuple[int, float, str]:
    """Sort key: not given, then numbers, then words."""
    if value is None:
        return (0, 0.0, "")
    return (1, float(value), "") if isinstance(value, int | float) else (2, 0.0, str(value))
