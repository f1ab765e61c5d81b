"""The database: what goes in comes out, in SQL too; a killed run is readable; others are refused."""

from __future__ import annotations

import dataclasses
import os
import sqlite3
import struct
from pathlib import Path

import numpy as np
import pytest
from database_contents import contents, kill_when
from messages import naming
from plates import plate, square_grid
from system_checks import bonds_of

from pdmesh.model.document import Run, write_file
from pdmesh.model.node_grid import document_of
from pdsolve.__main__ import main as pdsolve
from pdsolve.model import Model
from pdsolve.results import Results, ResultsError, WriteError, Writer
from pdsolve.results.schema import CHUNK
from pdsolve.run.simulation import resume, simulate


def test_plain_sql_sees_the_numbers(small_results: Path) -> None:
    connection = sqlite3.connect(small_results)
    with Results.open(small_results) as results:
        steps, times = results.frames()
        nodes = results.nodes()
        rows = connection.execute("SELECT time, uy FROM node_state WHERE node = 7").fetchall()
        assert [row[0] for row in rows] == times.tolist()
        assert [row[1] for row in rows] == [float(results.field("uy", int(step))[6]) for step in steps]
        for name in ("ux", "uy", "vx", "vy", "damage"):
            column = [
                row[0] for row in connection.execute(f"SELECT {name} FROM node_state WHERE step = 60 ORDER BY node")
            ]
            assert column == results.field(name, 60).tolist()
        row = connection.execute("SELECT x, y, z, uz, vz FROM node_state WHERE node = 30 AND step = 0").fetchone()
        assert row == (*nodes.position[29], 0.0, 0.0, 0.0)
    names = [column[0] for column in connection.execute("SELECT * FROM node_state").description]
    assert names == [
        "step",
        "time",
        "node",
        "x",
        "y",
        "z",
        "ux",
        "uy",
        "uz",
        "vx",
        "vy",
        "vz",
        "ax",
        "ay",
        "az",
        "energy",
        "damage",
        "sxx",
        "syy",
        "sxy",
        "szz",
        "sxz",
        "syz",
        "plastic",
        "rotation",
        "J",
        "c",
        "h",
        "solid",
        "T",
    ]
    connection.close()


def test_the_view_decodes_every_kind_of_number(small_results: Path) -> None:
    """Signs, subnormal numbers, the largest; what is no number is NULL."""
    with Results.open(small_results) as results:
        count = len(results.nodes().ids)
    patterns = np.random.default_rng(0).integers(0, 2**32, count, dtype=np.uint32)
    patterns[:8] = [0, 1, 0x80000001, 0x007FFFFF, 0x00800000, 0x7F7FFFFF, 0x7F800000, 0x7FC00000]
    values = patterns.view("<f4")
    connection = sqlite3.connect(small_results)
    connection.execute("UPDATE field_chunk SET data = ? WHERE step = 20 AND field = 'ux'", (values.tobytes(),))
    decoded = [row[0] for row in connection.execute("SELECT ux FROM node_state WHERE step = 20 ORDER BY node")]
    connection.close()
    assert decoded == [float(value) if np.isfinite(value) else None for value in values]


def test_more_nodes_than_a_chunk(tmp_path: Path, small_plate: Model) -> None:
    """2100 nodes make three chunks; the view finds its way."""
    import dataclasses

    import msgspec

    settings = msgspec.structs.replace(small_plate.settings, conditions=())
    settings = msgspec.structs.replace(settings, run=msgspec.structs.replace(settings.run, steps=0))
    model = dataclasses.replace(small_plate, grid=square_grid(70, 30), settings=settings)
    simulate(model, tmp_path / "big.sqlite").close()
    values = np.arange(2100, dtype="<f4")
    connection = sqlite3.connect(tmp_path / "big.sqlite")
    for chunk in range(3):
        data = values[CHUNK * chunk : CHUNK * (chunk + 1)].tobytes()
        connection.execute("UPDATE field_chunk SET data = ? WHERE field = 'vx' AND chunk = ?", (data, chunk))
    assert [row[0] for row in connection.execute("SELECT vx FROM node_state ORDER BY node")] == values.tolist()
    connection.close()


def test_damage_is_what_the_breaks_say(small_results: Path) -> None:
    with Results.open(small_results) as results:
        nodes, breaks = results.nodes(), results.breaks()
        gone = nodes.cut + np.bincount(breaks.node - 1, minlength=len(nodes.ids))
        assert results.field("damage", 60) == pytest.approx(gone / nodes.family, rel=1e-7)
        assert nodes.cut.sum() > 0


def test_the_ledger_and_the_model_are_inside(small_results: Path, small_plate: Model) -> None:
    from pdsolve.model import model_of

    with Results.open(small_results) as results:
        history, meta, model = results.history(), results.meta(), results.model()
    assert history["step"].tolist() == [0, 20, 40, 60]
    assert history["work"][-1] > 0
    assert model_of(model, "inside").settings == small_plate.settings
    assert {"created", "provenance", "numpy", "numba", "mode", "precision", "time_step"} <= set(meta)


def test_the_families_are_inside(small_results: Path, small_plate: Model) -> None:
    from pdsolve.options import Options
    from pdsolve.run.prepare import prepare

    with Results.open(small_results) as results:
        start, neighbour = results.families()
        nodes = results.nodes()
    problem = prepare(small_plate, Options())
    assert np.array_equal(start, bonds_of(problem).start)
    assert np.array_equal(neighbour, bonds_of(problem).neighbour)
    assert np.array_equal(np.diff(start), nodes.family - nodes.cut)


def test_only_one_file_is_left(small_results: Path) -> None:
    assert [path.name for path in small_results.parent.iterdir()] == [small_results.name]


def read_all(path: Path) -> None:
    """Read a bit of everything."""
    with Results.open(path) as results:
        results.nodes()
        results.history()
        results.field("uy", 60)


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("what", ["empty", "text", "other", "older", "truncated", "missing", "folder"])
def test_what_is_not_ours_is_refused_in_one_line(small_results: Path, tmp_path: Path, what: str) -> None:
    path = tmp_path / "given.sqlite"
    if what == "empty":
        path.write_bytes(b"")
    elif what == "text":
        path.write_text("not a database, but long enough to look like one\n" * 40)
    elif what == "other":
        sqlite3.connect(path).execute("CREATE TABLE t (x)").connection.commit()
    elif what == "older":
        data = bytearray(small_results.read_bytes())
        data[60:64] = struct.pack(">I", 0)  # user_version
        path.write_bytes(data)
    elif what == "truncated":
        path.write_bytes(small_results.read_bytes()[:10000])
    elif what == "folder":
        path.mkdir()
    with pytest.raises(ResultsError) as error:
        read_all(path)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_fields_and_frames_that_are_not_there_are_answered_with_those_that_are(small_results: Path) -> None:
    with Results.open(small_results) as results:
        with pytest.raises(ResultsError, match=naming(found="step 21", expected=("4 frames", "0", "60"))):
            results.field("ux", 21)
        with pytest.raises(ResultsError, match=naming(found="field 'heat'", expected=("ux", "energy"))):
            results.field("heat", 20)


def test_a_target_that_cannot_be_written_is_named(small_plate: Model, tmp_path: Path) -> None:
    with pytest.raises(WriteError, match=naming("gone/x.sqlite", "x.sqlite-lock")):
        simulate(small_plate, tmp_path / "gone" / "x.sqlite")


def test_a_full_disk_is_one_line(small_plate: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A database that may not grow stands for a disk that is full."""
    begin = Writer.begin.__func__  # type: ignore[attr-defined]

    def small(cls: type[Writer], *args: object) -> Writer:
        writer: Writer = begin(cls, *args)
        pages = writer.connection.execute("PRAGMA page_count").fetchone()[0]
        writer.connection.execute(f"PRAGMA max_page_count = {pages + 2}")
        return writer

    monkeypatch.setattr(Writer, "begin", classmethod(small))
    with pytest.raises(WriteError, match=r"full\.sqlite: database or disk is full"):
        simulate(small_plate, tmp_path / "full.sqlite")


@pytest.mark.slow
def test_a_killed_run_is_readable_and_goes_on_to_the_same_bits(small_plate: Model, tmp_path: Path) -> None:
    """kill -9 while bonds break: whole frames, and a resumed end equal to that of a run left alone."""
    model = tmp_path / "plate.json"
    write_file(document_of(small_plate.grid, small_plate.settings), model)
    killed, whole = tmp_path / "killed.sqlite", tmp_path / "whole.sqlite"
    extra = ["--set", "run.steps=12000", "--set", "run.every=100", "--set", "run.time_step=2.5e-10", "-q"]
    words = ["-m", "pdsolve", str(model), *extra, "-o", str(killed)]
    kill_when(lambda results: len(results.breaks().step) > 0, killed, words)
    with Results.open(killed) as results:
        steps, _ = results.frames()
        assert 0 < steps[-1] < 12000
        assert results.meta()["status"] == "running"
        assert 0 <= results.checkpoint()[0] <= steps[-1]
        assert len(results.field("uy", int(steps[-1]))) == len(small_plate.grid)
    assert pdsolve([*words[2:-1], str(whole)]) == 0
    resume(killed).close()
    assert contents(killed) == contents(whole)


def test_a_crack_of_whole_numbers_is_written_as_any_other(tmp_path: Path) -> None:
    """A file of it is read, looked at and gone on with."""
    grid = dataclasses.replace(square_grid(9, 8, 1.0, y0=-3.5), cracks=[[0, 0, 4, 0]])  # type: ignore[arg-type]
    assert grid.cracks.dtype == np.float64
    path = tmp_path / "whole.sqlite"
    simulate(plate(grid, run=Run(steps=4, every=2)), path, watch=lambda progress: progress.step >= 2).close()
    with Results.open(path) as results:
        results.verify()
        assert results.cracks().tolist() == [[0.0, 0.0, 4.0, 0.0]]
    resume(path).close()


def test_a_database_of_more_than_two_gigabytes_is_read(small_results: Path) -> None:
    """What is behind its pages is none of it."""
    os.truncate(small_results, 5 * 2**29)
    with Results.open(small_results) as results:
        assert len(results.nodes().ids) > 0
