"""Stored fields of a frame, and the option that stores a missing one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.output_fields import of_dimension
from pdsolve.results import Results, ResultsError

OF_DIFFUSION = ("concentration", "content", "solid", "temperature")


def scalar(results: Results, name: str, step: int) -> NDArray[np.float64]:
    """A field (n,) of the frame at `step`, SI. Raises ResultsError naming the stored fields."""
    return _columns(results, name, step)[0]


def vector(results: Results, name: str, step: int) -> NDArray[np.float64]:
    """Components (n, c) of a field of the frame at `step`, SI: x and y, in a body also z.

    Raises ResultsError naming the stored fields.
    """
    return np.column_stack(_columns(results, name, step))


def diffuses(results: Results) -> bool:
    """Whether the model is one of diffusion alone."""
    return len(results.masses()) > 0 and not len(results.history())  # both are noted from the start on


def _columns(results: Results, name: str, step: int) -> list[NDArray[np.float64]]:
    columns = of_dimension(name, results.dimension)
    stored = results.stored(step)
    missing = [column for column in columns if column not in stored]
    if missing and stored:
        expect_physics_of(results, name)
        expected = f"one of {', '.join(stored)} (pdsolve --fields +{','.join(missing)} stores it)"
        raise ResultsError(f"{results.name} has no field '{missing[0]}'; use {expected}")
    return [results.field(column, step).astype(float) for column in columns]


def expect_physics_of(results: Results, name: str) -> None:
    """Raise ResultsError if the model has no field of this name, whatever is stored."""
    if (name in OF_DIFFUSION) != diffuses(results):
        physics, needed_physics = ("diffusion", "mechanics")[:: 1 - 2 * (name in OF_DIFFUSION)]
        shown = f" (this has {', '.join(OF_DIFFUSION)})" if physics == "diffusion" else ""
        raise ResultsError(f"{results.name} is of a model of {physics}; {name} needs one of {needed_physics}{shown}")
