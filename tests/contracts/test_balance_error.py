"""The balance error is one number in the summary of a run, in its progress and in measures of its results."""

from __future__ import annotations

import pytest

from benchmarks.kinds_of_run import KINDS
from pdsolve.measures.balance import energy_balance
from pdsolve.run.simulation import simulate

pytestmark = pytest.mark.filterwarnings("ignore::pdsolve.model.ModelWarning")  # bodies this small jump
WITHOUT_MOTION = {kind for kind in KINDS if kind.startswith(("diffusion", "dissolution"))}
QUICK = ("bonds", "heat", "slow heat")
KINDS_OF_MOTION = sorted(KINDS.keys() - WITHOUT_MOTION)
MOTIONS = [pytest.param(kind, marks=() if kind in QUICK else pytest.mark.slow) for kind in KINDS_OF_MOTION]


@pytest.mark.parametrize("kind", MOTIONS)
def test_a_run_and_its_results_have_one_balance_error(kind: str) -> None:
    with simulate(KINDS[kind]()[0], None, KINDS[kind]()[1]) as results:
        summary, error, work = results.summary(), energy_balance(results).error, results.history()["work"]
        initial = float(results.meta()["initial_energy"])
    assert error[-1] == pytest.approx(summary["balance"], rel=1e-12)
    supplied = max(abs(work).max(), initial)
    assert summary["energy_supplied"] == pytest.approx(supplied, rel=1e-12)  # also of heat that strains what is free
