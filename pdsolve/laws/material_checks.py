"""Checks of materials and of laws by the bonds that they make, before a model is solved."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.fracture_energy import LARGE_STRETCH, SOFT, TOUGH
from pdmesh.model.material import Material
from pdmesh.model.material_constants import critical_stretch
from pdsolve.laws import LAWS, limits
from pdsolve.laws.law import Limits, Pair, Sizes
from pdsolve.laws.pair import no_bonds
from pdsolve.model import Model

SAMPLES = 64  # stretches at which the secant of a law is looked at


def remarks(model: Model) -> list[str]:
    """Remarks on materials whose bonds stretch absurdly far, and on laws whose bonds push when they are stretched."""
    absurd = []
    for own, _, (peak, _) in _bonds_of_materials(model):
        stiffness = np.array([model.materials[n].E if model.materials[n].G0 < TOUGH else SOFT for n in own])
        worst = int(np.argmax(np.where(stiffness < SOFT, peak, 0.0)))
        if peak[worst] > LARGE_STRETCH and stiffness[worst] < SOFT:
            one, place = model.materials[own[worst]], model.place_of(int(own[worst])).removeprefix(f"{model.name}: ")
            absurd.append(
                f"{place}: E = {one.E:g} Pa and G0 = {one.G0:g} J/m^2 give bonds that carry up to a stretch of"
                f" {peak[worst]:.2g}, more than {LARGE_STRETCH:g}: is E in Pa, not in MPa or GPa?"
            )
            break  # the first materials alike are enough
    return [*absurd, *negative_secants(model).values()]


def negative_secants(model: Model) -> dict[str, str]:
    """Remarks on laws of a model's bonds whose secant turns negative, by the law's name."""
    remark_by_law: dict[str, str] = {}
    for _, material, (peak, limit) in _bonds_of_materials(model):
        pair = LAWS[material.law].pair
        assert pair is not None
        wrong = negative_secant(pair, material.law, float(peak[0]), float(limit[0]))
        if wrong is not None:
            remark_by_law.setdefault(material.law, wrong)
    return remark_by_law


def _bonds_of_materials(model: Model) -> Iterator[tuple[NDArray[np.int64], Material, Limits]]:
    """Numbers (k,) of materials of bonds that differ in numbers alone, their words, and limits (k,) of the shortest
    bonds."""
    numbers = np.arange(len(model.materials))
    ratio, spacing = model.settings.horizon.ratio, float(model.grid.delta.min())
    for some, material in model.material_columns.of(numbers):
        if material.model == "bond" and LAWS[material.law].pair is not None:
            own = numbers[some]
            length, horizon = np.full(len(own), spacing), np.full(len(own), ratio * spacing)
            sizes = Sizes(critical_stretch(material, horizon), length, horizon, ratio)
            yield own, material, limits(material, sizes)


def negative_secant(pair: Pair, name: str, peak: float, limit: float) -> str | None:
    """A remark on a law whose secant is negative, or no number, for a bond with these stretches; None if it is not.

    Compressed bonds are looked at up to the size of the limit.
    """
    if pair.secant is None or (pair.softening is not None and peak == limit):
        return None
    part = np.arange(1, SAMPLES + 1) / SAMPLES
    stretch, worst, compressed = limit * part, np.zeros(SAMPLES), np.zeros(SAMPLES)
    if pair.softening is not None:
        stretch = worst = peak + (limit - peak) * part
        compressed = worst
    sampled = [(stretch, worst)]
    if not pair.elastic_in_compression:
        sampled += [(np.full(SAMPLES, -limit * share), compressed) for share in part]
    for stretches, largest in sampled:
        with np.errstate(all="ignore"):
            secants = pair.secant(no_bonds(LAWS[name]), stretches, largest, peak, limit)
        secant = np.broadcast_to(np.asarray(secants, dtype=float), stretches.shape)
        bad = np.flatnonzero(~(secant >= -np.finfo(float).eps))
        if len(bad):
            at = float(stretches[bad[0]])
            does = "push where they are stretched" if at > 0 else "pull where they are compressed"
            return (
                f"law '{name}' has a secant of {secant[bad[0]]:.3g} at the stretch {at:.3g}, {at / limit:.2g} of the"
                f" limit; use 0 or more: such bonds {does}, and runs do not stay stable"
            )
    return None
