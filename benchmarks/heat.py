"""What heat costs beside mechanics alone, in the quenched slab before it cracks: python -m benchmarks.heat

Times are CPU s of 60 steps on one thread, interleaved, the least of three; beside mechanics on the same kernel
(blocks), and on the one for any law (listed).
"""

from __future__ import annotations

import time
from pathlib import Path

import msgspec

from pdmesh.drawing.file_reading import build_file
from pdmesh.model.document import Displacement
from pdsolve.model import Model
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import Options

SCENE = Path(__file__).resolve().parent.parent / "geometries" / "quenched_slab.py"
STEPS, ROUNDS = 60, 3


def main() -> None:
    """Measure and print."""
    built = build_file(SCENE, [("hot", "1")], trust=True)
    settings = built.settings
    assert settings.material is not None
    cold = msgspec.structs.replace(
        settings,
        physics="mechanics",
        medium=None,
        conditions=tuple(each for each in settings.conditions if isinstance(each, Displacement)),
        material=msgspec.structs.replace(settings.material, alpha=None, T0=None),
    )
    cases = {
        "heat": prepare(Model(built.grid, settings), Options(threads=1)),
        "listed": prepare(Model(built.grid, cold), Options(threads=1, kernel="listed")),
        "blocks": prepare(Model(built.grid, cold), Options(threads=1)),
    }
    least = dict.fromkeys(cases, float("inf"))
    for number in range(ROUNDS):
        first = 1 + number * STEPS
        for name, case in cases.items():
            began = time.process_time()
            case.march(first, first + STEPS)
            least[name] = min(least[name], time.process_time() - began)
    for name, seconds in least.items():
        print(f"{name}: {seconds:.3f} s, heat takes {least['heat'] / seconds:.2f} times that")


if __name__ == "__main__":
    main()
