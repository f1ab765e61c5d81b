"""Steppers at rest that decide themselves how far each step goes, and when the last one is taken."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.static_breakage import Breakable
from pdsolve.model import Model
from pdsolve.operators.protocol import Operator
from pdsolve.steppers.arc_length_steps import ArcLengthSteps
from pdsolve.steppers.crack_length_steps import CrackLengthSteps
from pdsolve.steppers.fatigue_steps import BondFatigueSteps, make_bond_fatigue_steps
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
    """Steps of a model with fatigue: of cracks that `growth` grows, or of bonds; see `make_bond_fatigue_steps`. Raises
    ModelError."""
    law = model.settings.run.fatigue
    if growth is not None and law is not None:
        return ParisSteps(law, operator, load_steps, growth)
    return make_bond_fatigue_steps(model, operator, load_steps, breakable, family_size, uncut_bond_count)
