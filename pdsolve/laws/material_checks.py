"""Checks of materials and of laws by the bonds that they make, before a model is solved."""

from __future__ import annotations

import numpy as np

from pdmesh.model.fracture_energy import LARGE_STRETCH, SOFT, TOUGH
from pdmesh.model.material_constants import critical_stretch
from pdsolve.laws import LAWS, limits
from pdsolve.laws.bond_limits import Sizes
from pdsolve.laws.law import Pair
from pdsolve.laws.pair import no_bonds
from pdsolve.model import Model

SAMPLES = 64  # stretches at which the secant of a law is looked at


def remarks(model: Model) -> list[str]:
    """Remarks on materials whose bonds stretch absurdly far, and on laws whose bonds push when they are stretched."""
    numbers, said = np.arange(len(model.materials)), dict[str, str]()
    ratio, spacing = model.settings.horizon.ratio, float(model.grid.delta.min())
    for some, material in model.material_columns.of(numbers):
        if material.model != "bond" or (pair := LAWS[material.law].pair) is None:
            continue
        own = numbers[some]
        length, horizon = np.full(len(own), spacing), np.full(len(own), ratio * spacing)
        peak, limit = limits(material, Sizes(critical_stretch(material, horizon), length, horizon, ratio))
        stiffness = np.array([model.materials[n].E if model.materials[n].G0 < TOUGH else SOFT for n in own])
        worst = int(np.argmax(np.where(stiffness < SOFT, peak, 0.0)))
        if peak[worst] > LARGE_STRETCH and stiffness[worst] < SOFT:
            one, place = model.materials[own[worst]], model.place_of(int(own[worst])).removeprefix(f"{model.name}: ")
            said.setdefault(
                "stretch",
                f"{place}: E = {one.E:g} Pa and G0 = {one.G0:g} J/m^2 give bonds that carry up to a stretch of"
                f" {peak[worst]:.2g}, more than {LARGE_STRETCH:g}: is E in Pa, not in MPa or GPa?",
            )
        wrong = negative_secant(pair, material.law, float(peak[0]), float(limit[0]))
        if wrong is not None:
            said.setdefault(material.law, wrong)
    return list(said.values())


def negative_secant(pair: Pair, name: str, peak: float, limit: float) -> str | None:
    """A remark on a law whose secant is negative, or no number, for a bond with these stretches; None if it is not."""
    if pair.secant is None:
        return None
    stretch = limit * np.arange(1, SAMPLES + 1) / SAMPLES
    worst = np.zeros(SAMPLES)
    if pair.softening is not None:
        stretch = peak + (limit - peak) * np.arange(1, SAMPLES + 1) / SAMPLES
        worst = stretch
    with np.errstate(all="ignore"):
        secant = pair.secant(no_bonds(LAWS[name]), stretch, worst, peak, limit)
    secant = np.broadcast_to(np.asarray(secant, dtype=float), stretch.shape)
    bad = np.flatnonzero(~(secant >= -np.finfo(float).eps))
    if not len(bad) or (pair.softening is not None and peak == limit):
        return None
    at = stretch[bad[0]]
    return (
        f"law '{name}' has a secant of {secant[bad[0]]:.3g} at the stretch {at:.3g}, {at / limit:.2g} of the limit;"
        " use 0 or more: such bonds push where they are stretched, and runs do not stay stable"
    )
