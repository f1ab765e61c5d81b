"""Bonds of loads and holds that must not break, where a crack arrives: reported, as they hold it like a hinge."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Condition
from pdmesh.model.suggestions import called
from pdsolve.model import Model
from pdsolve.operators.softening_bonds import SofteningBonds

CRACKED = 5.0  # peaks: a stretch of bonds that a crack has gone through


def describe_crack_at_no_fail_bonds(
    model: Model, bonds: SofteningBonds, displacement: NDArray[np.float64]
) -> str | None:
    """What there is to say of no-fail bonds beyond the peak of others at displacements (n, d), beside cracked bonds."""
    keeps = ~np.isfinite(bonds.limit)
    if not keeps.any() or keeps.all():
        return None
    peaks = bonds.stretches(displacement) / float(bonds.peak[~keeps].max())
    cracked = np.zeros(len(displacement), dtype=bool)
    for end in (bonds.source, bonds.target):
        cracked[end[~keeps & (peaks > CRACKED)]] = True
    at_crack = cracked[bonds.source] | cracked[bonds.target]
    peaks = np.where(keeps & at_crack, peaks, 0.0)
    worst = int(peaks.argmax())
    if peaks[worst] < 1:
        return None
    ends = bonds.source[worst], bonds.target[worst]
    for number, condition in enumerate(model.settings.conditions):
        if not isinstance(condition, Condition) or condition.breakable:
            continue
        if np.isin(ends, model.selected(condition)).any():
            return (
                f"$.conditions[{number}]: bonds of '{called(condition.name, number)}', which do not break, are"
                f" stretched to {peaks[worst]:.2f} times the peak of others at the end of a crack; use breakable ="
                " true"
            )
    return None
