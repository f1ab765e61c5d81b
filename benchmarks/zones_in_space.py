"""What a fine zone that moves saves in space: python -m benchmarks.zones_in_space [penny] [kalthoff] [--spacing H].

A block of glass with a penny-shaped crack that is pulled until the crack grows, and Kalthoff and Winkler's plate of
steel, 100 x 200 x 9 mm; uniform and hybrid on one lattice with one step, one thread, in turn. Prints CPU time of the
loop, that of refining, and what came of each.
"""

from __future__ import annotations

import argparse
import time
import warnings
from typing import Any

import msgspec
import numpy as np

import pdmesh
from pdmesh import Body, Box, Material, Run, ramp
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.measures import books, damage
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import changing

GLASS = Material(E=65e9, rho=2235, G0=204, micromodulus="constant")
STEEL = Material(E=191e9, rho=8000, G0=42408, micromodulus="constant")
SPEED, STEP = 0.24, 1.15e-7  # m/s, of the faces of the block; s
CORNERS = 96  # of the penny
CRACKED = 0.35  # damage of a node on the path
LOOK = 8  # steps between two looks


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
    x, y, z, apart, notch = 0.05, 0.1, 0.0045, 0.025, 0.05
    plate = Box((-x, -y, -z), (x, y, z if round(2 * z / h) % 2 == 0 else z + h))
    body = Body(plate, h, STEEL, run=Run(steps=370, every=370, time_step=2.3e-7)).move(
        Box((-x - h, -apart, -2 * z), (2.6 * h - x, apart, 3 * z)), velocity=(16.0, 0, 0), breakable=True
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


def marched(problem: Model) -> dict[str, Any]:
    """CPU seconds of the loop, of that refining, and what came of it."""
    system, state = prepare(problem, Options(threads=1))
    splits, steps, done, refining = changing(system), problem.settings.run.steps, 0, 0.0
    begins = system.zone_summary.fine_share if system.zone_summary else 1.0
    began = time.process_time()
    while done < steps:
        looked = time.process_time()
        change = splits.epoch(system, state, done) if splits else None
        system, state = (system, state) if change is None else (change.system, change.state)
        refining += time.process_time() - looked
        last = min(done + LOOK, steps)
        system.stepper.march(state, done + 1, last + 1)
        done = last
    seconds, broken = time.process_time() - began, system.operator.broken()
    cracked = system.model.grid.position[damage(system, broken) > CRACKED]
    energies = books(system, state, steps)
    return {
        "seconds": seconds,
        "refining": refining,
        "steps": steps,
        "step": system.time_step,
        "nodes": len(system.model.grid.ids),
        "fine": [begins, energies.fine_share if system.zone_summary else 1.0],
        "first": int(broken.step.min(initial=np.iinfo(np.int64).max)),
        "broken": len(broken.step),
        "dissipated": energies.dissipated,
        "made": system.zone_summary.refinement if system.zone_summary else 0.0,
        "reach": np.abs(cracked).max(axis=0, initial=0.0).tolist(),
    }


def main() -> None:
    """Measure and tell."""
    scenes = {"penny": penny, "kalthoff": kalthoff}
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("scenes", nargs="*", choices=[*scenes, []], default=["penny"])
    parser.add_argument("--spacing", type=float, default=5e-4, help="between nodes, m")
    asked = parser.parse_args()
    for name in asked.scenes:
        for adapt in ("none", "hybrid"):
            print(name, adapt, marched(model(scenes[name](asked.spacing), adapt)), flush=True)


if __name__ == "__main__":
    main()
