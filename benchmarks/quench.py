"""Cracks of the quenched slab (geometries/quenched_slab.py) by their depth: python -m benchmarks.quench

Two temperatures, each with nodes moved at random by a thousandth of a spacing, a few times. Writes quench.json: for
each run, the depths of its cracks from the long side, m, and their spacing at depths, m. A crack is some neighbouring
columns of nodes with damage of DAMAGED or more that go on from the surface; it is as deep as the deepest of them.
"""

from __future__ import annotations

import argparse
import json
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from pdmesh.drawing.file_reading import build_file
from pdsolve.model import Model
from pdsolve.results import Results
from pdsolve.run.simulation import Options, simulate
from pdsolve.study.description import Repeat
from pdsolve.study.disturbed import disturbed

ROOT = Path(__file__).resolve().parent
SCENE = ROOT.parent / "geometries" / "quenched_slab.py"
HOT, REPETITIONS, NOISE = (380.0, 580.0), 2, 1e-3
DAMAGED, GAP, SHALLOW = 0.3, 2, 3.0  # damage; columns between two cracks; horizons from the short sides left out
DEPTHS = (0.5e-3, 1e-3, 1.5e-3, 2e-3, 2.5e-3, 3e-3)  # m


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", type=int, help="the number of one run")
    given = parser.parse_args()
    found = []
    for number, (hot, repetition) in enumerate(product(HOT, range(REPETITIONS))):
        if given.only in (None, number):
            found.append(one(hot, repetition))
            print(json.dumps(found[-1]), flush=True)
    if given.only is None:
        (ROOT / "quench.json").write_text(json.dumps(found, indent=1) + "\n")


def one(hot: float, repetition: int) -> dict[str, Any]:
    """Solve one run and measure its cracks."""
    built = build_file(SCENE, [("hot", f"{hot:g}")], trust=True)
    model = disturbed(Model(built.grid, built.settings), Repeat(noise=NOISE), repetition, 0.0)
    with simulate(model, None, Options(threads=1)) as results:
        depths = cracks(results)
        long = float(np.ptp(results.nodes(0).position[:, 0]))
        summary = results.summary()
    at = {f"{depth:g}": long / max((depths >= depth).sum(), 1) for depth in DEPTHS}
    return {
        "hot": hot,
        "repetition": repetition,
        "depths": depths.round(7).tolist(),
        "spacing": at,
        "balance": summary["balance"],
    }


def cracks(results: Results) -> np.ndarray:
    """Depths (c,) of the cracks from the long side, m, in order along it."""
    last = int(results.frames()[0][-1])
    (x, y), damage = results.nodes(0).position.T, results.field("damage", last)
    spacing = float(results.nodes(0).delta[0])
    columns, rows = (np.rint(place / spacing).astype(int) for place in (x, y))
    torn = np.zeros((columns.max() + 1, rows.max() + 1), dtype=bool)
    torn[columns, rows] = damage >= DAMAGED
    clear = int(2 * SHALLOW * SHALLOW)
    depth = np.where(torn[:, :3].any(axis=1), np.array([_deep(column) for column in torn]), 0)
    depth[:clear] = 0  # those of the short side
    places = np.flatnonzero(depth > SHALLOW)
    parts = np.split(places, np.flatnonzero(np.diff(places) > GAP) + 1) if len(places) else []
    return np.array([depth[some].max() * spacing for some in parts])


def _deep(column: np.ndarray) -> int:
    return int(np.flatnonzero(column).max(initial=0))


if __name__ == "__main__":
    main()
