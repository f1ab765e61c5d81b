"""How bonds are filled from a model: a scheme a file, the names users give them in one table."""

from __future__ import annotations

from collections.abc import Callable

from pdsolve.bonds import Filling
from pdsolve.model import Model
from pdsolve.schemes import average_horizon, one_sided

SCHEMES: dict[str, Callable[[Model], Filling]] = {
    "thesis": one_sided.fill,
    "conservative": average_horizon.fill,
}
EXACT_LOAD = {"thesis": False, "conservative": True}  # the body forces of an edge sum to traction * length
SYMMETRIC = {"thesis": False, "conservative": True}  # energy and momentum are conserved
PARTIAL_CELLS = {"thesis": False, "conservative": True}  # families reach half a spacing beyond the horizon, if constant
