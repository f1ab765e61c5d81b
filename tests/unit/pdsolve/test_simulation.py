"""Runs: the same bits on other threads and after a stop, a stop where physics ends."""

from __future__ import annotations

import dataclasses
import re
import time as clock
from pathlib import Path

import msgspec
import numba
import numpy as np
import pytest
from messages import naming
from plates import plate, square_grid
from system_checks import bonds_of, kept
from tampered_databases import tampered

from pdmesh.model.amounts import pair_count
from pdmesh.model.cracked_damage import CRACKED
from pdmesh.model.document import Run
from pdsolve.estimate import estimate_run
from pdsolve.model import Model, ModelError, ModelWarning
from pdsolve.results import Breaks, Results, ResultsError
from pdsolve.run.measures import compute_node_damage
from pdsolve.run.recorder import count_fragments, list_breaks_since
from pdsolve.run.simulation import Options, Progress, UnstableError, prepare, resume, simulate
from pdsolve.run.subdomain import restore_state, team_of


def with_run(model: Model, **run: object) -> Model:
    """The model with other run settings."""
    settings = msgspec.structs.replace(model.settings, run=msgspec.structs.replace(model.settings.run, **run))
    return dataclasses.replace(model, settings=settings)


def everything(results: Results) -> list[object]:
    """All that a run has computed, to compare bit by bit."""
    step, state = results.checkpoint()
    frames = [results.field(name, int(s)).tobytes() for s in results.frames()[0] for name in ("ux", "uy", "damage")]
    breaks = sorted(zip(*(column.tolist() for column in results.breaks()), strict=True))
    return [step, {name: values.tobytes() for name, values in state.items()}, frames, breaks]


@pytest.mark.parametrize("mode", ["thesis", "conservative"])
@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_a_run_in_memory_breaks_bonds_and_ends(small_plate: Model, mode: str, precision: str) -> None:
    with simulate(small_plate, options=Options(mode, precision)) as results:
        assert results.meta()["status"] == "finished"
        assert results.frames()[0].tolist() == [0, 20, 40, 60]
        summary = results.summary()
    assert summary["steps"] == 60
    assert summary["broken_bonds"] > 0
    assert summary["bonds"] == pair_count(len(bonds_of(prepare(small_plate, Options(mode))).neighbour))


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one core")
@pytest.mark.parametrize("mode", ["thesis", "conservative"])
def test_one_thread_and_two_give_the_same_bits(small_plate: Model, mode: str) -> None:
    with (
        simulate(small_plate, options=Options(mode, threads=1)) as one,
        simulate(small_plate, options=Options(mode, threads=2)) as two,
    ):
        assert everything(one) == everything(two)


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_a_stopped_run_goes_on_to_the_same_bits(small_plate: Model, tmp_path: Path, precision: str) -> None:
    options = Options("conservative", precision)
    path = tmp_path / "stopped.sqlite"
    model = with_run(small_plate, every=15)
    monkey = pytest.MonkeyPatch()
    with monkey.context() as patch:  # look at the watcher every seven steps
        bonds = prepare(model, options).system.directed_bond_count
        patch.setattr("pdsolve.run.simulation.PATIENCE", 7.0 * bonds)
        with simulate(model, path, options, watch=lambda progress: progress.step >= 36) as results:
            assert results.meta()["status"] == "interrupted"
            assert results.checkpoint()[0] == 37
            assert results.frames()[0].tolist() == [0, 15, 30]
            assert results.breaks().step.max() > 30
    with resume(path) as resumed, simulate(model, options=options) as whole:
        assert resumed.meta()["status"] == "finished"
        assert everything(resumed) == everything(whole)


def test_a_watcher_sees_progress(small_plate: Model) -> None:
    seen: list[Progress] = []
    simulate(small_plate, watch=lambda progress: bool(seen.append(progress))).close()
    steps = [progress.step for progress in seen]  # more of them where steps take long
    assert steps == sorted(steps)
    assert {20, 40, 60} <= set(steps)
    assert seen[-1].broken_directed_bond_count > 0


def test_too_large_a_step_is_stopped_and_told(small_plate: Model, tmp_path: Path) -> None:
    bound = prepare(small_plate, Options()).system.stable_time_step
    model = with_run(small_plate, time_step=3 * bound, steps=400, every=20)
    path = tmp_path / "unstable.sqlite"
    own = [f"{step:.4g} s" for step in (3 * bound, bound)]
    stopped = naming(re.compile(r"unstable at step \d+"), re.compile(r"node \d+"), *own)
    with pytest.warns(ModelWarning, match=naming(*own)), pytest.raises(UnstableError, match=stopped):
        simulate(model, path)
    with Results.open(path) as results:
        assert results.meta()["status"] == "unstable"
        for step in results.frames()[0]:
            assert np.isfinite(results.field("uy", int(step))).all()


@pytest.mark.parametrize("mode", ["thesis", "conservative"])
def test_no_time_step_takes_the_bound(small_plate: Model, mode: str) -> None:
    problem = prepare(with_run(small_plate, time_step=None), Options(mode))
    assert problem.system.time_step == problem.system.stable_time_step


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (Options(mode="thessis"), naming("mode", found="'thessis'", expected=("thesis", "conservative"))),
        (Options(precision="float16"), naming("precision", found="'float16'", expected=("float64", "float32"))),
        (Options(threads=0), naming("threads", found="0", expected="1")),
        (Options(kernel="fast"), naming("kernel", found="'fast'", expected=("blocks", "listed"))),
    ],
)
def test_options_that_are_none(small_plate: Model, options: Options, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        simulate(small_plate, options=options)


def test_no_steps_are_a_run_too(small_plate: Model) -> None:
    with simulate(with_run(small_plate, steps=0)) as results:
        assert results.frames()[0].tolist() == [0]
    assert Run(steps=0).steps == 0


def bilinear(model: Model) -> Model:
    """The model in a softening material."""
    material = msgspec.structs.replace(model.settings.material, law="bilinear", kr=3.0)
    return dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, material=material))


def test_a_softening_run_goes_on_to_the_same_bits(small_plate: Model, tmp_path: Path) -> None:
    model, path = bilinear(small_plate), tmp_path / "softening.sqlite"
    with simulate(model, path, watch=lambda progress: progress.step >= 40) as results:
        assert results.checkpoint()[1]["worst"].size > 0
    with resume(path) as resumed, simulate(model) as whole:
        assert everything(resumed) == everything(whole)
        assert resumed.breaks().step.size > 0


@pytest.mark.parametrize("kernel", ["blocks", "listed"])
def test_a_torn_problem_goes_back(small_plate: Model, kernel: str) -> None:
    """Bonds that broke later are whole again, and the way from there is the same to the last bit."""
    problem = prepare(bilinear(small_plate), Options(kernel=kernel))
    problem.advance(1, 41)
    before, broke = kept(problem), list_breaks_since(problem.system, 0)
    problem.advance(41, 61)
    after = problem.state.value.copy(), list_breaks_since(problem.system, 0)
    assert 0 < len(broke.step) < len(after[1].step)
    restore_state(*problem, 40, before, broke)
    assert list_breaks_since(problem.system, 0).step.tolist() == broke.step.tolist()
    problem.advance(41, 61)
    assert np.array_equal(problem.state.value, after[0])
    assert all(np.array_equal(*columns) for columns in zip(list_breaks_since(problem.system, 0), after[1], strict=True))


def test_a_checkpoint_of_another_version_is_refused(small_plate: Model, tmp_path: Path) -> None:
    """One that has other names for what it holds, as before there were states."""
    path = tmp_path / "old.sqlite"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(
            "pdsolve.run.subdomain.make_checkpoint", lambda system, state: {"u": state.value, "v": state.rate}
        )
        simulate(small_plate, path, watch=lambda progress: progress.step >= 20).close()
    before = path.read_bytes()
    with pytest.raises(ResultsError, match=naming("old.sqlite", found=("checkpoint", "pdsolve"), expected="anew")):
        resume(path)
    assert path.read_bytes() == before


def test_probes_follow_the_node_nearest_to_them(small_plate: Model) -> None:
    model = with_run(small_plate, probes=((7.1e-3, 0.4e-3), (12e-3, -5.5e-3)), ledger=5)
    with simulate(model) as results:
        probes, history = results.probes(), results.history()
        seen = {name: results.field(name, 40) for name in ("ux", "uy", "vx", "vy")}
    near, far = 6 * 21 + 8, 13
    assert np.unique(probes["node"]).tolist() == [far, near]
    assert history["step"].tolist() == list(range(0, 61, 5))
    assert probes["step"][probes["node"] == near].tolist() == history["step"].tolist()
    (row,) = probes[(probes["node"] == near) & (probes["step"] == 40)]
    for name, values in seen.items():
        assert np.float32(row[name]) == values[near - 1]


def test_fields_are_those_asked_for(small_plate: Model) -> None:
    model = with_run(small_plate, fields=("ax", "energy"))
    with simulate(model) as results:
        assert results.field("energy", 60).max() > 0
        assert np.abs(results.field("ax", 60)).max() > 0
        with pytest.raises(ResultsError, match=naming(found="field 'damage'", expected=("ax", "energy"))):
            results.field("damage", 60)


def test_energy_fields_add_up_to_the_ledger(small_plate: Model) -> None:
    with simulate(with_run(small_plate, fields=("energy",))) as results:
        total = float(np.sum(results.nodes().area * results.field("energy", 40)))
        assert total == pytest.approx(float(results.history()["strain"][2]), rel=1e-6)


def test_a_run_stops_when_the_plate_has_split(small_plate: Model) -> None:
    model = with_run(small_plate, steps=2000, until="split", ledger=10)
    with simulate(model) as results:
        assert results.meta()["status"] == "finished"
        summary = results.summary()
    assert summary["stopped"] == "split"
    assert summary["steps"] < 2000
    with simulate(with_run(small_plate, steps=summary["steps"] - 10, until="split", ledger=10)) as results:
        assert results.summary()["stopped"] is None  # not ten steps before


@pytest.mark.parametrize("kernel", ["blocks", "listed"])
def test_pieces_are_not_joined_by_cracked_nodes(kernel: str) -> None:
    """Three columns of nodes have lost their bonds to each other, and have all those to both sides."""
    problem = prepare(plate(square_grid(21, 12)), Options(kernel=kernel))
    column, bonds = np.arange(21 * 12) % 21, bonds_of(problem)
    source, target = np.repeat(np.arange(len(column)), np.diff(bonds.start)), bonds.neighbour
    between = np.abs(column - 10) <= 1
    inside = between[source] & between[target]
    assert count_fragments(team_of(*problem)) == 1
    ids = problem.system.model.grid.ids
    broke = Breaks(np.ones(inside.sum(), dtype=np.int64), ids[source[inside]], ids[target[inside]])
    restore_state(*problem, 1, kept(problem), broke)
    assert compute_node_damage(problem.system)[between].min() > CRACKED
    assert compute_node_damage(problem.system)[~between].max() == 0
    for side in (column < 9, column > 11):
        assert (between[source] & side[target]).sum() > 100
    assert count_fragments(team_of(*problem)) == 2


def test_a_run_stops_when_nothing_breaks_any_more(small_plate: Model) -> None:
    model = with_run(small_plate, steps=5000, until="quiet", quiet=2e-6, ledger=10)
    with simulate(model) as results:
        steps, last = results.summary()["steps"], int(results.breaks().step.max())
        assert results.summary()["stopped"] == "quiet"
    assert 40 <= steps - last < 50  # 2 us are 40 steps; looked at every ten


def test_a_plan_knows_what_a_run_takes(small_plate: Model) -> None:
    found = estimate_run(small_plate)
    with simulate(small_plate) as results:
        summary = results.summary()
    assert (found.nodes, pair_count(found.bonds), found.steps) == (summary["nodes"], summary["bonds"], 60)
    assert found.time_step == summary["time_step"]
    assert found.wall_time > 0


def test_a_finished_run_is_left_as_it_is(small_plate: Model, tmp_path: Path) -> None:
    path = tmp_path / "plate.sqlite"
    simulate(small_plate, path).close()
    before = path.read_bytes()
    with resume(path) as again:
        assert again.meta()["status"] == "finished"
    assert path.read_bytes() == before


def test_wall_time_counts_what_was_before_an_interruption(small_plate: Model, tmp_path: Path) -> None:
    path, seen = tmp_path / "plate.sqlite", []

    def slow(progress: Progress) -> bool:
        clock.sleep(0.2)
        seen.append(progress.step)
        return True

    simulate(small_plate, path, watch=slow).close()
    with resume(path) as resumed:
        assert resumed.summary()["wall_time"] > 0.2
    assert len(seen) == 1


def test_a_stop_at_the_last_step_keeps_the_last_frame(small_plate: Model) -> None:
    settings = msgspec.structs.replace(small_plate.settings, run=Run(time_step=50e-9, steps=25, every=10))
    model = dataclasses.replace(small_plate, settings=settings)
    with simulate(model, watch=lambda progress: progress.step == 25) as results:
        assert results.frames()[0].tolist() == [0, 10, 20, 25]
        assert results.meta()["status"] == "finished"


def test_a_run_of_other_bonds_does_not_go_on(small_plate: Model, tmp_path: Path) -> None:
    path = tmp_path / "plate.sqlite"
    simulate(small_plate, path, watch=lambda progress: True).close()
    with tampered(path) as connection:
        connection.execute("UPDATE meta SET value = 1e-9 WHERE key = 'time_step'")
    with pytest.raises(ResultsError, match=naming(found="1e-09 s", expected="5e-08 s")):
        resume(path)
