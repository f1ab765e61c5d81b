"""The deck of the multi-adaptive method's source, uniform and adaptive: python -m benchmarks.collocation [--full].

Kalthoff and Winkler's plate, plane strain, 16.5 m/s held, G0 = 42408 J/m^2, 87.5 us (G. Ongaro, A. Shojaei, F.
Mossaiby, A. Hermann, C. J. Cyron, P. Trovalusci, Int. J. Fract. 244 (2023)): a horizon of 6 mm, 0.5 and 1 mm between
nodes in a minute, with --full 0.25 and 0.5 mm, 24 and 12 in a horizon, as in the source, in some ten minutes of one
core. Uniform runs are of the same kernel, all of their nodes fine. All runs take turns, so that their times compare.
Besides, the same nodes with four spacings in the horizon: uniform, hybrid and this. Writes its sections of
docs/verification/collocation.md, and their pictures.
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

from benchmarks import adaptivity, pages
from benchmarks.adaptivity import GEOMETRIES, ROOT, with_run
from pdmesh.drawing.file_reading import read_scene
from pdmesh.grid.building import build
from pdmesh.model.document import Collocation
from pdsolve.adaptivity.collocation.operator import CollocationOperator
from pdsolve.model import Model, ModelWarning
from pdsolve.options import Options
from pdsolve.run.measures import compute_energy_balance_row, compute_node_damage
from pdsolve.run.node_changes import find_zone_change_since_last_call
from pdsolve.run.prepare import prepare

PAGE = ROOT / "docs" / "verification" / "collocation.md"
HORIZON, DURATION, LOOKS = 6e-3, 87.5e-6, 35
RADIUS = 10e-3  # m around the tip of the upper notch, whose energy is compared
CRACKED, LEVEL = 0.35, 0.06  # damage of a node on the path; m above the middle where tips are timed
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


class Found(NamedTuple):
    """What one run came to."""

    deck: Deck
    cpu: float  # s of the loop
    prepared: float  # s
    begins: float  # share of the plate that is fine
    time: NDArray[np.float64]  # (t,) s
    near: NDArray[np.float64]  # (t,) energy around the notch's tip, J/m
    balance: float
    top: NDArray[np.float64]  # (t,) how far up the plate nodes are cracked, m from its middle
    path: NDArray[np.float64]  # (k, 2) m, upper half
    fine: float
    stretch: float
    position: NDArray[np.float64]  # (n, 2) m
    delta: NDArray[np.float64]  # (n,) m
    damage: NDArray[np.float64]  # (n,)


def solved(decks: list[Deck]) -> list[Found]:
    """All of them, in turn from look to look."""
    runs, founds = [_solved(deck) for deck in decks], []
    for _ in range(LOOKS):
        for run in runs:
            next(run)
    for run in runs:
        try:
            next(run)
        except StopIteration as end:
            founds.append(end.value)
    return founds


def _solved(deck: Deck) -> Generator[None, None, Found]:
    """One run, which waits after each look."""
    model, began = deck.model(), time.thread_time()
    problem = prepare(model, Options(threads=1))
    system, state, took = problem.system, problem.state, time.thread_time() - began
    steps, cpu, begins = model.settings.run.steps, 0.0, system.moving_zone_operator.zone_summary().fine_share  # type: ignore[union-attr]
    noted: list[tuple[float, float, float]] = []
    for look in range(LOOKS):
        began = time.thread_time()
        system.stepper.advance(state, look * steps // LOOKS + 1, (look + 1) * steps // LOOKS + 1)
        cpu += time.thread_time() - began
        change = find_zone_change_since_last_call(system)
        if change is not None:
            system, state = change.system, change.state
        ledger = compute_energy_balance_row(system, state, (look + 1) * steps // LOOKS)
        noted.append((ledger.time, *_looked(system, state, deck.h)))
        print(deck.name, f"{1e6 * ledger.time:.1f} us, {cpu:.1f} s,", *noted[-1][1:], file=sys.stderr, flush=True)
        yield
    at, near, top = np.array(noted).T
    hurt, position = compute_node_damage(system), system.model.grid.position
    path = position[(hurt > CRACKED) & (position[:, 1] > 0.1)]
    told = system.moving_zone_operator.zone_summary()  # type: ignore[union-attr]
    balance = ledger.balance_error(system.initial_energy)
    return Found(
        deck, cpu, took, begins, at, near, balance, top, path, told.fine_share, told.clipped_stretch, position,
        system.model.grid.delta, hurt,
    )  # fmt: skip


def _looked(system: object, state: object, h: float) -> tuple[float, float]:
    """Energy around the upper notch's tip, J/m, and how far up nodes are cracked, m."""
    shown = system.moving_zone_operator  # type: ignore[attr-defined]
    assert isinstance(shown, CollocationOperator)
    held, _ = shown.energies(state)  # type: ignore[arg-type]
    position, rate = system.model.grid.position, state.rate  # type: ignore[attr-defined]
    own = np.hypot(*(position - (0.05, 0.125 + h / 2)).T) < RADIUS
    moving = shown.engine.lattice.rho / 2 * (rate[own] ** 2).sum(axis=1)
    cracked = position[(compute_node_damage(system) > CRACKED) & (position[:, 0] < 0.09), 1]  # type: ignore[arg-type]
    return float(((moving + held[own]) * shown.area[own]).sum()), float(cracked.max(initial=0.1) - 0.1)


def angle(path: NDArray[np.float64]) -> float:
    """Of the path to the notch, degrees, over 45 mm above it."""
    x, y = path[(path[:, 1] > 0.1265) & (path[:, 1] < 0.1715) & (path[:, 0] < 0.09)].T
    slope = np.polyfit(y - y.mean(), x - x.mean(), 1)[0]
    return float(np.degrees(np.arctan2(1, slope)))


def apart(one: Found, other: Found) -> float:
    """How far a path is from another, m: the mean over its nodes, both ways."""
    some = [found.path[(found.path[:, 1] > 0.1265) & (found.path[:, 1] < 0.1715)] for found in (one, other)]
    away = np.hypot(*(some[0][:, None] - some[1][None]).T)
    return float((away.min(axis=0).mean() + away.min(axis=1).mean()) / 2)


def passed(found: Found) -> float:
    """When the crack is LEVEL above the middle, s."""
    return float(np.interp(LEVEL, found.top, found.time)) if found.top[-1] > LEVEL else np.nan


def energies(one: Found, uniform: Found) -> tuple[float, float]:
    """The largest difference of the energy around the tip until the crack has left that circle, relative to that of the
    uniform run then; and after the first 15 us, as there is next to nothing before."""
    until = uniform.top < 0.025 + RADIUS
    some = until & (uniform.near > 0.01 * uniform.near[until].max())
    off = np.abs(one.near / np.maximum(uniform.near, 1e-9) - 1)
    return float(off[some].max()), float(off[some & (uniform.time > 15e-6)].max())


def page(founds: list[Found], coarse: Found, picture: str) -> str:
    """A section: one resolution."""
    uniform = founds[0]
    h = uniform.deck.h
    lines = [
        f"## {1e3 * h:g} and {2e3 * h:g} mm between nodes",
        "",
        f"The horizon is {HORIZON / h:.0f} and {HORIZON / h / 2:.0f} spacings. The runs have steps of {1e6 * STEP:g} us"
        f" and last {1e6 * DURATION:g} us. The uniform run has {len(uniform.position)} nodes. The runs take turns on"
        " one thread.",
        "",
        f"![Fine zone, damage and energy around the notch's tip]({picture})",
        "",
        "| run | CPU of the loop, s | times as fast | fine at the start, end, % | angle, degrees | path off, mm |"
        " 60 mm above the middle, us | energy around the tip off, %: from 1 % of its peak, from 15 us | balance, % |"
        " coarse pairs, of s0 |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for found in founds:
        first, later = energies(found, uniform)
        lines.append(
            f"| {found.deck.name} | {found.cpu:.0f} | {uniform.cpu / found.cpu:.2f} | {100 * found.begins:.1f},"
            f" {100 * found.fine:.1f} | {angle(found.path):.1f} | {1e3 * apart(found, uniform):.2f} |"
            f" {1e6 * passed(found):.1f} | {100 * first:.1f}, {100 * later:.1f} | {100 * found.balance:+.2f} |"
            f" {found.stretch:.2f} |"
        )
    lines += ["", "Cracked nodes within 20 mm of the edge opposite to the struck one: "]
    far = [f"{found.deck.name} {int(((found.position[:, 0] > 0.08) & (found.damage > CRACKED)).sum())}"
           for found in (*founds, coarse)]  # fmt: skip
    lines[-1] += ", ".join(far) + f". The last run, with {1e3 * coarse.deck.h:g} mm, took {coarse.cpu:.0f} s."
    return "\n".join([*lines, ""])


def beside(h: float) -> str:
    """A section: the same with as many spacings in the horizon as the hybrid takes."""
    model, cpu, last = Deck("", h, Collocation(damped=True)).model(), {}, {}
    horizon = msgspec.structs.replace(model.settings.horizon, ratio=FEW)
    material = msgspec.structs.replace(model.materials[0], micromodulus="conical")
    settings = msgspec.structs.replace(model.settings, horizon=horizon, material=material)
    model = dataclasses.replace(model, settings=settings)
    for _ in range(TURNS):
        for adapt in ("none", "hybrid", "collocation"):
            last[adapt] = adaptivity.solved(model, adapt, 1.0, DURATION)
            cpu[adapt] = min(cpu.get(adapt, np.inf), last[adapt].cpu)
    lines = [
        f"## Beside the hybrid, {1e3 * h:g} mm between nodes",
        "",
        "For this plate the hybrid's zone is too narrow if the horizon is 5 or 6 spacings, the largest it supports"
        " ([where methods fail](limitations.md)), or if the micromodulus is constant. The table has all three"
        f" with their defaults, a horizon of {FEW:g} spacings ({1e3 * FEW * h:g} mm) and a conical micromodulus, on the"
        f" same {len(model.grid)} nodes. CPU time is that of the loop on one thread, the least of {TURNS} runs in turn."
        " So few spacings need damping beside the seam (`run.collocation.damped`), which takes most of the work.",
        "",
        "| run | CPU of the loop, s | times as fast | fine at the end, % | first bond, us | dissipated, J/m |"
        " damped, J/m | balance, % |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for adapt, found in last.items():
        name = "uniform, in blocks" if adapt == "none" else adapt
        lines.append(
            f"| {name} | {cpu[adapt]:.2f} | {cpu['none'] / cpu[adapt]:.2f} | {100 * found.fine:.1f} |"
            f" {1e6 * found.first:.1f} | {found.dissipated:.0f} | {found.damped:.0f} | {100 * found.balance:+.2f} |"
        )
    return "\n".join([*lines, ""])


def chart(founds: list[Found], path: Path) -> None:
    """The fine zone and the damage of the first adaptive run, and the energy around the tip of all."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (zone, hurt, energy) = plt.subplots(1, 3, figsize=(13, 5.5), layout="constrained")
    shown = founds[1]
    x, y = 1e3 * shown.position.T
    fine = shown.delta < 1.5 * shown.deck.h
    zone.scatter(x[~fine], y[~fine], s=0.4, c="0.7", linewidths=0, label="coarse nodes")
    zone.scatter(x[fine], y[fine], s=0.3, c="tab:blue", linewidths=0, label="fine nodes")
    drawn = hurt.scatter(x, y, s=0.4, c=shown.damage, cmap="inferno_r", vmin=0, vmax=0.6, linewidths=0)
    figure.colorbar(drawn, ax=hurt, label="damage")
    for axes, words in ((zone, "Active nodes at the end"), (hurt, "Damage at the end")):
        axes.set(title=words, xlabel="mm", aspect="equal")
    zone.legend(markerscale=12, loc="lower right")
    for found in founds:
        energy.plot(1e6 * found.time, found.near, label=found.deck.name)
    energy.set(title=f"Energy within {1e3 * RADIUS:g} mm of the notch's tip", xlabel="us", ylabel="J/m")
    energy.legend()
    figure.savefig(path, dpi=110)


HEAD = """# Collocation benchmark

`python -m benchmarks.collocation` writes this page, with `--full` at the resolution of the source. The deck is
Kalthoff and Winkler's steel plate as G. Ongaro et al. (Int. J. Fract. 244 (2023)) solve it: plane strain, struck edge
held at 16.5 m/s, G0 = 42408 J/m^2, kappa 0.95. The source does not state its spacings; with 0.5 and 0.25 mm families
have its numbers of neighbours, 441 and 1793. Both grids have the same horizon. Coarse nodes have stencils of few
nodes, stabilized by those of a compact stencil (49 and 12 nodes at 12 spacings). Uniform runs use the same kernel with
all nodes fine.

"As in the source" is fine within one horizon of edges and notches. Stencils then reach into the surface layer of the
bonds, and energy is lost along all edges. The default therefore adds half a horizon (`run.collocation.margin`). A
quarter is faster, and sufficient for an error of a few per cent. The source's runs on 12 cores were 1.86 times as fast
as its uniform ones.

Each bond is stored as one bit, and its stiffness is that of the lattice. Along edges it is corrected. Rows of 16 nodes
along a straight edge share their corrections, which are stored once. Elsewhere corrections are computed as needed.
"""


def main(arguments: list[str]) -> int:
    """Measure and write the page and the pictures."""
    parser = argparse.ArgumentParser(description="Solve the deck of the multi-adaptive method's source.")
    parser.add_argument("--full", action="store_true", help="0.25 and 0.5 mm, as in the source: some ten minutes")
    args = parser.parse_args(arguments)
    warnings.simplefilter("ignore", ModelWarning)
    h, picture = (2.5e-4, "collocation.png") if args.full else (5e-4, "collocation_coarser.png")
    *founds, coarse = solved(
        [
            Deck("uniform", h, EVERYWHERE),
            Deck("collocation", h, Collocation(damping=0.0)),
            Deck("a quarter horizon more than the source", h, Collocation(damping=0.0, margin=0.25)),
            Deck("as in the source", h, Collocation(damping=0.0, margin=0.0)),
            Deck("uniform, coarse", 2 * h, EVERYWHERE),
        ]
    )
    chart(founds, PAGE.parent / picture)
    others = pages.sections(PAGE.read_text(encoding="utf-8"))[1:]
    PAGE.write_text("\n".join([HEAD, *others]), encoding="utf-8")
    for section in (page(founds, coarse, picture), beside(h)):
        pages.put_section(PAGE, section)
    print(PAGE)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
