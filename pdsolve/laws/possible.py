"""Materials that no law can have, said before anything is computed."""

from __future__ import annotations

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


def refuse(material: Material, ratio: float, place: str) -> None:
    """Raises ModelError for a material whose model cannot be, or says nothing of what is said; `ratio` is that of
    horizon and spacing."""
    model = material.model

    def no(name: str, expected: str) -> ModelError:
        value = getattr(material, name)
        found = "none" if value is None else f"{value:g}" if isinstance(value, float) else f"'{value}'"
        return ModelError(f"{place}.{name}: found {found}, expected {expected}")

    for name, models in ITS_OWN.items():
        if model not in models and getattr(material, name) != getattr(USUAL, name):
            raise no(name, f"none with model '{model}'")
    if material.failure not in FAILURES[model]:
        raise no("failure", f"one of {', '.join(FAILURES[model])} with model '{model}'")
    if model == "bond":
        return
    if material.nu is None or material.nu >= 0.5:
        raise no("nu", f"Poisson's ratio below 0.5 with model '{model}'")
    if model == "micropolar" and material.nu > BONDS_NU[material.plane] + SAME:
        most = BONDS_NU[material.plane]
        raise no("nu", f"{most:.4g} at most with model 'micropolar' in plane {material.plane}: beams would bend by themselves")
    if material.failure == "stress" and material.strength is None:
        raise no("strength", "the largest principal stress, Pa, as failure is by stress")
    if material.solid == "j2" and material.yield_stress is None:
        raise no("yield_stress", "more than 0 Pa with solid 'j2'")
    if material.hardening < 0:
        raise no("hardening", "0 Pa or more: what softens flows in one row of nodes, however thin")
    if material.form == "rate" and material.solid not in ("linear", "j2"):
        raise no("form", f"'total' with solid '{material.solid}'")
    if material.control == "breitzman-dayal" and (material.form == "rate" or material.solid == "j2"):
        raise no("control", "silling, wan or none where a node has a history")
    if (material.order > 1 or material.constant_term) and material.control not in ("silling", "none"):
        raise no("control", "silling or none with order above 1, or with the constant term")
