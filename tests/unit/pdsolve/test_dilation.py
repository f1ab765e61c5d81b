"""Dilations of masks beside SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from pdsolve.numerics.dilation import in_disc, in_square


@pytest.mark.parametrize("size", [(1, 1), (3, 40), (31, 17)])
@pytest.mark.parametrize("reach", [0, 1, 2, 5, 16, 50])
def test_places_near_marked_ones_are_those_of_scipy(size: tuple[int, int], reach: int) -> None:
    marked = np.random.default_rng(reach).random(size) < 0.02
    marked[0, 0] = True
    square = ndimage.maximum_filter(marked.astype(np.uint8), 2 * reach + 1, mode="constant") > 0
    assert np.array_equal(in_square(marked, reach), square)
    for radius in (reach, reach + 0.5):
        disc = ndimage.distance_transform_edt(~marked) <= radius
        assert np.array_equal(in_disc(marked, radius), disc)


def test_nothing_is_near_nothing() -> None:
    assert not in_square(np.zeros((4, 5), dtype=bool), 3).any()
    assert not in_disc(np.zeros((4, 5), dtype=bool), 3.5).any()
