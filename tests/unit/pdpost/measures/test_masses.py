"""The balance of what a run of diffusion has, lets through and is supplied with."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from pdpost.measures.masses import Masses, masses, unit

COLUMNS = [name for name in Masses._fields if name not in ("left", "error")]


def test_the_balance_counts_what_came_in_and_what_went_out() -> None:
    """Of 4 mol, 3 go and 1 is supplied: 2 mol are left where all is well, and 1 of 4 is missing where there is 1."""
    table = np.zeros(3, dtype=[(name, np.float64) for name in COLUMNS])
    table["inside"], table["through"], table["supplied"] = (4, 2, 1), (0, 3, 3), (0, 1, 1)
    found = masses(SimpleNamespace(name="some.sqlite", masses=lambda: table))  # type: ignore[arg-type]
    assert found.error == pytest.approx([0, 0, -0.25])


@pytest.mark.parametrize(("stored", "said"), [(["ux", "T"], "K m^2"), (["c", "h"], "mol")])
def test_the_books_of_heat_are_in_units_of_heat(stored: list[str], said: str) -> None:
    results = SimpleNamespace(dimension=2, frames=lambda: (np.array([0]), np.array([0.0])), stored=lambda step: stored)
    assert unit(results) == said  # type: ignore[arg-type]
