"""Speed against accuracy: the cost of results of one scene, and their errors relative to a reference.

Errors are relative to the reference's displacements, length of crack path, times and energy. An event in the reference
that is missing in the other run is an infinite error. An event that is missing in the reference has no error.
"""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import QhullError, cKDTree

from pdsolve.measures.balance import damped_energy
from pdsolve.measures.cracked_nodes import cracked_damage_of, damage_with_pre_cracks_at
from pdsolve.measures.cracks import DIRECTIONS, CrackEvent, find_crack_events
from pdsolve.measures.frame_steps import frames, vector
from pdsolve.measures.paths import crack_paths, main_growth_direction_name, mean_and_hausdorff_distance
from pdsolve.measures.plate_geometry import expect_same_plate
from pdsolve.results import Results, ResultsError

AWAY = 2.0  # of the larger spacing: displacements are compared where no crack is nearer


class RunCost(NamedTuple):
    """The cost of a run: wall time, bond updates and the size of its file."""

    wall_time: float  # s
    bond_updates: float  # bonds times steps
    bytes: float  # of its file


class RelativeErrors(NamedTuple):
    """Relative errors of a run against its reference; None where the reference has nothing to compare with."""

    displacement: float | None  # L2 norm over the nodes away from cracks, at the last common time
    path: float | None  # mean distance of the cracks' paths then, over the length of the reference's
    start: float | None  # of the crack
    branching: float | None  # time of it
    energy: float | None  # kinetic, strain, dissipated and damped, then

    @property
    def worst(self) -> float:
        """The largest of the known errors."""
        return max((error for error in self if error is not None), default=float("nan"))


class TradeoffPoint(NamedTuple):
    """One result on the chart of cost against error."""

    name: str
    node_count: int
    cost: RunCost
    errors: RelativeErrors


def measure_tradeoff_point(results: Results, file: Path, reference: Results) -> TradeoffPoint:
    """A result as a point of the chart. Raises ResultsError as `read_run_cost` and `relative_run_errors` do."""
    return TradeoffPoint(
        file.stem, len(results.nodes().ids), read_run_cost(results, file), relative_run_errors(results, reference)
    )


def read_run_cost(results: Results, file: Path) -> RunCost:
    """The cost of a run. Raises ResultsError if it is not finished."""
    summary = results.summary()
    if not summary:
        raise ResultsError(f"{results.name} is a run without a summary; let it end first (pdsolve --resume)")
    updates = float(results.bond_updates(int(summary["steps"])))
    return RunCost(float(summary["wall_time"]), updates, float(file.stat().st_size))


def relative_run_errors(results: Results, reference: Results) -> RelativeErrors:
    """Errors of a run against its reference. Raises ResultsError if the scenes differ or a frame is missing."""
    expect_same_plate(results, reference)
    time = _last_common_time(results, reference)
    lines, expected_lines = (crack_paths(run, _step_at_time(run, time)) for run in (results, reference))
    direction = DIRECTIONS[main_growth_direction_name(expected_lines)]
    run_growth, expected = find_crack_events(results, direction), find_crack_events(reference, direction)
    path: float | None = None
    length = sum(float(np.hypot(*np.diff(line, axis=0).T).sum()) for line in expected_lines)
    if expected_lines and not lines:
        path = float("inf")
    elif length > 0:
        path = mean_and_hausdorff_distance(lines, expected_lines)[0] / length
    return RelativeErrors(
        displacement=relative_displacement_error(results, reference),
        path=path,
        start=_relative_event_time_error(run_growth.start, expected.start),
        branching=_relative_event_time_error(run_growth.branching, expected.branching),
        energy=_relative_error(_total_energy_at(results, time), _total_energy_at(reference, time)),
    )


def pareto_front(cost: NDArray[np.float64], error: NDArray[np.float64]) -> list[int]:
    """Pareto front of points (k,): those that no other beats in both cost and error, the cheapest first."""
    best, least = [], np.inf
    for at in np.lexsort((error, cost)).tolist():
        if error[at] < least:
            best.append(at)
            least = float(error[at])
    return best


def cheapest_point(cost: NDArray[np.float64], error: NDArray[np.float64], largest_error: float) -> int | None:
    """The cheapest point (k,) whose error is at most `largest_error`; None if there is none."""
    good = np.flatnonzero(error <= largest_error)
    return int(good[cost[good].argmin()]) if len(good) else None


def _last_common_time(results: Results, reference: Results) -> float:
    return min(float(frames(run)[1][-1]) for run in (results, reference))


def _step_at_time(results: Results, time: float) -> int:
    return round(time / float(results.meta()["time_step"]))


def relative_displacement_error(results: Results, reference: Results) -> float | None:
    """Relative error of the displacements; None if there is nothing to compare. Raises ResultsError.

    The comparison is at the nodes of the coarser run; displacements of the finer run are interpolated linearly.
    """
    expect_same_plate(results, reference)
    time = _last_common_time(results, reference)
    runs = sorted((results, reference), key=lambda run: len(run.nodes(_first_frame_step_at_or_after(run, time)).ids))
    coarse, fine = (run.nodes(_first_frame_step_at_or_after(run, time)) for run in runs)
    away = np.ones(len(coarse.ids), dtype=bool)
    for run in runs:
        step = _step_at_time(run, time)
        nodes = run.nodes(step)
        near = (damage_with_pre_cracks_at(run, step) > cracked_damage_of(run)) | (nodes.cut > 0)
        if near.any():
            reach = AWAY * float(max(coarse.delta.max(), fine.delta.max()))
            away &= cKDTree(nodes.position[near]).query(coarse.position)[0] > reach
    try:
        between = LinearNDInterpolator(fine.position, _interpolate_displacement_at(runs[1], time))(coarse.position)
    except QhullError:  # fewer than three nodes, or all in one row
        return None
    away &= np.isfinite(between).all(axis=1)
    if not away.any():
        return None
    displacements = {id(runs[0]): _interpolate_displacement_at(runs[0], time)[away], id(runs[1]): between[away]}
    off = displacements[id(results)] - displacements[id(reference)]
    area = coarse.area[away, None]
    size = float(np.sum(area * displacements[id(reference)] ** 2))
    return float(np.sqrt(np.sum(area * off**2) / size)) if size > 0 else None


def _first_frame_step_at_or_after(results: Results, time: float) -> int:
    """The step of the first frame at or after a time, or else of the last frame."""
    steps, times = results.frames()
    return int(steps[np.searchsorted(times, time).clip(max=len(times) - 1)])


def _interpolate_displacement_at(results: Results, time: float) -> NDArray[np.float64]:
    """Displacements (n, 2), m, at a time between two frames, at the nodes of the second.

    Where the first frame has other nodes, its displacements are interpolated linearly.
    """
    steps, times = results.frames()
    after = int(np.searchsorted(steps, _first_frame_step_at_or_after(results, time)))
    before = max(after - 1, 0)
    gap = float(times[after] - times[before])
    share = (time - float(times[before])) / gap if gap > 0 else 1.0
    share = min(max(share, 0.0), 1.0)
    first, last = int(steps[before]), int(steps[after])
    new = vector(results, "displacement", last)
    if share == 1:
        return new
    old = vector(results, "displacement", first)
    if results.epoch(first) != results.epoch(last):
        old = LinearNDInterpolator(results.nodes(first).position, old)(results.nodes(last).position)
    return np.asarray((1 - share) * old + share * new)


def _relative_event_time_error(event: CrackEvent | None, expected: CrackEvent | None) -> float | None:
    if expected is None:
        return None
    return float("inf") if event is None else _relative_error(event.time, expected.time)


def _relative_error(value: float, expected: float) -> float | None:
    return abs(value - expected) / abs(expected) if expected else None


def _total_energy_at(results: Results, time: float) -> float:
    energy_balance = results.history()
    if not len(energy_balance):
        raise ResultsError(f"{results.name} has no energies; use a run of mechanics")
    total = (
        energy_balance["kinetic"]
        + energy_balance["strain"]
        + energy_balance["dissipated"]
        + np.nan_to_num(damped_energy(energy_balance))
    )
    return float(np.interp(time, energy_balance["time"], total))
