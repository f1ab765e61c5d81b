"""Results of a run as the numbers of the table."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from pdpost import Summary, crack, largest_displacement, largest_stretch
from pdsolve.results import Results
from pdsolve.study.measure_columns import measures_of


def measured(results: Results) -> dict[str, float | None]:
    """Measures of a finished run; None for events that did not happen. Raises ResultsError."""
    summary, names = results.summary(), measures_of(results.dimension)
    found: dict[str, Any] = {name: summary.get(name) for name in names}
    found |= summary["energy"]
    found |= {"largest_displacement": largest_displacement(results), "largest_stretch": largest_stretch(results)}
    if results.dimension == 2:
        found |= _cracked(crack(results))
    elif len(steps := results.breaks().step):
        found["first_break"] = int(steps.min()) * summary["time_step"]
    return {name: _number(found.get(name)) for name in names}


def _cracked(found: Summary) -> dict[str, Any]:
    events = {name: getattr(found.growth, name) for name in ("first_break", "start", "branching", "split")}
    times = {name: None if event is None else event.time for name, event in events.items()}
    branching, spent = events["branching"], found.release.value[np.isfinite(found.release.value)]
    sound = [branch for branch in found.branches if (branch.mean_speed or math.inf) <= found.rayleigh_speed]
    fork = found.forks[0] if found.forks else None
    return times | {
        "branching_at": None if branching is None else branching.along,
        "length": sum(branch.length for branch in found.branches),
        "longest": max((branch.length for branch in found.branches), default=0.0),
        "speed": sound[0].mean_speed if sound and not found.at_rest else None,
        "branches": len(found.branches),
        "forks": len(found.forks),
        "fork_angle": None if fork is None else fork.angle,
        "fork_x": None if fork is None else fork.place[0],
        "fork_y": None if fork is None else fork.place[1],
        "direction": max((abs(way.angle) for way in found.directions), default=None),
        "spent": float(np.median(spent)) if len(spent) else None,
        "pieces": len(found.fragments.pieces),
    }


def _number(value: Any) -> float | None:
    return None if value is None or not math.isfinite(value) else value
