"""Metadata and summary of a run in its database."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from pdmesh import VERSION
from pdmesh.model.bond_counts import pair_count
from pdsolve.adaptivity.quadtree.operator import QuadtreeOperator
from pdsolve.codegen.compile_time import processor_kind
from pdsolve.run.recorder import Recorder
from pdsolve.steppers.arc_length_steps import ArcLengthSteps
from pdsolve.steppers.crack_length_steps import CrackLengthSteps
from pdsolve.steppers.cycle_or_path_steps import CycleOrPathSteps
from pdsolve.steppers.fatigue_steps import BondFatigueSteps
from pdsolve.steppers.load_steps import LoadSteps
from pdsolve.steppers.paris_steps import ParisSteps
from pdsolve.steppers.path_steps import SofteningPathSteps

LOAD_STEP_KEYS = "step", "iterations", "residual", "breaks", "least"
PATH_STEP_KEYS = "step", "iterations", "residual", "factor", "pull", "spent"


def run_metadata(recorder: Recorder, provenance: str) -> dict[str, Any]:
    """Metadata of a run, known from its start."""
    system = recorder.system
    return {
        "program": f"pdsolve {VERSION}",
        "provenance": provenance,
        "units": "SI, per unit thickness" if system.model.grid.dimension == 2 else "SI",
        "dimension": system.model.grid.dimension,
        "numpy": np.__version__,
        "numba": numba.__version__,
        "processor": processor_kind(),
        "mode": system.options.mode,
        "precision": system.options.precision,
        "threads": system.thread_count,
        "kernel": system.kernel_name,
        "device": system.device_name,
        "time_step": system.time_step,
        "stable_time_step": system.stable_time_step,
        "model": system.requested_model.to_json(),
        **recorder.physics_records.metadata(),
    }


def run_summary(recorder: Recorder, step: int, stopped_early: bool) -> dict[str, Any]:
    """Results of a run for its summary."""
    system, wall = recorder.system, recorder.wall_time()
    results: dict[str, Any] = {
        "nodes": len(system.model.grid),
        "bonds": pair_count(system.directed_bond_count),
        "steps": step,
        "time": step * system.time_step,
        "time_step": system.time_step,
        "stable_time_step": system.stable_time_step if np.isfinite(system.stable_time_step) else None,
        "mode": system.options.mode,
        "precision": system.options.precision,
        "threads": system.thread_count,
        "kernel": system.kernel_name,
        "device": system.device_name,
        "wall_time": wall,
        "bond_updates_per_second": recorder.count_bond_updates(step) / wall if wall > 0 else 0.0,
        "stopped": system.model.settings.run.until if stopped_early else None,
        **recorder.physics_records.summary(),
    }
    if system.contact is not None:  # N/m^5, in space N/m^7; heat, J/m, of a body J
        contact = system.contact
        results["contact"] = {"stiffness": contact.stiffness, "friction": contact.friction(recorder.state)}
    if system.crack_growth is not None:
        results |= {"particles": len(system.crack_growth.particles.place), "remarks": system.crack_growth.remarks}
    if system.zone_summary is not None:
        statistics = system.zone_summary._asdict()
        if isinstance(system.operator, QuadtreeOperator):
            results["split"] = {name: statistics[name] for name in ("refinement", "fine_share")}
        else:
            results["hybrid"] = statistics
    return results | _equilibrium_summary(system.equilibrium_stepper)


def _equilibrium_summary(load_stepper: LoadSteps | CycleOrPathSteps | None) -> dict[str, Any]:
    """Iterations and residuals of each load step."""
    if isinstance(load_stepper, BondFatigueSteps | ParisSteps):
        rows = [cycled._asdict() for cycled in load_stepper.step_results]
        by_bonds = load_stepper if isinstance(load_stepper, BondFatigueSteps) and rows else None
        by_tips = load_stepper if isinstance(load_stepper, ParisSteps) else None
        return {
            "method": load_stepper.description,
            "fatigue_steps": rows,
            "first_break": by_bonds and by_bonds.first,
            "first_range": by_bonds and by_bonds.range,
            "cycles_error": by_tips and by_tips.estimated_cycle_error,
            "cycles_error_of_jumps": by_tips and by_tips.cycle_error_of_steps,
            "ended": load_stepper.end_reason or None,
        }
    if isinstance(load_stepper, ArcLengthSteps | CrackLengthSteps | SofteningPathSteps):
        rows = [dict(zip(PATH_STEP_KEYS, path_step, strict=True)) for path_step in load_stepper.step_results]
        ended = {} if isinstance(load_stepper, SofteningPathSteps) else {"ended": load_stepper.end_reason or None}
        return {"method": load_stepper.description, "path_steps": rows, "lost": load_stepper.peak_load_factor} | ended
    if load_stepper is None:
        return {}
    return {
        "method": load_stepper.method.description,
        "load_steps": [dict(zip(LOAD_STEP_KEYS, row, strict=True)) for row in load_stepper.step_results],
    }
