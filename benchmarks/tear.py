"""What a cut costs where half of a plate leaves the other half, over speeds and time steps: python -m benchmarks.tear

Writes `docs/tear.png` and the table of `docs/verification/schemes.md`.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import numpy as np

from benchmarks.models import grid_of_nodes
from benchmarks.pages import DOCS, markdown_table, write_block
from pdmesh.model.document import Horizon, Material, Run, Settings
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

GLASS = Material(E=65e9, rho=2235.0, G0=204.0)
COLUMNS, ROWS, SPACING = 20, 10, 1e-3  # the last in m
TIME = 2e-5  # s, in which slow halves come free
SPEEDS = (10.0, 15.0, 20.0, 30.0, 50.0, 100.0, 200.0)  # m/s
SHARES = (1.0, 0.71, 0.5, 0.35, 0.25, 0.125, 0.0625)  # of the program's own time step


class Cut(NamedTuple):
    """What a cut cost, over G0 times its area."""

    taken: float  # from the motion
    booked: float
    momentum: float  # its drift, N s/m
    bonds: int  # broken


def plate(material: Material, time_step: float | None) -> Model:
    """A plate whose nodes are symmetric about its middle."""
    y, x = np.mgrid[0:ROWS, 0:COLUMNS]
    grid = grid_of_nodes(SPACING * np.column_stack([x.ravel(), y.ravel()]), SPACING)
    return Model(grid, Settings(material=material, horizon=Horizon(3.0), run=Run(time_step=time_step)))


def torn(speed: float, share: float, material: Material = GLASS, options: Options | None = None) -> Cut:
    """Tear the plate at a speed, m/s, in steps that are a share of the program's own."""
    options = options or Options(threads=1)
    step = prepare(plate(material, None), options).system.time_step
    return cut(plate(material, share * step), speed, options, ROWS * SPACING)


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


def chart(energies: dict[str, list[list[float]]], path: Path) -> None:
    """A curve of each mode and speed over the time step."""
    mpl.use("agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(6.4, 4.0), layout="constrained")
    for curves, style in zip(energies.values(), ("-", ":"), strict=True):
        for number, (speed, curve) in enumerate(zip(SPEEDS, curves, strict=True)):
            label = f"{speed:g} m/s" if style == "-" else None
            axes.plot(SHARES, curve, style, marker="o", markersize=3, color=f"C{number}", label=label)
    axes.set(xscale="log", xlabel="time step / the program's own", ylabel="energy of the cut / G0 H", ylim=(-0.05, 1.1))
    axes.set_title("solid: conservative, dotted: thesis", fontsize="medium")
    axes.grid(alpha=0.3)
    axes.legend(loc="lower left")
    figure.savefig(path, dpi=100)


def table(energies: dict[str, list[list[float]]]) -> str:
    """The table of the page, of some of the time steps."""
    shown = (0, 2, 4)
    header = ["m/s", *(f"{mode}, {SHARES[at]:g} of the step" for mode in energies for at in shown)]
    rows = [
        [f"{speed:g}", *(f"{curves[number][at]:.3f}" for curves in energies.values() for at in shown)]
        for number, speed in enumerate(SPEEDS)
    ]
    return markdown_table(header, rows)


def main() -> int:
    """Write the chart and the table."""
    energies = {
        mode: [[torn(speed, share, options=Options(mode, threads=1)).taken for share in SHARES] for speed in SPEEDS]
        for mode in ("conservative", "thesis")
    }
    chart(energies, DOCS / "tear.png")
    write_block(DOCS / "verification" / "schemes.md", "cut", table(energies))
    return 0


if __name__ == "__main__":
    sys.exit(main())
