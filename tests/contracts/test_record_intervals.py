"""What is recorded, and how often, changes nothing of a run: its state at the end is bit-identical."""

from __future__ import annotations

import dataclasses

import msgspec
import numpy as np
import pytest

from benchmarks.kinds_of_run import KINDS
from pdsolve.run.simulation import simulate

pytestmark = pytest.mark.filterwarnings("ignore::pdsolve.model.ModelWarning")  # bodies this small jump
QUICK = ("bonds", "diffusion", "heat", "slow heat")
ALL_KINDS = [pytest.param(kind, marks=() if kind in QUICK else pytest.mark.slow) for kind in sorted(KINDS)]


def last_checkpoint(kind: str, every: int, ledger: int | None) -> dict[str, bytes]:
    """The state at the end, and the bonds broken until then, of a small run with these record intervals."""
    model, options = KINDS[kind]()
    run = msgspec.structs.replace(model.settings.run, every=every, ledger=ledger)
    model = dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, run=run))
    with simulate(model, None, options) as results:
        step, checkpoint = results.checkpoint()
        broken = {f"broken {n}": column for n, column in enumerate(results.breaks())}
        arrays = checkpoint | broken | {"step": np.array(step)}
        return {name: np.ascontiguousarray(values).tobytes() for name, values in arrays.items()}


@pytest.mark.parametrize("kind", ALL_KINDS)
def test_record_intervals_change_no_result(kind: str) -> None:
    usual = last_checkpoint(kind, 5, 5)
    for every, ledger in ((10, None), (7, 3)):
        other = last_checkpoint(kind, every, ledger)
        assert usual.keys() == other.keys()
        assert [name for name in usual if usual[name] != other[name]] == []
