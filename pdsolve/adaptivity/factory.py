"""Chooses the operator of a moving fine zone."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from pdsolve.adaptivity.hybrid.operator import HybridOperator
from pdsolve.adaptivity.hybrid.prepare import hybrid_of
from pdsolve.model import Model

if TYPE_CHECKING:
    from pdsolve.adaptivity.collocation.operator import CollocationOperator

    Moving = HybridOperator | CollocationOperator


def moving_of(
    model: Model, mode: str, precision: str, step_of: Callable[[Model, float], float], threads: int
) -> tuple[Moving, float]:
    """The operator at the start that `run.adapt` selects, and the surely stable step, s; `step_of` chooses the step.

    Raises ModelError for a model that the method does not support.
    """
    if model.settings.run.adapt == "collocation":
        from pdsolve.adaptivity.collocation.prepare import collocation_of  # few runs need it

        return collocation_of(model, mode, precision, step_of, threads)
    return hybrid_of(model, mode, precision, step_of, threads)
