"""What a fine zone that moves costs, and what it is off by: python -m benchmarks.adaptivity [--finer] [--repeat N].

Kalthoff and Winkler's plate of steel (geometries/kalthoff_winkler_steel.py), uniform and hybrid on one lattice, one
thread each. Cost: CPU time of the loop, both in turn, the least of N. Error: the mean distance of the crack's path from
that of a uniform run, over the length of the path, and the time of the first bond, for four steps, as a crack is known
no better than runs that differ by the step alone differ from each other. Writes docs/adaptivity.md.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import time
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.drawing.script import read_script
from pdmesh.grid.lattice import build_grid
from pdsolve.measures import books, damage
from pdsolve.model import Model
from pdsolve.system import Options, prepare

ROOT = Path(__file__).parent.parent
SCENE = ROOT / "geometries" / "kalthoff_winkler_steel.py"
PAGE = ROOT / "docs" / "adaptivity.md"
STEPS = (1.0, 0.9625, 0.925, 0.8875)  # of the surely stable step: ratios of 0.80, 0.77, 0.74 and 0.71
CRACKED = 0.35  # damage of a node on the path
HEIGHT = 0.06  # m above the notch, up to which paths are compared
LOOK = 100  # steps between two looks


class Found(NamedTuple):
    """What one run came to."""

    adapt: str
    share: float  # of the step
    cpu: float  # s, of the loop
    steps: int
    first: float  # s, of the first bond
    path: NDArray[np.float64]  # (k, 2) m, cracked nodes above the upper notch
    dissipated: float  # J/m
    balance: float
    fine: float  # share of the plate
    clipped: float  # over the critical stretch


def model(spacing: float) -> Model:
    """The scene at a spacing, m."""
    grid, settings, _ = build_grid(read_script(SCENE, [("spacing", str(spacing))]))
    return Model(grid, settings, f"kalthoff_winkler_steel at {spacing * 1e3:g} mm")


def solved(plate: Model, adapt: str, share: float, duration: float = 86e-6) -> Found:
    """One run, with its step that share of the surely stable one of the uniform plate."""
    run = msgspec.structs.replace(plate.settings.run, adapt=adapt, time_step=None)
    own = dataclasses.replace(plate, settings=msgspec.structs.replace(plate.settings, run=run))
    bound = prepare(own, Options(threads=1)).system.bound
    step = share * bound
    run = msgspec.structs.replace(run, time_step=step, steps=round(duration / step))
    own = dataclasses.replace(own, settings=msgspec.structs.replace(own.settings, run=run))
    problem = prepare(own, Options(threads=1))
    began, done = time.thread_time(), 0
    while done < run.steps:
        last = min(done + LOOK, run.steps)
        problem.march(done + 1, last + 1)
        done = last
    cpu = time.thread_time() - began
    system = problem.system
    broken, energies = system.operator.broken(), books(system, problem.state, run.steps)
    position, cracked = plate.grid.position, damage(system, broken) > CRACKED
    above = (position[:, 1] > 0.1262) & (position[:, 1] < 0.125 + HEIGHT) & (position[:, 0] > 0.05)
    told = system.hybrid.told() if system.hybrid else None
    return Found(
        adapt,
        share,
        cpu,
        run.steps,
        float(broken.step.min()) * step,
        position[cracked & above],
        energies.dissipated,
        energies.balance(system.initial_energy),
        told.fine_share if told else 1.0,
        told.clipped_stretch if told else 0.0,
    )


def distance(one: Found, other: Found) -> float:
    """Mean two-way distance of two paths over their length."""
    apart = np.hypot(*(one.path[:, None] - other.path[None]).T)
    length = float(np.hypot(*np.ptp(other.path, axis=0)))
    return float((apart.min(axis=0).mean() + apart.min(axis=1).mean()) / 2) / length


def angle(found: Found) -> float:
    """Of the path to the notch, degrees, through its nodes."""
    x, y = found.path.T
    slope = np.polyfit(y - y.mean(), x - x.mean(), 1)[0]
    return float(np.degrees(np.arctan2(1, slope)))


def compared(spacing: float, repeat: int) -> str:
    """A section of the page: one spacing."""
    plate = model(spacing)
    runs: dict[str, list[Found]] = {"none": [], "hybrid": []}
    for share in STEPS:
        for adapt, found in runs.items():
            found.append(solved(plate, adapt, share))
            print(found[-1]._replace(path=found[-1].path[:0]), file=sys.stderr, flush=True)
    cpu = {adapt: [found[0].cpu] for adapt, found in runs.items()}
    for _ in range(repeat - 1):
        for adapt, times in cpu.items():
            times.append(solved(plate, adapt, STEPS[0]).cpu)
    least = {adapt: min(times) for adapt, times in cpu.items()}
    lines = [
        f"## {spacing * 1e3:g} mm between nodes: {len(plate.grid)} nodes",
        "",
        f"CPU time of the loop, least of {repeat} in turn, one thread: uniform {least['none']:.2f} s, hybrid"
        f" {least['hybrid']:.2f} s, **{least['none'] / least['hybrid']:.1f} times**.",
        "",
        "| run | step / sure step | first bond, us | angle of the path, degrees | path off the uniform runs', % |"
        " dissipated, J/m | balance, % of the work | fine at the end, % | clipped bonds, of s0 |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for adapt, founds in runs.items():
        for found in founds:
            off = [distance(found, other) for other in runs["none"] if other is not found]
            lines.append(
                f"| {'uniform' if adapt == 'none' else 'hybrid'} | {found.share:g} | {found.first * 1e6:.2f} |"
                f" {angle(found):.1f} | {100 * float(np.mean(off)):.1f} | {found.dissipated:.0f} |"
                f" {100 * found.balance:+.2f} | {100 * found.fine:.1f} | {found.clipped:.2f} |"
            )
    return "\n".join(lines)


HEAD = """# Peridynamics where bonds may break, a compact lattice elsewhere

`pdsolve plate.json --adapt hybrid`, `run.adapt` in a model. Written by `python -m benchmarks.adaptivity`; times are of
the machine it ran on, and only their ratio means something.

A cell of 2 h is fine, with nodes of spacing h and all bonds of the horizon, or coarse: four springs along its edges and
two along its diagonals, as stiff as the fine lattice is, its anisotropy included. Cells are fine from the start within
12 h of the tips of pre-cracks. Every 8 steps those become fine that are within 8 h of a node that has lost a bond, or
of a coarse bond stretched to more than 0.7 of what breaks it. Nothing becomes coarse again, and no bond
heals: a table has a bit for each bond of the whole plate, which is cleared once. Bonds that leave the fine cells are
clipped at their edge, and as much stiffer as they are shorter, after A. V. Shapeev (Multiscale Model. Simul. 9 (2011)
905-932). A linear field is at rest, momentum and energy are conserved (`tests/verification/test_clipped.py`); of a
pulse half, one and two times 2 m h wide 5.2, 2.1 and 0.5 % come back.

**What it takes**: a rectangle without holes, one spacing with nodes on all edges and an even number of spacings each
way, one brittle material, the conservative mode in double precision; loads, held displacements and velocities, initial
velocities, straight pre-cracks in any direction that pass through no node. All else is refused in one line.

**When not to take it**: where much of the plate is crushed, as then most of it becomes fine; and where a plate is so
small that 12 h around a tip are most of it. A run stops where a clipped bond is stretched beyond what breaks it. It
runs on one thread. Frames show the whole fine lattice: between coarse nodes what they say.

"Path off" is the mean two-way distance from the other uniform runs, over the path's length up to 60 mm above the notch:
for uniform runs this is how far they are from each other.
"""


def main(arguments: list[str]) -> int:
    """Measure and write the page."""
    parser = argparse.ArgumentParser(description="Measure what a fine zone that moves costs and is off by.")
    parser.add_argument("--finer", action="store_true", help="0.25 mm too: some minutes")
    parser.add_argument("--repeat", type=int, default=3, help="times each cost is measured")
    args = parser.parse_args(arguments)
    spacings = (5e-4, 2.5e-4) if args.finer else (5e-4,)
    sections = [compared(spacing, args.repeat) for spacing in spacings]
    PAGE.write_text("\n".join([HEAD, *sections, ""]), encoding="utf-8")
    print(PAGE)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
