"""What one bond does, a law a file; the names users give them in one table."""

from __future__ import annotations

from types import ModuleType

from pdsolve.laws import bilinear, brittle, ordinary
from pdsolve.model import Model, ModelError

LAWS: dict[str, ModuleType] = {"brittle": brittle, "bilinear": bilinear, "ordinary": ordinary}
PAIRS = (brittle, bilinear)  # which the fast kernel knows, too


def law_of(model: Model) -> ModuleType:
    """The law of a model's bonds. Raises ModelError for one that is not known, and for several that do not mix."""
    found = {material.law: number for number, material in enumerate(model.materials)}
    for name, number in found.items():
        if name not in LAWS:
            place = "$.material" if number == 0 else f"$.regions[{number - 1}].material"
            raise ModelError(f"{model.name}: {place}.law: found '{name}', expected one of {', '.join(LAWS)}")
    laws = [LAWS[name] for name in found]
    if len(laws) > 1 and any(law not in PAIRS for law in laws):
        raise ModelError(f"{model.name}: law: found {' and '.join(found)} in one plate, expected one of them")
    return bilinear if len(laws) > 1 else laws[0]  # a bilinear bond whose peak is its limit is brittle
