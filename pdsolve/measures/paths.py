"""Crack paths as polylines, the distance between two sets of them, and the comparison of the cracks of two runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.measures.cracks import DIRECTIONS, find_crack_events
from pdsolve.measures.plate_geometry import expect_same_plate
from pdsolve.measures.tips import crack_branches
from pdsolve.results import Results

BLOCK = 256  # points at a time, so that memory stays small
LONG = 0.4  # of the longest: shorter branches are no main ones
SAMPLES = 2000  # points of a set of lines that distances are measured from
Polyline = NDArray[np.float64]  # (k, 2) m


def distances_to_nearest_segment(
    points: NDArray[np.float64], start: NDArray[np.float64], end: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Distances (n,) of points (n, 2) from the nearest segment from `start` (k, 2) to `end` (k, 2), m."""
    way = end - start
    squared = np.maximum((way**2).sum(axis=1), 1e-300)
    nearest = np.full(len(points), np.inf)
    for at in range(0, len(points), BLOCK):
        from_start = points[at : at + BLOCK, None, :] - start
        share = ((from_start * way).sum(axis=2) / squared).clip(0, 1)
        nearest[at : at + BLOCK] = np.hypot(*(from_start - share[..., None] * way).transpose(2, 0, 1)).min(
            axis=1, initial=np.inf
        )
    return nearest


class PathError(ValueError):
    """Paths that cannot be compared."""


def crack_paths(results: Results, step: int, threshold: float | None = None) -> list[Polyline]:
    """The crack paths after `step`: a polyline (k, 2), m, for each branch, the longest first."""
    return [branch.points for branch in crack_branches(results, step, threshold)]


def mean_and_hausdorff_distance(
    first_lines: Sequence[Polyline], second_lines: Sequence[Polyline]
) -> tuple[float, float]:
    """Distances between two sets of lines, m: the mean over the length of both, and the Hausdorff distance.

    The mean is that of the two mean distances from one set to the nearest points of the other. Each set is sampled at
    about 2000 points. Raises PathError if one is empty.
    """
    if not first_lines or not second_lines:
        raise PathError("one of the runs has no path of a crack; compare runs with cracks")
    forward = _mean_and_largest_distance(first_lines, second_lines)
    back = _mean_and_largest_distance(second_lines, first_lines)
    return (forward[0] + back[0]) / 2, max(forward[1], back[1])


def main_growth_direction_name(lines: Sequence[Polyline]) -> str:
    """The direction in `cracks.DIRECTIONS` along which most of a crack's length runs; "right" without a crack.

    Lines shorter than 0.4 of the longest do not count. Of directions within a tenth of each other, the first is taken.
    """
    way = np.array(list(DIRECTIONS.values()))
    lengths = np.zeros(len(way))
    sizes = [float(np.hypot(*np.diff(line, axis=0).T).sum()) for line in lines]
    for line, size in zip(lines, sizes, strict=True):
        if size >= LONG * max(sizes):
            lengths[int((way @ (line[-1] - line[0])).argmax())] += size
    return list(DIRECTIONS)[int((lengths >= 0.9 * lengths.max()).argmax())]


def _mean_and_largest_distance(lines: Sequence[Polyline], target_lines: Sequence[Polyline]) -> tuple[float, float]:
    """Mean and largest distance from points of `lines` to the nearest points of `target_lines`, m."""
    pieces = [np.hypot(*np.diff(line, axis=0).T) for line in lines]
    total_length = sum(float(piece.sum()) for piece in pieces)
    if total_length == 0:
        points = np.concatenate(list(lines))
        weight = np.ones(len(points))
    else:
        samples, weights = [], []
        for line, lengths in zip(lines, pieces, strict=True):
            for start, end, length in zip(line[:-1], line[1:], lengths, strict=True):
                parts = max(1, int(np.ceil(SAMPLES * length / total_length)))
                samples.append(start + np.linspace(0, 1, parts + 1)[:, None] * (end - start))
                weight = np.full(parts + 1, length / parts)
                weight[[0, -1]] /= 2
                weights.append(weight)
        points, weight = np.concatenate(samples), np.concatenate(weights)
    start = np.concatenate([line[:-1] if len(line) > 1 else line for line in target_lines])
    end = np.concatenate([line[1:] if len(line) > 1 else line for line in target_lines])
    nearest = distances_to_nearest_segment(points, start, end)
    return float(np.average(nearest, weights=weight)), float(nearest.max())


class CrackComparison(NamedTuple):
    """Distances of two runs' cracks; None where one run has none.

    Differences are the other's value minus the first's.
    """

    paths: tuple[list[Polyline], list[Polyline]]
    mean_distance: float | None  # m, symmetric, see `paths.mean_and_hausdorff_distance`
    hausdorff_distance: float | None  # m
    start_time_difference: float | None  # s
    branching_time_difference: float | None  # s
    split_time_difference: float | None  # s


def compare_cracks(
    first_run: Results,
    second_run: Results,
    steps: tuple[int, int],
    direction: tuple[float, float] = (1.0, 0.0),
    threshold: float | None = None,
) -> CrackComparison:
    """Compare the paths of two runs after their `steps`, and when their cracks started, branched and split the plate.

    Raises ResultsError if the plates differ.
    """
    expect_same_plate(second_run, first_run)
    paths = crack_paths(first_run, steps[0], threshold), crack_paths(second_run, steps[1], threshold)
    apart = mean_and_hausdorff_distance(*paths) if all(paths) else (None, None)
    first_growth, second_growth = (
        find_crack_events(results, direction, threshold, step)
        for results, step in zip((first_run, second_run), steps, strict=True)
    )
    events = (
        (first_growth.start, second_growth.start),
        (first_growth.branching, second_growth.branching),
        (first_growth.split, second_growth.split),
    )
    later = (None if first is None or second is None else second.time - first.time for first, second in events)
    return CrackComparison(paths, *apart, *later)
