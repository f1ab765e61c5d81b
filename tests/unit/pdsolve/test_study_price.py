"""The price of a study before it runs, the heads of its table in words, and the frames of a run."""

from __future__ import annotations

from pathlib import Path

import pytest
from plates import plate, square_grid

from pdmesh.model.document import Run, in_steps, write_file
from pdmesh.model.node_grid import document_of
from pdsolve.diffusion.swelling import CYCLES
from pdsolve.estimate import Plan
from pdsolve.model import Model
from pdsolve.study import plan
from pdsolve.study.description import read_study
from pdsolve.study.table import Column, head


@pytest.fixture
def study_path(tmp_path: Path) -> Path:
    """A study of ten runs of a small plate, with 10 to 100 steps."""
    model = plate(square_grid(6, 6), run=Run(time_step=50e-9, steps=10))
    write_file(document_of(model.grid, model.settings), tmp_path / "plate.json")
    path = tmp_path / "study.toml"
    path.write_text(f'drawing = "plate.json"\n[vary.model]\n"run.steps" = {[10 * n for n in range(1, 11)]}\n')
    return path


def test_a_study_has_a_price_before_it_runs(study_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From three of the runs, the first, the middle and the last; those that are finished cost nothing."""
    steps = []

    def estimate(model: Model, _: object) -> Plan:
        steps.append(model.settings.run.steps)
        return Plan(0, 0, 1, 1.0, 1.0, memory=10**8, wall_time=60.0)

    monkeypatch.setattr(plan, "measure_machine_slowdown", lambda: 1.0)
    monkeypatch.setattr(plan.jit_cache, "is_kept", lambda: True)
    monkeypatch.setattr(plan, "estimate_run", estimate)
    study = read_study(study_path)
    price = plan.price_study(study, set(), workers=2, threads=1)
    assert steps == [10, 50, 100]
    assert price is not None
    assert (price.runs, price.workers, price.memory) == (10, 2, 10**8)
    assert price.core_seconds == pytest.approx(10 * (60 + plan.AROUND))
    assert price.seconds == pytest.approx(plan.START + price.core_seconds / 2)
    assert "about 5.1 min with 2 processes, 0.17 core hours, 100 MB" in plan.price_line(price)
    assert plan.price_study(study, {case.key for case in study.cases()}, 2, 1) is None


def test_a_column_says_what_it_is() -> None:
    assert head("start", Column("measure", "s", "when a crack started")) == "start: when a crack started (s)"
    assert head("forks", Column("measure", "", "")) == "forks"


@pytest.mark.parametrize(("steps", "every"), [(10, 5), (200, 5), (1000, 20), (2000, 50), (100_000, 50)])
def test_a_run_of_200_steps_has_40_frames_unless_its_model_says_otherwise(steps: int, every: int) -> None:
    assert in_steps(Run(steps=steps), 1.0).every == every
    assert in_steps(Run(steps=steps, every=7), 1.0).every == 7
    assert in_steps(Run(duration=1e-3 * steps), 1e-3).every == every


def test_a_swelling_run_records_content_and_motion_of_the_same_time() -> None:
    """Frames that a run of 400 steps or more chooses come at the end of a step of the content."""
    for steps in (400, 700, 1000, 1480, 5000):
        run = in_steps(Run(steps=steps), 1.0)
        assert all(run.frame_interval % cycle == 0 for cycle in CYCLES)
