"""The deck of the multi-adaptive method's source, uniform and adaptive: python -m benchmarks.collocation [--coarser].

Kalthoff and Winkler's plate, plane strain, 16.5 m/s held, G0 = 42408 J/m^2, 87.5 us (G. Ongaro, A. Shojaei, F.
Mossaiby, A. Hermann, C. J. Cyron, P. Trovalusci, Int. J. Fract. 244 (2023)): 0.25 and 0.5 mm between nodes, a horizon
of 6 mm, 24 and 12 spacings. Uniform runs are of the same kernel, all of their nodes fine. --coarser: 0.5 and 1 mm.
Writes docs/collocation.md and docs/collocation.png; some ten minutes of one core.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from benchmarks.adaptivity import GEOMETRIES, ROOT, with_run
from pdmesh.drawing.sources import read_scene
from pdmesh.grid.building import build
from pdmesh.model.document import Collocation
from pdsolve.adapt import zone_moved
from pdsolve.adaptive.collocation.shown import Collocated
from pdsolve.measures import books, damage
from pdsolve.model import Model, ModelWarning
from pdsolve.system import Options, prepare

PAGE, CHART = ROOT / "docs" / "collocation.md", ROOT / "docs" / "collocation.png"
HORIZON, DURATION, LOOKS = 6e-3, 87.5e-6, 35
RADIUS = 10e-3  # m around the tip of the upper notch, whose energy is compared
CRACKED, LEVEL = 0.35, 0.06  # damage of a node on the path; m above the middle where tips are timed
EVERYWHERE = 1e6  # horizons from edges


class Deck(NamedTuple):
    """One way to solve it."""

    name: str
    h: float  # m, of fine nodes
    step: float  # s
    how: Collocation

    def model(self) -> Model:
        """Its model."""
        given = [("spacing", f"{self.h:g}"), ("horizon", f"{HORIZON / self.h:g}"), ("step", f"{self.step:g}")]
        built = build(read_scene(GEOMETRIES / "kalthoff_winkler_steel.py", given).adapt("collocation"))
        assert built.settings.material is not None
        material = msgspec.structs.replace(built.settings.material, micromodulus="constant")
        model = Model(built.grid, msgspec.structs.replace(built.settings, material=material))
        return with_run(model, steps=round(DURATION / self.step), collocation=self.how)


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


def solved(deck: Deck) -> Found:
    """One run."""
    model, began = deck.model(), time.thread_time()
    problem = prepare(model, Options(threads=1))
    system, state, took = problem.system, problem.state, time.thread_time() - began
    steps, cpu, begins = model.settings.run.steps, 0.0, system.hybrid.told().fine_share  # type: ignore[union-attr]
    noted: list[tuple[float, float, float]] = []
    for look in range(LOOKS):
        began = time.thread_time()
        system.stepper.march(state, look * steps // LOOKS + 1, (look + 1) * steps // LOOKS + 1)
        cpu += time.thread_time() - began
        change = zone_moved(system)
        if change is not None:
            system, state = change.system, change.state
        ledger = books(system, state, (look + 1) * steps // LOOKS)
        noted.append((ledger.time, *_looked(system, state, deck.h)))
        print(deck.name, f"{1e6 * ledger.time:.1f} us, {cpu:.1f} s,", *noted[-1][1:], file=sys.stderr, flush=True)
    at, near, top = np.array(noted).T
    hurt, position = damage(system), system.model.grid.position
    path = position[(hurt > CRACKED) & (position[:, 1] > 0.1)]
    told = system.hybrid.told()  # type: ignore[union-attr]
    balance = ledger.balance(system.initial_energy)
    return Found(
        deck, cpu, took, begins, at, near, balance, top, path, told.fine_share, told.clipped_stretch, position,
        system.model.grid.delta, hurt,
    )  # fmt: skip


def _looked(system: object, state: object, h: float) -> tuple[float, float]:
    """Energy around the upper notch's tip, J/m, and how far up nodes are cracked, m."""
    shown = system.hybrid  # type: ignore[attr-defined]
    assert isinstance(shown, Collocated)
    held, _ = shown.energies(state)  # type: ignore[arg-type]
    position, rate = system.model.grid.position, state.rate  # type: ignore[attr-defined]
    own = np.hypot(*(position - (0.05, 0.125 + h / 2)).T) < RADIUS
    moving = shown.hybrid.ground.rho / 2 * (rate[own] ** 2).sum(axis=1)
    cracked = position[(damage(system) > CRACKED) & (position[:, 0] < 0.09), 1]  # type: ignore[arg-type]
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


def page(founds: list[Found], coarse: Found) -> str:
    """What is written."""
    uniform = founds[0]
    h = uniform.deck.h
    lines = [
        "# The deck of the multi-adaptive method's source",
        "",
        *HEAD.splitlines(),
        "",
        f"{1e3 * h:g} and {2e3 * h:g} mm between nodes, horizon {1e3 * HORIZON:g} mm, steps of"
        f" {1e6 * uniform.deck.step:g} us to {1e6 * DURATION:g} us; {len(uniform.position)} fine nodes in all.",
        "",
        "![Fine zone, damage and energy around the notch's tip](collocation.png)",
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
    lines += ["", "Nodes cracked at the edge opposite to the struck one, 20 mm of it: "]
    far = [f"{found.deck.name} {int(((found.position[:, 0] > 0.08) & (found.damage > CRACKED)).sum())}"
           for found in (*founds, coarse)]  # fmt: skip
    lines[-1] += ", ".join(far) + f". The last, uniform of {1e3 * coarse.deck.h:g} mm, took {coarse.cpu:.0f} s."
    return "\n".join([*lines, ""])


def chart(founds: list[Found]) -> None:
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
    figure.savefig(CHART, dpi=110)


HEAD = """Written by `python -m benchmarks.collocation`. Kalthoff and Winkler's plate of steel as G. Ongaro et al. (Int.
J. Fract. 244 (2023)) solve it, plane strain, struck edge held at 16.5 m/s, G0 = 42408 J/m^2, kappa 0.95; its
spacings are not stated; 0.5 and 0.25 mm have its numbers of neighbours, 441 and 1793. Both grids have the
same horizon; coarse nodes have stencils of few nodes, tied together by those of a compact one (49 and 12 of
them at 12 spacings). Uniform runs are of the same kernel with all nodes fine. "As in the source" is fine
within one horizon of edges and notches; stencils then reach into the surface layer that bonds have there, and
energy is lost along all edges: so half a horizon more is the default. A bond is one bit here, and its
stiffness the lattice's own, corrected at edges where it is needed: no list would fit.
"""


def main(arguments: list[str]) -> int:
    """Measure and write the page and the picture."""
    parser = argparse.ArgumentParser(description="Solve the deck of the multi-adaptive method's source.")
    parser.add_argument("--coarser", action="store_true", help="twice the spacings: half a minute")
    args = parser.parse_args(arguments)
    warnings.simplefilter("ignore", ModelWarning)
    h = 5e-4 if args.coarser else 2.5e-4
    everywhere = Collocation(margin=EVERYWHERE)
    decks = (
        Deck("uniform", h, 2.5e-7, everywhere),
        Deck("collocation", h, 2.5e-7, Collocation(damping=0.0)),
        Deck("as in the source", h, 2.5e-7, Collocation(damping=0.0, margin=0.0)),
    )
    founds, coarse = [solved(deck) for deck in decks], solved(Deck("uniform, coarse", 2 * h, 2.5e-7, everywhere))
    chart(founds)
    PAGE.write_text(page(founds, coarse), encoding="utf-8")
    print(PAGE)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
