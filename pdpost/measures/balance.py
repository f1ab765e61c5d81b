"""The energy ledger of a run as curves, with the error of the balance."""

from __future__ import annotations

from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.amounts import damping_warning
from pdmesh.model.document import AnyCondition, Contact, Run
from pdpost.reading.embedded_model import expect_mechanics, read
from pdsolve.results import Results, ResultsError


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
    error: NDArray[np.float64]  # (t,) total - work, over the most that was ever put in
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


def largest_energy_supplied_so_far(ledger: NDArray[np.void], initial_energy: float) -> float:
    """Largest total energy supplied to a run so far, J/m, including the `initial_energy` energy at the start."""
    return max(float(np.abs(ledger["work"]).max()), initial_energy)


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


def energy_balance(results: Results) -> EnergyBalance:
    """The energy balance of a run. Raises ResultsError if its ledger is empty."""
    ledger = results.history()
    if not len(ledger):
        expect_mechanics(results)
        raise ResultsError(f"{results.name}: the energy balance is empty; use a run with at least one entry")
    initial = float(results.meta()["initial_energy"])
    damped, friction = damped_energy(ledger), friction_heat(ledger)
    total = ledger["kinetic"] + ledger["strain"] + ledger["dissipated"] + np.nan_to_num(damped) + friction
    energy_input = ledger["work"] + initial
    if "refinement" in (ledger.dtype.names or ()):
        energy_input = energy_input + ledger["refinement"]
    scale = largest_energy_supplied_so_far(ledger, initial)
    error = (total - energy_input) / scale if scale > 0 else np.zeros(len(ledger))
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
