"""Comparison of the cracks of two runs."""

from __future__ import annotations

from typing import NamedTuple

from pdmesh.model.output_fields import CRACKED
from pdpost.measures.cracks import Event, growth
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
    one: Results,
    other: Results,
    steps: tuple[int, int],
    direction: tuple[float, float] = (1.0, 0.0),
    threshold: float = CRACKED,
) -> Comparison:
    """Compare the paths of two runs after their `steps`, and when their cracks started, branched and split the plate.

    Raises ResultsError if the plates differ.
    """
    check_alike(other, one)
    paths = path(one, steps[0], threshold), path(other, steps[1], threshold)
    apart = distance(*paths) if all(paths) else (None, None)
    here, there = (
        growth(results, direction, threshold, step) for results, step in zip((one, other), steps, strict=True)
    )
    later = (
        _later(mine, its)
        for mine, its in ((here.start, there.start), (here.branching, there.branching), (here.split, there.split))
    )
    return Comparison(paths, *apart, *later)


def _later(one: Event | None, other: Event | None) -> float | None:
    return None if one is None or other is None else other.time - one.time
