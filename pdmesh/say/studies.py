"""What a study will take: the numbers behind `pdmesh plan study.toml`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from pdsolve.model import ModelError
from pdsolve.study import description, making
from pdsolve.threads import cores

ERRORS = (ModelError, description.StudyError)
LISTED = 12  # different runs, in lines


def plan(path: Path, trust: bool = False) -> dict[str, Any]:
    """What solving all runs of the study at `path` takes, as if none were solved yet.

    Raises StudyError, SceneError, GridError, ModelError.
    """
    study = description.read_study(path)
    planned = making.planned(study, trust)
    seconds = sum(number * one.wall_time for _, number, one in planned)
    longest = max(one.wall_time for _, _, one in planned)
    return {
        "study": str(path),
        "runs": sum(number for _, number, _ in planned),
        "solve_seconds": seconds,  # one after the other, on one thread each
        "workers": cores(),
        "study_seconds": max(seconds / cores(), longest),
        "memory_bytes": max(one.memory for _, _, one in planned),  # of the largest
        "different": [
            {"values": {name: case.values.get(name) for name in study.varied}, "times": number}
            | {"nodes": one.nodes, "bonds": one.bonds, "steps": one.steps, "time_step": one.time_step}
            | {"memory_bytes": one.memory, "solve_seconds": one.wall_time}
            for case, number, one in planned
        ],
    }


def plan_lines(result: dict[str, Any]) -> list[str]:
    """What `plan` found, for a reader."""
    workers, memory = result["workers"], result["memory_bytes"] / 1e6
    lines = [
        f"{result['study']}: {result['runs']} runs, {result['solve_seconds']:.3g} s to solve one after the other, about"
        f" {result['study_seconds']:.3g} s by {workers} processes, of {memory:.3g} MB each at most"
    ]
    for one in result["different"][:LISTED]:
        named = ", ".join(f"{name} = {value}" for name, value in one["values"].items()) or "as drawn"
        lines.append(
            f"{one['times']} x {named}: {one['nodes']} nodes, {one['bonds']} bonds, {one['steps']} steps of"
            f" {one['time_step']:.4g} s, {one['solve_seconds']:.3g} s"
        )
    if len(result["different"]) > LISTED:
        lines.append(f"and {len(result['different']) - LISTED} more")
    return lines
