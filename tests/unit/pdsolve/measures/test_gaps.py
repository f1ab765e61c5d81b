"""The opening between two places, and the force against it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from messages import naming
from plates import plate, square_grid

from pdmesh.model.document import Displacement, Run, Static
from pdpost.__main__ import main
from pdsolve.measures.forces import force_over_gap_opening, measure_gap_between_places, read_condition_force_histories
from pdsolve.results import Results, ResultsError
from pdsolve.run.simulation import Options, simulate


@pytest.fixture(scope="module")
def stretched(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A strip drawn out evenly, in five load steps."""
    path = tmp_path_factory.mktemp("stretched") / "stretched.sqlite"
    profile = ((0.0, 0.0), (1.0, 1.0))
    ends = tuple(
        Displacement(name=name, box=(x - 1e-4, -1.0, x + 1e-4, 1.0), x=u, y=0.0, profile=profile)
        for name, x, u in (("left", 0.0, -1e-6), ("right", 20e-3, 1e-6))
    )
    run = Run(solver="static", static=Static(load_steps=5))
    simulate(plate(square_grid(21, 9), 3, conditions=ends, run=run), path, Options(threads=1)).close()
    return path


def test_force_against_opening(stretched: Path) -> None:
    with Results.open(stretched) as results:
        _, right = read_condition_force_histories(results)
        found = measure_gap_between_places(results, (0.0, 0.0), (20e-3, 0.0))
        assert found.opening == pytest.approx(2e-6 * np.arange(6) / 5, rel=1e-5, abs=1e-15)
        across = measure_gap_between_places(results, (10e-3, 0.0), (10e-3, 8e-3))
        assert across.opening[-1] < -1e-8  # it becomes narrower
        pulled = force_over_gap_opening(found, right, 0)
        assert pulled.force == pytest.approx(pulled.opening * pulled.force[-1] / 2e-6, rel=1e-4)
        assert pulled.peak_force_index == 5
        assert pulled.work_under_curve == pytest.approx(pulled.force[-1] * 1e-6, rel=1e-4)  # a triangle
        smooth = force_over_gap_opening(found, right, 0, 3)
        assert smooth.force == pytest.approx(pulled.force[1:-1], rel=1e-4)
        with pytest.raises(ResultsError, match=naming(found="6 times", expected="7")):
            force_over_gap_opening(found, right, 0, 7)
        with pytest.raises(ResultsError, match=naming(found=("node 1", "both"))):
            measure_gap_between_places(results, (0.0, 0.0), (1e-4, 0.0))


@pytest.mark.slow
def test_the_command(stretched: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    picture, table = tmp_path / "gap.png", tmp_path / "gap.csv"
    words = ["reaction", str(stretched), "--gap", "0,0", "0.02,0", "--condition", "right"]
    assert main([*words, "-o", str(picture), "--csv", str(table)]) == 0
    assert "between nodes 1 and 21" in capsys.readouterr().out
    assert picture.stat().st_size > 1000
    assert len(table.read_text().splitlines()) == 7
    assert main([*words, "--smooth", "0"]) == 2
    assert main(["reaction", str(stretched), "--smooth", "2"]) == 2
    assert main(["reaction", str(stretched), "--gap", "0,0", "1,1"]) == 2
