"""What a cut costs where half of a plate leaves the other half, over speeds and time steps: python -m benchmarks.tear

Writes `docs/tear.png`, its section of `docs/verification/schemes.md`, and one of what the last pull of bonds costs.
"""

from __future__ import annotations

import sys
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import numpy as np
from numpy.typing import NDArray

from benchmarks.claims import Case
from benchmarks.pages import put_section
from benchmarks.runs import built
from benchmarks.timing import timed
from pdmesh.model.document import Horizon, Material, Run, Settings
from pdmesh.model.node_grid import Grid
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.schemes import SCHEMES

ROOT = Path(__file__).parent.parent
GLASS = Material(E=65e9, rho=2235.0, G0=204.0)
COLUMNS, ROWS, SPACING = 20, 10, 1e-3  # the last in m
TIME = 2e-5  # s, in which slow halves come free
SPEEDS = (10.0, 15.0, 20.0, 30.0, 50.0, 100.0, 200.0)  # m/s
SHARES = (1.0, 0.71, 0.5, 0.35, 0.25, 0.125, 0.0625)  # of the program's own time step

TEXT = """
## What a cut costs

Half of a plate of glass, {columns} by {rows} nodes, leaves the other half at a speed. The cut costs G0 times its
length; its bonds hold {lattice:.3f} of that on this lattice. The table has the energy that the motion loses for good,
over G0 H, at the program's own time step and at shorter ones (`python -m benchmarks.tear`).

{table}

![Energy of a cut over the time step](../tear.png)

In the conservative mode a bond that softens or breaks in a step adds the force that makes the work of the step the
area below its curve. This force slows the nodes, so that it does less of its work in the next step. A bond that has
broken therefore pulls once more in the next step. Without this second pull the first column had 0.819, 0.860, 0.912,
0.956, 0.976 and 0.983 from 15 m/s on. At 10 m/s the halves hardly part, and up to 146 bonds break in place of 132.
Bonds that soften over several steps lose more at long steps, as only breaking bonds pull twice: bilinear and cohesive
ones spend 0.89 to 0.95 of G0 H at 15 and 20 m/s and the program's own step, 0.96 to 0.98 at half of it. In the thesis
mode a bond is gone in the step in which it passes its limit, so that a fast cut costs nothing. Families other than
ordinary ones have that rule too. A bond whose cells split one step after it broke (`--adapt split`) does not pull
again.
"""

SCENES = (  # shipped, whose bonds break in one step or soften over several
    Case("duran50", "Duran 50 glass, two scales", "duran50.geo", (), ()),
    Case("duran50_one_scale", "Duran 50 glass, one scale", "duran50_one_scale.py", (), ()),
    Case("soda_lime", "soda-lime glass, two scales", "soda_lime.geo", (), ()),
    Case("kalthoff_winkler", "Kalthoff and Winkler's steel", "kalthoff_winkler.geo", (), ()),
)
MOST_STEPS, CHUNK, ROUNDS = 500, 50, 25

COST_TEXT = """
## Time that the last pull takes

Scenes as they are shipped, at most {steps} steps, on one thread. CPU time of the steps with the force of the last step
over that where bonds are gone at once; of each {chunk} steps the least of {rounds} interleaved runs
(`python -m benchmarks.tear`). Repeated in other processes, ratios differ by 0.01. Since bonds that break are summed
only once in their step, such runs are faster with and without the force: Kalthoff and Winkler's plate takes 1.017 to
1.020 of the time that it took before there was one (medians and least of six interleaved processes).

{table}
"""


class Cut(NamedTuple):
    """What a cut cost, over G0 times its area."""

    taken: float  # from the motion
    booked: float
    momentum: float  # its drift, N s/m
    bonds: int  # broken


def plate(material: Material, time_step: float | None) -> Model:
    """A plate whose nodes are symmetric about its middle."""
    y, x = np.mgrid[0:ROWS, 0:COLUMNS]
    grid = Grid(
        ids=np.arange(1, x.size + 1),
        position=SPACING * np.column_stack([x.ravel(), y.ravel()]),
        delta=np.full(x.size, SPACING),
        border=np.zeros(x.size, dtype=bool),
        hole_id=np.full(x.size, -1),
        cracks=np.empty((0, 4)),
    )
    return Model(grid, Settings(material=material, horizon=Horizon(3.0), run=Run(time_step=time_step)))


def torn(speed: float, share: float, material: Material = GLASS, options: Options | None = None) -> Cut:
    """Tear the plate at a speed, m/s, in steps that are a share of the program's own."""
    options = options or Options(threads=1)
    own = prepare(plate(material, None), options).system.time_step
    return cut(plate(material, share * own), speed, options, ROWS * SPACING)


def cut(model: Model, speed: float, options: Options, area: float) -> Cut:
    """Tear a model in the middle of x; `area` of the cut, m of a plate, m^2 of a body."""
    problem = prepare(model, options)
    system, state, x = problem.system, problem.state, model.grid.position[:, 0]
    mass = model.rho * system.area
    state.rate[x < (x.min() + x.max()) / 2, 0] = -speed

    def energy() -> float:
        return float(0.5 * mass @ (state.rate.astype(float) ** 2).sum(axis=1))

    start, momentum = energy(), mass @ state.rate
    problem.advance(1, round(TIME / system.time_step) + 1)
    strain, softened = system.operator.energies(state)
    cost = model.materials[0].G0 * area
    taken, booked = start - energy() - system.area @ strain, system.area @ (state.dissipated + softened)
    drift = np.abs(mass @ state.rate - momentum).max()
    return Cut(float(taken / cost), float(booked / cost), float(drift), len(system.operator.broken().step) // 2)


def drawn(found: dict[str, list[list[float]]], path: Path) -> None:
    """A curve of each mode and speed over the time step."""
    mpl.use("agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 4.0), layout="constrained")
    for curves, style in zip(found.values(), ("-", ":"), strict=True):
        for number, (speed, curve) in enumerate(zip(SPEEDS, curves, strict=True)):
            label = f"{speed:g} m/s" if style == "-" else None
            axes.plot(SHARES, curve, style, marker="o", markersize=3, color=f"C{number}", label=label)
    axes.set(xscale="log", xlabel="time step / the program's own", ylabel="energy of the cut / G0 H", ylim=(-0.05, 1.1))
    axes.set_title("solid: conservative, dotted: thesis", fontsize="medium")
    axes.grid(alpha=0.3)
    axes.legend(loc="lower left")
    figure.savefig(path, dpi=100)


def steps_times(model: Model, matches_work: bool) -> tuple[NDArray[np.float64], int]:
    """CPU seconds of each `CHUNK` of a model's steps, and the number of bonds that break in all."""
    usual = SCHEMES["conservative"]
    SCHEMES["conservative"] = usual._replace(matches_work=matches_work)
    try:
        prepared = prepare(model, Options(threads=1))
    finally:
        SCHEMES["conservative"] = usual
    times = []
    for first in range(1, min(model.settings.run.steps or MOST_STEPS, MOST_STEPS) + 1, CHUNK):
        times.append(timed(partial(prepared.advance, first, first + CHUNK), time.process_time))
    return np.array(times), len(prepared.system.operator.broken().step) // 2


def cost_rows() -> list[str]:
    """A row of the table of costs for each scene."""
    rows = ["| scene | nodes | bonds that break | with over without |", "|---|---|---|---|"]
    with tempfile.TemporaryDirectory() as folder:
        for case in SCENES:
            model = built(case, Path(folder))
            broken = [steps_times(model, matches_work)[1] for matches_work in (False, True)]  # compiles
            least = np.full((2, len(steps_times(model, True)[0])), np.inf)
            for turn in range(ROUNDS):
                for side in (0, 1) if turn % 2 else (1, 0):
                    least[side] = np.minimum(least[side], steps_times(model, bool(side))[0])
            without, with_pull = least.sum(axis=1)
            rows.append(f"| {case.title} | {len(model.grid)} | {broken[1]} | {with_pull / without:.3f} |")
            print(rows[-1], flush=True)
    return rows


def main() -> int:
    """Write the chart and the sections."""
    found = {
        mode: [[torn(speed, share, options=Options(mode, threads=1)).taken for share in SHARES] for speed in SPEEDS]
        for mode in ("conservative", "thesis")
    }
    drawn(found, ROOT / "docs" / "tear.png")
    shown = (0, 2, 4)
    lines = ["| m/s | " + " | ".join(f"{mode}, {SHARES[at]:g} of the step" for mode in found for at in shown) + " |"]
    lines.append("|---" * (1 + 2 * len(shown)) + "|")
    for number, speed in enumerate(SPEEDS):
        cells = (f"{curves[number][at]:.3f}" for curves in found.values() for at in shown)
        lines.append(f"| {speed:g} | " + " | ".join(cells) + " |")
    words = {"columns": COLUMNS, "rows": ROWS, "lattice": torn(50.0, 0.25).booked, "table": "\n".join(lines)}
    page = ROOT / "docs" / "verification" / "schemes.md"
    put_section(page, TEXT.format(**words).strip("\n"))
    put_section(
        page, COST_TEXT.format(steps=MOST_STEPS, chunk=CHUNK, rounds=ROUNDS, table="\n".join(cost_rows())).strip("\n")
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
