"""Fine zones of all kinds on the same scenes, in one table and one chart: python -m benchmarks.kinds.

Drawn zones, those that move with cracks and a compact lattice elsewhere (hybrid), or stencils (collocation), each
beside uniform nodes of the finest spacing, with the same horizon over spacing. Cost: CPU time of the loop on one
thread, over that of the uniform run. Error: the distance of the crack's path from those of uniform runs, over its
length, for four steps, as a crack is known no better than runs that differ by the step alone. Besides, free vibration
that noise sets in motion: how much energy there is of it after 4000 units of time. Writes its part of
docs/adaptivity.md, and docs/adaptivity.png. Another kind is another row of `KINDS`.
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
from pdmesh import Scene, box
from pdmesh.drawing.sources import read_scene
from pdmesh.grid.building import build
from pdmesh.model.document import Collocation, InitialVelocity, Material, Run
from pdsolve.measures import books
from pdsolve.model import Model, ModelWarning
from pdsolve.system import Options, prepare
from pdsolve.unstable import UnstableError

CHART = ROOT / "docs" / "adaptivity.png"
UNITS = 4000.0  # spacing sqrt(rho / E): how long a plate vibrates
DIRECTIONS = 8  # of the noise
GROWN = 1e6  # of the energy at the start: enough to know


class Plate(NamedTuple):
    """A scene, and what of it is compared."""

    title: str
    file: str
    assignments: tuple[tuple[str, str], ...]
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
        scene = read_scene(GEOMETRIES / plate.file, plate.assignments).one_scale()
        if self.drawn:
            scene = plate.drawn(scene)
        elif self.adapt == "none":
            scene = scene.adapt("hybrid")  # whose nodes a uniform run is of too
        built = build(scene if self.adapt == "none" else scene.adapt(self.adapt))  # type: ignore[arg-type]
        return with_run(Model(built.grid, built.settings, plate.file), **self._run())

    def _run(self) -> dict[str, object]:
        return {"adapt": self.adapt, "collocation": Collocation(damping=self.damping)}


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
        _steel,
        86e-6,
        (0.05, 0.1262, 1.0, 0.185),
    ),
    Plate(
        "Duran's glass, 0.25 mm",
        "duran50.geo",
        (("Zones/fine/Spacing", "2.5e-4"), ("Zones/coarse/Spacing", "2.5e-4")),
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
            yield Row(plate.title, kind.name, *(np.nan,) * 3, (np.nan, np.nan), *(np.nan,) * 3, str(error))
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
    scene = Scene(box(0, 0, 0.08, 0.08), 1e-3, material, 4, Run(steps=1)).crack([(0, 0.0405), (0.0245, 0.0405)])
    if kind.drawn:
        scene = replace(scene.zone(box(0.0, 0.03, 0.05, 0.05), 1e-3), spacing=2e-3)
    built = build(scene if kind.adapt == "none" else scene.adapt(kind.adapt))  # type: ignore[arg-type]
    model = with_run(Model(built.grid, built.settings), **kind._run())
    group = np.random.default_rng(5).integers(DIRECTIONS, size=len(model.grid))
    angle = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    conditions = tuple(
        InitialVelocity(nodes=tuple(model.grid.ids[group == number].tolist()), x=float(x), y=float(y))
        for number, (x, y) in enumerate(1e-3 * np.column_stack([np.cos(angle), np.sin(angle)]))
    )
    model = dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, conditions=conditions))
    bound = prepare(model, Options(threads=1)).system.bound
    problem = prepare(with_run(model, time_step=0.8 * bound), Options(threads=1))
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


def table(rows: list[Row]) -> str:
    """The section of the page."""
    lines = [
        KINDS_BEGIN,
        "",
        "Written by `python -m benchmarks.kinds`; horizon 4 spacings, conical, coarse nodes twice as far apart. Cost is"
        " CPU time of the loop over that of the uniform run, one thread, of the fastest of four; the rest are means of"
        " four runs whose steps differ, and of the path the least and most. Free vibration: energy over that at the"
        f" start after {UNITS:g} spacing sqrt(rho / E), or when it has grown a million times.",
        "",
        "![Cost against error of fine zones of all kinds](adaptivity.png)",
        "",
        "| scene | kind | cost | first bond, us | path off the uniform runs', % | dissipated, J/m | balance, % of the"
        " work | fine at the end, % |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        if row.said:
            lines.append(f"| {row.plate} | {row.kind} | stopped: {row.said} | | | | | |")
            continue
        off = f"{100 * row.off:.1f} ({100 * row.scatter[0]:.1f} to {100 * row.scatter[1]:.1f})"
        lines.append(
            f"| {row.plate} | {row.kind} | {row.cost:.2f} | {1e6 * row.first:.2f} | {off} | {row.dissipated:.4g} |"
            f" {100 * row.balance:+.2f} | {100 * row.fine:.1f} |"
        )
    lines += ["", "| kind | free vibration: energy over that at the start | after |", "|---|---|---|"]
    for kind in KINDS:
        energy, units = vibrating(kind)
        print(kind.name, energy, units, file=sys.stderr, flush=True)
        lines.append(f"| {kind.name} | {energy:.4g} | {units:.0f} |")
    return "\n".join([*lines, "", WORDS])


def chart(rows: list[Row]) -> None:
    """Cost against error, a plate each."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    plates = list(dict.fromkeys(row.plate for row in rows))
    figure, every = plt.subplots(1, len(plates), figsize=(5 * len(plates), 4), squeeze=False, layout="constrained")
    for axes, plate in zip(every[0], plates, strict=True):
        for number, row in enumerate(one for one in rows if one.plate == plate and not one.said):
            away = [[100 * (row.off - row.scatter[0])], [100 * (row.scatter[1] - row.off)]]
            axes.errorbar(row.cost, 100 * row.off, yerr=away, fmt="o", color=f"C{number}", capsize=3, label=row.kind)
        axes.set(title=plate, xlabel="cost over that of the uniform run", ylabel="path off the uniform runs', %")
        axes.set_xlim(left=0)
        axes.set_ylim(bottom=0)
        axes.legend()
    figure.savefig(CHART, dpi=120)


WORDS = """**What to take when.** Where a family has few bonds, as in all shipped scenes, take `--adapt hybrid`: its
lattice costs a few bonds a node, it conserves energy and momentum, and edges need no bonds. Take drawn zones
where nodes are on no lattice, in the thesis mode, with dampers or at rest. Take `--adapt collocation` to
compare with its source, and where the horizon is a length of the material, of many spacings: its cost is that
of bonds within one and a half horizons of edges and cracks, and the coarse grid's is next to nothing. Small
families need damping beside the seam, which takes motion out of the plate.
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
    chart(rows)
    put_section(PAGE, table(rows))
    print(PAGE)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
