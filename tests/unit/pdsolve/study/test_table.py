"""A study's table: what is read of it is what was written, and what a kill leaves of it is gone on with."""

from __future__ import annotations

import os
import random
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest
from messages import naming

from pdsolve.study import table
from pdsolve.study.description import Study, StudyError, read_study
from pdsolve.study.measure_columns import MEASURES
from pdsolve.study.table import FAILED, FINISHED, WAITING, Table


@pytest.fixture
def study(tmp_path: Path) -> Study:
    """One of six runs."""
    (tmp_path / "a.geo").write_text("")
    (tmp_path / "study.toml").write_text('drawing = "a.geo"\nvary.model.G = [1, 2.5, "three"]\nvary.drawing.h = [1, 2]')
    return read_study(tmp_path / "study.toml")


@pytest.fixture
def path(tmp_path: Path, study: Study) -> Path:
    """Its table, with one run finished and one failed."""
    path = tmp_path / "study.sqlite"
    with Table.create(path, study, "1.0") as table:
        table.add(study.cases(), {}, MEASURES)
        table.finish(2, {"nodes": 21, "dissipated": -0.0, "branching": None, "work": float("nan")})
        table.finish(5, None, "found nothing")
    return path


def edit(path: Path, *statements: str) -> None:
    """Change it by other means."""
    with closing(sqlite3.connect(path)) as connection, connection:
        for statement in statements:
            connection.execute(statement)


def test_it_holds_what_was_written_and_grows(path: Path, study: Study) -> None:
    with Table.open(path) as table:
        rows = table.rows()
    assert [row.status for row in rows] == [WAITING, FINISHED, WAITING, WAITING, FAILED, WAITING]
    assert (rows[1].values["nodes"], rows[1].values["work"], rows[4].error) == (21, None, "found nothing")
    with Table.create(path, study, "1.1") as table:
        table.add(study.cases(), {}, {**MEASURES, "another": MEASURES["work"]})
        table.finish(1, {"another": 3.0})
    with Table.open(path) as table:
        assert table.rows()[0].values["another"] == 3.0
        assert table.about()["program"] == "1.1"


@pytest.mark.parametrize(
    ("statement", "said"),
    [
        ("UPDATE run SET dissipated = 1 WHERE number = 2", "run 2 is damaged"),
        ("UPDATE run SET nodes = NULL WHERE number = 2", "run 2 is damaged"),
        ("UPDATE run SET status = 'finished' WHERE number = 5", "run 5 is damaged"),
        ("DELETE FROM run WHERE number = 6", "5 runs"),
        ("UPDATE study SET value = 'x' WHERE name = 'drawing_sha256'", "its study is damaged"),
        ("DELETE FROM column_unit WHERE name = 'nodes'", "its column_unit is damaged"),
        ("UPDATE run SET file = '/tmp/mine.sqlite' WHERE number = 1", "the file of run 1 is '/tmp/mine.sqlite'"),
        ("UPDATE run SET file = '../a.runs/0001.sqlite' WHERE number = 1", "of run 1"),
        ("DROP TABLE column_unit", "no table column_unit"),
        ("ALTER TABLE run DROP COLUMN nodes", "no column nodes"),
        ("DELETE FROM checksum WHERE number = 3", "6 runs"),
    ],
)
def test_a_damaged_one_is_refused(path: Path, study: Study, statement: str, said: str) -> None:
    edit(path, statement)
    for look in (lambda: Table.open(path), lambda: Table.create(path, study, "1.0")):
        with pytest.raises(StudyError) as error:
            look()
        line = str(error.value)
        assert line.startswith(f"{path}: ")
        assert said in line
        assert "remove it" in line
        assert "study.runs (without that folder" in line
        assert "\n" not in line


@pytest.mark.slow
def test_bytes_that_have_changed_are_refused_or_change_nothing(path: Path) -> None:
    """Of 400 damaged tables none is read as something else, and none ends with another error."""
    whole, chance, refused, same = path.read_bytes(), random.Random(7), 0, 0
    with Table.open(path) as table:
        rows, columns, about = table.rows(), table.columns(), table.about()
    for _ in range(400):
        data = bytearray(whole)
        at = chance.randrange(len(data))
        data[at] ^= 1 << chance.randrange(8)
        path.write_bytes(data[: chance.randrange(len(data))] if chance.random() < 0.2 else data)
        try:
            table = Table.open(path)
        except StudyError as error:
            refused += "\n" not in str(error)
        else:
            with table:
                same += (table.rows(), table.columns(), table.about()) == (rows, columns, about)
    assert refused + same == 400
    assert refused > 80


def test_a_table_of_an_older_version_is_read_and_given_checksums(path: Path, study: Study) -> None:
    edit(path, "DROP TABLE checksum")
    with Table.open(path) as table:
        assert len(table.rows()) == 6
    Table.create(path, study, "1.1").close()
    edit(path, "UPDATE run SET nodes = 3 WHERE number = 2")
    with pytest.raises(StudyError, match=naming(found=("run 2", "damaged"))):
        Table.open(path)


@pytest.mark.slow
def test_one_whose_program_was_killed_at_any_statement_is_gone_on_with(
    study: Study, path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of the files as they are before each statement, with pages that were written ahead of their transaction's end."""
    killed, own = path.with_name("killed"), path.with_name("written.sqlite")
    connect = sqlite3.connect

    def copy(statement: str) -> None:
        place = killed / f"{len(list(killed.iterdir()))}"
        place.mkdir()
        for beside in ("", "-journal"):
            if Path(f"{own}{beside}").exists():
                shutil.copy(f"{own}{beside}", place / f"study.sqlite{beside}")

    def spied(*words: Any, **more: Any) -> sqlite3.Connection:
        connection: sqlite3.Connection = connect(*words, **more)
        connection.execute("PRAGMA cache_size = 1")
        connection.execute("PRAGMA cache_spill = 1")
        connection.set_trace_callback(copy)
        return connection

    killed.mkdir()
    with monkeypatch.context() as patch:
        patch.setattr(sqlite3, "connect", spied)
        with Table.create(own, study, "1.0") as table:
            table.add(study.cases(), {}, {name: MEASURES[name] for name in ("nodes", "work")})
            table.finish(1, {"nodes": 3})
    assert len(list(killed.glob("*/*-journal"))) > 20
    for place in killed.iterdir():
        with Table.create(place / "study.sqlite", study, "1.0") as table:
            table.add(study.cases(), {}, MEASURES)
            assert [row.number for row in table.rows()] == [1, 2, 3, 4, 5, 6]
        Table.open(place / "study.sqlite").close()


def test_a_table_is_looked_at_as_of_one_moment(path: Path, study: Study, monkeypatch: pytest.MonkeyPatch) -> None:
    """A study that goes on meanwhile makes nothing look damaged."""
    looked = table._expect_sums

    def later(connection: sqlite3.Connection) -> None:
        writer = Table(sqlite3.connect(path, isolation_level=None, timeout=0.1), path)
        with writer, pytest.raises(StudyError, match="locked"):
            writer.finish(3, {"nodes": 4})
        looked(connection)

    monkeypatch.setattr(table, "_expect_sums", later)
    with Table.open(path) as opened:
        assert opened.rows()[2].status == WAITING


def test_a_column_more_is_not_read(path: Path) -> None:
    edit(path, "DROP TABLE checksum", "ALTER TABLE column_unit ADD COLUMN more")
    with Table.open(path) as table:
        assert table.columns()["nodes"].kind == "measure"


def test_a_column_of_another_name_is_one_line(path: Path) -> None:
    edit(path, "DROP TABLE checksum", "ALTER TABLE study RENAME COLUMN name TO other")
    with Table.open(path) as table, pytest.raises(StudyError, match=naming("study.sqlite")):
        table.about()


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_a_pipe_is_no_table(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "p.sqlite")
    (tmp_path / "p.sqlite-wal").write_bytes(bytes.fromhex("377f0682") + bytes(40))
    with pytest.raises(StudyError, match=naming("p.sqlite", found="no table of a study")):
        Table.open(tmp_path / "p.sqlite")
