"""Amounts of a substance or of heat in words."""

from __future__ import annotations

import pytest

from pdmesh.model.amounts import amounts_line


@pytest.mark.parametrize(
    ("through", "supplied", "words"),
    [
        (0.00078, 2.0, "gone out 0.00078, supplied 2"),
        (-0.00078, -2.0, "come in 0.00078, withdrawn 2"),
        (-0.0, 0.0, "gone out 0, supplied 0"),
    ],
)
def test_each_amount_has_a_word_for_its_sign(through: float, supplied: float, words: str) -> None:
    line = amounts_line("J/m", 1.5, through, supplied, 1e-12)
    assert line == f"J/m: inside 1.5, {words} (balance +1.0e-12)"
