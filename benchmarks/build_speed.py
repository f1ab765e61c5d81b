"""How long a grid takes: a plate with a hole from 10 thousand to a million nodes, built and written.

    python benchmarks/build_speed.py [NODES ...]

Each size runs in a process of its own. Bars: 1e6 nodes in 60 s and 2 GB, 13 thousand in 2 s after imports.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SIZES = (13_000, 100_000, 1_000_000)


def measure(nodes: int) -> None:
    """Build and write the plate; print nodes, seconds to build and to write, and the largest memory, MB."""
    from pdmesh import Circle, Material, Scene, box
    from pdmesh.grid.lattice import build_grid
    from pdmesh.model.document import write_file
    from pdmesh.model.node_grid import document_of

    spacing = (0.0914 / nodes) ** 0.5  # so that the plate less its hole holds about that many
    start = time.perf_counter()
    scene = (
        Scene(box(0, 0, 0.32, 0.32), spacing, Material(E=72e9, rho=2440, G0=135))
        .hole(Circle(0.16, 0.16, 0.06))
        .crack([(0, 0.1601), (0.05, 0.1601)])
        .load("top", traction=(0, 1e6), rows=3)
    )
    grid, settings, _ = build_grid(scene)
    built = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        write_file(document_of(grid, settings), Path(folder) / "grid.json")
    written = time.perf_counter()
    megabytes = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    times = f"built in {built - start:6.2f} s, written in {written - built:6.2f} s"
    print(f"{len(grid):9d} nodes: {times}, {megabytes:6.0f} MB")


if __name__ == "__main__":
    if len(sys.argv) == 3 and sys.argv[1] == "--measure":
        measure(int(sys.argv[2]))
    else:
        for size in [int(word) for word in sys.argv[1:]] or SIZES:
            subprocess.run([sys.executable, __file__, "--measure", str(size)], check=True)
