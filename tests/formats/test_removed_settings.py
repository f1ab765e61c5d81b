"""Settings that this version no longer has: files of older versions name the last one that had them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from tampered_databases import tampered

from pdmesh.model.document import Hybrid, write_file
from pdmesh.model.node_grid import document_of
from pdpost.__main__ import main as pdpost
from pdsolve.__main__ import main as pdsolve
from pdsolve.measures.embedded_model import model_text, run_of
from pdsolve.model import Model
from pdsolve.results import Results

LINE = "$.run.hybrid.wake was removed (version 1.0.0 was the last that had it); leave it out"


@pytest.fixture
def plate_file(small_plate: Model, tmp_path: Path) -> Path:
    """The small plate's grid file."""
    path = tmp_path / "plate.json"
    write_file(document_of(small_plate.grid, small_plate.settings), path)
    return path


def with_wake(text: str) -> str:
    """The text of a model with `run.hybrid.wake`, as version 1.0.0 wrote it."""
    model = json.loads(text)
    model["run"]["adapt"], model["run"]["hybrid"] = "hybrid", {"kappa": 0.5, "wake": "lattice"}
    return json.dumps(model)


@pytest.mark.filterwarnings("ignore:.*digest")
def test_a_grid_file_that_names_one_is_refused(plate_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In one line, and nothing is written."""
    plate_file.write_text(with_wake(plate_file.read_text()))
    assert pdsolve([str(plate_file)]) == 2
    assert capsys.readouterr().err == f"pdsolve: {plate_file}: {LINE}\n"
    assert [path.name for path in plate_file.parent.iterdir()] == ["plate.json"]


def test_settings_laid_over_a_file_are_refused(plate_file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Given on the command line and in a TOML file."""
    assert pdsolve([str(plate_file), "--set", "run.hybrid.wake=fine"]) == 2
    assert capsys.readouterr().err == f"pdsolve: {plate_file} with run.hybrid.wake=fine: {LINE}\n"
    settings = plate_file.with_name("run.toml")
    settings.write_text('run.hybrid.wake = "lattice"\n')
    assert pdsolve([str(plate_file), "--settings", str(settings)]) == 2
    assert capsys.readouterr().err == f"pdsolve: {plate_file} + {settings}: {LINE}\n"


def test_a_database_that_names_one_is_read_and_not_resumed(
    small_results: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`pdpost` leaves the setting out; resuming says what solving says."""
    with Results.open(small_results) as results:
        text = results.model()
    with tampered(small_results) as connection:
        connection.execute("UPDATE meta SET value = ? WHERE key = 'model'", (with_wake(text),))
        connection.execute("UPDATE meta SET value = 'interrupted' WHERE key = 'status'")
    with Results.open(small_results) as results:
        assert run_of(results).hybrid == Hybrid(kappa=0.5)
        assert json.loads(model_text(results))["run"]["hybrid"] == {"kappa": 0.5}
    assert pdpost(["history", str(small_results), "--csv", str(small_results.with_suffix(".csv"))]) == 0
    capsys.readouterr()
    assert pdsolve(["--resume", str(small_results)]) == 2
    assert capsys.readouterr().err == f"pdsolve: {small_results}: {LINE}\n"
