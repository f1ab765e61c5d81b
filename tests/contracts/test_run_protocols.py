"""What a run asks of its regridder and of its accounts, over all of them: what is stopped goes on to the same bits."""

from __future__ import annotations

import json
import warnings
from pathlib import Path

import pytest
from database_contents import contents

from benchmarks.kinds_of_run import KINDS
from pdsolve.model import ModelWarning
from pdsolve.results import Results
from pdsolve.run.prepare import prepare
from pdsolve.run.recorder import HistoryUntilCheckpoint, open_accounts
from pdsolve.run.simulation import Progress, resume, simulate
from pdsolve.run.subdomain import team_of
from pdsolve.run.system import NODES_STAY

pytestmark = pytest.mark.filterwarnings("ignore::pdsolve.model.ModelWarning")  # bodies this small jump
QUICK = ("bonds", "diffusion", "dissolution, implicit", "heat at rest", "fatigue by K", "particles", "split")
ALL_KINDS = [pytest.param(kind, marks=() if kind in QUICK else pytest.mark.slow) for kind in sorted(KINDS)]


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_a_run_that_is_stopped_goes_on_to_the_same_bits(kind: str, tmp_path: Path) -> None:
    """Nodes, bonds, records, fields and the checkpoint, whatever regrids, and whatever is accounted for."""
    model, options = KINDS[kind]()
    half = model.settings.run.steps // 2

    def stops(progress: Progress) -> bool:
        return progress.step >= half and progress.load_step_progress is None  # which would be lost

    simulate(model, tmp_path / "whole", options).close()
    with simulate(model, tmp_path / "stopped", options, stops) as results:
        assert results.meta()["status"] == "interrupted"
    resume(tmp_path / "stopped", options.threads).close()
    whole, stopped = contents(tmp_path / "whole"), contents(tmp_path / "stopped")
    for table in whole.keys() - {"meta", "checksum"}:
        assert stopped[table] == whole[table], table


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_a_regridder_keeps_its_protocol(kind: str) -> None:
    """It is asked after later steps, changes nothing that has not begun, and goes back to its own checkpoint."""
    model, options = KINDS[kind]()
    system, _ = prepare(model, options)
    regridder, steps = system.regridder, model.settings.run.steps
    assert all(step < regridder.next_check(step, steps) for step in range(steps))
    assert regridder.least_steps >= 1
    assert regridder.collect_change(system) is None
    before = {name: values.tobytes() for name, values in regridder.checkpoint_arrays().items()}
    regridder.restore(regridder.checkpoint_arrays(), system.operator.broken())
    assert {name: values.tobytes() for name, values in regridder.checkpoint_arrays().items()} == before
    json.dumps(regridder.summary(system))
    assert regridder.nodes_may_change == (kind in ("hybrid", "collocation", "split"))
    assert (regridder is NODES_STAY) == (kind not in ("hybrid", "collocation", "split", "particles", "fatigue by K"))


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_accounts_that_are_opened_again_say_the_same(kind: str, tmp_path: Path) -> None:
    """Of a state, with the results so far: the rows are there, and what is asked twice is answered alike."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        model, options = KINDS[kind]()
        simulate(model, tmp_path / "run", options, watch=lambda progress: progress.load_step_progress is None).close()
        with Results.open(tmp_path / "run") as results:
            system, state = prepare(model, options)
            begins = HistoryUntilCheckpoint(0, 0.0, 0, 0, None, len(system.model.grid))
            goes_on = begins._replace(past_results=results)
            first, again = (open_accounts(system, state, team_of(system, state), each) for each in (begins, goes_on))
    first.record(0)
    again.evaluate(0)
    assert json.dumps(first.summary()) == json.dumps(again.summary())
    assert first.balance_error == again.balance_error
    assert first.broken_directed_bond_count == again.broken_directed_bond_count == 0
    assert first.last_break_step == 0
    assert json.dumps(first.metadata()) == json.dumps(again.metadata())
