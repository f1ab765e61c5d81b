"""What accuracy costs in space: opening and K1 of a penny-shaped crack, by bonds and by a fine zone.

`python -m benchmarks.penny_accuracy` writes penny_accuracy.json, penny_accuracy.png and a section of
docs/guide/speed.md. A block of three radii to each side is pulled by tractions that rise slowly and then stay; opening
and K1 are means over a period of the block, beside those in an unbounded solid under the same stress. Each run is a
process of its own: CPU time of all of it but imports, and its peak of memory beyond that after imports.
"""

from __future__ import annotations

import argparse
import json
import resource
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import msgspec
import numpy as np
from matplotlib.ticker import LogLocator

import pdmesh
from benchmarks.pages import put_section
from pdmesh import Body, Box, Material, Run
from pdpost.measures.intensities_in_space import follow_fronts
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.results import Results
from pdsolve.run.simulation import simulate

HERE = Path(__file__).parent
STORED = HERE / "penny_accuracy.json"
PAGE = HERE.parent / "docs" / "guide" / "speed.md"
E, RHO, NU, RADIUS, HALF, STRESS = 65e9, 2235.0, 0.25, 0.01, 3.0, 1e6  # Pa, kg/m^3, -, m, radii, Pa
PERIOD = 4 * HALF * RADIUS * (RHO / E) ** 0.5  # s, of a bar as long as the block
RISE, FRAMES, STEP = 4, 4, 0.8  # periods; in the last period; h sqrt(rho / E)
CORNERS = 96
TEXT = """## A penny-shaped crack

![Error of a penny's opening and K1 against CPU time and memory](../../benchmarks/penny_accuracy.png)

A block of three radii to each side, whose tractions rise slowly over four periods of the block. Opening (of the inner
half) and K1 (mean along the front) are means over the fifth, above those of an unbounded solid under the same stress,
from which the block differs too. Numbers in the picture are spacings in the radius. Each run is a process of its own:
its CPU time on one thread and its peak of memory beyond that of the programs, building included
(`python -m benchmarks.penny_accuracy`).
"""
RUNS = ("bonds-8", "bonds-10", "ordinary-8", "hybrid-8", "hybrid-10")  # and spacings in the radius
COLORS = {"bonds": "#0072B2", "ordinary": "#009E73", "hybrid": "#D55E00"}


def block(kind: str, fineness: int) -> Model:
    """The block, of so many spacings in the radius."""
    h, half = RADIUS / fineness, HALF * RADIUS
    material = Material(E=E, rho=RHO, G0=1e12, micromodulus="constant")
    if kind == "ordinary":
        material = msgspec.structs.replace(material, model="ordinary", nu=NU)
    step = STEP * h * (RHO / E) ** 0.5
    period = round(PERIOD / step)
    run = Run(steps=(RISE + 1) * period, every=max(1, period // FRAMES), time_step=step)
    at, off = np.linspace(0, 2 * np.pi, CORNERS, endpoint=False), 0.52 * h
    rim = [(float(RADIUS * np.cos(a)), float(RADIUS * np.sin(a)), off) for a in at]
    body = Body(Box((-half,) * 3, (half,) * 3), h, material, run=run)
    body = body.crack([[(0.0, 0.0, off), rim[k - 1], rim[k]] for k in range(CORNERS)])
    rise = tuple((RISE * PERIOD * t, float(0.5 - 0.5 * np.cos(np.pi * t))) for t in np.linspace(0, 1, 33).tolist())
    for side, traction in (("top", STRESS), ("bottom", -STRESS)):
        body = body.load(side, (0.0, 0.0, traction), rows=3, profile=rise)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        built = pdmesh.build(body.adapt("hybrid"))
    run = msgspec.structs.replace(built.settings.run, adapt="hybrid" if kind == "hybrid" else "none")
    return Model(built.grid, msgspec.structs.replace(built.settings, run=run))


def solved(kind: str, fineness: int, folder: Path) -> dict[str, Any]:
    """Cost and errors of one run."""
    began, held = time.process_time(), _peak()
    model, path = block(kind, fineness), folder / "penny.sqlite"
    nodes, steps = len(model.grid), int(model.settings.run.steps or 0)
    simulate(model, path, Options(threads=1)).close()
    cost = {"seconds": time.process_time() - began, "bytes": _peak() - held}
    with Results.open(path) as results:
        late = [step for step in results.frames()[0].tolist() if step > steps * RISE / (RISE + 1)]
        opening = [_opening(results, step, RADIUS / fineness) for step in late]
        k1 = [float(np.nanmean(front.value["K1"])) for front in follow_fronts(results, late)]
    exact = 2 * STRESS * (RADIUS / np.pi) ** 0.5
    found = {"kind": kind, "fineness": fineness, "nodes": nodes, "steps": steps, **cost}
    return found | {
        "opening": float(np.mean(opening)),
        "K1": float(np.mean(k1)) / exact,
        "scatter": float(np.std(opening)),
    }


def _peak() -> int:
    return 1024 * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss


def _opening(results: Results, step: int, h: float) -> float:
    """The mean opening of the inner half of the crack over the exact one."""
    place, uz = results.nodes(step).position, results.field("uz", step)
    inner = np.hypot(place[:, 0], place[:, 1]) < RADIUS / 2
    low, high = (inner & (np.abs(place[:, 2] - z) < 0.3 * h) for z in (0.0, h))
    away = np.hypot(place[high, 0], place[high, 1]) / RADIUS
    exact = 8 * (1 - NU**2) * STRESS * RADIUS / (np.pi * E) * np.sqrt(1 - away**2).mean()
    return float((uz[high].mean() - uz[low].mean()) / exact)


def main() -> None:
    """Measure what is asked for, all by default, keep the rest, and draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("runs", nargs="*", help="such as hybrid-12 (default: all)")
    parser.add_argument("--one", help="one run alone, told in JSON")
    asked = parser.parse_args()
    if asked.one:
        kind, _, fineness = asked.one.partition("-")
        with tempfile.TemporaryDirectory() as folder:
            print(json.dumps(solved(kind, int(fineness), Path(folder))))
        return
    rows = json.loads(STORED.read_text()) if STORED.exists() else {}
    for name in asked.runs or RUNS:
        words = [sys.executable, "-m", "benchmarks.penny_accuracy", "--one", name]
        said = subprocess.run(words, capture_output=True, text=True, check=True, cwd=HERE.parent).stdout
        rows[name] = json.loads(said.splitlines()[-1])
        print(name, rows[name], flush=True)
        STORED.write_text(json.dumps(rows, indent=1) + "\n")
    draw(list(rows.values()))
    put_section(PAGE, section(list(rows.values())))


def draw(rows: list[dict[str, Any]]) -> None:
    """Errors of opening and K1 against seconds and against bytes."""
    figure, axes = plt.subplots(1, 2, figsize=(9, 4), layout="constrained", sharey=True)
    for axis, cost, label in zip(axes, ("seconds", "bytes"), ("CPU time, s", "memory, MB"), strict=True):
        for kind in dict.fromkeys(row["kind"] for row in rows):
            color = COLORS[kind]
            own = sorted((row for row in rows if row["kind"] == kind), key=lambda row: row["fineness"])
            x = [row[cost] / (1e6 if cost == "bytes" else 1) for row in own]
            for what, style in (("opening", "o-"), ("K1", "s--")):
                axis.plot(x, [100 * (row[what] - 1) for row in own], style, color=color, label=f"{what}, {kind}")
                if what == "opening":
                    for at, row in zip(x, own, strict=True):
                        above = (at, 100 * (row[what] - 1))
                        axis.annotate(str(row["fineness"]), above, (0, 6), textcoords="offset points", ha="center")
        axis.set(xlabel=label, xscale="log")
        axis.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axis.xaxis.set_major_formatter("{x:g}")
        axis.xaxis.set_minor_formatter("")
        axis.grid(alpha=0.3)
    axes[0].set(ylabel="above that of an unbounded solid, %", ylim=(0, 12))
    axes[1].legend(fontsize="small", loc="lower center")
    figure.savefig(STORED.with_suffix(".png"), dpi=150)


def section(rows: list[dict[str, Any]]) -> str:
    """The section of the page, in Markdown."""
    lines = [
        TEXT,
        "| | spacings in the radius | nodes | steps | CPU time, s | memory, MB | opening | K1 |",
        "|---" * 8 + "|",
    ]
    for row in sorted(rows, key=lambda row: (list(COLORS).index(row["kind"]), row["fineness"])):
        cost = f"{row['seconds']:.0f} | {row['bytes'] / 1e6:.0f}"
        errors = f"{100 * (row['opening'] - 1):+.1f} % | {100 * (row['K1'] - 1):+.1f} %"
        lines.append(f"| {row['kind']} | {row['fineness']} | {row['nodes']} | {row['steps']} | {cost} | {errors} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
