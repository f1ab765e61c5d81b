"""Nodes that are born and die in mid-run: what is read of each frame is what was there, however the run came about."""

from __future__ import annotations

import dataclasses
import re
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from database_contents import contents, kill_when, newest
from messages import naming
from numpy.typing import NDArray
from splitting_clouds import Moving, marched, torn_plate

from pdsolve.measures.bond_pairs import read_bond_pairs
from pdsolve.measures.cracked_nodes import damage_with_pre_cracks_at
from pdsolve.measures.strain import families_without_broken_bonds
from pdsolve.model import Model
from pdsolve.results import DamagedError, Results, ResultsError
from pdsolve.run.measures import compute_node_damage
from pdsolve.run.simulation import Options, Progress, resume, simulate
from pdsolve.run.system import System, SystemAfterNodeChange
from pdsolve.state import State

TESTS = Path(__file__).parent.parent


@pytest.fixture
def model() -> Model:
    return torn_plate()


def adapt(model: Model) -> Moving:
    """What changes its nodes."""
    return Moving(model.grid)


def named(ids: NDArray[np.int64], one: NDArray[np.int64], other: NDArray[np.int64]) -> set[tuple[int, int]]:
    """Pairs of ids of pairs of rows."""
    return set(zip(ids[one].tolist(), ids[other].tolist(), strict=True))


@pytest.mark.slow
def test_each_frame_has_the_nodes_there_were(moving: Path, model: Model) -> None:
    """Ids, places, fields, damage and bonds, compared with the same run marched by hand."""
    frames, updates = 0, 0
    with Results.open(moving) as results:
        for step, system, state in marched(model, adapt(model), Options(threads=1)):
            nodes, grid = results.nodes(step), system.model.grid
            updates += system.directed_bond_count if step else 0
            assert results.bond_updates(step) == updates
            order = np.argsort(grid.ids)[np.argsort(np.argsort(nodes.ids))]
            assert np.array_equal(nodes.ids, grid.ids[order])
            assert damage_with_pre_cracks_at(results, step) == pytest.approx(
                compute_node_damage(system)[order], abs=1e-15
            )
            if step % 10:
                continue
            frames += 1
            assert np.array_equal(nodes.position, grid.position[order])
            assert np.array_equal(nodes.area, system.area[order])
            for name, values in (
                ("uy", state.value[:, 1]),
                ("vx", state.rate[:, 0]),
                ("damage", compute_node_damage(system)),
            ):
                assert np.array_equal(results.field(name, step), values[order].astype("<f4"))
            start, neighbour = families_without_broken_bonds(results, results.families(step), step)
            found = named(nodes.ids, np.repeat(np.arange(len(nodes.ids)), np.diff(start)), neighbour)
            assert found == named(grid.ids, *system.operator.bonds())
            drawn = read_bond_pairs(results, step)
            assert 2 * (~drawn.is_broken).sum() == len(found)
            assert drawn.is_broken.sum() >= len(damage_with_pre_cracks_at(results, step) > 0) * (step == 60)
        assert (frames, len(results.epochs())) == (7, 11)
        assert len(results.lives().birth) > 2 * len(model.grid)
        assert results.history()["broken"].tolist() == [
            int((results.breaks().step <= step).sum()) for step in results.history()["step"]
        ]


def test_sql_sees_the_nodes_of_each_frame(moving: Path) -> None:
    with Results.open(moving) as results, closing(sqlite3.connect(moving)) as plain:
        for step in results.frames()[0].tolist():
            rows = plain.execute("SELECT node, x, uy FROM node_state WHERE step = ? ORDER BY node", (step,)).fetchall()
            nodes, uy = results.nodes(step), results.field("uy", step)
            order = np.argsort(nodes.ids)
            ids, x, moved = (column[order].tolist() for column in (nodes.ids, nodes.position[:, 0], uy))
            assert rows == list(zip(ids, x, moved, strict=True))
        plan = plain.execute("EXPLAIN QUERY PLAN SELECT uy FROM node_state WHERE node = 7").fetchall()
        assert not any("SCAN n" in row[-1] for row in plan), plan
        counted = plain.execute("SELECT nodes FROM epoch ORDER BY step").fetchall()
        assert [count for (count,) in counted] == [len(results.nodes(int(step)).ids) for step in results.epochs()]


def test_a_run_of_one_epoch_gives_all_its_nodes_at_any_step(small_results: Path) -> None:
    with Results.open(small_results) as results:
        assert results.nodes(0) is results.nodes(60) is results.nodes() is results.lives().nodes
        assert results.epochs().tolist() == [0]
        assert results.rows(20).tolist() == list(range(252))


@pytest.mark.slow
@pytest.mark.parametrize("kernel", ["blocks", "listed"])
def test_an_interrupted_run_goes_on_to_the_same_tables(
    model: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kernel: str
) -> None:
    """Before nodes change, after that, at a frame, between two."""
    options = Options(threads=1, kernel=kernel)
    simulate(model, tmp_path / "whole.sqlite", options, adapt=adapt(model)).close()
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)
    path = tmp_path / "stopped.sqlite"
    for number, stop in enumerate((1, 4, 5, 16, 20, 33, 36, 59)):

        def watch(progress: Progress, stop: int = stop) -> bool:
            return progress.step == stop

        if number == 0:
            simulate(model, path, options, watch, adapt=adapt(model)).close()
        else:
            resume(path, watch=watch, adapt=adapt(model)).close()
        with Results.open(path) as results:
            results.verify()
            assert results.checkpoint()[0] == stop
    resume(path, adapt=adapt(model)).close()
    assert contents(path) == contents(tmp_path / "whole.sqlite")


@pytest.mark.slow
@pytest.mark.parametrize("kept", [1e9, 0.0])
def test_what_was_born_and_died_after_the_checkpoint_is_dropped(
    model: Model, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, kept: float
) -> None:
    """Copied from under a run with a checkpoint at step 0 only, or with every frame."""
    monkeypatch.setattr("pdsolve.run.recorder.KEPT", kept)
    path, killed = tmp_path / "whole.sqlite", tmp_path / "killed.sqlite"
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)

    def kill(progress: Progress) -> bool:
        if progress.step == 47:
            newest(path, at_least=40)
            for beside in ("", "-wal", "-shm"):
                shutil.copy(f"{path}{beside}", f"{killed}{beside}")
        return False

    simulate(model, path, Options(threads=1), kill, adapt=adapt(model)).close()
    with Results.open(killed) as results:
        results.verify()
        assert results.checkpoint()[0] == (0 if kept else 40)
        assert results.epochs()[-1] == 37
    resume(killed, adapt=adapt(model)).close()
    assert contents(killed) == contents(path)


@pytest.mark.endurance
def test_a_killed_run_goes_on_to_the_same_tables(tmp_path: Path) -> None:
    """kill -9 while nodes are born and die."""
    program = f"""
import sys; sys.path.insert(0, {str(TESTS)!r})
from pathlib import Path
from splitting_clouds import Moving, torn_plate
from pdsolve.run.simulation import Options, simulate
import pdsolve.run.simulation
pdsolve.run.simulation.PATIENCE = 1.0
import time
model = torn_plate()
watch = lambda progress: bool(time.sleep(0.02))
simulate(model, Path(sys.argv[1]), Options(threads=1), watch, adapt=Moving(model.grid))
"""
    path, model = tmp_path / "killed.sqlite", torn_plate()
    kill_when(lambda results: len(results.frames()[0]) >= 3, path, ["-c", program, str(path)])
    with Results.open(path) as results:
        assert len(results.field("ux", int(results.frames()[0][-1]))) == len(results.nodes().ids)
    resume(path, adapt=adapt(model)).close()
    simulate(model, tmp_path / "whole.sqlite", Options(threads=1), adapt=adapt(model)).close()
    assert contents(path) == contents(tmp_path / "whole.sqlite")


@pytest.mark.parametrize(
    ("what", "table"),
    [
        ("DELETE FROM node_death WHERE rowid = 7", "node_death"),
        ("UPDATE node_death SET step = step + 1 WHERE rowid = 7", "node_death"),
        ('UPDATE node SET birth = birth + 1 WHERE "row" = 400', "node"),
        ("DELETE FROM epoch WHERE step = 9", "epoch"),
        ("DELETE FROM field_chunk WHERE step = 30 AND field = 'uy' AND chunk = 0", "field_chunk"),
    ],
)
def test_other_births_and_deaths_than_were_written_are_refused(
    moving: Path, tmp_path: Path, what: str, table: str
) -> None:
    path = tmp_path / "other.sqlite"
    shutil.copy(moving, path)
    with closing(sqlite3.connect(path)) as connection:
        connection.execute(what)
        connection.commit()
    with Results.open(path) as results, pytest.raises(DamagedError, match=naming(found=(table, "damaged"))):
        results.field("uy", 30)


@pytest.mark.slow
def test_a_run_goes_on_only_as_it_began(model: Model, small_plate: Model, tmp_path: Path) -> None:
    """Nodes that change need what changes them; those that stay do not."""

    def watch(progress: Progress) -> bool:
        return progress.step >= 20

    path = tmp_path / "changing.sqlite"
    simulate(model, path, watch=watch, adapt=adapt(model)).close()
    with pytest.raises(ResultsError, match=naming("changing.sqlite", found=("nodes", "change"))):
        resume(path)
    path = tmp_path / "staying.sqlite"
    simulate(small_plate, path, watch=watch).close()
    with pytest.raises(ResultsError, match=naming("staying.sqlite", found=("nodes", "stay"), expected="nodes")):
        resume(path, adapt=adapt(model))


class Careless(Moving):
    """Forgets those whose bonds are others now."""

    def change_nodes(self, system: System, state: State, step: int) -> SystemAfterNodeChange | None:
        """As in `Regridder`."""
        found, known = super().change_nodes(system, state, step), system.model.grid.ids.tolist()
        if found is None:
            return None
        ids = found.system.model.grid.ids.tolist()
        return found._replace(previous_rows=np.array([known.index(node) if node in known else -1 for node in ids]))


@pytest.mark.slow
def test_a_bond_to_nobody_is_told(model: Model, tmp_path: Path) -> None:
    path = tmp_path / "careless.sqlite"
    with simulate(model, path, adapt=Careless(model.grid)) as results:
        with pytest.raises(ResultsError, match=naming(found=(re.compile(r"node \d+"), "step 1"))):
            results.families(1)
        assert len(results.families(0).neighbour) > 0


class Hasty(Moving):
    """Takes another time step."""

    def change_nodes(self, system: System, state: State, step: int) -> SystemAfterNodeChange | None:
        """As in `Regridder`."""
        found = super().change_nodes(system, state, step)
        return found and found._replace(system=dataclasses.replace(found.system, time_step=1e-9))


def test_the_step_does_not_change(model: Model) -> None:
    with pytest.raises(ValueError, match=naming("step 0", found=("time", "step"))):
        simulate(model, adapt=Hasty(model.grid))
