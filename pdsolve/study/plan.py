"""Estimated cost of a study: the numbers of `pdmesh plan study.toml`."""

from __future__ import annotations

import contextlib
import dataclasses
import heapq
import warnings
from collections.abc import Container, Sequence
from typing import Any, NamedTuple

import numpy as np

from pdmesh.files import FilePath
from pdmesh.model.amounts import pair_count
from pdsolve.codegen import jit_cache
from pdsolve.estimate import estimate_run, measure_machine_slowdown
from pdsolve.numerics.thread_team import cores
from pdsolve.study import run_model
from pdsolve.study.description import Study, read_study

# Seconds on the machine of `pdsolve.estimate`: of the command and then its processes, until they solve, a third
# of it for kernels that are read; of a run besides what its plan has, and for each of its nodes: it is built and
# measured; of the kernels of a plate of bonds, where none are kept
START = 4.0
AROUND, AROUND_NODE = 0.05, 3e-5
COMPILE = 8.0
SAMPLE = 3  # runs that are built for the price of a study
LISTED = 12  # different runs, in lines


def plan_study(path: FilePath, trust: bool = False) -> dict[str, Any]:
    """Cost of solving all runs of the study at `path`, as if none were solved yet.

    Raises StudyError, SceneError, GridError, ModelError.
    """
    study = read_study(path)
    planned = run_model.plan_distinct_runs(study, trust)
    seconds = sum(number * plan.wall_time for _, number, plan in planned)
    rate, run_plans = measure_machine_slowdown(), [plan for _, number, plan in planned for _ in range(number)]
    workers, compiling = min(cores(), len(run_plans)), 0.0 if jit_cache.is_kept() else rate * COMPILE
    runs = [plan.wall_time + rate * (AROUND + AROUND_NODE * plan.nodes) for plan in run_plans]
    return {
        "study": str(path),
        "runs": sum(number for _, number, _ in planned),
        "solve_seconds": seconds,  # one after the other, on one thread each
        "workers": workers,
        "compile_seconds": compiling,  # of that, once for these sources
        "study_seconds": rate * START + compiling + wall_time_of_processes(runs, workers),
        "memory_bytes": max(plan.memory for _, _, plan in planned),  # of the largest
        "different": [
            {"values": {name: case.values.get(name) for name in study.varied}, "times": number}
            | {"nodes": plan.nodes, "bonds": pair_count(plan.bonds), "steps": plan.steps, "time_step": plan.time_step}
            | {"memory_bytes": plan.memory, "solve_seconds": plan.wall_time}
            for case, number, plan in planned
        ],
    }


class Price(NamedTuple):
    """What the runs of a study that are still to be solved cost, estimated from some of them."""

    runs: int
    workers: int
    seconds: float  # until all are solved
    core_seconds: float
    memory: int  # bytes, of the largest run of the sample


def price_study(
    study: Study, finished: Container[str], workers: int, threads: int, trust: bool = False
) -> Price | None:
    """The price of the runs whose keys are not `finished`; None without any, and if no run of the sample can be built.

    At most `SAMPLE` different runs, spread over all, are built. Raises StudyError.
    """
    cases = [case for case in study.cases() if case.key not in finished]
    if not cases:
        return None
    rows = np.unique(np.linspace(0, len(cases) - 1, SAMPLE).round().astype(int)).tolist()
    plans = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the runs will warn
        for row in rows:
            case = dataclasses.replace(cases[row], repetition=0)
            with contextlib.suppress(Exception):  # of any kind, which the run itself reports
                model = run_model.model_of_run(study.drawing, case, trust)
                plans.append(estimate_run(model, run_model.options(case, threads)))
    if not plans:
        return None
    rate = measure_machine_slowdown()
    mean = sum(plan.wall_time + rate * (AROUND + AROUND_NODE * plan.nodes) for plan in plans) / len(plans)
    workers = min(workers, len(cases))
    compiling = 0.0 if jit_cache.is_kept() else rate * COMPILE
    wall = wall_time_of_processes([mean] * len(cases), workers)
    core_seconds = threads * (mean * len(cases) + compiling)
    return Price(len(cases), workers, rate * START + compiling + wall, core_seconds, max(plan.memory for plan in plans))


def price_line(price: Price) -> str:
    """A price in words."""
    runs = f"{price.runs} run{'s' * (price.runs > 1)}"
    processes = f"{price.workers} process{'es' * (price.workers > 1)}"
    return (
        f"{runs} to solve: about {_duration(price.seconds)} with {processes},"
        f" {_rounded(price.core_seconds / 3600)} core hours, {_rounded(price.memory / 1e6)} MB of memory each"
    )


def _duration(seconds: float) -> str:
    """A duration in s, min or h."""
    size, unit = next((entry for entry in ((3600, "h"), (60, "min")) if seconds >= 2 * entry[0]), (1, "s"))
    return f"{_rounded(seconds / size)} {unit}"


def _rounded(value: float) -> str:
    """A number with two digits or more, without a power of ten."""
    return f"{value:.0f}" if value >= 10 else f"{value:.2g}"


def wall_time_of_processes(runs: Sequence[float], workers: int) -> float:
    """Total time, s, of runs of these durations, s, started in order on the next free of several processes."""
    busy = [0.0] * workers
    for seconds in runs:
        heapq.heapreplace(busy, busy[0] + seconds)
    return max(busy)


def study_plan_lines(result: dict[str, Any]) -> list[str]:
    """The result of `plan_study` in words."""
    workers, memory = result["workers"], result["memory_bytes"] / 1e6
    lines = [
        f"{result['study']}: {result['runs']} runs, {result['solve_seconds']:.3g} s to solve one after the other, about"
        f" {result['study_seconds']:.3g} s by {workers} processes, of {memory:.3g} MB each at most"
    ]
    if result["compile_seconds"]:
        lines.append(f"{result['compile_seconds']:.2g} s of that is for kernels that are compiled once")
    for plan in result["different"][:LISTED]:
        named = ", ".join(f"{name} = {value}" for name, value in plan["values"].items()) or "as drawn"
        lines.append(
            f"{plan['times']} x {named}: {plan['nodes']} nodes, {plan['bonds']} bonds, {plan['steps']} steps of"
            f" {plan['time_step']:.4g} s, {plan['solve_seconds']:.3g} s"
        )
    if len(result["different"]) > LISTED:
        lines.append(f"and {len(result['different']) - LISTED} more")
    return lines
