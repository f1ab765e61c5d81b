"""User time of whole hybrid commands, drawing to results: python -m benchmarks.command [OTHER CHECKOUT].

Each plate is built and solved as from the command line, on one thread, 20 frames included, by this checkout and by the
other in turn; the least of three counts. Each checkout runs with the Python of its own .venv. The bars are shares of
the time that commit b58342c takes. Measured beside it: 63, 60 and 70 %, of which 0.7 s build; since then the solved
part became 72, 71 and 76 % of what it was.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).parent.parent
STEEL = ("geometries/kalthoff_winkler_steel.py", "--trust", "--set")
PLATES = {  # name: words of the command, and the bar
    "Kalthoff-Winkler 0.5 mm": ((*STEEL, "spacing=5e-4"), 0.4),
    "Kalthoff-Winkler 0.25 mm": ((*STEEL, "spacing=2.5e-4"), 0.3),
    "Duran 0.25 mm": (
        ("geometries/duran50.geo", "--set", "Zones/fine/Spacing=2.5e-4", "--set", "Zones/coarse/Spacing=2.5e-4"),
        0.4,
    ),
}
TURNS = 3


def timed(checkout: Path, *words: str) -> float:
    """User time, s, of a command of a checkout."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    subprocess.run([checkout / ".venv/bin/python", "-m", *words], check=True, cwd=checkout)
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before


def main(*other: str) -> None:
    """Measure, and say so."""
    checkouts = [HERE, *map(Path, other)]
    with tempfile.TemporaryDirectory() as folder:
        model, output = (str(Path(folder) / name) for name in ("plate.json", "plate.sqlite"))
        for name, (words, bar) in PLATES.items():
            taken: list[list[tuple[float, float]]] = [[] for _ in checkouts]
            for _ in range(TURNS):
                for checkout, times in zip(checkouts, taken, strict=True):
                    build = ("pdmesh", "build", *words, "--adapt", "hybrid", "-o", model, "--force", "--quiet")
                    solve = ("pdsolve", model, "--threads", "1", "-o", output, "--force", "--quiet")
                    times.append((timed(checkout, *build), timed(checkout, *solve)))
            least = [tuple(map(min, zip(*times, strict=True))) for times in taken]
            said = ", ".join(f"built {built:.2f} + solved {solved:.2f} s" for built, solved in least)
            share = f": {sum(least[0]) / sum(least[1]):.0%}, bar {bar:.0%}" if other else ""
            print(f"{name}: {said}{share}", flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
