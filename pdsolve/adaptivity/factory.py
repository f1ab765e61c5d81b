"""Fine zones that move, of whatever kind."""

from __future__ import annotations

from collections.abc import Callable

from pdsolve.adaptivity.collocation.operator import CollocationOperator
from pdsolve.adaptivity.collocation.prepare import collocation_of
from pdsolve.adaptivity.hybrid.operator import HybridOperator
from pdsolve.adaptivity.hybrid.prepare import hybrid_of
from pdsolve.model import Model

Moving = HybridOperator | CollocationOperator


def moving_of(
    model: Model, mode: str, precision: str, step_of: Callable[[Model, float], float], threads: int
) -> tuple[Moving, float]:
    """The run as it starts, as `run.adapt` says, and the surely stable step, s; `step_of` chooses the step.

    Raises ModelError for what cannot be solved so.
    """
    if model.settings.run.adapt == "collocation":
        return collocation_of(model, mode, precision, step_of, threads)
    return hybrid_of(model, mode, precision, step_of, threads)
