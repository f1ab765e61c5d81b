"""Steps over ranks: python -m benchmarks.rank_curves [--ranks 1,2] [--nodes 400000] [--rounds 3].

Strong: a plate of so many nodes on more and more ranks. Weak: half as many nodes a rank. What is measured is the least
of several rounds, taken in turns, of the processor time of a step and the time of its exchange (`benchmarks.ranks`).
What more ranks take, each with a core and its memory of its own, is computed from the step of one process and the
network of `benchmarks.ranks`, and is marked so. Writes ranks.json and ranks.png.
"""

from __future__ import annotations

import argparse
import json
import math
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

from benchmarks.ranks import BANDWIDTH, LATENCY, RATIO

FOLDER = Path(__file__).parent
COMPUTED = (1, 2, 4, 8, 16, 32, 64)  # ranks


def one(ranks: int, nodes: int) -> dict[str, float]:
    """The least time of a step and of an exchange of a plate on so many ranks, s."""
    words = [sys.executable, "-m", "benchmarks.ranks", "--step", "--nodes", str(nodes)]
    if ranks > 1:
        near = shutil.which("mpiexec", path=str(Path(sys.executable).parent)) or "mpiexec"
        words = [near, "-launcher", "fork", "-hosts", "localhost", "-n", str(ranks), *words]
    said = subprocess.run(words, check=True, capture_output=True, text=True, cwd=FOLDER.parent).stdout
    return dict(json.loads(next(line for line in said.splitlines() if line.startswith("{"))))


def measured(ranks: list[int], nodes: int, rounds: int) -> dict[str, list[dict[str, Any]]]:
    """The rows of both curves."""
    found: dict[tuple[str, int], dict[str, Any]] = {}
    for _ in range(rounds):
        for kind in ("strong", "weak"):
            for many in ranks:
                row = one(many, nodes if kind == "strong" else nodes // 2 * many)
                known = found.setdefault((kind, many), {"ranks": many, **row})
                for name in ("step", "exchange"):
                    known[name] = min(known[name], row[name])
    return {kind: [found[kind, many] for many in ranks] for kind in ("strong", "weak")}


def computed(step: float, nodes: int, kind: str) -> list[dict[str, float]]:
    """What steps take on COMPUTED ranks, from that of `nodes` in one process, s: nothing of it is measured."""
    rows = []
    for ranks in COMPUTED:
        whole = nodes * (ranks if kind == "weak" else 1)
        sent = 2 * RATIO * math.sqrt(whole) * 2 * 8 if ranks > 1 else 0  # bytes of a slab's ghosts, in a square plate
        swap = sent / BANDWIDTH + 2 * LATENCY * (ranks > 1)
        rows.append({"ranks": ranks, "step": step * whole / nodes / ranks + swap, "exchange": swap})
    return rows


def drawn(found: dict[str, Any], path: Path) -> None:
    """The chart of both curves."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.6, 3.4), layout="constrained")
    for axis, kind in zip(figure.subplots(1, 2), ("strong", "weak"), strict=True):
        for rows, style, label in (
            (found["computed"][kind], "k--", "computed"),
            (found["measured"][kind], "o", "measured"),
        ):
            axis.loglog([row["ranks"] for row in rows], [row["step"] * 1e3 for row in rows], style, label=label)
        nodes = found["measured"][kind][0]["nodes"]
        axis.set(title=f"{kind}: {nodes} nodes" + (" a rank" if kind == "weak" else ""), xlabel="ranks")
        axis.set_xticks(COMPUTED, [str(ranks) for ranks in COMPUTED], minor=False)
        low, high = axis.get_ylim()
        axis.set(ylabel="ms a step", ylim=(min(low, high / 10), high * 1.5))
        axis.minorticks_off()
        axis.grid(alpha=0.3)
        axis.legend(fontsize="small")
    figure.savefig(path, dpi=120, bbox_inches="tight")


def main() -> int:
    """Measure, compute and draw both curves."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--ranks", type=lambda text: [int(word) for word in text.split(",")], default=[1, 2])
    options.add_argument("--nodes", type=int, default=400_000)
    options.add_argument("--rounds", type=int, default=3)
    given = options.parse_args()
    rows = measured(given.ranks, given.nodes, given.rounds)
    first = {kind: rows[kind][0] for kind in rows}
    far = {kind: computed(row["step"], int(row["nodes"]), kind) for kind, row in first.items()}
    found = {"measured": rows, "computed": far}
    (FOLDER / "ranks.json").write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    drawn(found, FOLDER / "ranks.png")
    for kind, each in rows.items():
        for row in each:
            print(f"{kind}: {row['ranks']} ranks, {row['nodes']} nodes: {row['step'] * 1e3:.2f} ms a step")
    return 0


if __name__ == "__main__":
    sys.exit(main())
