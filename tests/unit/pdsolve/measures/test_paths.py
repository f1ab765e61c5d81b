"""Where lines run, and how far they are apart, known by geometry."""

from __future__ import annotations

import numpy as np
import pytest
from damaged_results import lattice, run
from messages import naming

from pdsolve.measures.paths import PathError, crack_paths, main_growth_direction_name, mean_and_hausdorff_distance


def test_a_path_is_where_the_tips_were() -> None:
    (line,) = crack_paths(run(lattice(), [(x, x, 0) for x in range(5, 18)]), 100)
    assert line[[0, -1]] == pytest.approx(np.array([[4.5e-3, 0.0], [17e-3, 0.0]]), abs=1e-15)


@pytest.mark.parametrize(
    ("lines", "way"),
    [
        ([], "right"),
        ([[[0, 0], [1, 9]]], "up"),
        ([[[0, 0], [0, 9]], [[0, 0], [0, -9.5]]], "up"),  # alike: the first of right, left, up, down
        ([[[0, 0], [0, 9]], [[0, 0], [0, -10.5]]], "down"),
        ([[[0, 0], [-9, 0]], *[[[0, 0], [3, 0]]] * 9], "left"),  # crumbs do not count
    ],
)
def test_where_a_crack_runs(lines: list, way: str) -> None:
    assert main_growth_direction_name([np.array(line, dtype=float) for line in lines]) == way


LINE = np.array([[0.0, 0.0], [10.0, 0.0]])


@pytest.mark.parametrize(
    ("other", "mean", "hausdorff"),
    [
        ([LINE], 0.0, 0.0),
        ([LINE[::-1] + np.array([0, 3.0])], 3.0, 3.0),  # parallel
        ([np.array([[0.0, 0.0], [3.0, 0.0], [10.0, 0.0]])], 0.0, 0.0),  # other corners
        ([LINE[:, ::-1]], 5.0, 10.0),  # at right angles: the mean of 0 to 10, and the far ends
        ([np.array([[0.0, 0.0], [5.0, 0.0]])], 0.625, 5.0),  # half: (5 / 2 * 1 / 2 + 0) / 2
        (
            [LINE[:1] + np.array([0, 4.0])],
            (4 + np.mean(np.hypot(np.linspace(0, 10, 100001), 4))) / 2,
            np.hypot(10, 4),
        ),  # a point
        ([LINE + np.array([0, 1.0]), LINE + np.array([0, -2.0])], 1.25, 2.0),  # two lines: 1 there, (1 + 2) / 2 back
    ],
)
def test_distances_of_lines(other: list[np.ndarray], mean: float, hausdorff: float) -> None:
    assert mean_and_hausdorff_distance([LINE], other) == pytest.approx((mean, hausdorff), rel=1e-6, abs=1e-12)
    assert mean_and_hausdorff_distance(other, [LINE]) == pytest.approx((mean, hausdorff), rel=1e-6, abs=1e-12)


def test_no_line_has_no_distance() -> None:
    with pytest.raises(PathError, match=naming(found="path")):
        mean_and_hausdorff_distance([], [LINE])
