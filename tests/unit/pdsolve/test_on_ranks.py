"""A run by the code of ranks on one of them, in this process, is that of one process; see `tests/cli/test_ranks.py`."""

from __future__ import annotations

import dataclasses
import sqlite3
from collections.abc import Callable
from contextlib import closing
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from database_contents import contents
from messages import naming
from plates import plate, square_grid

from pdmesh.model.document import Load, Run, Velocity
from pdsolve.errors import UnstableError
from pdsolve.model import Model, ModelWarning
from pdsolve.numerics.team import Team
from pdsolve.options import Options
from pdsolve.results import Results, WriteError
from pdsolve.run.simulation import Progress, resume, simulate

pytestmark = pytest.mark.skipif(find_spec("mpi4py") is None, reason="needs mpi4py")


@pytest.fixture(scope="module")
def alone() -> Team:
    from mpi4py import MPI

    return Team(MPI.COMM_SELF)


def torn(**more: object) -> Model:
    """A notched plate torn apart, until it is in two pieces; its probe is as near to two nodes."""
    grid = dataclasses.replace(square_grid(21, 12, y0=-5.5e-3), cracks=np.array([[-1.0, 0.0, 8e-3, 0.0]]))
    grows = ((0.0, 1.0), (2e-6, 1.5))
    ends = (
        Load(box=(-1.0, 5e-3, 1.0, 1.0), body_force=(0.0, 6e10), profile=grows),
        Velocity(box=(-1.0, -1.0, 1.0, -5e-3), y=-2.0),
    )
    usual = {"time_step": 50e-9, "steps": 400, "every": 20, "ledger": 5, "until": "split", "probes": ((0.5e-3, 0.0),)}
    return plate(grid, conditions=ends, run=Run(**{**usual, **more}))  # type: ignore[arg-type]


def expect_same(known: Path, found: Path) -> None:
    """Both files hold the same, but for what says how the runs went."""
    one, other = contents(known), contents(found)
    for table, rows in one.items():
        if table not in ("meta", "checkpoint", "checksum"):
            assert other[table] == rows, table


@pytest.mark.slow
def test_a_run_on_a_rank_is_that_of_one_process_until_it_is_split(alone: Team, tmp_path: Path) -> None:
    simulate(torn(), tmp_path / "one").close()
    with simulate(torn(), tmp_path / "rank", Options(team=alone)) as results:
        assert len(results.breaks().step) > 200
        assert 20 < results.frames()[0][-1] < 400
        assert results.summary()["bonds"] > 1500
    expect_same(tmp_path / "one", tmp_path / "rank")


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("one_file", [100, 1000])
def test_a_run_that_is_stopped_goes_on(alone: Team, tmp_path: Path, one_file: int) -> None:
    def stops(progress: Progress) -> bool:
        return progress.step >= 40

    options = Options(team=alone, one_file=one_file)
    with simulate(torn(), tmp_path / "rank", options, stops) as results:
        assert results.meta()["status"] == "interrupted"
        assert bool(results.pieces) == (one_file < 252)
        step = results.checkpoint_step()
    for file in tmp_path.glob("rank.0-0"):  # the index may have had to be read with the checkpoint before
        with closing(sqlite3.connect(file)) as connection:
            assert connection.execute("SELECT DISTINCT step FROM checkpoint").fetchall() == [(0,), (step,)]
    with resume(tmp_path / "rank", team=alone) as results, simulate(torn(), tmp_path / "one") as one:
        assert results.meta()["status"] == "finished"
        results.verify()
        for step in one.frames()[0].tolist():
            for name in one.stored(step):
                assert results.field(name, step).tobytes() == one.field(name, step).tobytes(), (name, step)
        assert results.history().tolist() == one.history().tolist()
        assert results.reactions().tolist() == one.reactions().tolist()
        assert results.breaks().node.tolist() == one.breaks().node.tolist()
        known, found = one.checkpoint()[1], results.checkpoint()[1]
        assert {name: values.tobytes() for name, values in found.items()} == {
            name: values.tobytes() for name, values in known.items()
        }


def test_a_run_that_is_not_stable_says_the_same_on_a_rank(alone: Team, tmp_path: Path) -> None:
    said = []
    for options in (Options(), Options(team=alone)):
        with pytest.raises(UnstableError) as error, pytest.warns(ModelWarning):
            simulate(torn(time_step=1e-6, until=None), tmp_path / "rank", options)
        said.append(str(error.value))
    assert said[0] == said[1]


def test_the_nodes_of_another_model_are_not_gone_on_with(alone: Team, tmp_path: Path) -> None:
    from pdsolve.run import ranks_start, simulation

    simulate(torn(steps=20, until=None), tmp_path / "one").close()
    with Results.open(tmp_path / "one") as results:
        for cracked in (True, False):
            model = torn(steps=20, until=None)
            if not cracked:
                model = Model(dataclasses.replace(model.grid, cracks=np.empty((0, 4))), model.settings)
            prepared = ranks_start.prepare_run_on_ranks(model, Options(), alone)
            assert simulation.has_same_bonds(*prepared, results) == cracked


@pytest.mark.parametrize(
    ("name", "mine"),
    [
        ("rank.0-0", lambda copy: copy),  # a copy of a user, not of a rank
        ("rank.3-7", lambda _: b"notes"),
    ],
)
def test_a_file_of_somebody_else_is_met_before_anything_is_removed(
    alone: Team, tmp_path: Path, name: str, mine: Callable[[bytes], bytes]
) -> None:
    model = torn(steps=20, until=None)
    simulate(model, tmp_path / "rank").close()
    (tmp_path / name).write_bytes(mine((tmp_path / "rank").read_bytes()))
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(WriteError, match=naming(name, expected="move it away")):
        simulate(model, tmp_path / "rank", Options(team=alone, one_file=100))
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_the_file_of_a_rank_has_no_files_of_ranks_beside_it(alone: Team, tmp_path: Path) -> None:
    """What is called like one is left alone, and nothing is removed before it would be met."""
    simulate(torn(steps=20, until=None), tmp_path / "rank").close()
    (tmp_path / "rank.0-0.0-0").write_text("notes")
    simulate(torn(steps=20, until=None), tmp_path / "rank", Options(team=alone, one_file=100)).close()
    assert (tmp_path / "rank.0-0.0-0").read_text() == "notes"
