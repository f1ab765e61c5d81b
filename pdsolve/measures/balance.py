"""The energy ledger of a run as curves, with the error of the balance; likewise amounts of a substance or of heat."""

from __future__ import annotations

from typing import NamedTuple, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.amounts import damping_warning
from pdmesh.model.document import AnyCondition, Contact, Run
from pdmesh.model.medium import Medium, amount_of
from pdsolve.measures.embedded_model import expect_mechanics, read
from pdsolve.results import Results, ResultsError

AMOUNTS = ("inside", "through", "supplied")
SWELLING_SHARE = 1e-3  # of the energy of a body that swells and is clamped: work below it is little


class EnergyBalance(NamedTuple):
    """Energy balance at t steps; J/m for a plate (per unit thickness), J for a body."""

    step: NDArray[np.int64]  # (t,)
    time: NDArray[np.float64]  # (t,) s
    kinetic: NDArray[np.float64]  # (t,) J/m
    strain: NDArray[np.float64]  # (t,) J/m
    dissipated: NDArray[np.float64]  # (t,) J/m, spent by bonds; of older files what is damped too
    damped: NDArray[np.float64]  # (t,) J/m, taken by damping, absorbing and numerical layers; NaN of older files
    friction: NDArray[np.float64]  # (t,) J/m, turned into heat where faces rub
    work: NDArray[np.float64]  # (t,) J/m, done by loads and holds, what refining made, and what was there at the start
    total: NDArray[np.float64]  # (t,) J/m, kinetic, strain, dissipated, damped and friction
    error: NDArray[np.float64]  # (t,) total - work, over the energy supplied; see `relative_balance_error`
    momentum_x: NDArray[np.float64]  # (t,) N s/m
    momentum_y: NDArray[np.float64]  # (t,) N s/m


def thickness_unit_suffix(results: Results) -> str:
    """End of the units of energies and forces: "/m" for a plate, per metre of thickness, "" for a body."""
    return "/m" if results.dimension == 2 else ""


def damped_energy(ledger: NDArray[np.void]) -> NDArray[np.float64]:
    """Energy (t,) taken by damping, J/m; NaN in older files, where it is part of the dissipated energy."""
    return np.asarray(ledger["damped"] if "damped" in (ledger.dtype.names or ()) else np.full(len(ledger), np.nan))


def friction_heat(ledger: NDArray[np.void]) -> NDArray[np.float64]:
    """Heat (t,) of friction, J/m; 0 in files without it."""
    return np.asarray(ledger["friction"] if "friction" in (ledger.dtype.names or ()) else np.zeros(len(ledger)))


def energy_supplied(largest_work: float, initial_energy: float, clamped_energy: float = 0.0) -> float:
    """The energy supplied to a run, J/m, by which errors of its balance are divided.

    It is the largest of the `largest_work`, given or taken, and the `initial_energy` at the start; of bodies that
    swell also a share of the `clamped_energy` that their bonds would have without displacements, as work that little
    is round-off.
    """
    return max(largest_work, initial_energy, SWELLING_SHARE * clamped_energy)


def largest_energy_supplied_so_far(ledger: NDArray[np.void], initial_energy: float) -> float:
    """The energy supplied to a run, J/m, as its ledger tells it, with the `initial_energy` at the start."""
    return energy_supplied(float(np.abs(ledger["work"]).max()), initial_energy)


Energies = TypeVar("Energies", float, NDArray[np.float64])  # of one step, or of t


def relative_balance_error(
    total: Energies, work: Energies, refinement: Energies, initial_energy: float, supplied: float
) -> Energies:
    """The energy created since the start over the energy `supplied` to the run; 0 where none was.

    `total` is present and dissipated; `work` was done, and `refinement` came with finer cells.
    """
    return (total - work - refinement - initial_energy) / supplied if supplied > 0 else 0.0 * total


class _EnergyBalanceGridFileKeys(msgspec.Struct):
    """The keys of the grid file that the balance of energy needs."""

    run: Run = Run()
    conditions: tuple[AnyCondition, ...] = ()
    contact: Contact | None = None


def energy_loss_warnings(results: Results) -> list[str]:
    """Sentences about energy that went elsewhere than into cracks, if it is a large share."""
    ledger, model = results.history(), read(results, _EnergyBalanceGridFileKeys)
    energy_input = largest_energy_supplied_so_far(ledger, float(results.meta()["initial_energy"]))
    damped = float(np.nan_to_num(damped_energy(ledger))[-1] + friction_heat(ledger)[-1])
    said = damping_warning(model.run, model.conditions, model.contact, damped, energy_input)
    return [] if said is None else [said]


def _energy_supplied_of_summary(results: Results) -> float | None:
    """The energy supplied as the run has summed it up; None before its end, and in files of earlier releases."""
    supplied = results.summary().get("energy_supplied")
    return None if supplied is None else float(supplied)


def energy_balance(results: Results) -> EnergyBalance:
    """The energy balance of a run. Raises ResultsError if its ledger is empty."""
    ledger = results.history()
    if not len(ledger):
        expect_mechanics(results)
        raise ResultsError(f"{results.name}: the energy balance is empty; use a run with at least one entry")
    initial = float(results.meta()["initial_energy"])
    damped, friction = damped_energy(ledger), friction_heat(ledger)
    total = ledger["kinetic"] + ledger["strain"] + ledger["dissipated"] + np.nan_to_num(damped) + friction
    refined = "refinement" in (ledger.dtype.names or ())
    refinement = ledger["refinement"] if refined else np.zeros(len(ledger))
    energy_input = ledger["work"] + initial + refinement
    supplied = _energy_supplied_of_summary(results)
    supplied = largest_energy_supplied_so_far(ledger, initial) if supplied is None else supplied
    error = relative_balance_error(total, ledger["work"], refinement, initial, supplied)
    return EnergyBalance(
        ledger["step"].astype(np.int64),
        ledger["time"],
        ledger["kinetic"],
        ledger["strain"],
        ledger["dissipated"],
        damped,
        friction,
        energy_input,
        total,
        error,
        ledger["momentum_x"],
        ledger["momentum_y"],
    )


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
