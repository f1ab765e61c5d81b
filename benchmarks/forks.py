"""Where the crack of geometries/forked_crack.py forks, over time steps and grids: python -m benchmarks.forks

Writes its section of `docs/verification/crack_particles.md`. One run of a crack that branches says nothing of how
sure it is.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np

from benchmarks.pages import put_section
from pdmesh.drawing.file_reading import build_file
from pdmesh.model.crack_particles import polylines
from pdpost.measures.tips import crack_branches, find_forks
from pdsolve.model import Model
from pdsolve.run.simulation import Options, simulate

ROOT = Path(__file__).parent.parent
SPACINGS = (0.5e-3, 0.4e-3)  # m
STEPS = (50e-9, 45e-9, 35e-9)  # s
LASTS = 60e-6  # s
MEASURES = ("place, mm", "time, us", "angle, degrees", "speed before, m/s", "further forks")

ABOVE = """
## Where the forked crack forks

`python -m benchmarks.forks` solves `forked_crack` with {steps} time steps of {least:g} to {most:g} ns on {grids} grids,
and writes the medians, with the range in brackets. A finer grid has a shorter horizon too.

"""
BELOW = """
In all {runs} runs the first fork is on the axis and all arms are mirror images, to {off:.1g} m. How often the arms fork
again depends on the time step.
"""


class Forked(NamedTuple):
    """What a crack does at its first fork, in the units of `MEASURES`, and whether to believe it."""

    place: float
    time: float
    angle: float
    speed: float
    further: int
    off: float  # m, by which all arms are no mirror images, and the fork is off the axis
    balance: float  # of the books of energy


def forked(spacing: float, time_step: float) -> Forked:
    """A run of the plate."""
    made = build_file(ROOT / "geometries" / "forked_crack.py", [("spacing", f"{spacing:g}")], trust=True)
    steps = round(LASTS / time_step)
    run = msgspec.structs.replace(made.settings.run, time_step=time_step, steps=steps, every=steps)
    settings = msgspec.structs.replace(made.settings, run=run)
    with simulate(Model(made.grid, settings), options=Options(threads=1)) as results:
        branches, particles, balance = crack_branches(results), results.particles(), float(results.summary()["balance"])
    first, *further = find_forks(branches)
    trunk = min(branches, key=lambda branch: float(branch.length_along_crack[0]))
    points = np.concatenate(polylines(particles))
    apart = np.hypot(*(points[:, None] - points * [1, -1]).transpose(2, 0, 1)).min(axis=1)
    speed, place = trunk.mean_speed or np.nan, first.place[0] * 1e3
    off = max(float(apart.max()), abs(first.place[1]))
    return Forked(place, first.time * 1e6, first.angle_between_outer_arms, speed, len(further), off, balance)


def section(found: dict[float, list[Forked]]) -> str:
    """What the page says of runs, those of each spacing."""
    lines: list[tuple[str, ...]] = [("", *(f"{spacing * 1e3:g} mm" for spacing in found)), ("---",) * (1 + len(found))]
    for number, name in enumerate(MEASURES):
        columns = ([run[number] for run in runs] for runs in found.values())
        cells = (f"{np.median(some):.4g} ({min(some):.4g} to {max(some):.4g})" for some in columns)
        lines.append((name, *cells))
    table = "".join(f"| {' | '.join(line)} |\n" for line in lines)
    words = {"steps": len(STEPS), "least": min(STEPS) * 1e9, "most": max(STEPS) * 1e9, "grids": len(SPACINGS)}
    every = [run for runs in found.values() for run in runs]
    return ABOVE.format(**words) + table + BELOW.format(runs=len(every), off=max(run.off for run in every))


def main() -> int:
    """Write the section."""
    found = {spacing: [forked(spacing, step) for step in STEPS] for spacing in SPACINGS}
    put_section(ROOT / "docs" / "verification" / "crack_particles.md", section(found).strip("\n"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
