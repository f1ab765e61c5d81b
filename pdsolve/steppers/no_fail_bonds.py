"""Bonds of loads and holds that must not break, where a crack would pass: reported, as they hold it like a hinge."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Condition
from pdmesh.model.suggestions import called
from pdsolve.model import Model
from pdsolve.operators.softening_bonds import SofteningBonds


def held_crack(model: Model, bonds: SofteningBonds, value: NDArray[np.float64]) -> str | None:
    """What there is to say of the no-fail bond that is stretched most at displacements (n, d); None of small ones."""
    keeps = ~np.isfinite(bonds.limit)
    if not keeps.any() or keeps.all():
        return None
    peaks = np.where(keeps, bonds.stretches(value), 0.0) / float(bonds.peak[~keeps].max())
    worst = int(peaks.argmax())
    if peaks[worst] < 1:
        return None
    ends = {int(bonds.source[worst]), int(bonds.target[worst])}
    for number, condition in enumerate(model.settings.conditions):
        if (
            isinstance(condition, Condition)
            and not condition.breakable
            and ends & set(model.selected(condition).tolist())
        ):
            return (
                f"$.conditions[{number}]: found bonds of '{called(condition.name, number)}', which do not break,"
                f" stretched to {peaks[worst]:.2f} times the peak of others, where a crack may have to pass; expected"
                " breakable = true"
            )
    return None
