"""Materials that no law can have, said before anything is computed."""

from __future__ import annotations

from collections.abc import Iterator

from pdmesh.model.continuum import BONDS_NU
from pdmesh.model.document import Material
from pdsolve.model import ModelError

FAILURES = {
    "bond": ("stretch",),
    "ordinary": ("stretch", "energy", "none"),
    "correspondence": ("stretch", "energy", "stress", "none"),
    "micropolar": ("stretch", "none"),
}
ITS_OWN = {  # name: the models that know it
    "influence": ("ordinary", "correspondence"),
    "strength": ("correspondence",),
    "solid": ("correspondence",),
    "form": ("correspondence",),
    "control": ("correspondence",),
    "order": ("correspondence",),
    "constant_term": ("correspondence",),
    "yield_stress": ("correspondence",),
    "hardening": ("correspondence",),
    "law": ("bond",),
    "kr": ("bond",),
}
SAME = 1e-12
USUAL = Material(E=1.0, rho=1.0, G0=1.0)


def refuse(material: Material, place: str) -> None:
    """Raises ModelError for a material whose model cannot be, or says nothing of what is said."""
    for name, expected in (*_unheard(material), *_impossible(material)):
        value = getattr(material, name)
        found = "none" if value is None else f"{value:g}" if isinstance(value, float) else f"'{value}'"
        raise ModelError(f"{place}.{name}: found {found}, expected {expected}")


def _unheard(material: Material) -> Iterator[tuple[str, str]]:
    """What is said and means nothing to the model: its name, and what was expected."""
    model = material.model
    for name, models in ITS_OWN.items():
        if model not in models and getattr(material, name) != getattr(USUAL, name):
            yield name, f"none with model '{model}'"
    if material.sight == "visibility" and material.gamma != USUAL.gamma:
        yield "gamma", "none with sight 'visibility'"
    if material.failure not in FAILURES[model]:
        yield "failure", f"one of {', '.join(FAILURES[model])} with model '{model}'"


def _impossible(material: Material) -> Iterator[tuple[str, str]]:
    """What cannot be, likewise."""
    model, most = material.model, BONDS_NU[material.plane]
    beyond = material.order > 1 or material.constant_term
    remembers = material.form == "rate" or material.solid == "j2"
    if model == "bond":
        return
    if material.nu is None or material.nu >= 0.5:
        yield "nu", f"Poisson's ratio below 0.5 with model '{model}'"
    elif model == "micropolar" and material.nu > most + SAME:
        yield "nu", f"{most:.4g} at most with model 'micropolar' in plane {material.plane}: its beams are soft beyond"
    if material.failure == "stress" and material.strength is None:
        yield "strength", "the largest principal stress, Pa, as failure is by stress"
    if material.solid == "j2" and material.yield_stress is None:
        yield "yield_stress", "more than 0 Pa with solid 'j2'"
    if material.hardening < 0:
        yield "hardening", "0 Pa or more: what softens flows in one row of nodes, however thin"
    if material.form == "rate" and material.solid not in ("linear", "j2"):
        yield "form", f"'total' with solid '{material.solid}'"
    if material.control == "breitzman-dayal" and remembers:
        yield "control", "silling, wan or none where a node has a history"
    if beyond and material.control not in ("silling", "none"):
        yield "control", "silling or none with order above 1, or with the constant term"
