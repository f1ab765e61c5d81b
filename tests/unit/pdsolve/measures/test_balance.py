"""The ledger as curves, the reactions by name, and how they are drawn."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from messages import naming
from plates import plate, square_grid

from pdmesh.model.document import InitialVelocity, Load, Run, Velocity
from pdpost.figures import charts
from pdsolve.measures.balance import energy_balance
from pdsolve.measures.forces import read_condition_force_histories, select_condition_force_histories
from pdsolve.results import Results, ResultsError
from pdsolve.run.simulation import simulate


def test_the_last_error_is_the_solvers_own(small_results: Path) -> None:
    """Work only grows here, so that the most put in is the last; total is all that is there."""
    with Results.open(small_results) as results:
        books, summary = energy_balance(results), results.summary()
    assert books.error[-1] == pytest.approx(summary["balance"], rel=1e-12)
    assert books.total[-1] - books.work[-1] == pytest.approx(books.error[-1] * books.work.max(), rel=1e-9)
    assert books.dissipated[-1] > 0


def test_energy_at_the_start_counts_as_put_in() -> None:
    """Two thirds of a plate at 2 m/s: rho / 2 * area * 4."""
    model = plate(
        square_grid(9, 5), conditions=(InitialVelocity(box=(0, 0, 5e-3, 1), x=2.0),), run=Run(time_step=1e-8, steps=50)
    )
    with simulate(model) as results:
        books = energy_balance(results)
    assert books.work == pytest.approx(2235 / 2 * 30e-6 * 4)
    assert np.abs(books.error).max() < 1e-3  # measured 6e-5
    assert books.strain[-1] > 0


def test_reactions_have_the_names_of_their_conditions() -> None:
    left, right = (0.0, 0.0, 0.0, 1.0), (8e-3, 0.0, 8e-3, 1.0)
    model = plate(
        square_grid(9, 5),
        conditions=(
            InitialVelocity(box=left, x=1.0),
            Load(name="pull", box=right, body_force=(1e9, 5e9)),
            Velocity(box=left, x=0.1),
        ),
        run=Run(time_step=1e-8, steps=20, every=10),
    )
    with simulate(model) as results:
        found = read_condition_force_histories(results)
    assert [(one.number, one.name, one.kind, one.main_axis) for one in found] == [
        (1, "pull", "load", 1),
        (2, "condition 2", "velocity", 0),
    ]
    assert found[0].force[-1] == pytest.approx([1e9 * 5e-6, 5e9 * 5e-6])
    assert [one.number for one in select_condition_force_histories(found, ["2", "pull"])] == [2, 1]
    assert select_condition_force_histories(found, []) == found
    with pytest.raises(ResultsError, match=naming(found="condition 'push'", expected=("1 (pull)", "2 (condition 2)"))):
        select_condition_force_histories(found, ["push"])
    figure = charts.reactions(found)
    over_time, over_way = figure.axes
    assert over_time.get_ylabel() == "force on the plate, kN/m"
    assert over_time.lines[0].get_ydata()[-1] == pytest.approx(25.0)
    assert over_way.get_xlabel() == "mean displacement, nm"


def test_the_figure_of_the_balance(small_results: Path) -> None:
    """Handy units, the same colours each time; what was put in lies over the total."""
    with Results.open(small_results) as results:
        books = energy_balance(results)
    above, below = charts.balance(books).axes
    labels = [line.get_label() for line in above.lines]
    assert labels == ["kinetic", "strain", "dissipated", "total", "put in"]
    assert below.get_xlabel() == "time, µs"
    scale = above.lines[0].get_ydata()[-1] / books.kinetic[-1]
    assert np.log10(scale) == pytest.approx(round(np.log10(scale)), abs=1e-9)
    assert 1 <= books.work[-1] * scale < 1000


def test_curves_are_told_apart_without_colours_too() -> None:
    looks = [tuple(charts.look(number).values()) for number in range(20)]
    assert len(set(looks)) == 20
    assert len(set(charts.COLOURS)) == 7
