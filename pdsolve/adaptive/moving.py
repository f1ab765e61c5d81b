"""Fine zones that move, of whatever kind."""

from __future__ import annotations

from collections.abc import Callable

from pdsolve.adaptive.collocation import march as collocation
from pdsolve.adaptive.collocation.shown import Collocated
from pdsolve.adaptive.collocation.system import collocation_of
from pdsolve.adaptive.energy import held
from pdsolve.adaptive.march import march
from pdsolve.adaptive.precracks import begin_coarse
from pdsolve.adaptive.shown import Shown
from pdsolve.adaptive.system import hybrid_of
from pdsolve.compiled import settle
from pdsolve.model import Model

Moving = Shown | Collocated


def moving_of(
    model: Model, mode: str, precision: str, step_of: Callable[[Model, float], float], threads: int
) -> tuple[Moving, float]:
    """The run as it starts, as `run.adapt` says, and the surely stable step, s; `step_of` chooses the step.

    Raises ModelError for what cannot be solved so.
    """
    if model.settings.run.adapt == "collocation":
        settle(collocation.march, collocation.held)
        return collocation_of(model, mode, precision, step_of, threads)
    settle(march, held, begin_coarse)
    return hybrid_of(model, mode, precision, step_of, threads)
