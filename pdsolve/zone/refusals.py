"""Errors of models that a moving fine zone does not support."""

from __future__ import annotations

from pdmesh.messages import unfit
from pdsolve.model import Model, ModelError


def check_model_supported(model: Model, largest_ratio: float) -> None:
    """Raise ModelError for a model that a moving fine zone does not support; horizons are at most `largest_ratio`."""
    grid, settings = model.grid, model.settings
    if settings.horizon.ratio > largest_ratio:
        raise create_unsupported_error(
            model, "$.horizon.ratio", f"{settings.horizon.ratio:g}", f"at most {largest_ratio:g}"
        )
    if (grid.delta != grid.delta[0]).any():
        raise create_unsupported_error(
            model,
            "$.nodes",
            "several spacings",
            f"one, the finest, as pdmesh build --adapt {adaptivity_name(model)} makes of its zones",
        )


def adaptivity_name(model: Model) -> str:
    """The adaptivity of a model: "split" or "collocation", or the default "hybrid"."""
    how = model.settings.run.adapt
    return how if how != "none" else "hybrid"


def create_unsupported_error(model: Model, setting: str, actual: str, expected: str) -> ModelError:
    """A ModelError that names the adaptivity and what it does not support."""
    name = setting if setting in ("precision", "kernel") else f"{model.name}: {setting}"
    return ModelError(unfit(name, actual, f"{expected}, as run.adapt is {adaptivity_name(model)}"))
