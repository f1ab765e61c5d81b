"""The deck of the multi-adaptive method's source, uniform and adaptive: python -m benchmarks.collocation [--full].

Kalthoff and Winkler's plate, plane strain, 16.5 m/s held, G0 = 42408 J/m^2, 87.5 us (G. Ongaro, A. Shojaei, F.
Mossaiby, A. Hermann, C. J. Cyron, P. Trovalusci, Int. J. Fract. 244 (2023)): a horizon of 6 mm, 0.5 and 1 mm between
nodes in a minute, with --full 0.25 and 0.5 mm, 24 and 12 in a horizon, as in the source, in some ten minutes of one
core. Uniform runs are of the same kernel, all of their nodes fine. All runs take turns, so that their times compare.
Besides, the same nodes with four spacings in the horizon: uniform, hybrid and this. Writes tables and pictures of
docs/verification/collocation.md.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import time
import warnings
from collections.abc import Generator
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from benchmarks import adaptivity
from benchmarks.adaptivity import CRACKED, angle, mean_distance
from benchmarks.balance_rows import compute_energy_balance_row
from benchmarks.models import GEOMETRIES, with_run
from benchmarks.pages import DOCS, markdown_table, write_block
from pdmesh.drawing.file_reading import read_scene
from pdmesh.grid.building import build
from pdmesh.model.document import Collocation
from pdsolve.adaptivity.collocation.operator import CollocationOperator
from pdsolve.model import Model, ModelWarning
from pdsolve.options import Options
from pdsolve.run.measures import compute_node_damage
from pdsolve.run.prepare import prepare
from pdsolve.run.system import create_system_if_zone_changed

PAGE = DOCS / "verification" / "collocation.md"
HORIZON, DURATION, LOOKS = 6e-3, 87.5e-6, 35
RADIUS = 10e-3  # m around the tip of the upper notch, whose energy is compared
LEVEL = 0.06  # m above the middle where tips are timed
EVERYWHERE = Collocation(damped=True, margin=1e6)  # horizons from edges
STEP = 2.5e-7  # s
FEW = 4.0  # spacings in the horizon: with more the hybrid's zone is too narrow for this plate
TURNS = 2  # times that cost is measured


class Deck(NamedTuple):
    """One way to solve it."""

    name: str
    h: float  # m, of fine nodes
    how: Collocation

    def model(self) -> Model:
        """Its model."""
        given = [("spacing", f"{self.h:g}"), ("horizon", f"{HORIZON / self.h:g}"), ("step", f"{STEP:g}")]
        built = build(read_scene(GEOMETRIES / "kalthoff_winkler_steel.py", given, trust=True).adapt("hybrid"))
        assert built.settings.material is not None
        material = msgspec.structs.replace(built.settings.material, micromodulus="constant")
        model = Model(built.grid, msgspec.structs.replace(built.settings, material=material))
        return with_run(model, adapt="collocation", steps=round(DURATION / STEP), collocation=self.how)


class Run(NamedTuple):
    """What one run came to."""

    deck: Deck
    cpu: float  # s of the loop
    begins: float  # share of the plate that is fine
    time: NDArray[np.float64]  # (t,) s
    near: NDArray[np.float64]  # (t,) energy around the notch's tip, J/m
    balance: float
    top: NDArray[np.float64]  # (t,) how far up the plate nodes are cracked, m from its middle
    fine: float
    stretch: float
    position: NDArray[np.float64]  # (n, 2) m
    delta: NDArray[np.float64]  # (n,) m
    damage: NDArray[np.float64]  # (n,)

    @property
    def path(self) -> NDArray[np.float64]:
        """Cracked nodes (k, 2) of the upper half up to 45 mm above the notch, m."""
        y = self.position[:, 1]
        return self.position[(self.damage > CRACKED) & (y > 0.1265) & (y < 0.1715)]

    @property
    def far(self) -> str:
        """How many cracked nodes are within 20 mm of the edge opposite to the struck one."""
        return f"{self.deck.name} {int(((self.position[:, 0] > 0.08) & (self.damage > CRACKED)).sum())}"


def solved(decks: list[Deck]) -> list[Run]:
    """All of them, in turn from look to look."""
    marches = [_solved(deck) for deck in decks]
    for _ in range(LOOKS - 1):
        for march in marches:
            next(march)
    return [run for march in marches for run in march if run is not None]


def _solved(deck: Deck) -> Generator[Run | None, None, None]:
    """One run, which waits after each look; the last one yields what it came to."""
    model = deck.model()
    system, state = prepare(model, Options(threads=1))
    steps, cpu, begins = model.settings.run.steps, 0.0, system.moving_zone_operator.engine.zone_summary().fine_share  # type: ignore[union-attr]
    looks: list[tuple[float, float, float]] = []
    for look in range(LOOKS):
        began = time.thread_time()
        system.stepper.advance(state, look * steps // LOOKS + 1, (look + 1) * steps // LOOKS + 1)
        cpu += time.thread_time() - began
        change = create_system_if_zone_changed(system)
        if change is not None:
            system, state = change.system, change.state
        ledger = compute_energy_balance_row(system, state, (look + 1) * steps // LOOKS)
        looks.append((ledger.time, *_looked(system, state, deck.h)))
        print(deck.name, f"{1e6 * ledger.time:.1f} us, {cpu:.1f} s,", *looks[-1][1:], file=sys.stderr, flush=True)
        if look < LOOKS - 1:
            yield None
    at, near, top = np.array(looks).T
    zone, grid = system.moving_zone_operator.engine.zone_summary(), system.model.grid  # type: ignore[union-attr]
    yield Run(
        deck, cpu, begins, at, near, ledger.balance_error(system.initial_energy), top, zone.fine_share,
        zone.clipped_stretch, grid.position, grid.delta, compute_node_damage(system),
    )  # fmt: skip


def _looked(system: object, state: object, h: float) -> tuple[float, float]:
    """Energy around the upper notch's tip, J/m, and how far up nodes are cracked, m."""
    operator = system.moving_zone_operator  # type: ignore[attr-defined]
    assert isinstance(operator, CollocationOperator)
    strain, _ = operator.energies(state)  # type: ignore[arg-type]
    position, rate = system.model.grid.position, state.rate  # type: ignore[attr-defined]
    near = np.hypot(*(position - (0.05, 0.125 + h / 2)).T) < RADIUS
    kinetic = operator.engine.lattice.rho / 2 * (rate[near] ** 2).sum(axis=1)
    cracked = position[(compute_node_damage(system) > CRACKED) & (position[:, 0] < 0.09), 1]  # type: ignore[arg-type]
    return float(((kinetic + strain[near]) * operator.area[near]).sum()), float(cracked.max(initial=0.1) - 0.1)


def energies(run: Run, uniform: Run) -> tuple[float, float]:
    """The largest difference of the energy around the tip until the crack has left that circle, relative to that of the
    uniform run then; and after the first 15 us, as there is next to nothing before."""
    until = uniform.top < 0.025 + RADIUS
    compared = until & (uniform.near > 0.01 * uniform.near[until].max())
    off = np.abs(run.near / np.maximum(uniform.near, 1e-9) - 1)
    return float(off[compared].max()), float(off[compared & (uniform.time > 15e-6)].max())


def block(runs: list[Run], coarse: Run) -> str:
    """The table of a resolution; the first run is the uniform one."""
    uniform = runs[0]
    header = ["run", "CPU of the loop, s", "times as fast", "fine at the start, end, %", "angle, degrees"]
    header += ["path off, mm", "60 mm above the middle, us"]
    header += ["energy around the tip off, %: from 1 % of its peak, from 15 us", "balance, %", "coarse pairs, of s0"]
    rows = []
    for run in runs:
        first, later = energies(run, uniform)
        turned = angle(run.path[run.path[:, 0] < 0.09])
        off = 1e3 * mean_distance(run.path, uniform.path)
        cells = [run.deck.name, f"{run.cpu:.0f}", f"{uniform.cpu / run.cpu:.2f}"]
        cells += [f"{100 * run.begins:.1f}, {100 * run.fine:.1f}", f"{turned:.1f}", f"{off:.2f}"]
        passed = float(np.interp(LEVEL, run.top, run.time)) if run.top[-1] > LEVEL else np.nan  # above the middle
        cells += [f"{1e6 * passed:.1f}", f"{100 * first:.1f}, {100 * later:.1f}"]
        rows.append([*cells, f"{100 * run.balance:+.2f}", f"{run.stretch:.2f}"])
    return (
        f"{markdown_table(header, rows)}\nCracked nodes within 20 mm of the edge opposite to the struck one:"
        f" {', '.join(run.far for run in (*runs, coarse))}. The last run, with {1e3 * coarse.deck.h:g} mm, took"
        f" {coarse.cpu:.0f} s."
    )


def beside(h: float) -> str:
    """The table of the same with as many spacings in the horizon as the hybrid takes."""
    model = Deck("", h, Collocation(damped=True)).model()
    horizon = msgspec.structs.replace(model.settings.horizon, ratio=FEW)
    material = msgspec.structs.replace(model.materials[0], micromodulus="conical")
    settings = msgspec.structs.replace(model.settings, horizon=horizon, material=material)
    model = dataclasses.replace(model, settings=settings)
    runs: dict[str, adaptivity.Run] = {}
    for turn in range(TURNS):
        for adapt in ("none", "hybrid", "collocation"):
            run = adaptivity.solved(model, adapt, 1.0, DURATION)
            runs[adapt] = run if turn == 0 else run._replace(cpu=min(run.cpu, runs[adapt].cpu))
    header = ["run", "CPU of the loop, s", "times as fast", "fine at the end, %", "first bond, us", "dissipated, J/m"]
    rows = []
    for adapt, run in runs.items():
        cells = ["uniform, in blocks" if adapt == "none" else adapt, f"{run.cpu:.2f}"]
        cells += [f"{runs['none'].cpu / run.cpu:.2f}", f"{100 * run.fine:.1f}", f"{1e6 * run.first:.1f}"]
        rows.append([*cells, f"{run.dissipated:.0f}", f"{run.damped:.0f}", f"{100 * run.balance:+.2f}"])
    return markdown_table([*header, "damped, J/m", "balance, %"], rows)


def chart(runs: list[Run], path: Path) -> None:
    """The fine zone and the damage of the first adaptive run, and the energy around the tip of all."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (zone, damage, energy) = plt.subplots(1, 3, figsize=(13, 5.5), layout="constrained")
    shown = runs[1]
    x, y = 1e3 * shown.position.T
    fine = shown.delta < 1.5 * shown.deck.h
    zone.scatter(x[~fine], y[~fine], s=0.4, c="0.7", linewidths=0, label="coarse nodes")
    zone.scatter(x[fine], y[fine], s=0.3, c="tab:blue", linewidths=0, label="fine nodes")
    drawn = damage.scatter(x, y, s=0.4, c=shown.damage, cmap="inferno_r", vmin=0, vmax=0.6, linewidths=0)
    figure.colorbar(drawn, ax=damage, label="damage")
    for axes, words in ((zone, "Active nodes at the end"), (damage, "Damage at the end")):
        axes.set(title=words, xlabel="mm", aspect="equal")
    zone.legend(markerscale=12, loc="lower right")
    for run in runs:
        energy.plot(1e6 * run.time, run.near, label=run.deck.name)
    energy.set(title=f"Energy within {1e3 * RADIUS:g} mm of the notch's tip", xlabel="us", ylabel="J/m")
    energy.legend()
    figure.savefig(path, dpi=110)


def main(arguments: list[str]) -> int:
    """Measure and write the page and the pictures."""
    parser = argparse.ArgumentParser(description="Solve the deck of the multi-adaptive method's source.")
    parser.add_argument("--full", action="store_true", help="0.25 and 0.5 mm, as in the source: some ten minutes")
    args = parser.parse_args(arguments)
    warnings.simplefilter("ignore", ModelWarning)
    h, picture = (2.5e-4, "collocation.png") if args.full else (5e-4, "collocation_coarser.png")
    *runs, coarse = solved(
        [
            Deck("uniform", h, EVERYWHERE),
            Deck("collocation", h, Collocation(damping=0.0)),
            Deck("a quarter horizon more than the source", h, Collocation(damping=0.0, margin=0.25)),
            Deck("as in the source", h, Collocation(damping=0.0, margin=0.0)),
            Deck("uniform, coarse", 2 * h, EVERYWHERE),
        ]
    )
    chart(runs, PAGE.parent / picture)
    write_block(PAGE, f"{1e3 * h:g} mm", block(runs, coarse))
    write_block(PAGE, f"beside the hybrid, {1e3 * h:g} mm", beside(h))
    print(PAGE)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
