"""Steppers at rest that decide themselves how far each step goes, and when the last one is taken."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.static_breakage import Breakable
from pdsolve.model import Model, ModelError
from pdsolve.operators.protocol import Operator
from pdsolve.steppers.arc_length_steps import ArcLengthSteps
from pdsolve.steppers.crack_length_steps import CrackLengthSteps
from pdsolve.steppers.fatigue_steps import BondFatigueSteps
from pdsolve.steppers.growing_cracks import CrackGrowth
from pdsolve.steppers.load_steps import LoadSteps
from pdsolve.steppers.paris_steps import ParisSteps
from pdsolve.steppers.path_steps import SofteningPathSteps

CycleOrPathSteps = ArcLengthSteps | CrackLengthSteps | BondFatigueSteps | ParisSteps | SofteningPathSteps


def make_fatigue_stepper(
    model: Model,
    operator: Operator,
    load_steps: LoadSteps,
    breakable: Breakable | None,
    family_size: NDArray[np.int64],
    uncut_bond_count: NDArray[np.int64],
    growth: CrackGrowth | None,
) -> BondFatigueSteps | ParisSteps:
    """Steps of a model with fatigue: of cracks that `growth` grows, or of bonds; see `BondFatigueSteps`. Raises
    ModelError."""
    law = model.settings.run.fatigue
    assert law is not None
    if growth is not None:
        return ParisSteps(law, operator, load_steps, growth)
    if breakable is None:
        raise ModelError(f"{model.name}: $.run.fatigue: no bond may break; let some tire")
    return BondFatigueSteps(law, operator, load_steps, breakable, family_size, uncut_bond_count)
