"""Fine zones of all kinds on the same scenes, in one table and one chart: python -m benchmarks.kinds.

Drawn zones, those that move with cracks and a compact lattice elsewhere (hybrid), cells that split, or stencils
(collocation), each beside uniform nodes of the finest spacing, with the same horizon over spacing. Cost: CPU time of
the loop on one thread, over that of the uniform run. Error: the distance of the crack's path from those of uniform
runs, over its length, for four steps, as a crack is known no better than runs that differ by the step alone. Besides,
free vibration that noise sets in motion: how much energy there is of it after 4000 units of time; and what of a pulse
comes back from the seam (`benchmarks.pulses`). Writes its part of docs/adaptivity.md, and docs/adaptivity.png. Another
kind is another row of `KINDS`.
"""

from __future__ import annotations

import argparse
import dataclasses
import sys
import warnings
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import NamedTuple

import msgspec
import numpy as np

from benchmarks.adaptivity import GEOMETRIES, KINDS_BEGIN, PAGE, ROOT, STEPS, Found, distance, solved, with_run
from benchmarks.pages import put_section
from benchmarks.pulses import WIDTHS, sent_back, split_where
from pdmesh import Scene, box
from pdmesh.drawing.file_reading import read_scene
from pdmesh.grid.building import build
from pdmesh.model.document import Collocation, InitialVelocity, Material, Run
from pdsolve.errors import UnstableError
from pdsolve.model import Model, ModelWarning
from pdsolve.options import Options
from pdsolve.run.measures import books
from pdsolve.run.prepare import prepare

CHART = ROOT / "docs" / "adaptivity.png"
EVERYWHERE = (-1.0, -1.0, 1.0, 1.0)  # m
UNITS = 4000.0  # spacing sqrt(rho / E): how long a plate vibrates
DIRECTIONS = 8  # of the noise
SHAKEN = (0.0, 0.03, 0.05, 0.05)  # m: what is fine then, where it is drawn or split
COSTS, SHARES = (0.1, 0.3, 1.0, 3.0, 10.0), (0.1, 1.0, 10.0, 100.0)  # marked in the chart; %
GROWN = 1e6  # of the energy at the start: enough to know


class Plate(NamedTuple):
    """A scene, and what of it is compared."""

    title: str
    file: str
    assignments: tuple[tuple[str, str], ...]
    coarse: tuple[tuple[str, str], ...]  # with nodes twice as far apart, which are to be split
    drawn: Callable[[Scene], Scene]  # with zones drawn by one who knows where cracks go
    duration: float  # s
    box: tuple[float, float, float, float]  # where its path is compared, m


class Kind(NamedTuple):
    """A way to spend fewer bonds."""

    name: str
    adapt: str = "none"
    drawn: bool = False
    damping: float | None = None  # of a collocation's seam; None: its default

    def model(self, plate: Plate) -> Model:
        """A plate's model for it."""
        splits = self.adapt == "split"
        given = plate.coarse if splits else plate.assignments
        scene = read_scene(GEOMETRIES / plate.file, given, trust=True).one_scale()
        if self.drawn:
            scene = plate.drawn(scene)
        return self.built(scene, plate.file)

    def built(self, scene: Scene, name: str = "") -> Model:
        """The model of a scene, whose zones are drawn for it."""
        if self.adapt == "split":
            scene = scene.zone(box(*EVERYWHERE), scene.finest / 2)  # all may split once
        lattice = "hybrid" if self == UNIFORM or self.adapt == "collocation" else self.adapt  # whose nodes it is of
        built = build(scene if lattice == "none" else scene.adapt(lattice))  # type: ignore[arg-type]
        return with_run(Model(built.grid, built.settings, name), adapt=self.adapt, collocation=self.collocation)

    @property
    def collocation(self) -> Collocation:
        """How it is solved if it is that."""
        return Collocation(damped=True, damping=self.damping)


def _steel(scene: Scene) -> Scene:
    h = scene.finest
    for low, high in ((0.0, 0.08), (0.12, 0.2)):
        scene = scene.zone(box(0.04, low, 0.095, high), h)
    return replace(scene, spacing=2 * h)


def _glass(scene: Scene) -> Scene:
    h = scene.finest
    return replace(scene.zone(box(0.0, -0.011, 0.1, 0.011), h), spacing=2 * h)


PLATES = (
    Plate(
        "Kalthoff and Winkler's steel, 0.5 mm",
        "kalthoff_winkler_steel.py",
        (("spacing", "5e-4"),),
        (("spacing", "1e-3"),),
        _steel,
        86e-6,
        (0.05, 0.1262, 1.0, 0.185),
    ),
    Plate(
        "Duran's glass, 0.25 mm",
        "duran50.geo",
        (("Zones/fine/Spacing", "2.5e-4"), ("Zones/coarse/Spacing", "2.5e-4")),
        (("Zones/fine/Spacing", "5e-4"), ("Zones/coarse/Spacing", "5e-4")),
        _glass,
        40e-6,
        (0.0505, -1.0, 0.068, 1.0),
    ),
)
UNIFORM = Kind("uniform")
KINDS = (
    UNIFORM,
    Kind("drawn zones", drawn=True),
    Kind("hybrid", "hybrid"),
    Kind("split", "split"),
    Kind("collocation", "collocation"),
    Kind("collocation, undamped", "collocation", damping=0.0),
)


class Row(NamedTuple):
    """A kind on a plate."""

    plate: str
    kind: str
    cost: float  # over that of the uniform run
    first: float  # s, of the first bond: mean of the runs
    off: float  # of the path
    scatter: tuple[float, float]
    dissipated: float  # J/m
    damped: float  # J/m
    balance: float  # the largest
    fine: float
    said: str = ""  # why it was stopped


def run_of(plate: Plate, kind: Kind, share: float) -> Found:
    """One run. Raises UnstableError."""
    return solved(kind.model(plate), kind.adapt, share, plate.duration, plate.box)


def compared(plate: Plate) -> Iterable[Row]:
    """All kinds on one plate."""
    uniform = [run_of(plate, UNIFORM, share) for share in STEPS]
    for kind in KINDS:
        try:
            founds = uniform if kind == UNIFORM else [run_of(plate, kind, share) for share in STEPS]
        except UnstableError as error:
            yield Row(plate.title, kind.name, *(np.nan,) * 3, (np.nan, np.nan), *(np.nan,) * 4, str(error))
            continue
        off = [np.mean([distance(one, other) for other in uniform if other is not one]) for one in founds]
        yield Row(
            plate.title,
            kind.name,
            min(one.cpu for one in founds) / min(one.cpu for one in uniform),
            float(np.mean([one.first for one in founds])),
            float(np.mean(off)),
            (float(np.min(off)), float(np.max(off))),
            float(np.mean([one.dissipated for one in founds])),
            float(np.mean([one.damped for one in founds])),
            max((one.balance for one in founds), key=abs),
            _share(kind.model(plate)) if kind.drawn else max(one.fine for one in founds),
        )


def _share(model: Model) -> float:
    """How much of a plate has the finest spacing."""
    area = model.grid.delta**2
    return float(area[np.isclose(area, area.min())].sum() / area.sum())


def vibrating(kind: Kind) -> tuple[float, float]:
    """Energy over that at the start of a plate that noise sets in motion, and after how many units of time: when
    there is enough to know, or at the end."""
    material = Material(E=1e9, rho=1e3, G0=1e30, plane="strain")
    h = 2e-3 if kind.adapt == "split" else 1e-3
    tip, level = 0.024 + h / 2, 0.04 + h / 2
    scene = Scene(box(0, 0, 0.08, 0.08), h, material, 4, Run(steps=1)).crack([(0, level), (tip, level)])
    if kind.drawn:
        scene = replace(scene.zone(box(*SHAKEN), 1e-3), spacing=2e-3)
    model = kind.built(scene)
    model = dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, conditions=_noise(model)))
    bound = prepare(model, Options(threads=1)).system.bound
    problem = prepare(with_run(model, time_step=0.8 * bound), Options(threads=1))
    if kind.adapt == "split":
        problem = split_where(problem, lambda at: ((at > SHAKEN[:2]) & (at < SHAKEN[2:])).all(axis=1))
        random = np.random.default_rng(5).standard_normal(problem.state.rate.shape)
        problem.state.rate[:] = 1e-3 * random / np.sqrt(2)
    unit, begins, done = 1e-3 * np.sqrt(material.rho / material.E), 0.0, 0
    steps = int(UNITS * unit / problem.system.time_step)
    for part in range(9):
        problem.march(done + 1, part * steps // 8 + 1)
        done = part * steps // 8
        ledger = books(problem.system, problem.state, done)
        begins = begins or ledger.kinetic + ledger.strain
        energy = (ledger.kinetic + ledger.strain) / begins
        if not energy < GROWN:
            break
    return energy, done * problem.system.time_step / unit


def _noise(model: Model) -> tuple[InitialVelocity, ...]:
    """Velocities of one size, in directions at random."""
    group = np.random.default_rng(5).integers(DIRECTIONS, size=len(model.grid))
    angle = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    return tuple(
        InitialVelocity(nodes=tuple(model.grid.ids[group == number].tolist()), x=float(x), y=float(y))
        for number, (x, y) in enumerate(1e-3 * np.column_stack([np.cos(angle), np.sin(angle)]))
    )


class Seam(NamedTuple):
    """What the seam of a kind does by itself."""

    kind: str
    energy: float  # of free vibration, over that at the start
    units: float  # of time, after which
    back: tuple[float, ...]  # share of a pulse, by its width


def seam_of(kind: Kind) -> Seam:
    """All of that."""
    return Seam(kind.name, *vibrating(kind), sent_back(kind.adapt, kind.drawn, kind.collocation))


def number(value: float) -> str:
    """Four digits at least, thousands apart."""
    return f"{value:,.0f}".replace(",", " ") if abs(value) >= 1000 else f"{value:.4g}"


def table(rows: list[Row], seams: list[Seam]) -> str:
    """The section of the page."""
    lines = [
        KINDS_BEGIN,
        "",
        "`python -m benchmarks.kinds` writes this section. The horizon is 4 spacings, the micromodulus conical, and"
        " coarse nodes are twice as far apart. Cost is the CPU time of the loop over that of the uniform run, on one"
        " thread, of the fastest of four runs. The other numbers are means of four runs with different steps; for"
        " the path the least and the most are given too. Free vibration is the energy over that at the start, after"
        f" {number(UNITS)} h sqrt(rho / E) or when it has grown a million times. Pulse is the share of the velocity"
        " of a P pulse exp(-(x / w)^2) that comes back when the pulse leaves the fine part through a straight seam."
        " For cells that split, the drawing has twice the spacing, and the steel's pre-cracks are moved by a quarter"
        " of a millimetre. Their first bond breaks at the tip when cells split there, because linear interpolation"
        " continues the opening behind a tip ahead of it. Their next bonds break within a microsecond or so of the"
        " uniform run's.",
        "",
        "![Cost against error of fine zones of all kinds](adaptivity.png)",
        "",
        "| scene | kind | cost | first bond, us | path off the uniform runs', % | dissipated, J/m | damped, J/m |"
        " balance, % of the work | fine at the end, % |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        if row.said:
            lines.append(f"| {row.plate} | {row.kind} | stopped: {row.said} | | | | | | |")
            continue
        off = f"{100 * row.off:.1f} ({100 * row.scatter[0]:.1f} to {100 * row.scatter[1]:.1f})"
        lines.append(
            f"| {row.plate} | {row.kind} | {row.cost:.2f} | {1e6 * row.first:.2f} | {off} | {number(row.dissipated)} |"
            f" {number(row.damped)} | {100 * row.balance:+.2f} | {100 * row.fine:.1f} |"
        )
    widths = ", ".join(f"{width} h" for width in WIDTHS)
    lines += [
        "",
        f"| kind | free vibration: energy over that at the start | after | of a pulse {widths} wide comes back, % |",
        "|---|---|---|---|",
    ]
    for seam in seams:
        back = ", ".join(f"{100 * share:.1f}" for share in seam.back)
        energy = f"{seam.energy:.3g}" if seam.energy < GROWN else f"more than {number(GROWN)}"
        lines.append(f"| {seam.kind} | {energy} | {number(seam.units)} | {back} |")
    return "\n".join([*lines, "", WORDS])


def chart(rows: list[Row], seams: list[Seam]) -> None:
    """Cost against error, a plate each, and what comes back of pulses."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    plates = list(dict.fromkeys(row.plate for row in rows))
    colours = {kind.name: f"C{number}" for number, kind in enumerate(KINDS)}
    figure, (*every, pulses) = plt.subplots(1, len(plates) + 1, figsize=(5 * len(plates) + 5, 4), layout="constrained")
    for axes, plate in zip(every, plates, strict=True):
        for row in (one for one in rows if one.plate == plate and not one.said):
            away = [[100 * (row.off - row.scatter[0])], [100 * (row.scatter[1] - row.off)]]
            axes.errorbar(
                row.cost, 100 * row.off, yerr=away, fmt="o", color=colours[row.kind], capsize=3, label=row.kind
            )
        axes.set(title=plate, xlabel="cost over that of the uniform run", ylabel="path off the uniform runs', %")
        axes.set_xscale("log")
        axes.set_xticks(COSTS, labels=[f"{cost:g}" for cost in COSTS], minor=False)
        axes.minorticks_off()
        axes.set_ylim(bottom=0)
        axes.legend()
    for seam in seams:
        pulses.loglog(WIDTHS, [100 * share for share in seam.back], "o-", color=colours[seam.kind], label=seam.kind)
    pulses.set(
        title="What comes back from the seam", xlabel="width of the pulse, spacings", ylabel="%", ylim=(0.1, 300)
    )
    pulses.set_yticks(SHARES, labels=[f"{share:g}" for share in SHARES], minor=False)
    pulses.set_xticks(WIDTHS, labels=[str(width) for width in WIDTHS], minor=False)
    pulses.minorticks_off()
    pulses.legend(loc="upper center", ncols=2)
    figure.savefig(CHART, dpi=120)


WORDS = """**Which kind to choose.**

- Choose `--adapt hybrid` where a family has few bonds, as in all shipped scenes. Its coarse lattice costs a few bonds a
  node, it conserves energy and momentum, edges need no bonds, and its seam reflects less than bonds of two sizes do.
- Choose drawn zones where nodes are on no lattice, in the thesis mode, or at rest.
- Choose `--adapt split` to compare with the thesis, or in the thesis mode if the path of the crack is unknown. It sums
  its bonds one by one, and lists them anew whenever cells change. That costs more than fine nodes everywhere in blocks.
- Choose `--adapt collocation` to compare with its source, or if the horizon is a length of the material and spans many
  spacings. It costs as much as the bonds within one and a half horizons of edges and cracks; the coarse grid costs next
  to nothing. Small families need damping beside the seam. The damping takes motion out of the plate and reflects long
  pulses, which the seam alone lets through.
"""


def main(arguments: list[str]) -> int:
    """Measure, and write the page's part and the chart."""
    argparse.ArgumentParser(description="Compare fine zones of all kinds.").parse_args(arguments)
    warnings.simplefilter("ignore", ModelWarning)
    rows = []
    for plate in PLATES:
        for row in compared(plate):
            print(row, file=sys.stderr, flush=True)
            rows.append(row)
    seams = []
    for kind in KINDS:
        seams.append(seam_of(kind))
        print(seams[-1], file=sys.stderr, flush=True)
    chart(rows, seams)
    put_section(PAGE, table(rows, seams))
    print(PAGE)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
