"""Check of the plastic strain: j2 in its total form is for small strains."""

from __future__ import annotations

import warnings

import numpy as np

from pdsolve.laws.materials.solid import J2
from pdsolve.model import Model, ModelWarning
from pdsolve.operators.protocol import Operator
from pdsolve.run.operator_factory import bonded

LARGEST = 0.1  # plastic strain up to which j2 in its total form counts as one for small strains


def plastic_strain_exceeds(operator: Operator) -> float:
    """The largest equivalent plastic strain of nodes of j2 in its total form, if above `LARGEST`; else 0."""
    solid = getattr(getattr(bonded(operator), "columns", None), "solid", None)
    if solid is None or solid.rate or not (solid.kind == J2).any():
        return 0.0
    p = solid.history[:, :6].astype(float)
    largest = float(np.sqrt(2 / 3 * ((p[:, :3] ** 2).sum(axis=1) + 2 * (p[:, 3:] ** 2).sum(axis=1))).max(initial=0.0))
    return largest if largest > LARGEST else 0.0


def warn_of_plastic_strain(model: Model, step: int, strain: float) -> None:
    """Warn of a plastic strain that is too large for small strains."""
    warnings.warn(
        f"{model.name}: step {step}: found a plastic strain of {strain:.3g}, expected at most {LARGEST:g} where j2 is"
        " for small strains: stress and volume are wrong; material.form = 'rate' is for large ones",
        ModelWarning,
        stacklevel=2,
    )
