"""Metadata and summary of a run in its database."""

from __future__ import annotations

from typing import Any

import numba
import numpy as np

from pdmesh import VERSION
from pdmesh.model.bond_counts import pair_count
from pdsolve.codegen.compile_time import processor_kind
from pdsolve.run.recorder import Recorder


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
        "device": system.stepper.device_name,
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
        "device": system.stepper.device_name,
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
    zone_summary = system.zone_summary
    if zone_summary is not None and system.regridder is not None:
        results |= system.regridder.summary(zone_summary)
    elif zone_summary is not None:
        results["hybrid"] = zone_summary._asdict()
    return results | system.stepper.summary()
