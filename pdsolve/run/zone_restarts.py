"""Fine zones that come too late: the run goes back, and makes cells fine sooner from a step before that on.

The step is a multiple of a fixed number, and what is done between the checkpoint gone back to and that step is done
again: results depend neither on when frames and checkpoints were written nor on whether a run was stopped meanwhile.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pdsolve.adaptivity.hybrid.adaptivity_choice import (
    model_with_refinement_stretch_ratio,
    model_with_wider_zone_or_fine_everywhere,
    refinement_stretch_ratio,
)
from pdsolve.errors import FineZoneTooLateError
from pdsolve.model import Model, ModelWarning
from pdsolve.results import Results, ResultsError
from pdsolve.run.system import RefinementThresholdFromStep
from pdsolve.zone.cells import EVERY

KEY = "sooner"  # of `meta`
BETWEEN = 40  # steps between those from which on cells may come sooner: far more than a look at the zone, few to repeat


def plan_zone_restart(
    model: Model,
    refinement_thresholds: tuple[RefinementThresholdFromStep, ...],
    fine_zone_too_late: FineZoneTooLateError,
) -> tuple[Model, tuple[RefinementThresholdFromStep, ...]]:
    """The model to solve after fine cells came too late, and from when on they are to come sooner.

    A run that has no such step before that but the first begins anew with a wider zone. So does one for which no wider
    zone is left, first with the widest from the start, then with fine nodes everywhere.
    """
    now = (
        model_with_refinement_stretch_ratio(model, refinement_thresholds[-1].refinement_stretch_ratio)
        if refinement_thresholds
        else model
    )
    wider = model_with_wider_zone_or_fine_everywhere(now)
    step = max(fine_zone_too_late.step - EVERY - 1, 0) // BETWEEN * BETWEEN
    if wider.settings.run.adapt == "none":
        return (now if refinement_thresholds else wider), ()
    if step == 0 or model.grid.dimension == 3:
        return wider, ()
    return model, (
        *(refinement for refinement in refinement_thresholds if refinement.first_step < step),
        RefinementThresholdFromStep(step, refinement_stretch_ratio(wider)),
    )


def warn_of_zone_restart(
    model: Model,
    fine_zone_too_late: FineZoneTooLateError,
    model_with_wider_zone: Model,
    refinement_thresholds: tuple[RefinementThresholdFromStep, ...],
    checkpoint_step: int,
) -> None:
    """Warn of what is done about cells that came too late: of the step that is gone back to."""
    if model_with_wider_zone.settings.run.adapt == "none":
        how = "fine nodes everywhere (run.adapt none)"
    else:
        kappa = refinement_stretch_ratio(model_with_wider_zone)
        if refinement_thresholds:
            kappa = refinement_thresholds[-1].refinement_stretch_ratio
        how = f"run.hybrid.kappa {kappa:g}"
    words = f"begins anew with {how}"
    if refinement_thresholds:
        first_step = refinement_thresholds[-1].first_step
        words = f"goes back to step {checkpoint_step}, and on with {how} from step {first_step} on"
    warnings.warn(f"{model.name}: {fine_zone_too_late}; {words}", ModelWarning, stacklevel=3)


def find_restart_checkpoint_step(
    output: Path | None, refinement_thresholds: tuple[RefinementThresholdFromStep, ...]
) -> int:
    """The step of the checkpoint to go back to, 0 for the start."""
    if output is None or not refinement_thresholds or not output.exists():
        return 0
    with Results.open(output) as results:
        step = results.checkpoint_step() if results.has_checkpoint() else 0
    return step if step <= refinement_thresholds[-1].first_step else 0


def refinement_threshold_metadata(refinement_thresholds: tuple[RefinementThresholdFromStep, ...]) -> dict[str, Any]:
    """What a database says of cells that come sooner."""
    return {KEY: json.dumps(refinement_thresholds)} if refinement_thresholds else {}


def read_refinement_thresholds(metadata: Mapping[str, Any], path: Path) -> tuple[RefinementThresholdFromStep, ...]:
    """What the metadata of a database say of cells that come sooner. Raises ResultsError."""
    try:
        refinement_thresholds = tuple(
            RefinementThresholdFromStep(int(step), float(kappa))
            for step, kappa in json.loads(str(metadata.get(KEY, "[]")))
        )
    except (TypeError, ValueError, OverflowError):
        refinement_thresholds = (RefinementThresholdFromStep(-1, 0.0),)
    if not all(
        refinement.first_step >= 0 and 0 < refinement.refinement_stretch_ratio < 1
        for refinement in refinement_thresholds
    ):
        raise ResultsError(f"{path}: {KEY} is {str(metadata[KEY])[:40]!r}; it must be steps and shares of a stretch")
    return refinement_thresholds
