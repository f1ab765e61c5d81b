"""What a study is said to take: processes that start, kernels that are compiled, runs that are shared out."""

from __future__ import annotations

from pathlib import Path

import pytest
from plates import GEOMETRIES

from pdsolve import estimate
from pdsolve.codegen import jit_cache
from pdsolve.study import plan


@pytest.mark.parametrize(
    ("runs", "workers", "seconds"),
    [([4.0], 1, 4.0), ([1.0] * 5, 2, 3.0), ([1.0, 1.0, 9.0], 2, 10.0), ([9.0, 1.0, 1.0], 2, 9.0), ([2.0] * 6, 3, 4.0)],
)
def test_a_run_is_taken_by_the_process_that_is_free_first(runs: list[float], workers: int, seconds: float) -> None:
    assert plan.wall_time_of_processes(runs, workers) == seconds


def promised(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, times: int, kept: bool = True) -> dict[str, float]:
    """What repetitions of the Duran plate are said to take by two processes, on the machine of the estimate."""
    for module in (plan, estimate):
        monkeypatch.setattr(module, "measure_machine_slowdown", lambda: 1.0)
    monkeypatch.setattr(plan, "cores", lambda: 2)
    monkeypatch.setattr(jit_cache, "is_kept", lambda: kept)
    path = tmp_path / "study.toml"
    path.write_text(f'drawing = "{GEOMETRIES / "duran50.geo"}"\n[repeat]\ntimes = {times}\nstep = 0.1\n')
    return plan.plan_study(path)


@pytest.mark.slow
def test_what_is_not_steps_is_promised_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """One run is of one process, and five take two of them as long as three."""
    one, five = (promised(tmp_path, monkeypatch, times) for times in (1, 5))
    each = one["study_seconds"] - plan.START
    assert (one["workers"], five["workers"]) == (1, 2)
    assert each == pytest.approx(one["solve_seconds"] + plan.AROUND + 2732 * plan.AROUND_NODE)
    assert five["study_seconds"] == pytest.approx(plan.START + 3 * each)
    assert five["solve_seconds"] == pytest.approx(5 * one["solve_seconds"])


@pytest.mark.slow
def test_kernels_that_are_not_kept_are_compiled_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    warm, cold = (promised(tmp_path, monkeypatch, 3, kept) for kept in (True, False))
    assert cold["study_seconds"] == pytest.approx(warm["study_seconds"] + plan.COMPILE)
    assert len(plan.study_plan_lines(cold)) == len(plan.study_plan_lines(warm)) + 1


def test_kept_kernels_are_seen(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(jit_cache, "folder_of", lambda file: tmp_path / Path(file).stem)
    assert not jit_cache.is_kept()
    (tmp_path / "verlet").mkdir()
    assert not jit_cache.is_kept()
    (tmp_path / "verlet" / "verlet.py311.nbi").touch()
    assert jit_cache.is_kept()
