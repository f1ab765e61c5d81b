"""Comparison of the cracks of two runs."""

from __future__ import annotations

from typing import NamedTuple

from pdmesh.model.output_fields import CRACKED
from pdpost.measures.cracks import growth
from pdpost.measures.paths import Polyline, distance, path
from pdpost.measures.plate_geometry import check_alike
from pdsolve.results import Results


class Comparison(NamedTuple):
    """Distances of two runs' cracks; None where one run has none.

    Differences are the other's value minus the first's.
    """

    paths: tuple[list[Polyline], list[Polyline]]
    mean: float | None  # m, symmetric, see `paths.distance`
    hausdorff: float | None  # m
    start: float | None  # s
    branching: float | None  # s
    split: float | None  # s


def compare(
    first_run: Results,
    second_run: Results,
    steps: tuple[int, int],
    direction: tuple[float, float] = (1.0, 0.0),
    threshold: float = CRACKED,
) -> Comparison:
    """Compare the paths of two runs after their `steps`, and when their cracks started, branched and split the plate.

    Raises ResultsError if the plates differ.
    """
    check_alike(second_run, first_run)
    paths = path(first_run, steps[0], threshold), path(second_run, steps[1], threshold)
    apart = distance(*paths) if all(paths) else (None, None)
    first_growth, second_growth = (
        growth(results, direction, threshold, step)
        for results, step in zip((first_run, second_run), steps, strict=True)
    )
    events = (
        (first_growth.start, second_growth.start),
        (first_growth.branching, second_growth.branching),
        (first_growth.split, second_growth.split),
    )
    later = (None if first is None or second is None else second.time - first.time for first, second in events)
    return Comparison(paths, *apart, *later)
