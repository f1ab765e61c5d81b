"""Checks that a run is still physical."""

from __future__ import annotations

import numpy as np

from pdsolve.errors import UnstableError
from pdsolve.run.measures import Ledger
from pdsolve.run.system import System
from pdsolve.state import State

RUNAWAY = 10.0  # times the energy put in: more than this is not physics


def check_physics(system: System, state: State, books: Ledger, most: float) -> None:
    """Raise UnstableError for values that are not finite, or for energy created.

    The message names step, time, node, energy and the stability bound; `most`, J/m, is the largest work so far.
    """
    energy, u = books.kinetic + books.strain, state.value
    finite = np.isfinite(u).all(axis=1)
    given = max(abs(books.work), most) + system.initial_energy
    ratio = energy / given if given else 0.0
    if finite.all() and np.isfinite(energy) and ratio <= RUNAWAY:
        return
    worst = int((~finite).argmax() if not finite.all() else np.abs(state.rate).sum(axis=1).argmax())
    raise UnstableError(
        f"unstable at step {books.step}, {books.time:.4g} s, node {system.model.grid.ids[worst]}: energy is"
        f" {ratio:.3g} times what was put in; the time step is {system.time_step:.4g} s,"
        f" surely stable up to {system.bound:.4g} s"
        f"{_suspect(system)}"
    )


def _suspect(system: System) -> str:
    """The likely cause of an instability other than the time step."""
    if system.time_step > system.bound:
        return ""
    if system.scheme.symmetric:
        return "; the step is not the cause: check loads and prescribed motion"
    return (
        f"; the cause is the one-sided bonds of the {system.scheme.name} mode, which make energy: --mode conservative"
    )
