"""Materials that no law can have, said before anything is computed."""

from __future__ import annotations

from pdmesh.model.document import Material
from pdsolve.model import ModelError

FAILURES = {
    "bond": ("stretch",),
    "ordinary": ("stretch", "energy", "none"),
    "correspondence": ("stretch", "energy", "stress", "none"),
    "micropolar": ("stretch", "none"),
}
ITS_OWN = {  # name: the models that know it
    "influence": ("ordinary", "correspondence", "micropolar"),
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
