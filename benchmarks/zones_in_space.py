"""What a fine zone that moves saves in space: python -m benchmarks.zones_in_space [penny] [kalthoff] [--spacing H].

A block of glass with a penny-shaped crack that is pulled until the crack grows, and Kalthoff and Winkler's plate of
steel, 100 x 200 x 9 mm. The uniform lattice and the hybrid take the same steps on one thread, some of one and as many
of the other in turn, so that what else the machine does slows both. Writes the CPU times and what came of each into
docs/guide/adaptivity.md, row by row.
"""

from __future__ import annotations

import argparse
import time
import warnings
from dataclasses import dataclass
from pathlib import Path

import msgspec
import numpy as np

import pdmesh
from benchmarks.pages import put_section, sections
from pdmesh import Body, Box, Material, Run, ramp
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.measures import books, damage
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import changing
from pdsolve.run.system import System
from pdsolve.state import State

GLASS = Material(E=65e9, rho=2235, G0=204, micromodulus="constant")
STEEL = Material(E=191e9, rho=8000, G0=42408, micromodulus="constant")
SPEED, STEP = 0.24, 1.15e-7  # m/s, of the faces of the block; s
DURATION, STRUCK = 85.1e-6, 0.37  # s, of the struck plate; m, steps times spacing
CORNERS = 96  # of the penny
CRACKED = 0.35  # damage of a node on the path
APART = 0.025  # m, half of the distance of the notches
BEYOND = 0.002  # m: nodes farther than that beyond the notches are looked at
LOOK = 8  # steps between two looks
PAGE = Path(__file__).resolve().parents[1] / "docs" / "guide" / "adaptivity.md"
TITLES = {"penny": "penny in a block", "kalthoff": "Kalthoff and Winkler's plate"}
HEADING = "## What a fine zone saves in a body"
HEAD = (
    "| scene | nodes | fine share | steps | loop, s: uniform, hybrid | refining, s | ratio of loops | with preparing |"
    " first bond, step | dissipated, J | angles of the paths, degrees |"
)
TEXT = """CPU time of one thread of the uniform lattice and of the hybrid, which take the same steps in turn: of the
loop, of refining in it, and the ratio of both loops, without and with what prepares them; when the first bond breaks,
the energy dissipated at the end, and the angles between notches and the two cracks that leave them, uniform and hybrid.
`python -m benchmarks.zones_in_space` writes this table."""


def penny(h: float, side: float = 0.04) -> Body:
    """A block with a penny of a quarter of its side as radius, pulled apart at its upper and lower faces."""
    radius, half, off = side / 4, side / 2, 0.52 * h
    at = np.linspace(0, 2 * np.pi, CORNERS, endpoint=False)
    rim = [(float(radius * np.cos(a)), float(radius * np.sin(a)), off) for a in at]
    faces = [[(0.0, 0.0, off), rim[k - 1], rim[k]] for k in range(CORNERS)]
    body = Body(Box((-half,) * 3, (half,) * 3), h, GLASS, run=Run(steps=400, every=400, time_step=STEP)).crack(faces)
    for side_of, speed in (("top", SPEED), ("bottom", -SPEED)):
        body = body.move(side_of, velocity=(None, None, speed), rows=3, profile=ramp(2e-6))
    return body


def kalthoff(h: float) -> Body:
    """Kalthoff and Winkler's plate, struck at 16 m/s between its notches."""
    x, y, z, apart, notch = 0.05, 0.1, 0.0045, APART, 0.05
    steps = 2 * round(STRUCK / h / 2)
    plate = Box((-x, -y, -z), (x, y, z if round(2 * z / h) % 2 == 0 else z + h))
    body = Body(plate, h, STEEL, run=Run(steps=steps, every=steps, time_step=DURATION / steps)).move(
        Box((-x - h, -apart + 0.1 * h, -2 * z), (2.6 * h - x, apart - 0.1 * h, 3 * z)),
        velocity=(16.0, 0, 0),
        breakable=True,
    )
    for place in (-apart + 0.02 * h, apart - 0.02 * h):
        flat = [(-x - h, place, -2 * z), (notch - x, place, -2 * z), (notch - x, place, 3 * z), (-x - h, place, 3 * z)]
        body = body.crack([[flat[0], flat[1], flat[2]], [flat[0], flat[2], flat[3]]])
    return body


def model(body: Body, adapt: str) -> Model:
    """The body on the lattice of the hybrid, however it is solved."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        built = pdmesh.build(body.adapt("hybrid"))
    run = msgspec.structs.replace(built.settings.run, adapt=adapt)
    return Model(built.grid, msgspec.structs.replace(built.settings, run=run))


@dataclass
class Marched:
    """A run so far."""

    system: System
    state: State
    prepared: float  # s of CPU
    begins: float  # share that is fine at the start
    done: int = 0
    seconds: float = 0.0  # of CPU, with refining
    refining: float = 0.0

    def march(self, steps: int) -> None:
        """Take some steps, after looking for what becomes fine."""
        began = time.process_time()
        splits = changing(self.system)
        change = splits.epoch(self.system, self.state, self.done) if splits else None
        if change is not None:
            self.system, self.state = change.system, change.state
        self.refining += time.process_time() - began
        self.system.stepper.march(self.state, self.done + 1, self.done + steps + 1)
        self.done += steps
        self.seconds += time.process_time() - began


def begun(problem: Model) -> Marched:
    """A run that has taken no step. What is compiled for it is not counted."""
    for _ in range(2):
        began = time.process_time()
        system, state = prepare(problem, Options(threads=1))
        took = time.process_time() - began
    return Marched(system, state, took, fine_share(system))


def fine_share(system: System) -> float:
    """Of the body."""
    return system.zone_summary.fine_share if system.zone_summary else 1.0


def angle(run: Marched, apart: float) -> str:
    """Degrees between notches and the cracks that leave them, of both sides."""
    place = run.system.model.grid.position[damage(run.system, run.system.operator.broken()) > CRACKED]
    found = []
    for side in (1, -1):
        x, y = place[:, 0], side * place[:, 1] - apart
        of = (y > BEYOND) & (x > -y)
        found.append(np.degrees(np.arctan2((y[of] ** 2).sum(), (x[of] * y[of]).sum())))
    return ", ".join(f"{each:.1f}" for each in found)


def row(name: str, h: float) -> str:
    """The row of a scene."""
    problem = [model(SCENES[name](h), adapt) for adapt in ("none", "hybrid")]
    runs = [begun(each) for each in problem]
    for first in range(0, problem[0].settings.run.steps, LOOK):
        for run in runs:
            run.march(min(LOOK, problem[0].settings.run.steps - first))
        if first % (10 * LOOK) == 0:
            print(name, first, *(f"{run.seconds:.1f}" for run in runs), fine_share(runs[1].system), flush=True)
    uniform, hybrid = runs
    books_of = [books(run.system, run.state, run.done).dissipated for run in runs]
    first = [int(run.system.operator.broken().step.min(initial=np.iinfo(np.int64).max)) for run in runs]
    paths = [angle(run, APART) for run in runs] if name == "kalthoff" else ["-", "-"]
    whole = [run.seconds + run.prepared for run in runs]
    return (
        f"| {TITLES[name]}, {1e3 * h:g} mm | {len(problem[0].grid):,} | {hybrid.begins:.3f} to"
        f" {fine_share(hybrid.system):.3f} | {uniform.done} | {uniform.seconds:.1f}, {hybrid.seconds:.1f} |"
        f" {hybrid.refining:.1f} | {uniform.seconds / hybrid.seconds:.2f} | {whole[0] / whole[1]:.2f} |"
        f" {first[0]}, {first[1]} | {books_of[0]:.4g}, {books_of[1]:.4g} | {paths[0]}; {paths[1]} |"
    )


def put_row(new: str) -> None:
    """Put a row on the page, in place of that of its scene."""
    lines = next((part for part in sections(PAGE.read_text(encoding="utf-8")) if part.startswith(HEADING)), "")
    others = [line for line in lines.splitlines() if line.startswith("| ") and not line.startswith(HEAD[:9])]
    scene = new.split("|")[1]
    rows = sorted([line for line in others if line.split("|")[1] != scene] + [new])
    put_section(PAGE, "\n".join([HEADING, "", TEXT, "", HEAD, "|---" * HEAD.count(" | ") + "|---|", *rows]))


def main() -> None:
    """Measure and write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", choices=[*SCENES, []], default=["penny"])
    parser.add_argument("--spacing", type=float, default=5e-4, help="between nodes, m")
    asked = parser.parse_args()
    for name in asked.scenes:
        found = row(name, asked.spacing)
        print(found, flush=True)
        put_row(found)


SCENES = {"penny": penny, "kalthoff": kalthoff}


if __name__ == "__main__":
    main()
