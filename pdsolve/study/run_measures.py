"""Results of a run as the numbers of the table."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pdsolve.measures.bond_pairs import largest_displacement, largest_stretch
from pdsolve.measures.crack_summary import CrackPathSummary, crack
from pdsolve.results import Results
from pdsolve.study.measure_columns import measures_of


def compute_run_measures(results: Results) -> dict[str, float | None]:
    """Measures of a finished run; None for events that did not happen. Raises ResultsError."""
    summary, names = results.summary(), measures_of(results.dimension)
    measures: dict[str, Any] = {name: summary.get(name) for name in names}
    measures |= summary["energy"]
    measures |= {"largest_displacement": largest_displacement(results), "largest_stretch": largest_stretch(results)}
    if results.dimension == 2:
        measures |= _crack_measures(crack(results))
    elif len(steps := results.breaks().step):
        measures["first_break"] = int(steps.min()) * summary["time_step"]
    values = {name: measures.get(name) for name in names}
    return {name: None if value is None or not math.isfinite(value) else value for name, value in values.items()}


def _crack_measures(summary: CrackPathSummary) -> dict[str, Any]:
    events = {name: getattr(summary.events, name) for name in ("first_break", "start", "branching", "split")}
    times = {name: None if event is None else event.time for name, event in events.items()}
    branching = events["branching"]
    spent = summary.energy_release.release_rate[np.isfinite(summary.energy_release.release_rate)]
    sound = [branch for branch in summary.branches if (branch.mean_speed or math.inf) <= summary.rayleigh_speed]
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
