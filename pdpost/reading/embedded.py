"""What pdpost reads of the grid file that a database holds; the rest, mostly nodes, is passed over."""

from __future__ import annotations

from typing import TypeVar

import msgspec

from pdsolve.results import Results, ResultsError

T = TypeVar("T", bound=msgspec.Struct)


def read(results: Results, kind: type[T]) -> T:
    """The keys of the model that `kind` has. Raises ResultsError, saying what is wrong with them."""
    try:
        return msgspec.json.decode(results.model(), type=kind)
    except msgspec.DecodeError as error:
        raise ResultsError(f"{results.name}: found no model to read ({error}), expected a grid file") from None
