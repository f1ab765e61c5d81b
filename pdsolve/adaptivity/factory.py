"""Chooses the operator of a moving fine zone."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from pdsolve.adaptivity.hybrid.operator import HybridOperator
from pdsolve.adaptivity.hybrid.prepare import create_hybrid_operator_and_stable_step
from pdsolve.adaptivity.hybrid.space.operator import HybridBodyOperator
from pdsolve.adaptivity.hybrid.space.prepare import create_body_operator_and_stable_step
from pdsolve.model import Model

if TYPE_CHECKING:
    from pdsolve.adaptivity.collocation.operator import CollocationOperator

    MovingZoneOperator = HybridOperator | HybridBodyOperator | CollocationOperator


def create_zone_operator_and_stable_step(
    model: Model, precision: str, choose_time_step: Callable[[Model, float], float], threads: int
) -> tuple[MovingZoneOperator, float]:
    """The operator at the start that `run.adapt` selects, and the surely stable step, s; `choose_time_step` takes it.

    Raises ModelError for a model that the method does not support.
    """
    if model.settings.run.adapt == "collocation":
        from pdsolve.adaptivity.collocation.prepare import (
            create_collocation_operator_and_stable_step,
        )  # few runs need it

        return create_collocation_operator_and_stable_step(model, choose_time_step, threads)
    if model.grid.dimension == 3:
        return create_body_operator_and_stable_step(model, precision, choose_time_step, threads)
    return create_hybrid_operator_and_stable_step(model, precision, choose_time_step, threads)
