"""Crack paths as polylines, and the distance between two sets of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.output_fields import CRACKED
from pdpost.measures.cracks import DIRECTIONS
from pdpost.measures.segments import distances_to_nearest_segment
from pdpost.measures.tips import crack_branches
from pdsolve.results import Results

LONG = 0.4  # of the longest: shorter branches are no main ones
SAMPLES = 2000  # points of a set of lines that distances are measured from

Polyline = NDArray[np.float64]  # (k, 2) m


class PathError(ValueError):
    """Paths that cannot be compared."""


def crack_paths(results: Results, step: int, threshold: float = CRACKED) -> list[Polyline]:
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
