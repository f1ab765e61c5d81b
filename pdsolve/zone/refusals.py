"""Errors of models whose nodes a moving fine zone, or cells that split, cannot begin with."""

from __future__ import annotations

from pdmesh.messages import unfit
from pdsolve.model import Model, ModelError


def check_one_spacing(model: Model) -> None:
    """Raise ModelError for nodes of several spacings."""
    delta, adapt = model.grid.delta, model.settings.run.adapt
    if (delta != delta[0]).any():
        which = "coarsest" if adapt == "split" else "finest"
        use = f"one, the {which}, as pdmesh build --adapt {adapt} makes it"
        raise create_unsupported_error(model, "$.nodes", "of several spacings", use)


def check_straight_at_rest(model: Model, stretch: float) -> None:
    """Raise ModelError for a law for whose bonds coarse springs can stand up to no `stretch`."""
    if stretch == 0:
        law = f"{model.place_of(0)}.law", f"'{model.materials[0].law}'"
        raise create_unsupported_error(model, *law, "a law whose secant at rest is 1")


def create_unsupported_error(model: Model, setting: str, actual: str, expected: str) -> ModelError:
    """A ModelError that names the adaptivity and what it does not support."""
    use = f"{expected}, as run.adapt is {model.settings.run.adapt}"
    return ModelError(unfit(f"{model.name}: {setting}", actual, use))
