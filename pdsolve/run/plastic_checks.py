"""Check of the plastic strain: j2 in its total form is for small strains."""

from __future__ import annotations

import warnings

import numpy as np

from pdsolve.model import ModelWarning
from pdsolve.operators.together import unwrap_bond_operator
from pdsolve.run.system import System

LARGEST = 0.1  # plastic strain up to which j2 in its total form counts as one for small strains


def warn_if_plastic_strain_is_large(system: System, step: int) -> bool:
    """Warn if the equivalent plastic strain of a node is above `LARGEST`; returns whether one is."""
    solid = getattr(getattr(unwrap_bond_operator(system.operator), "columns", None), "solid", None)
    if solid is None:
        return False
    p = solid.history[:, :6].astype(float)
    largest = float(np.sqrt(2 / 3 * ((p[:, :3] ** 2).sum(axis=1) + 2 * (p[:, 3:] ** 2).sum(axis=1))).max(initial=0.0))
    if largest <= LARGEST:
        return False
    warnings.warn(
        f"{system.model.name}: step {step}: the plastic strain is {largest:.3g}, more than {LARGEST:g}, and j2 is"
        " for small strains: stress and volume are wrong; use material.form = 'rate' for large ones",
        ModelWarning,
        stacklevel=2,
    )
    return True
