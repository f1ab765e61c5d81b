"""The adaptive Duran plate: cells of 2 mm that split once follow the uniform plate of 1 mm for less than half its cost.

A crack that branches is known no better than runs that differ by the time step alone differ from each other, so that
medians of three are compared. docs/verification/adaptivity.md has more thresholds and intervals.
"""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from benchmarks.split import COARSE, Way, plate, solved
from pdsolve.model import ModelWarning
from pdsolve.run.simulation import Options, simulate

STEPS = (25e-9, 24.5e-9, 24e-9)  # s


@pytest.mark.slow
def test_a_branching_crack_is_followed() -> None:
    """Start, branch, tip, cost; no bond between coarse nodes breaks."""
    warnings.simplefilter("ignore", ModelWarning)
    fine, split = (np.array([solved(way, dt) for dt in STEPS]) for way in (Way(COARSE / 2), Way(COARSE, 0.3)))
    (start, branch, place, tip), (own, forked, at, ends) = (np.median(one[:, :4], axis=0) for one in (fine, split))
    assert abs(own - start) <= 0.5  # us; measured 9.6 and 9.75
    assert abs(forked - branch) <= 2.0  # us; 26.2 and 26.7
    assert abs(at - place) <= 4.0  # mm; 72 and 72
    assert abs(ends - tip) <= 2.0  # mm, at 30 us; 75.5 and 74.5
    assert (split[:, 4] <= 0.55 * fine[:, 4]).all()  # 0.34
    assert not split[:, 5].any()  # broken bonds between two coarse nodes
    assert np.abs(split[:, 7]).max() < 1e-4  # of the energy; 1e-5


@pytest.mark.slow
def test_above_the_thesis_share_the_branch_is_lost_in_its_mode() -> None:
    """60 % refines too narrow a strip for the thesis's bonds, 30 % does not; the uniform plate branches at 29.5 us."""
    warnings.simplefilter("ignore", ModelWarning)
    wide, narrow = ([solved(Way(COARSE, share, mode="thesis"), dt) for dt in STEPS] for share in (0.3, 0.6))
    assert np.isnan([one.branch for one in narrow]).all()
    assert np.mean([one.branch for one in wide]) == pytest.approx(29.5, abs=2.0)  # us; measured 31.0, 26.5, 27.4
    assert np.mean([one.place for one in wide]) == pytest.approx(72.0, abs=4.0)  # mm; 74 to 76


@pytest.mark.slow
def test_what_splits_is_mirrored() -> None:
    """Places of all nodes at each change, to the bit; areas to round-off."""
    warnings.simplefilter("ignore", ModelWarning)
    with simulate(plate(Way(COARSE, 0.3), 25e-9), options=Options(threads=1)) as results:
        epochs = results.epochs()
        assert len(epochs) > 20
        for step in epochs.tolist():
            nodes = results.nodes(step)
            assert nodes.area.sum() == pytest.approx(4080e-6, rel=1e-12)
            places = set(map(tuple, (nodes.position / 1e-9).round().astype(int).tolist()))
            assert places == {(x, -y) for x, y in places}
