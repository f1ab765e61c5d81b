"""Sums of pieces are NumPy's sums of the whole, bit by bit."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from pdsolve.numerics.ordered_sums import branches, total


@pytest.mark.parametrize("count", [0, 1, 7, 128, 129, 1000, 4097, 100_003])
@pytest.mark.parametrize("pieces", [1, 2, 3, 7])
def test_sums_of_pieces_are_those_of_the_whole(count: int, pieces: int) -> None:
    numbers = np.random.default_rng(count)
    values = numbers.normal(size=count) * 10 ** numbers.uniform(-8, 8, count)
    cuts = [0, *np.sort(numbers.integers(0, count + 1, pieces - 1)).tolist(), count]
    parts = [branches(values[first:last], first, count) for first, last in pairwise(cuts)]
    assert total(parts, count) == np.sum(values)


def test_another_order_would_be_another_sum() -> None:
    numbers = np.random.default_rng(1)
    values = numbers.normal(size=1000) * 10 ** numbers.uniform(-8, 8, 1000)
    assert sum(values.tolist()) != np.sum(values)


def test_a_rank_says_a_few_numbers_of_many() -> None:
    found = branches(np.ones(50_000), 17, 100_003)
    assert len(found.sums) + sum(map(len, found.cut.values())) < 2 * 128 + 2 * 20
