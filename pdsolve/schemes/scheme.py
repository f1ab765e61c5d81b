"""A scheme: how bonds are made from a model, and the properties that its users need."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from pdsolve.bonds.assembly import BondSource, ByPairs
from pdsolve.model import Model


class Scheme(NamedTuple):
    """How the bonds of a model are made."""

    name: str  # as users give it
    fill: Callable[[Model], BondSource]
    by_pairs: Callable[[Model], ByPairs]  # the same for bonds that hold energy by themselves
    symmetric: bool  # energy and momentum are conserved
    partial_cells: bool  # families reach half a spacing beyond the horizon, if the micromodulus is constant
    matches_work: bool  # what softening and breaking bonds take from the motion is the area below their law's curve
    exact_load: bool  # the body forces of an edge sum to traction * length
