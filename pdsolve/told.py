"""What a database of results says of its run: how it was made, and what it came to."""

from __future__ import annotations

from typing import Any

import numpy as np

from pdsolve.made import made_by
from pdsolve.measures import Ledger
from pdsolve.notes import Notes
from pdsolve.steppers.load_steps import LoadSteps
from pdsolve.system import Stepper, System


def meta(system: System, provenance: str) -> dict[str, Any]:
    return {
        **made_by(provenance, system.model.grid.dimension),
        "mode": system.options.mode,
        "precision": system.options.precision,
        "threads": system.threads,
        "kernel": system.operator.name,
        "time_step": system.time_step,
        "stable_time_step": system.bound,
        "initial_energy": system.initial_energy,
        "model": system.asked.to_json(),
    }


def summary(notes: Notes, books: Ledger, stopped_early: bool) -> dict[str, Any]:
    """What the run came to, in the end."""
    system, wall = notes.system, notes.wall()
    return {
        "nodes": len(system.model.grid),
        "bonds": system.bonds,
        "steps": books.step,
        "time": books.time,
        "time_step": system.time_step,
        "stable_time_step": system.bound if np.isfinite(system.bound) else None,
        "mode": system.options.mode,
        "precision": system.options.precision,
        "threads": system.threads,
        "kernel": system.operator.name,
        "wall_time": wall,
        "bond_updates_per_second": notes.updates(books.step) / wall if wall > 0 else 0.0,
        "broken_bonds": books.broken,
        "energy": {name: getattr(books, name) for name in ("kinetic", "strain", "dissipated", "work")},
        "balance": notes.balance(books),
        "stopped": system.model.settings.run.until if stopped_early else None,
        **({"particles": len(system.growth.particles.place)} if system.growth is not None else {}),
        **_finer(system),
        **({"energy_unit": "J"} if system.model.grid.dimension == 3 else {}),
        **_rested(system.stepper),
    }


def _finer(system: System) -> dict[str, Any]:
    """What finer nodes that come and go were like."""
    if system.told is None:
        return {}
    found = system.told._asdict()
    if system.hybrid is not None:
        return {"hybrid": found}
    return {"split": {name: found[name] for name in ("refinement", "fine_share")}}


def _rested(stepper: Stepper) -> dict[str, Any]:
    """How each load step came to rest."""
    if not isinstance(stepper, LoadSteps):
        return {}
    return {"method": stepper.method.said, "load_steps": [rested._asdict() for rested in stepper.rested]}
