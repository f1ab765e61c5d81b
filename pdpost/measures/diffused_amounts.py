"""Amounts of a substance that diffuses, or of heat, over time: inside, passed through the boundary, supplied."""

from __future__ import annotations

from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.medium import Medium, amount_of
from pdpost.reading.embedded_model import read
from pdsolve.results import Results, ResultsError

AMOUNTS = ("inside", "through", "supplied")


class MassBalance(NamedTuple):
    """Balance of a diffusion run at t times; for a plate, per unit thickness.

    Amounts are in mol. Those of heat are in K m^d as `mass_balance` reads them, and in the unit that
    `mass_balance_with_unit` returns.
    """

    step: NDArray[np.int64]  # (t,)
    time: NDArray[np.float64]  # (t,) s
    inside: NDArray[np.float64]  # (t,) in all nodes, what is solid counted
    through: NDArray[np.float64]  # (t,) gone out through nodes of prescribed content
    supplied: NDArray[np.float64]  # (t,)
    solid_volume: NDArray[np.float64]  # (t,) m^d
    dissolved: NDArray[np.float64]  # (t,) mol that was solid
    solid_surface_area: NDArray[np.float64]  # (t,) m^(d - 1) of what is solid
    solid_share_left: NDArray[np.float64]  # (t,) of the solid there was; NaN without any
    error: NDArray[np.float64]  # (t,) of the balance, over what there was or was supplied


class _MediumGridFileKeys(msgspec.Struct):
    """The key of the grid file that says what amounts are of."""

    medium: Medium | None = None


def mass_balance_with_unit(results: Results) -> tuple[MassBalance, str]:
    """The balance of a run, and the unit of its amounts: mol; of heat J or J/m, or K m^d where its heat capacity is not
    known. Raises ResultsError for a run of mechanics."""
    balance, medium = mass_balance(results), read(results, _MediumGridFileKeys).medium
    factor, unit = (1.0, "mol") if medium is None else amount_of(medium, results.dimension)
    return balance._replace(**{name: factor * getattr(balance, name) for name in AMOUNTS}), unit


def mass_balance(results: Results) -> MassBalance:
    """The mass balance of a run. Raises ResultsError for a run of mechanics."""
    table = results.masses()
    if not len(table):
        raise ResultsError(f"{results.name} has no masses; use results of a model of diffusion")
    columns = {name: np.ascontiguousarray(table[name]) for name in table.dtype.names or ()}
    columns["step"] = columns["step"].astype(np.int64)
    inside, through, supplied, solid = (columns[name] for name in ("inside", "through", "supplied", "solid"))
    missing = inside + through - supplied - inside[0]
    scale = np.maximum(inside[0], np.maximum(np.abs(supplied), np.abs(through)))
    solid_share = solid / solid[0] if solid[0] > 0 else np.full(len(solid), np.nan)
    columns |= {"solid_volume": columns.pop("solid"), "solid_surface_area": columns.pop("surface")}
    return MassBalance(**columns, solid_share_left=solid_share, error=missing / np.where(scale > 0, scale, 1.0))
