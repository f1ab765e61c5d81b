"""Schemes that make bonds from a model, one a file, and the table of their names for users."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import BondSource, Paired, Scheme
from pdsolve.model import Model
from pdsolve.schemes import average_horizon, families, one_sided
from pdsolve.schemes.gripped_edges import gripped


def _symmetric(model: Model) -> BondSource:
    """Symmetric bonds for any model."""
    first = model.materials[0]
    springs = first.model == "bond" or (first.model == "micropolar" and first.law == "cohesive")
    return gripped(average_horizon.fill(model), model) if springs else families.fill(model)


SCHEMES: dict[str, Scheme] = {
    scheme.name: scheme
    for scheme in (
        Scheme(
            "thesis",
            one_sided.fill,
            one_sided.Rule,
            symmetric=False,
            partial_cells=False,
            matches_work=False,
            exact_load=False,
        ),
        Scheme(
            "conservative",
            _symmetric,
            average_horizon.Rule,
            symmetric=True,
            partial_cells=True,
            matches_work=True,
            exact_load=True,
        ),
    )
}


def bond_pairs(model: Model) -> Callable[[NDArray[np.int64]], Paired]:
    """How to list the directed bonds of some nodes, as a run in the conservative mode has them.

    Parameters
    ----------
    model : Model
        The grid and its settings, with a material.

    Returns
    -------
    Callable
        Takes rows of nodes, (k,), which increase; returns the pairs of those nodes and their neighbours: those that
        a pre-crack cuts, which are not intact, too.

    Raises
    ------
    ModelError
        For a model that the scheme cannot make bonds of.

    Examples
    --------
    >>> pairs, intact, *_ = bond_pairs(model)(np.arange(len(model.grid)))
    >>> cut = np.count_nonzero(~intact) // 2
    """
    return SCHEMES["conservative"].fill(model).pairs
