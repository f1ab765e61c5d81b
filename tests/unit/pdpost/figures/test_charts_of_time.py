"""Curves between frames: J under a load that grows in proportion is drawn as its square."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pdpost.figures.sif_figure import BETWEEN, _squares
from pdpost.reading.studies import label
from pdsolve.study.table import Row


def test_J_of_a_linear_load_is_a_parabola_between_few_frames() -> None:
    time = np.array([0.0, 1.0, 3.0])
    at, (low, value) = _squares(time, [4 * time**2, 5 * time**2])
    assert low == pytest.approx(4 * at**2, rel=1e-12, abs=1e-12)
    assert len(at) == 2 * BETWEEN + 1
    assert value == pytest.approx(5 * at**2, rel=1e-12, abs=1e-12)
    assert set(time) <= set(at)


def test_J_of_one_load_step_is_a_parabola_too() -> None:
    at, (value,) = _squares(np.array([0.0, 1.0]), [np.array([0.0, 6.0])])
    assert value == pytest.approx(6 * at**2, rel=1e-12, abs=1e-12)
    assert len(at) == BETWEEN + 1


def test_values_below_0_are_left_as_they_are() -> None:
    time, value = np.arange(4.0), np.array([0.0, -1.0, 2.0, 3.0])
    at, same = _squares(time, [value])
    assert at is time
    assert same[0] is value


def test_numbers_of_a_legend_have_their_units() -> None:
    run = Row(1, "", "finished", None, Path(), 0, {"material.G0": 204.0, "run.adapt": "hybrid"})
    assert label(run, ["material.G0", "run.adapt"], {"material.G0": "J/m^2"}) == "G0 204 J/m^2, adapt hybrid"
