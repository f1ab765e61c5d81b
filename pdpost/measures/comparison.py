"""Comparison of the cracks of two runs."""

from __future__ import annotations

from typing import NamedTuple

from pdmesh.model.output_fields import CRACKED
from pdpost.measures.cracks import find_crack_events
from pdpost.measures.paths import Polyline, crack_paths, mean_and_hausdorff_distance
from pdpost.measures.plate_geometry import expect_same_plate
from pdsolve.results import Results


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
    threshold: float = CRACKED,
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
