"""What a fine zone that moves costs, and what it is off by: python -m benchmarks.adaptivity [--finer] [--repeat N].

Kalthoff and Winkler's plate of steel and Duran's of glass, uniform and hybrid on one lattice, one thread each. Cost:
CPU time of the loop, both in turn, the least of N. Error: the mean distance of the crack's path from those of uniform
runs, over the length of the path, and the time of the first bond, for four steps, as a crack is known no better than
runs that differ by the step alone differ from each other. And all shipped scenes, once. Writes tables of
docs/verification/adaptivity.md.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.balance_rows import compute_energy_balance_row
from benchmarks.models import PLATES, scene_model, with_run
from benchmarks.pages import DOCS, markdown_table, write_block
from pdmesh.drawing.additions import ADAPT
from pdmesh.model import contradictions
from pdmesh.model.possible import impossible
from pdmesh.scene.shapes import SceneError
from pdsolve.model import Model, ModelWarning
from pdsolve.options import Options
from pdsolve.run.measures import compute_node_damage
from pdsolve.run.prepare import prepare
from pdsolve.run.system import create_system_if_zone_changed

PAGE = DOCS / "verification" / "adaptivity.md"
STEPS = (1.0, 0.9625, 0.925, 0.8875)  # of the surely stable step: ratios of 0.80, 0.77, 0.74 and 0.71
CRACKED = 0.35  # damage of a node on the path
LOOK = 100  # steps between two looks


class Case(NamedTuple):
    """A scene at a spacing."""

    title: str
    file: str
    assignments: tuple[tuple[str, str], ...]
    duration: float  # s
    box: tuple[float, float, float, float]  # where its path is compared, m
    turns: bool  # whether the angle of its path means something
    finer: bool  # whether it is one for which one has to wait


CASES = (
    *(
        Case(
            f"Kalthoff and Winkler's steel, {1e3 * h:g} mm between nodes",
            "kalthoff_winkler_steel.py",
            (("spacing", str(h)),),
            86e-6,
            (0.05, 0.1262, 1.0, 0.185),
            True,
            h < 5e-4,
        )
        for h in (5e-4, 2.5e-4)
    ),
    Case(
        "Duran's glass, 0.25 mm between nodes",
        "duran50.geo",
        (("Zones/fine/Spacing", "2.5e-4"), ("Zones/coarse/Spacing", "5e-4")),
        40e-6,
        (0.0505, -1.0, 0.068, 1.0),
        False,
        False,
    ),
)


class Run(NamedTuple):
    """What one run came to."""

    adapt: str
    share: float  # of the step
    cpu: float  # s, of the loop
    first: float  # s, of the first bond
    path: NDArray[np.float64]  # (k, 2) m, cracked nodes
    dissipated: float  # J/m
    damped: float  # J/m
    balance: float
    begins: float  # share of the plate that is fine at the start
    fine: float  # at the end
    clipped: float  # over what breaks or softens a bond


def hybrid_model(file: str, assignments: tuple[tuple[str, str], ...] = ()) -> Model:
    """A shipped scene, as it is built for a fine zone that moves. Raises SceneError."""
    return scene_model(file, [(ADAPT, "hybrid"), *assignments])


def solved(
    plate: Model, adapt: str, share: float | None = None, duration: float = 0.0, box: tuple[float, ...] | None = None
) -> Run:
    """One run, with its step that share of the surely stable one; None: as the scene says."""
    plate = with_run(plate, adapt=adapt)
    if share is not None:
        step = share * prepare(with_run(plate, time_step=None), Options(threads=1)).system.stable_time_step
        plate = with_run(plate, time_step=step, steps=round(duration / step))
    (system, state), steps = prepare(plate, Options(threads=1)), plate.settings.run.steps
    at_start = system.regridder.zone_summary(system)
    begins = at_start.fine_share if at_start else 1.0
    splits = system.regridder if system.regridder.steps_between_checks else None
    began, done = time.thread_time(), 0
    while done < steps:
        change = splits.change_nodes(system, state, done) if splits else None
        system, state = (system, state) if change is None else (change.system, change.state)
        last = min(done + (splits.steps_between_checks if splits else LOOK), steps)
        system.stepper.advance(state, done + 1, last + 1)
        done = last
    cpu = time.thread_time() - began
    change = create_system_if_zone_changed(system) if system.moving_zone_operator else None
    system, state = (system, state) if change is None else (change.system, change.state)
    broken, energies = system.operator.broken(), compute_energy_balance_row(system, state, steps)
    cracked = system.model.grid.position[compute_node_damage(system, broken) > CRACKED]
    if box is not None:
        cracked = cracked[((cracked > box[:2]) & (cracked < box[2:])).all(axis=1)]
    return Run(
        adapt,
        share or 0.0,
        cpu,
        float(broken.step.min(initial=np.iinfo(np.int64).max)) * system.time_step if len(broken.step) else np.nan,
        cracked,
        energies.dissipated,
        energies.damped,
        energies.balance_error(system.initial_energy),
        begins,
        energies.fine_share,
        energies.clipped_stretch,
    )


def distance(run: Run, reference: Run) -> float:
    """Mean two-way distance of two paths over the length of the second."""
    return mean_distance(run.path, reference.path) / float(np.hypot(*np.ptp(reference.path, axis=0)))


def mean_distance(path: NDArray[np.float64], reference: NDArray[np.float64]) -> float:
    """How far two paths (k, 2) and (l, 2) are apart, m: the mean over their nodes, both ways."""
    apart = np.hypot(*(path[:, None] - reference[None]).T)
    return float((apart.min(axis=0).mean() + apart.min(axis=1).mean()) / 2)


def angle(path: NDArray[np.float64]) -> float:
    """Of a path (k, 2) to the notch, degrees, through its nodes."""
    x, y = path.T
    slope = np.polyfit(y - y.mean(), x - x.mean(), 1)[0]
    return float(np.degrees(np.arctan2(1, slope)))


def compared(case: Case, repeat: int) -> str:
    """A section of the page: one scene at one spacing."""
    plate = hybrid_model(case.file, case.assignments)
    runs: dict[str, list[Run]] = {"none": [], "hybrid": []}
    for share in STEPS:
        for adapt, of_steps in runs.items():
            of_steps.append(solved(plate, adapt, share, case.duration, case.box))
            print(of_steps[-1]._replace(path=of_steps[-1].path[:0]), file=sys.stderr, flush=True)
    cpu = {adapt: [of_steps[0].cpu] for adapt, of_steps in runs.items()}
    for _ in range(repeat - 1):
        for adapt, times in cpu.items():
            times.append(solved(plate, adapt, STEPS[0], case.duration).cpu)
    uniform, hybrid = min(cpu["none"]), min(cpu["hybrid"])
    header = ["run", "step / sure step", "first bond, us", "angle of the path, degrees"]
    header += [
        "path off the uniform runs', %",
        "dissipated, J/m",
        "balance, % of the work",
        "fine at the end, %",
        "clipped bonds, of s0",
    ]
    rows = []
    for run in (*runs["none"], *runs["hybrid"]):
        off = np.mean([distance(run, reference) for reference in runs["none"] if reference is not run])
        name, turned = "uniform" if run.adapt == "none" else run.adapt, f"{angle(run.path):.1f}" if case.turns else "-"
        cells = [name, f"{run.share:g}", f"{1e6 * run.first:.2f}", turned, f"{100 * off:.1f}", f"{run.dissipated:.4g}"]
        rows.append([*cells, f"{100 * run.balance:+.2f}", f"{100 * run.fine:.1f}", f"{run.clipped:.2f}"])
    return (
        f"## {case.title}: {len(plate.grid)} nodes\n\nCPU time of the loop, least of {repeat} in turn, one thread:"
        f" uniform {uniform:.2f} s, hybrid {hybrid:.2f} s, **{uniform / hybrid:.1f} times**.\n\n"
        + markdown_table(header, rows)
    )


def scenes() -> str:
    """The table of all shipped scenes of bonds in motion, once each, as they are drawn."""
    header = ["scene", "nodes", "fine at the start, end, %", "first bond, us: uniform, hybrid", "dissipated, J/m"]
    header += ["CPU of the loop, s", "balance, % of the work", "clipped bonds"]
    rows = []
    for path in PLATES:
        plate = _taken(path.name)
        if plate is None:
            continue
        uniform, hybrid = (solved(plate, adapt) for adapt in ("none", "hybrid"))
        print(path.name, hybrid._replace(path=hybrid.path[:0]), file=sys.stderr, flush=True)
        fine = f"{100 * hybrid.begins:.1f}, {100 * hybrid.fine:.1f}"
        first = f"{_time(uniform)}, {_time(hybrid)}"
        dissipated, cpu = f"{uniform.dissipated:.4g}, {hybrid.dissipated:.4g}", f"{uniform.cpu:.2f}, {hybrid.cpu:.2f}"
        balance, clipped = f"{100 * hybrid.balance:+.3f}", f"{hybrid.clipped:.2f}"
        rows.append([path.name, len(plate.grid), fine, first, dissipated, cpu, balance, clipped])
    return markdown_table(header, rows)


def _taken(file: str) -> Model | None:
    """A scene as a fine zone that moves takes it; None if it does not."""
    try:
        plate = hybrid_model(file)
    except SceneError:
        return None
    with_zone, run = with_run(plate, adapt="hybrid"), plate.settings.run
    refused = plate.grid.bodies is not None or any(True for _ in impossible(contradictions.Case(with_zone.settings, 2)))
    return None if refused or "static" in (run.solver, run.start) else plate


def _time(run: Run) -> str:
    return "none" if np.isnan(run.first) else f"{1e6 * run.first:.2f}"


def main(arguments: list[str]) -> int:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(description="Measure what a fine zone that moves costs and is off by.")
    parser.add_argument("--finer", action="store_true", help="0.25 mm of the steel too: some minutes")
    parser.add_argument("--repeat", type=int, default=3, help="times each cost is measured")
    args = parser.parse_args(arguments)
    warnings.simplefilter("ignore", ModelWarning)
    sections = [compared(case, args.repeat) for case in CASES if args.finer or not case.finer]
    write_block(PAGE, "uniform and hybrid", "\n".join(sections))
    write_block(PAGE, "scenes", scenes())
    print(PAGE)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
