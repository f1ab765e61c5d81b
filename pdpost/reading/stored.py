"""Fields of a frame as they were stored, and how to store those that were not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.fields import FIELDS
from pdsolve.results import Results, ResultsError


def scalar(results: Results, name: str, step: int) -> NDArray[np.float64]:
    """A field (n,) of the frame at `step`, SI. Raises ResultsError, naming those there are."""
    return _fields(results, (name,), step)[0]


def vector(results: Results, name: str, step: int) -> NDArray[np.float64]:
    """The components (n, 2) of displacement, velocity or acceleration of the frame at `step`, SI.

    Raises ResultsError, naming what there is.
    """
    return np.column_stack(_fields(results, FIELDS[name].columns, step))


def _fields(results: Results, names: tuple[str, ...], step: int) -> list[NDArray[np.float64]]:
    there = results.stored(step)
    missing = [name for name in names if name not in there]
    if missing and there:
        raise ResultsError(
            f"{results.name}: found no field '{missing[0]}', expected one of {', '.join(there)}"
            + ("" if "h" in there else f" (pdsolve --fields +{','.join(missing)} stores it)")
        )
    return [results.field(name, step).astype(float) for name in names]
