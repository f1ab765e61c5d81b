"""Time and memory of a bond by what a model is: plates and bodies of one spacing and of several, others, a list.

`python -m benchmarks.lattices` writes lattices.json and a section of docs/verification/accuracy_and_cost.md. Times are
the least user time of interleaved repeats on one thread; bytes are all arrays of the operator.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from benchmarks.claims import Case
from benchmarks.pages import put_section
from benchmarks.peers import PAGE, processor
from benchmarks.runs import built
from benchmarks.space import GLASS, cube
from benchmarks.speed import PLATES, square
from benchmarks.timing import least_of_steps, timed
from pdmesh import Body, Box, Run, build
from pdmesh.model.document import Horizon, Settings
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.operator_factory import bond_arrangement, unwrap_bond_operator
from pdsolve.run.prepare import prepare

STORED = Path(__file__).with_suffix(".json")
FLAT = msgspec.structs.replace(GLASS, plane="stress")
CONICAL = msgspec.structs.replace(GLASS, micromodulus="conical")
H, M, STEP = 1e-3, 3.0, 2e-8  # m; horizon over spacing; s
ROUNDS, SAMPLE = 7, 0.2  # repeats; s of user time of one
SCENES = ("duran50", "kalthoff_winkler")  # plates with a fine zone


class OfKernel(NamedTuple):
    """A model, and the kernel that it asks for."""

    model: Model
    kernel: str | None = None


def box(x: float, y: float, z: float, corner: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Box:
    """A box of so many spacings along each axis."""
    low = tuple(H * start for start in corner)
    return Box(low, tuple(H * (start + size) for start, size in zip(corner, (x, y, z), strict=True)))


def models(folder: Path) -> dict[str, OfKernel]:
    """Models by what they are; scenes are built in a folder."""
    plain = Settings(material=FLAT, horizon=Horizon(M), run=Run(time_step=STEP))
    found = {"plate, one spacing": OfKernel(Model(square(*PLATES["64k"]), plain))}
    for scene in SCENES:
        grid = built(Case(scene, "", f"{scene}.geo", ()), folder).grid
        found[f"plate, two spacings (`{scene}`)"] = OfKernel(Model(grid, plain))

    def of(body: Body) -> OfKernel:
        model = build(body)
        return OfKernel(Model(model.grid, model.settings))

    def solid(x: float, y: float, z: float) -> Body:
        return Body(box(x, y, z), H, GLASS, M, Run(time_step=STEP))

    found["body, one spacing"] = OfKernel(cube(40))
    found["body, two spacings"] = of(solid(48, 36, 36).zone(box(48, 36, 6, (0, 0, 15)), H / 2))
    found["body, two spacings, smaller"] = of(solid(24, 16, 16).zone(box(8, 6, 4, (8, 5, 6)), H / 2))
    deeper = solid(24, 16, 16).zone(box(8, 6, 4, (8, 5, 6)), H / 2).zone(box(2, 2, 2, (11, 7, 7)), H / 4)
    found["body, three spacings"] = of(deeper)
    found["body, two profiles of the micromodulus"] = of(solid(32, 18, 12).region(box(16, 18, 12), CONICAL, "half"))
    apart = box(20, 16, 14, (0.5, 0.5, 14))  # on a lattice of its own
    found["two bodies"] = of(solid(20, 16, 14).body(apart, "upper"))
    found["body, one spacing, in a list"] = OfKernel(cube(20), "listed")
    return found


def measured(models_of_kernels: dict[str, OfKernel]) -> list[dict[str, Any]]:
    """ns and bytes a directed bond of each."""
    measures: dict[str, Callable[[int], float]] = {}
    rows: dict[str, dict[str, Any]] = {}
    for name, (model, kernel) in models_of_kernels.items():
        prepared = prepare(model, Options(threads=1, kernel=kernel))
        shape = prepared.state.value.shape
        prepared.state.value[:] = 1e-10 * np.random.default_rng(0).standard_normal(shape)
        operator, bonds = unwrap_bond_operator(prepared.system.operator), prepared.system.directed_bond_count
        measures[name] = lambda steps, run=prepared: timed(lambda: run.advance(1, 1 + steps))  # type: ignore[misc]
        rows[name] = {
            "name": name,
            "nodes": len(model.grid),
            "bonds": bonds,
            "in": bond_arrangement(operator),
            "bytes a bond": operator.bytes() / bonds,
        }
    for name, seconds in least_of_steps(measures, ROUNDS, SAMPLE).items():
        rows[name]["ns a bond"] = 1e9 * seconds / rows[name]["bonds"]
    return list(rows.values())


def section(found: dict[str, Any]) -> str:
    """The section of the page."""
    lines = [
        "## Time and memory of a bond",
        "",
        "Models with a horizon of three spacings and a constant micromodulus, in whole steps on one thread.",
        "`python -m benchmarks.lattices` measures them on a machine with other work: the least user time of",
        "interleaved repeats over the directed bonds (two for each pair of nodes), and the bytes of all arrays of the",
        f"operator that sums them. Processor: {found['processor']}.",
        "",
        "| model | nodes | bonds a node | summed in | ns a bond | bytes a bond |",
        "|---|---|---|---|---|---|",
    ]
    for row in found["models"]:
        where = "a list" if row["in"] == "listed" else row["in"]
        lines.append(
            f"| {row['name']} | {row['nodes']} | {row['bonds'] / row['nodes']:.0f} | {where} | {row['ns a bond']:.2f} |"
            f" {row['bytes a bond']:.1f} |"
        )
    return "\n".join([*lines, ""])


def main() -> None:
    """Measure, write, tell."""
    with tempfile.TemporaryDirectory() as folder:
        rows = measured(models(Path(folder)))
    found = {"processor": processor(), "models": rows}
    STORED.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    put_section(PAGE, section(found))
    print(section(found))


if __name__ == "__main__":
    main()
