"""What contact costs a step of 64k nodes in the plane, apart and in touch: python -m benchmarks.contact.

CPU time of the fast kernel on one thread, interleaved, the least of several repeats.
"""

from __future__ import annotations

import time

import msgspec
import numpy as np

from pdmesh import Material, Run, Scene, box, build
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import Prepared

SIDE, STEPS, REPEATS = 256, 50, 4
PLACES = 4  # times that each model is prepared: where its arrays lie in memory makes up to a tenth of its time
STRIPES = 6  # cracks across the plate, whose faces are in touch
NOISE = 1e-6  # m/s, of all velocities: numbers at rest are not computed with, tiny ones slowly


def model(gap: float, cracks: int, contact: bool) -> Model:
    """Two halves of a unit plate `gap` m apart that move towards each other, with cracks across the lower one."""
    h = 1 / SIDE
    scene = Scene(box(0, 0, 1, 0.5), h, Material(E=1.0, rho=1.0, G0=1e9), run=Run(time_step=0.5 * h))
    for number in range(cracks):
        y = round((number + 1) * SIDE / 2 / (cracks + 1)) * h
        scene = scene.crack([(0.02, y), (0.98, y)])
    built = build(scene.body(box(0, 0.5 + gap, 1, 1 + gap), "upper", velocity=(0.0, -1e-3)))
    settings = built.settings if contact else msgspec.structs.replace(built.settings, contact=None)
    return Model(built.grid, settings)


def touching(prepared: Prepared) -> float:
    """Share of the nodes that are in touch."""
    contact, state = prepared.system.contact, prepared.state
    return 0.0 if contact is None else contact.touching(state) / len(state.value)


def main() -> None:
    """Measure and print the table."""
    for name, gap, cracks in (("apart", 0.1, 0), ("in touch along a side", 0.0, 0), ("and along cracks", 0.0, STRIPES)):
        best, share = [np.inf, np.inf], 0.0
        for _ in range(PLACES):
            pair = [prepare(model(gap, cracks, contact), Options(threads=1)) for contact in (False, True)]
            for prepared in pair:
                noise = np.random.default_rng(1).standard_normal(prepared.state.rate.shape)
                prepared.state.rate[:] += NOISE * noise
            for repeat in range(REPEATS):
                for number, prepared in enumerate(pair):
                    began = time.process_time()
                    prepared.march(1 + repeat * STEPS, 1 + (repeat + 1) * STEPS)
                    best[number] = min(best[number], (time.process_time() - began) / STEPS)
            share = touching(pair[1])
        without, of = best
        print(
            f"{name}: {share:.1%} of the nodes touch, {of * 1e3:.3f} ms a step, {of / without:.2f} times that without"
        )


if __name__ == "__main__":
    main()
