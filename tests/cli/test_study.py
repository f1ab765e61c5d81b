"""A study from its TOML to its figures: solved once by two processes, gone on with, looked at from all sides."""

from __future__ import annotations

import csv
import json
import re
import shutil
import sqlite3
import sys
from collections.abc import Callable
from contextlib import closing, nullcontext
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import Mock

import numpy as np
import pytest
from messages import mentions, naming
from plates import plate, square_grid

from pdmesh.__main__ import main as pdmesh
from pdmesh.model.document import Load, Run, write_file
from pdmesh.model.node_grid import document_of
from pdpost.__main__ import main as pdpost
from pdpost.figures.study_figure import study
from pdpost.reading.scatter import choose_measures_and_parameter
from pdpost.reading.studies import Read
from pdsolve.__main__ import main
from pdsolve.measures.forces import read_condition_force_histories
from pdsolve.model import ModelError
from pdsolve.results import Results, ResultsError, writing_to
from pdsolve.study import dispatch, one_run, workers
from pdsolve.study.description import Case, read_study
from pdsolve.study.one_run import Outcome, Task
from pdsolve.study.run_model import model_of_run
from pdsolve.study.table import Column, Row, Table

STUDY = """
drawing = "plate.json"
set.model.run.every = 100
[vary.model]
"material.G0" = [204, 100]
"horizon.ratio" = [3, 1]
[repeat]
times = 2
step = 0.1
"""


def small(folder: Path) -> None:
    """A cracked plate of 21 x 12 nodes that is torn apart, as a grid file."""
    import dataclasses

    import numpy as np

    grid = dataclasses.replace(square_grid(21, 12, y0=-5.5e-3), cracks=np.array([[0.0, 0.0, 8e-3, 0.0]]))
    pulls = (
        Load(box=(0.0, s * 5.2e-3 - 0.8e-3, 20e-3, s * 5.2e-3 + 0.8e-3), body_force=(0.0, s * 6e10)) for s in (1, -1)
    )
    model = plate(grid, conditions=tuple(pulls), run=Run(time_step=50e-9, steps=100))
    write_file(document_of(model.grid, model.settings), folder / "plate.json")


@pytest.fixture(scope="module")
def once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a study of eight runs, half of which cannot be solved, solved in this process."""
    folder = tmp_path_factory.mktemp("study")
    small(folder)
    (folder / "study.toml").write_text(STUDY)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dispatch, "task_solver", by(in_this_process))
        assert main(["study", str(folder / "study.toml"), "-o", str(folder / "study.sqlite"), "-q"]) == 1  # some failed
    return folder


@pytest.fixture
def solved(once: Path, here: Path) -> Path:
    """That folder, as the current one."""
    shutil.copytree(once, here, dirs_exist_ok=True)
    return here


def by(solve: Callable[[list[Task]], list[Outcome]]) -> Callable[[dispatch.StudyWorkers], Any]:
    """What replaces the solver of tasks by a function."""
    return lambda workers: nullcontext(solve)


def in_this_process(tasks: list[Task]) -> list[Outcome]:
    """What workers would say of these tasks."""
    return [one_run.solve_and_measure(task) for task in tasks]


def rows(folder: Path) -> list[sqlite3.Row]:
    connection = sqlite3.connect(folder / "study.sqlite")
    connection.row_factory = sqlite3.Row
    found = list(connection.execute("SELECT * FROM run ORDER BY number"))
    connection.close()
    return found


def edit(*statements: str) -> None:
    """Change the table as one of an older version, which has no checksums."""
    with closing(sqlite3.connect("study.sqlite")) as connection, connection:
        for statement in ("DROP TABLE IF EXISTS checksum", *statements):
            connection.execute(statement)


@pytest.mark.slow
def test_a_table_is_read_without_a_page(solved: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Its view and its CSV have heads that say what a column is, with the unit."""
    with closing(sqlite3.connect("study.sqlite")) as connection:
        view = connection.execute("SELECT * FROM run_in_words ORDER BY number")
        heads, shown = [entry[0] for entry in view.description], view.fetchall()
    assert pdpost(["study", "study.sqlite", "--runs", "runs.csv", "-q"]) == 0
    with Path("runs.csv").open(newline="") as file:
        head, *lines = csv.reader(file)
    assert head == heads
    assert "first_break: when the first bond broke (s)" in head
    assert any(name.startswith("material.G0") and name.endswith("(J/m^2)") for name in head)
    at = head.index("nodes: nodes")
    assert [line[at] for line in lines] == ["252" if row["nodes"] else "" for row in rows(solved)]
    assert [row[at] for row in shown] == [row["nodes"] for row in rows(solved)]


@pytest.mark.slow
def test_the_price_is_printed_before_the_runs(
    solved: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of what is still to be solved: nothing, after all runs are finished."""
    monkeypatch.setattr(dispatch, "task_solver", by(in_this_process))
    Path("study.toml").write_text(STUDY.replace('"horizon.ratio" = [3, 1]', '"horizon.ratio" = [3]'))
    assert main(["study", "study.toml", "--workers", "2"]) == 0
    assert "to solve" not in capsys.readouterr().err
    assert main(["study", "study.toml", "--workers", "2", "-o", "new.sqlite"]) == 0
    first, *_ = capsys.readouterr().err.splitlines()
    assert mentions(first, "4 runs to solve", "2 processes", "core hours", "MB")


@pytest.mark.slow
def test_each_run_has_a_row_and_failures_are_kept_and_listed(
    solved: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Solved by two processes."""
    assert main(["study", "study.toml", "--workers", "2", "--force", "-q"]) == 1
    capsys.readouterr()
    found = rows(solved)
    assert [row["status"] for row in found] == ["finished", "finished", "failed", "failed"] * 2
    assert [row["material.G0"] for row in found] == [204] * 4 + [100] * 4
    assert [row["repetition"] for row in found] == [0, 1] * 4
    good = [row for row in found if row["status"] == "finished"]
    assert all(row["nodes"] == 252 and row["broken_bonds"] > 0 and row["dissipated"] > 0 for row in good)
    assert good[0]["time_step"] == 50e-9
    assert 45e-9 <= good[1]["time_step"] < 50e-9
    assert good[2]["first_break"] < good[0]["first_break"]  # of less G0
    monkeypatch.setattr(workers, "_process", None)  # nothing is solved again, nor are those that failed
    assert main(["study", "study.toml"]) == 1
    captured = capsys.readouterr()
    assert mentions(captured.out, "study.sqlite", "8 runs", "4 finished", "4 failed")
    said = captured.err.splitlines()
    assert len(said) == 4
    assert said[0].startswith("pdsolve study: run 3 failed: ")
    assert mentions(said[0], "$.horizon.ratio", found=("1", "conical"))
    assert main(["study", "study.toml", "-q"]) == 1
    assert capsys.readouterr() == ("", captured.err)  # a failure is always said


MEASURES = """
[measures]
peak = {peak_force = "condition 0"}
thick = {peak_force = "condition 0", thickness = 0.02}
up = {displacement_at_peak = "condition 0"}
most = {sql = "SELECT max(strain) FROM history", unit = "J/m"}
K1 = {intensity = "K1"}
"""


@pytest.mark.slow
def test_finished_runs_are_measured_anew_where_a_study_asks_for_more(
    solved: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = {path.name: path.read_bytes() for path in Path("study.runs").iterdir()}
    Path("study.toml").write_text(STUDY + MEASURES)
    monkeypatch.setattr(dispatch, "task_solver", by(in_this_process))
    assert main(["study", "study.toml", "-q"]) == 1  # runs that failed stay failed
    assert {path.name: path.read_bytes() for path in Path("study.runs").iterdir()} == before
    for row in rows(solved):
        if row["status"] == "failed":
            continue
        with Results.open(Path(row["file"])) as results:
            history = results.history()
            (first, _) = read_condition_force_histories(results)
        at = np.abs(first.force[:, 1]).argmax()
        assert (row["peak"], row["up"]) == (first.force[at, 1], first.displacement[at, 1])
        assert row["thick"] == 0.02 * row["peak"]
        assert row["most"] == history["strain"].max()
        assert row["K1"] is None  # cracks are through: no tip has room
    least = MEASURES.replace("max(strain)", "min(strain)")  # another quantity under the same name
    Path("study.toml").write_text(STUDY + least)
    monkeypatch.setattr(dispatch, "task_solver", by(lambda tasks: []))  # stopped before anything is measured
    assert main(["study", "study.toml", "-q"]) == 1
    monkeypatch.setattr(dispatch, "task_solver", by(in_this_process))
    assert main(["study", "study.toml", "-q"]) == 1
    assert [row["most"] for row in rows(solved) if row["status"] == "finished"] == [0.0] * 4


@pytest.mark.parametrize(
    ("measure", "words"),
    [
        ('peak_force = "top"', ("there is no condition 'top'", "condition 0, condition 1")),
        ('sql = "SELECT 1; SELECT 2"', ("one statement", "pdpost sql")),
        ('sql = "SELECT strain FROM nowhere"', ("no such table: nowhere", "pdpost sql")),
    ],
)
def test_a_measure_that_no_run_has_is_refused_before_any_is_solved(
    here: Path, capsys: pytest.CaptureFixture[str], measure: str, words: tuple[str, ...]
) -> None:
    small(here)
    Path("study.toml").write_text(f'drawing = "plate.json"\n[measures]\nmine = {{{measure}}}\n')
    assert main(["study", "study.toml"]) == 2
    said = capsys.readouterr().err
    assert all(word in said for word in ("$.measures.mine", *words)), said
    assert not Path("study.sqlite").exists()


@pytest.mark.slow
def test_it_goes_on_where_it_was_stopped_and_grows(solved: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One run was never begun, one had only just begun, one had ended but nobody had written it down; two are new."""
    before = rows(solved)
    edit("UPDATE run SET status = 'waiting', dissipated = NULL WHERE number IN (1, 2, 5)")
    Path("study.runs/0001.sqlite").unlink()
    Path("study.runs/0002.sqlite").write_bytes(b"")
    Path("study.toml").write_text(STUDY.replace("[204, 100]", "[204, 100, 50]").replace("[3, 1]", "[3]"))
    asked = []

    def here(tasks: list[Task]) -> list[Outcome]:
        asked.extend(task.number for task in tasks)
        return in_this_process(tasks)

    monkeypatch.setattr(dispatch, "task_solver", by(here))
    assert main(["study", "study.toml", "-q"]) == 0
    assert asked == [1, 2, 5, 9, 10]
    after = rows(solved)
    assert [row["dissipated"] for row in after[:8]] == [row["dissipated"] for row in before]
    assert [row["status"] for row in after[8:]] == ["finished"] * 2


@pytest.mark.slow
def test_another_drawing_and_another_file_are_refused(solved: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("plate.json").write_bytes(Path("plate.json").read_bytes().rpartition(b',\n"digest"')[0] + b"\n}\n")
    assert main(["study", "study.toml"]) == 2
    assert mentions(capsys.readouterr().err, "study.sqlite", found=("another", "plate.json"), expected="--force")
    assert main(["study", "study.toml", "-o", "study.runs/0001.sqlite"]) == 2
    assert mentions(capsys.readouterr().err, found=("table", "study"))
    assert main(["study", "study.toml", "-o", "plate.json"]) == 2
    Path("study.sqlite").unlink()
    assert main(["study", "study.toml"]) == 2
    assert mentions(
        capsys.readouterr().err, "study.runs", found=("files of other runs", "plate.json"), expected="move them away"
    )


@pytest.mark.slow
def test_a_damaged_table_is_refused_and_made_anew_from_its_runs(
    solved: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run that the study has no more keeps its number; none is solved again."""
    before, whole = rows(solved), Path("study.sqlite").read_bytes()
    with closing(sqlite3.connect("study.sqlite")) as connection, connection:
        connection.execute("UPDATE run SET dissipated = 2 * dissipated WHERE number = 2")
    for words in (["study", "study.toml"], ["study", "study.toml", "--again"]):
        assert main(words) == 2
        said = capsys.readouterr().err
        assert said.startswith("pdsolve study: study.sqlite: run 2 is damaged; ")
        assert mentions(said, "remove", "study.runs", "anew")
        assert said.count("\n") == 1
    for words in (
        ["study", "study.sqlite"],
        ["crack", "study.sqlite"],
        ["tradeoff", "study.sqlite", "--reference", "a"],
    ):
        assert pdpost(words) == 2
        said = capsys.readouterr().err
        assert mentions(said, "study.sqlite", found="run 2")
        assert said.count("\n") == 1
    Path("study.sqlite").write_bytes(b"x" + whole[1:])
    assert main(["study", "study.toml"]) == 2
    assert mentions(capsys.readouterr().err, "remove", "study.runs")
    Path("study.sqlite").unlink()
    Path("study.toml").write_text(STUDY.replace("[204, 100]", "[100]").replace("[3, 1]", "[3]"))
    began = {path.name: path.stat().st_mtime_ns for path in Path("study.runs").glob("*.sqlite")}
    monkeypatch.setattr(dispatch, "task_solver", by(in_this_process))
    assert main(["study", "study.toml", "-q"]) == 0
    after = rows(solved)
    assert [row["number"] for row in after] == [5, 6]
    assert [row["dissipated"] for row in after] == [row["dissipated"] for row in before[4:6]]
    assert {path.name: path.stat().st_mtime_ns for path in Path("study.runs").glob("*.sqlite")} == began


def tree(folder: Path) -> dict[str, bytes]:
    """All files in a folder."""
    return {str(path): path.read_bytes() for path in sorted(folder.rglob("*")) if path.is_file()}


def test_force_begins_anew(solved: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    monkeypatch.setattr(dispatch, "task_solver", by(lambda tasks: asked.extend(task.number for task in tasks) or []))
    Path("study.runs/0003.sqlite").write_bytes(b"")  # killed before its first frame
    main(["study", "study.toml", "--force"])
    assert asked == [1, 2, 3, 4, 5, 6, 7, 8]
    assert list(Path("study.runs").iterdir()) == []


def through_a_link(runs: Path) -> None:
    runs.rename("elsewhere")
    runs.symlink_to("elsewhere")


def run_that_is_a_link(runs: Path) -> None:
    (runs / "0001.sqlite").rename("mine.sqlite")
    (runs / "0001.sqlite").symlink_to(Path("mine.sqlite").resolve())


def run_of_another(runs: Path) -> None:
    shutil.copy(runs / "0002.sqlite", runs / "0001.sqlite")


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda runs: (runs / "notes.txt").write_text("mine"), "notes.txt"),
        (lambda runs: (runs / "0009.sqlite").write_bytes(b""), "0009.sqlite"),
        (lambda runs: (runs / "0007.sqlite-journal").write_text("mine"), "0007.sqlite-journal"),
        (through_a_link, "study.runs"),
        (run_that_is_a_link, "0001.sqlite"),
        (run_of_another, "0001.sqlite"),
        (lambda runs: (runs / "0001.sqlite").write_text("mine"), "0001.sqlite"),
        (lambda runs: edit("UPDATE run SET file = '../mine.sqlite' WHERE number = 1"), "mine.sqlite"),
        (lambda runs: Path("study.sqlite").unlink(), "study.runs"),
        (lambda runs: Path("study.sqlite").write_text("mine"), "study.sqlite"),
        (lambda runs: Path("study.sqlite-journal").write_text("mine"), "study.sqlite-journal"),
    ],
)
def test_force_removes_all_that_the_table_names_or_nothing(
    solved: Path, capsys: pytest.CaptureFixture[str], spoil: Callable[[Path], object], said: str
) -> None:
    spoil(Path("study.runs"))
    before = tree(solved)
    assert main(["study", "study.toml", "--force"]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1
    assert tree(solved) == before


def test_force_removes_nothing_while_a_run_is_written(solved: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = tree(solved)
    with writing_to(Path("study.runs/0005.sqlite")):
        assert main(["study", "study.toml", "--force"]) == 2
    assert mentions(capsys.readouterr().err, "0005.sqlite", found="a run is writing to it")
    assert tree(solved) == before


def test_force_removes_nothing_before_a_scheduler_answers(
    solved: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    before = tree(solved)
    refused = SimpleNamespace(Client=Mock(side_effect=OSError("refused")))
    for library, reason in ((None, "distributed"), (refused, "does not answer (refused)")):
        monkeypatch.setitem(sys.modules, "distributed", library)
        assert main(["study", "study.toml", "--force", "--scheduler", "tcp://127.0.0.1:1"]) == 2
        assert mentions(capsys.readouterr().err, "--scheduler", found=reason)
        assert tree(solved) == before


def test_a_run_stays_until_the_one_in_its_place_is_prepared(solved: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with Table.open(solved / "study.sqlite") as table:
        digest = table.about()["drawing_sha256"]
    case = read_study(Path("study.toml")).cases()[4]
    task = Task(5, Path("plate.json"), case, Path("study.runs/0005.sqlite"), digest=digest, again=True)
    before = task.output.read_bytes()
    monkeypatch.setattr(one_run, "resume", Mock(side_effect=ResultsError("of another version")))
    monkeypatch.setattr(one_run, "model_of_run", Mock(side_effect=ModelError("plate.json is gone")))
    assert one_run.solve_and_measure(task).error == "plate.json is gone"
    assert task.output.read_bytes() == before


def test_a_run_is_not_written_through_a_link(solved: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    edit("UPDATE run SET status = 'waiting' WHERE number = 1")
    run_that_is_a_link(Path("study.runs"))
    Path("mine.sqlite").write_bytes(b"")
    monkeypatch.setattr(dispatch, "task_solver", by(in_this_process))
    assert main(["study", "study.toml", "-q"]) == 1
    assert Path("mine.sqlite").read_bytes() == b""


def test_a_run_that_is_held_is_said_and_waited_for(
    solved: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    edit("UPDATE run SET status = 'waiting' WHERE number = 5")
    monkeypatch.setattr(dispatch, "task_solver", by(in_this_process))
    Path("study.runs/0005.sqlite").unlink()
    with writing_to(Path("study.runs/0005.sqlite")), monkeypatch.context() as patch:
        patch.setattr(one_run, "PATIENCE", 0.0)
        assert main(["study", "study.toml", "-q"]) == 1
    said = capsys.readouterr().err
    assert re.search(r"^pdsolve study: run 5 waits up to 30 s for process \d+", said, re.M)
    assert "run 5 failed: " in said
    assert main(["study", "study.toml", "--again", "-q"]) == 1  # the others fail as before
    assert [row["status"] for row in rows(solved)][4] == "finished"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('"material.G0" = [204]', None),
        ('"material.G" = [204]', ".G is unknown"),
        ('"run.steps" = [1.5]', "$.run.steps is 1.5"),
    ],
)
def test_a_setting_that_means_nothing_is_refused_before_anything_is_solved(
    here: Path, capsys: pytest.CaptureFixture[str], text: str, said: str | None
) -> None:
    small(here)
    Path("study.toml").write_text(f'drawing = "plate.json"\n[vary.model]\n{text}')
    assert pdmesh(["plan", "study.toml"]) == (0 if said is None else 2)
    if said is not None:
        assert main(["study", "study.toml"]) == 2
        error = capsys.readouterr().err
        assert said in error
        assert error.count("\n") == 2
        assert not Path("study.sqlite").exists()


def test_a_setting_that_its_runs_do_not_use_is_refused(here: Path) -> None:
    small(here)
    with pytest.raises(ModelError, match=naming("run.theta", found="run.solver", expected="run.solver")):
        model_of_run(Path("plate.json"), Case({}, {"run.theta": 0.6}, {}))


def test_without_the_extra_there_is_no_cluster(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    small(here)
    Path("study.toml").write_text('drawing = "plate.json"')
    assert main(["study", "study.toml", "--scheduler", "tcp://127.0.0.1:1"]) == 2
    err = capsys.readouterr().err
    assert mentions(err, "pdsolve study: --scheduler", found="distributed", expected="pip install 'pdsuite[study]'")
    assert err.count("\n") == 1


def test_a_plan_counts_what_is_different(solved: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("study.toml").write_text(STUDY.replace("[3, 1]", "[3, 4]"))
    assert pdmesh(["plan", "study.toml", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["runs"] == 8
    assert [one["times"] for one in found["different"]] == [2] * 4
    assert found["different"][0]["bonds"] < found["different"][1]["bonds"]
    assert found["solve_seconds"] == pytest.approx(sum(2 * one["solve_seconds"] for one in found["different"]))
    assert pdmesh(["plan", "study.toml", "--set", "a=1"]) == 2
    assert mentions(capsys.readouterr().err, "--set", found="study", expected="study.toml")


@pytest.mark.slow
def test_its_measures_are_drawn_and_told(solved: Path, capsys: pytest.CaptureFixture[str]) -> None:
    edit("UPDATE run SET start = NULL WHERE number = 6")
    words = ["study", "study.sqlite", "--measure", "dissipated", "--measure", "start"]
    assert pdpost([*words, "--json", "-o", "study.svg"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["over"] == "material.G0"
    assert found["failed"] == 4
    first, _, start, _ = found["measures"]
    with Table.open(Path("study.sqlite")) as table:
        values = [row.values["dissipated"] for row in table.rows((5, 6))]
    assert (first["value"], first["runs"], first["happened"]) == (100, 2, 2)
    assert (first["smallest"], first["largest"]) == (min(values), max(values))
    assert (start["value"], start["runs"], start["happened"]) == (100, 2, 1)
    assert first["median"] == pytest.approx(sum(values) / 2)
    assert "material.G0, J/m" in Path("study.svg").read_text()
    assert mentions(Path("study.svg").read_text(), "1 of 4 runs")
    assert pdpost(["study", "study.sqlite", "--measure", "wonder"]) == 2
    assert mentions(capsys.readouterr().err, "--measure", found="'wonder'", expected=("nodes", "bonds"))
    assert pdpost(["study", "plate.json"]) == 2


@pytest.mark.slow
def test_where_nothing_cracks_there_is_something_to_draw(solved: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What a crack does happened nowhere, and what broke was nothing: what moved is left."""
    cracked = ("first_break", "start", "branching", "split", "speed", "fork_angle", "direction")
    nothing = ", ".join(f"{one} = NULL" for one in cracked)
    edit(f"UPDATE run SET length = 0, dissipated = 0, {nothing}")
    assert pdpost(["study", "study.sqlite", "--json", "-o", "calm.svg"]) == 0
    captured = capsys.readouterr()
    found = json.loads(captured.out)["measures"]
    assert list(dict.fromkeys(one["measure"] for one in found)) == [
        "largest_displacement", "largest_stretch", "strain", "work",
    ]  # fmt: skip
    assert all(one["happened"] == one["runs"] == 2 and one["median"] > 0 for one in found)
    assert mentions(captured.err, "4 runs", "start", "branching", "speed", "fork_angle", "direction")
    assert pdpost(["study", "study.sqlite", "--measure", "start", "-o", "start.svg"]) == 0
    err = capsys.readouterr().err
    assert mentions(err, "4 runs", "start")
    assert not mentions(err, "branching")
    assert "of 4 runs" in Path("start.svg").read_text()
    edit("UPDATE run SET start = 1e-6 + 1e-8 * number WHERE number IN (1, 2)")
    low, high = study(Path("study.sqlite"), ["start"]).axes[0].get_xlim()
    assert low < 100 < 204 < high  # of G0, of which nothing started at 100


@pytest.mark.parametrize(
    ("varied", "over", "first"),
    [
        ({"mode": ["thesis", "conservative"], "pull": [1, 2]}, "pull", "start"),
        ({"pull": [1, 2], "length": [1, 2, 3]}, "length", "start"),
        ({"mode": ["thesis", "conservative"]}, "mode", "start"),
        ({"kernel": ["blocks", "listed"]}, "kernel", "wall_time"),
        ({}, None, "start"),
    ],
)
def test_the_axis_and_the_measures_suit_what_varies(
    varied: dict[str, list[object]], over: str | None, first: str
) -> None:
    measured = ("wall_time", "start", "branching", "dissipated", "work")
    rows = []
    for number, values in enumerate(product(*varied.values())):
        found = dict.fromkeys(measured, float(number)) | {"branching": 1.0 if number == 0 else None}
        rows.append(Row(number, "", "finished", None, Path(), 0, found | dict(zip(varied, values, strict=True))))
    columns = {name: Column("options", "", "") for name in varied} | {
        name: Column("measure", "", "") for name in measured
    }
    names, axis = choose_measures_and_parameter(Read(Path("a"), rows, columns, list(varied), 0, 0), (), None)
    assert (axis, names[0]) == (over, first)
    assert "branching" not in names or names[-1] == "branching" or len(rows) < 3


@pytest.mark.slow
def test_paths_and_tradeoff_take_it(solved: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert pdpost(["crack", "study.sqlite", "--json", "-o", "paths.png"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert [run["number"] for run in found["runs"]] == [1, 2, 5, 6]
    assert Path("paths.png").read_bytes()[:4] == b"\x89PNG"
    assert pdpost(["crack", "study.sqlite", "--step", "3"]) == 2
    words = ["tradeoff", "study.sqlite", "--reference", "study.runs/0001.sqlite", "--by", "energy", "--json"]
    assert pdpost([*words, "-o", "tradeoff.png"]) == 0
    points = {point["name"]: point["energy"] for point in json.loads(capsys.readouterr().out[-10000:])["points"]}
    assert set(points) == {"G0 204", "G0 204 (1)", "G0 100", "G0 100 (1)"}
    assert points["G0 204"] == 0
