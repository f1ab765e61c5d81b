"""Results of a run as the numbers of the table."""

from __future__ import annotations

import contextlib
import math
import sqlite3
import time
from collections.abc import Mapping
from typing import Any

import numpy as np

from pdsolve.measures.bond_pairs import largest_displacement, largest_stretch
from pdsolve.measures.crack_summary import CrackPathSummary, crack
from pdsolve.measures.fatigue import cycles_after_steps
from pdsolve.measures.forces import read_condition_force_histories, select_condition_force_histories
from pdsolve.measures.stress_intensities import follow_tip_intensities
from pdsolve.results import Results, ResultsError
from pdsolve.study.description import RunMeasure
from pdsolve.study.measure_columns import measures_of

LONGEST_QUERY = 60.0  # s


def compute_run_measures(results: Results, further: Mapping[str, RunMeasure] = {}) -> dict[str, float | None]:
    """Measures of a finished run, and those `further` ones, by name; None for events that did not happen.

    Raises ResultsError.
    """
    summary, names = results.summary(), measures_of(results.dimension)
    measures: dict[str, Any] = {name: summary.get(name) for name in names}
    measures |= summary["energy"]
    measures |= {"largest_displacement": largest_displacement(results), "largest_stretch": largest_stretch(results)}
    if results.dimension == 2:
        measures |= _crack_measures(crack(results))
    elif len(steps := results.breaks().step):
        measures["first_break"] = int(steps.min()) * summary["time_step"]
    values = {name: measures.get(name) for name in names}
    values |= {name: _further_measure(results, name, measure) for name, measure in further.items()}
    return {name: None if value is None or not math.isfinite(value) else value for name, value in values.items()}


def _crack_measures(summary: CrackPathSummary) -> dict[str, Any]:
    events = {name: getattr(summary.events, name) for name in ("first_break", "start", "branching", "split")}
    times = {name: None if event is None else event.time for name, event in events.items()}
    branching = events["branching"]
    spent = summary.energy_release.release_rate[np.isfinite(summary.energy_release.release_rate)]
    sound = [branch for branch in summary.branches if (branch.mean_speed or math.inf) <= summary.limiting_speed]
    fork = summary.forks[0] if summary.forks else None
    return times | {
        "branching_at": None if branching is None else branching.along,
        "length": sum(branch.length for branch in summary.branches),
        "longest": max((branch.length for branch in summary.branches), default=0.0),
        "speed": sound[0].mean_speed if sound and not summary.is_quasi_static else None,
        "branches": len(summary.branches),
        "forks": len(summary.forks),
        "fork_angle": None if fork is None else fork.angle_between_outer_arms,
        "fork_x": None if fork is None else fork.place[0],
        "fork_y": None if fork is None else fork.place[1],
        "direction": max((abs(way.angle_from_pre_crack) for way in summary.initial_directions), default=None),
        "spent": float(np.median(spent)) if len(spent) else None,
        "pieces": len(summary.fragments.pieces),
    }


def _further_measure(results: Results, name: str, measure: RunMeasure) -> float | None:
    """The value of a measure that the study describes. Raises ResultsError."""
    field, value = measure.quantity
    try:
        if field == "sql":
            until = time.monotonic() + LONGEST_QUERY
            results.connection.set_progress_handler(lambda: time.monotonic() > until, 100_000)
            try:
                row = results.connection.execute(value).fetchone()
            finally:
                results.connection.set_progress_handler(None, 0)
            return None if row is None or row[0] is None else float(row[0])
        if field == "cycles":
            total = float(cycles_after_steps(results)[-1])
            return total if value == "total" else results.summary().get("first_break")
        if field == "intensity":
            return _last_intensity(results, value)
        (history,) = select_condition_force_histories(read_condition_force_histories(results), [value])
        force = history.force[:, history.main_axis]
        peak = int(np.abs(force).argmax())
        if field == "displacement_at_peak":
            return float(history.displacement[peak, history.main_axis])
        if measure.thickness is not None and results.dimension == 3:
            raise ResultsError("thickness is for plates; leave it out for a body in space")
        return float(force[peak]) * (1.0 if measure.thickness is None else measure.thickness)
    except (ResultsError, sqlite3.Error, sqlite3.Warning, ValueError, TypeError) as error:
        raise ResultsError(f"$.measures.{name}: {error}") from None


def _last_intensity(results: Results, name: str) -> float | None:
    """J, K1, K2 or T of the first tip in the last of the frames in which a tip has room; None if none has."""
    for step in reversed(results.frames()[0].tolist()):
        with contextlib.suppress(ResultsError):  # `pdpost sif` says why
            value = follow_tip_intensities(results, [step])[0].value[name][0]
            if np.isfinite(value):
                return float(value)
    return None
