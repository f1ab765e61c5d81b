"""A field along a line against fields that are known everywhere."""

from __future__ import annotations

import numpy as np
import pytest
from messages import naming
from prescribed_results import plate, results_of

from pdsolve.measures.lines import sample_field_along_line
from pdsolve.results import ResultsError

H = np.array([[3e-3, -1e-3], [4e-3, 2e-3]])


@pytest.mark.parametrize("jitter", [0.0, 0.3])
def test_a_linear_field_is_itself_between_nodes(jitter: float) -> None:
    nodes, families = plate(jitter=jitter)
    results = results_of(nodes, families, nodes.position @ H.T, [])
    found = sample_field_along_line(results, "displacement", 10, (0.7e-3, 1.1e-3), (10.9e-3, 9.3e-3))
    for part, row in (("x", 0), ("y", 1)):
        assert (
            np.abs(found.component_values[part] - found.points @ H[row]).max() < 1e-11
        )  # stored in single precision; 1.4e-12
    assert found.distance_from_start[-1] == pytest.approx(np.hypot(10.2e-3, 8.2e-3))
    assert len(found.distance_from_start) == 28  # two for each of 13.1 spacings


def test_a_crack_is_a_jump() -> None:
    """Halves that move apart, the bonds between them broken: no value is between, and half of a spacing at most off."""
    nodes, families = plate()
    upper = nodes.position[:, 1] > 5.5e-3
    u = np.where(upper, 1e-4, -1e-4)[:, None] * np.array([0.0, 1.0])
    own = np.repeat(np.arange(169), np.diff(families.start))
    between = upper[own] != upper[families.neighbour]
    ends = zip(nodes.ids[own[between]], nodes.ids[families.neighbour[between]], strict=True)
    pairs = [(5, int(i), int(j)) for i, j in ends]
    whole, torn = (
        sample_field_along_line(
            results_of(nodes, families, u, gone), "displacement", 10, (6.3e-3, 0.0), (6.3e-3, 12e-3)
        )
        for gone in ([], pairs)
    )
    assert np.abs(np.abs(whole.component_values["y"]) - 1e-4).max() == pytest.approx(1e-4, rel=1e-6)  # 0 in the middle
    assert np.abs(np.abs(torn.component_values["y"]) - 1e-4).max() < 1e-11
    middle = torn.points[:, 1] != 5.5e-3  # as near to one side as to the other
    assert np.array_equal((torn.component_values["y"] > 0)[middle], (torn.points[:, 1] > 5.5e-3)[middle])


def test_off_the_plate_there_is_nothing() -> None:
    nodes, families = plate()
    results = results_of(nodes, families, nodes.position @ H.T, [])
    found = sample_field_along_line(results, "displacement", 10, (-5e-3, 6e-3), (6e-3, 6e-3))
    there = np.isfinite(found.component_values["x"])
    assert np.array_equal(there, found.points[:, 0] >= -0.5e-3 - 1e-9)
    assert found.component_values["x"][there][0] == pytest.approx(float(H[0] @ [0, 6e-3]))  # as the nearest node has it
    with pytest.raises(ResultsError, match=naming(found=("1,1", "2,2"))):
        sample_field_along_line(results, "displacement", 10, (1.0, 1.0), (2.0, 2.0))
    with pytest.raises(ResultsError, match=naming(found="1,1", expected="place")):
        sample_field_along_line(results, "displacement", 10, (1.0, 1.0), (1.0, 1.0))


def test_what_says_nothing_is_left_out() -> None:
    """Of strain, nodes that have lost more than 0.35 of their bonds, and what is nearest to them."""
    nodes, families = plate()
    middle = 84
    lost = families.neighbour[families.start[middle] : families.start[middle + 1]][:14]
    pairs = [(1, *map(int, nodes.ids[[i, j]])) for near in lost for i, j in ((middle, near), (near, middle))]
    found = sample_field_along_line(
        results_of(nodes, families, nodes.position @ H.T, pairs), "strain", 10, (0.0, 6e-3), (12e-3, 6e-3)
    )
    gone = np.isnan(found.component_values["xx"])
    assert gone.any()
    assert np.abs(found.points[gone, 0] - 6e-3).max() < 0.6e-3
