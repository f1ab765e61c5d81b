"""The ledger of a run as curves: where the energy went, and how much of it was lost or found."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdpost.reading.embedded import expect_mechanics
from pdsolve.results import Results, ResultsError


class Balance(NamedTuple):
    """The books of t steps, of a plate per unit thickness: its J/m are J of a body."""

    step: NDArray[np.int64]  # (t,)
    time: NDArray[np.float64]  # (t,) s
    kinetic: NDArray[np.float64]  # (t,) J/m
    strain: NDArray[np.float64]  # (t,) J/m
    dissipated: NDArray[np.float64]  # (t,) J/m
    work: NDArray[np.float64]  # (t,) J/m, done by loads and holds, what refining made, and what was there at the start
    total: NDArray[np.float64]  # (t,) J/m, kinetic, strain and dissipated
    error: NDArray[np.float64]  # (t,) total - work, over the most that was ever put in
    momentum_x: NDArray[np.float64]  # (t,) N s/m
    momentum_y: NDArray[np.float64]  # (t,) N s/m


def per_thickness(results: Results) -> str:
    """What units of energies and forces end in: those of a plate are per metre of thickness."""
    return "/m" if results.dimension == 2 else ""


def balance(results: Results) -> Balance:
    """The balance of energy of a run. Raises ResultsError if nothing was booked yet."""
    books = results.history()
    if not len(books):
        expect_mechanics(results)
        raise ResultsError(f"{results.name}: found an empty ledger, expected at least one entry")
    initial = float(results.meta()["initial_energy"])
    total = books["kinetic"] + books["strain"] + books["dissipated"]
    given = books["work"] + initial
    if "refinement" in (books.dtype.names or ()):
        given = given + books["refinement"]
    scale = max(float(np.abs(books["work"]).max()), initial)
    error = (total - given) / scale if scale > 0 else np.zeros(len(books))
    return Balance(
        books["step"].astype(np.int64),
        books["time"],
        books["kinetic"],
        books["strain"],
        books["dissipated"],
        given,
        total,
        error,
        books["momentum_x"],
        books["momentum_y"],
    )
