"""Where the crack of geometries/forked_crack.py forks, over time steps and grids: python -m benchmarks.forks

Writes the table of `docs/verification/crack_particles.md`. One run of a crack that branches says nothing of how
sure it is.
"""

from __future__ import annotations

import sys
from typing import NamedTuple

import numpy as np

from benchmarks.models import scene_model, with_run
from benchmarks.pages import DOCS, markdown_table, write_block
from pdsolve.fracture.crack_particles import polylines
from pdsolve.measures.tips import crack_branches, find_forks
from pdsolve.run.simulation import Options, simulate

SPACINGS = (0.5e-3, 0.4e-3)  # m
STEPS = (50e-9, 45e-9, 35e-9)  # s
LASTS = 60e-6  # s
MEASURES = ("place, mm", "time, us", "angle, degrees", "speed before, m/s", "further forks")


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
    steps = round(LASTS / time_step)
    plate = scene_model("forked_crack.py", [("spacing", f"{spacing:g}")])
    plate = with_run(plate, time_step=time_step, steps=steps, every=steps)
    with simulate(plate, options=Options(threads=1)) as results:
        branches, particles, balance = crack_branches(results), results.particles(), float(results.summary()["balance"])
    first, *further = find_forks(branches)
    trunk = min(branches, key=lambda branch: float(branch.length_along_crack[0]))
    points = np.concatenate(polylines(particles))
    apart = np.hypot(*(points[:, None] - points * [1, -1]).transpose(2, 0, 1)).min(axis=1)
    speed, place = trunk.mean_speed or np.nan, first.place[0] * 1e3
    off = max(float(apart.max()), abs(first.place[1]))
    return Forked(place, first.time * 1e6, first.angle_between_outer_arms, speed, len(further), off, balance)


def table(runs: dict[float, list[Forked]]) -> str:
    """The table of the page: medians of the runs of each spacing, with their range."""
    rows = []
    for number, name in enumerate(MEASURES):
        columns = ([run[number] for run in of_spacing] for of_spacing in runs.values())
        rows.append(
            [name, *(f"{np.median(column):.4g} ({min(column):.4g} to {max(column):.4g})" for column in columns)]
        )
    return markdown_table(["", *(f"{spacing * 1e3:g} mm" for spacing in runs)], rows)


def main() -> int:
    """Write the table."""
    runs = {spacing: [forked(spacing, step) for step in STEPS] for spacing in SPACINGS}
    write_block(DOCS / "verification" / "crack_particles.md", "forks", table(runs))
    return 0


if __name__ == "__main__":
    sys.exit(main())
