"""What pdpost reads of the grid file that a database holds; the rest, mostly nodes, is passed over."""

from __future__ import annotations

from typing import TypeVar

import msgspec

from pdmesh.model.document import Run
from pdsolve.results import Results, ResultsError

T = TypeVar("T", bound=msgspec.Struct)


class _Named(msgspec.Struct):
    """What is read of the grid file."""

    physics: str = "mechanics"


class _Solved(msgspec.Struct):
    """What is read of the grid file."""

    run: Run = Run()


def read(results: Results, kind: type[T]) -> T:
    """The keys of the model that `kind` has. Raises ResultsError, saying what is wrong with them."""
    if "material" in kind.__struct_fields__:
        expect_mechanics(results)
    try:
        return msgspec.json.decode(results.model(), type=kind)
    except msgspec.DecodeError as error:
        raise ResultsError(f"{results.name}: found no model to read ({error}), expected a grid file") from None


def expect_mechanics(results: Results) -> None:
    """Raises ResultsError for a model of anything else, saying what shows it."""
    physics = read(results, _Named).physics
    if physics != "mechanics":
        raise ResultsError(
            f"{results.name}: found a model of {physics}, expected one of mechanics (pdpost history, concentration,"
            " content and solid show it)"
        )


def at_rest(results: Results) -> bool:
    """Whether the model was solved at rest: times are those of load steps, and no motion's. Raises ResultsError."""
    return read(results, _Solved).run.solver == "static"
