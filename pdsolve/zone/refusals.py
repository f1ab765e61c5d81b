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


def create_unsupported_error(model: Model, setting: str, actual: str, expected: str) -> ModelError:
    """A ModelError that names the adaptivity and what it does not support."""
    use = f"{expected}, as run.adapt is {model.settings.run.adapt}"
    return ModelError(unfit(f"{model.name}: {setting}", actual, use))
