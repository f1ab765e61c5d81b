"""The balance of what a run of diffusion has, lets through and is supplied with."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from diffusion_models import grid, row

from pdmesh.model.document import Horizon, Run, Settings, Source
from pdmesh.model.medium import Medium
from pdpost.__main__ import main as pdpost
from pdpost.figures import charts, page
from pdpost.reading.tables import tables
from pdsolve.measures.balance import mass_balance, mass_balance_with_unit
from pdsolve.model import Model
from pdsolve.results import Results
from pdsolve.run.simulation import Options, simulate

COLUMNS = ("step", "time", "inside", "through", "supplied", "solid", "dissolved", "surface")  # of the table of masses


def test_the_balance_counts_what_came_in_and_what_went_out() -> None:
    """Of 4 mol, 3 go and 1 is supplied: 2 mol are left where all is well, and 1 of 4 is missing where there is 1."""
    table = np.zeros(3, dtype=[(name, np.float64) for name in COLUMNS])
    table["inside"], table["through"], table["supplied"] = (4, 2, 1), (0, 3, 3), (0, 1, 1)
    found = mass_balance(SimpleNamespace(name="some.sqlite", masses=lambda: table))  # type: ignore[arg-type]
    assert found.error == pytest.approx([0, 0, -0.25])


def test_charts_and_pages_have_a_word_for_the_sign() -> None:
    """3 mol came in and 1 was withdrawn: no negative amount went out."""
    table = np.zeros(2, dtype=[(name, np.float64) for name in COLUMNS])
    table["inside"], table["through"], table["supplied"], table["time"] = (4, 6), (0, -3), (0, -1), (0, 1)
    results: Any = SimpleNamespace(
        name="some.sqlite", masses=lambda: table, model=lambda: '{"medium": {"D": 1.0}}', decoded={}, dimension=2
    )
    axes = charts.masses(mass_balance(results)).axes[0]
    drawn = {line.get_label(): line.get_ydata()[-1] for line in axes.get_lines()}
    assert drawn == {"inside": 6, "come in": 3, "withdrawn": 1}
    rows, _ = page._masses(results)
    for word, amount in (("inside", 6), ("come in", 3), ("withdrawn", 1)):
        assert f"<th>{word}</th><td>{amount} mol</td>" in rows


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(
    ("medium", "factor", "unit"),
    [
        (Medium(D=1.0), 1.0, "mol"),
        (Medium(D=1.0, carries="heat"), 1.0, "K m^2"),
        (Medium(D=1.0, carries="heat", heat_capacity=2e6), 2e6, "J/m"),
    ],
)
def test_amounts_are_in_what_the_medium_carries(
    medium: Medium, factor: float, unit: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A row of 8 cells of 1 m^2 that is supplied with 3 a second for 2 s: numbers, table, picture and summary."""
    path, conditions = tmp_path / "row.sqlite", (Source(nodes=tuple(range(1, 9)), rate=3.0),)
    settings = Settings(
        physics="diffusion", medium=medium, horizon=Horizon(3.0), conditions=conditions,
        run=Run(steps=20, every=20, time_step=0.1),
    )  # fmt: skip
    simulate(Model(grid(row(8, 1.0), 1.0), settings), path, Options(threads=1)).close()
    with Results.open(path) as results:
        books, found = mass_balance_with_unit(results)
        raw = mass_balance(results)
        assert results.summary()["amounts"]["unit"] == unit
        assert results.summary()["amounts"]["supplied"] == pytest.approx(48.0 * factor)
        named = {name: unit for table in tables(results) if table.name == "mass" for name, unit in table.columns}
    assert found == unit
    assert (raw.supplied[-1], books.supplied[-1]) == (pytest.approx(48.0), pytest.approx(48.0 * factor))
    assert named["inside"] == ("mol" if unit == "mol" else "K m^2")
    assert pdpost(["history", str(path), "-o", str(tmp_path / "row.png")]) == 0
    said = capsys.readouterr().out
    assert f", {unit}: inside" in said
    assert ("mol" in said) == (unit == "mol")
