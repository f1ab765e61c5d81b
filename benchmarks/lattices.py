"""Time and memory of a bond by what a model is: plates and bodies of one spacing and of several, others, a list.

`python -m benchmarks.lattices` writes lattices.json and a table of docs/verification/accuracy_and_cost.md. Times are
the least user time of interleaved repeats on one thread; bytes are all arrays of the operator.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import msgspec

from benchmarks.models import lattice_grid, model_of, scene_model, shaken
from benchmarks.pages import markdown_table, write_block
from benchmarks.peers import processor
from benchmarks.space import GLASS, PAGE, cube
from benchmarks.speed import PLATES
from benchmarks.timing import least_of_steps, timed
from pdmesh import Body, Box, Run
from pdmesh.model.document import Horizon, Settings
from pdsolve.model import Model
from pdsolve.operators.together import unwrap_bond_operator
from pdsolve.options import Options

STORED = Path(__file__).with_suffix(".json")
FLAT = msgspec.structs.replace(GLASS, plane="stress")
CONICAL = msgspec.structs.replace(GLASS, micromodulus="conical")
H, M, STEP = 1e-3, 3.0, 2e-8  # m; horizon over spacing; s
ROUNDS, SAMPLE = 7, 0.2  # repeats; s of user time of one
SCENES = ("duran50", "kalthoff_winkler")  # plates with a fine zone


def box(x: float, y: float, z: float, corner: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Box:
    """A box of so many spacings along each axis."""
    low = tuple(H * start for start in corner)
    return Box(low, tuple(H * (start + size) for start, size in zip(corner, (x, y, z), strict=True)))


def models() -> dict[str, Model]:
    """Models by what they are."""
    plain = Settings(material=FLAT, horizon=Horizon(M), run=Run(time_step=STEP))
    plates = {"plate, one spacing": Model(lattice_grid(*PLATES["64k"]), plain)}
    for scene in SCENES:
        plates[f"plate, two spacings (`{scene}`)"] = Model(scene_model(f"{scene}.geo").grid, plain)

    def solid(x: float, y: float, z: float) -> Body:
        return Body(box(x, y, z), H, GLASS, M, Run(time_step=STEP))

    smaller = solid(24, 16, 16).zone(box(8, 6, 4, (8, 5, 6)), H / 2)
    bodies = {
        "body, two spacings": solid(48, 36, 36).zone(box(48, 36, 6, (0, 0, 15)), H / 2),
        "body, two spacings, smaller": smaller,
        "body, three spacings": smaller.zone(box(2, 2, 2, (11, 7, 7)), H / 4),
        "body, two profiles of the micromodulus": solid(32, 18, 12).region(box(16, 18, 12), CONICAL, "half"),
        "two bodies": solid(20, 16, 14).body(box(20, 16, 14, (0.5, 0.5, 14)), "upper"),  # each on its own lattice
    }
    return plates | {"body, one spacing": cube(40)} | {name: model_of(body) for name, body in bodies.items()}


def measured() -> list[dict[str, Any]]:
    """ns and bytes a directed bond of each model, and of a body whose bonds are summed from a list."""
    measures: dict[str, Callable[[int], float]] = {}
    rows: dict[str, dict[str, Any]] = {}
    chosen = {name: (model, Options(threads=1)) for name, model in models().items()}
    chosen["body, one spacing, in a list"] = cube(20), Options(threads=1, kernel="listed")
    for name, (model, options) in chosen.items():
        prepared = shaken(model, options)
        operator, bonds = unwrap_bond_operator(prepared.system.operator), prepared.system.directed_bond_count
        measures[name] = lambda steps, run=prepared: timed(lambda: run.advance(1, 1 + steps))  # type: ignore[misc]
        rows[name] = {
            "name": name,
            "nodes": len(model.grid),
            "bonds": bonds,
            "in": operator.bond_layout,
            "bytes a bond": operator.bytes() / bonds,
        }
    for name, seconds in least_of_steps(measures, ROUNDS, SAMPLE).items():
        rows[name]["ns a bond"] = 1e9 * seconds / rows[name]["bonds"]
    return list(rows.values())


def block(measurement: dict[str, Any]) -> str:
    """The block of the page."""
    rows = []
    for row in measurement["models"]:
        arrangement = "a list" if row["in"] == "listed" else row["in"]
        cells = [row["name"], row["nodes"], f"{row['bonds'] / row['nodes']:.0f}", arrangement]
        rows.append([*cells, f"{row['ns a bond']:.2f}", f"{row['bytes a bond']:.1f}"])
    header = ["model", "nodes", "bonds a node", "summed in", "ns a bond", "bytes a bond"]
    return f"Processor: {measurement['processor']}.\n\n{markdown_table(header, rows)}"


def main() -> None:
    """Measure, write, print."""
    measurement = {"processor": processor(), "models": measured()}
    STORED.write_text(json.dumps(measurement, indent=1) + "\n", encoding="utf-8")
    write_block(PAGE, "bonds", block(measurement))
    print(block(measurement))


if __name__ == "__main__":
    main()
