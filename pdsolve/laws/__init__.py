"""Bond laws, one a file, and two tables of their names for users."""

from __future__ import annotations

import warnings
from dataclasses import replace

from pdmesh.model.material import Material
from pdmesh.model.material_constants import BONDS_NU
from pdmesh.spelling import meant
from pdsolve.laws import (
    breitzman_dayal,
    cohesive_micropolar,
    correspondence,
    higher_order_correspondence,
    micropolar,
    ordinary,
    plastic_correspondence,
    wan,
)
from pdsolve.laws.law import Law, Limits, Sizes
from pdsolve.laws.pair_laws import bilinear, brittle, cohesive
from pdsolve.model import Model, ModelError, ModelWarning

LAWS: dict[str, Law] = {  # of bonds alone
    "brittle": brittle.LAW,
    "bilinear": bilinear.LAW,
    "cohesive": cohesive.LAWS["linear"],  # and of other shapes there
}
MODELS: dict[str, Law] = {  # of families, and of beams
    "ordinary": ordinary.LAW,
    "correspondence": correspondence.LAW,
    "micropolar": micropolar.LAW,
}


def limits(material: Material, bonds: Sizes) -> Limits:
    """Stretches (b,) at which a material's bonds change, by its law."""
    pair = LAWS[material.law].pair
    assert pair is not None
    return pair.limits(material, bonds)


def law_of(model: Model, matches_work: bool = True) -> Law:
    """The law of a model's bonds; `matches_work`: what they take from the motion is the area below its curve.

    Raises ModelError for an unknown law. Warns if a material has a measured Poisson's ratio that differs from that of
    its law.
    """
    laws = [law_named(material, model.place_of(number)) for number, material in enumerate(model.materials)]
    for material, law in zip(model.materials, laws, strict=True):
        fixed = BONDS_NU[material.plane]
        if law.pair is not None and material.nu is not None and abs(material.nu - fixed) > 0.01:
            warnings.warn(
                f"{model.name}: nu is {material.nu:g}; bonds have {fixed:.4g} in plane {material.plane}",
                ModelWarning,
                stacklevel=2,
            )
    common_law = laws[0] if all(law is laws[0] for law in laws) else bilinear.LAW  # of brittle and bilinear ones
    if common_law in (correspondence.LAW, wan.LAW) and any(material.solid == "j2" for material in model.materials):
        return plastic_correspondence.LAW
    return common_law if matches_work else replace(common_law, matches_work=False)


def law_named(material: Material, place: str) -> Law:
    """The law of a material's bonds. Raises ModelError for an unknown one."""
    if material.model != "bond":
        if material.control == "breitzman-dayal":
            return breitzman_dayal.LAW
        if material.control == "wan":
            return wan.LAW
        if material.order > 1 or material.constant_term:
            return higher_order_correspondence.LAW
        if material.model == "micropolar" and material.law == "cohesive":
            return cohesive_micropolar.LAWS[material.shape]
        return MODELS[material.model]
    if material.law not in LAWS:
        near = meant(material.law, LAWS)
        hint = f" (did you mean '{near}'?)" if near else ""
        hint = f" (or material.model = '{material.law}')" if material.law in MODELS else hint
        raise ModelError(f"{place}.law is '{material.law}'; use one of {', '.join(LAWS)}{hint}")
    if material.law == "cohesive":
        return cohesive.LAWS[material.shape]
    return LAWS[material.law]
