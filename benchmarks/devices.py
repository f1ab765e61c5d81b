"""An OpenCL device beside the processor and its own roofline: python -m benchmarks.devices [-o FILE].

Plates and a body of brittle bonds, none of which breaks, march on the device and on one thread of the processor in
turns; the least time of a step counts. Where the device is the processor itself (PoCL) processor time counts, else that
of the clock. The roofline is what the device reaches in two kernels of a few lines, a copy and sums of products, over
what a bond takes: `taken` counts its operations and its bytes. A bond is summed from both of its ends.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.models import lattice_grid, model_of
from benchmarks.timing import least, timed
from pdmesh import Body, Box
from pdmesh.drawing.building import meshed
from pdmesh.model.document import Horizon, InitialVelocity, Material, Run, Settings
from pdsolve.device import tiles
from pdsolve.device.runtime import Session
from pdsolve.device.source import preamble
from pdsolve.model import Model, on_device
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

STEPS, ROUNDS = 10, 5
SIDES = {"64k": (400, 160), "400k": (1000, 400)}
CUBE = 48  # nodes along each axis of the body
COPIED, CHAINS = 1 << 24, 2048  # numbers of the copy; products and sums of a work item
EIGHT = 8
SIMPLE = """
__kernel void copied(__global const REAL *a, __global REAL *b) { b[get_global_id(0)] = a[get_global_id(0)]; }
__kernel void summed(__global REAL *a) {
  WIDE_REAL x = a[get_global_id(0)], s = x, t = -x, v = 2 * x, w = 3 * x;
  for (int k = 0; k < CHAIN; ++k) {
    s = fma(s, x, x);
    t = fma(t, x, x);
    v = fma(v, x, x);
    w = fma(w, x, x);
  }
  s += t + v + w;
  a[get_global_id(0)] = s.s0 + s.s1 + s.s2 + s.s3 + s.s4 + s.s5 + s.s6 + s.s7;
}
"""


class Taken(NamedTuple):
    """What a bond, seen from one end, takes of a device."""

    operations: float
    bytes: float


def taken(dimension: int, precision: str, family: float) -> Taken:
    """What the kernel counts for each bond of a node with so many, none of them long enough for a root.

    Of d components: eta d; e 4 d - 1; the polynomial 2 a degree; w e g 2; xi + eta and the sums 3 d. A node moves its
    displacement twice, its velocity twice, 1 / rho, its place among conditions and a word of bits for 32 bonds; its
    neighbours' displacements are those that the nodes beside it have read.
    """
    size, degree = (8, 5) if precision == "float64" else (4, 2)
    words = -(-family // 32)
    moved = 4 * dimension * size + size + 4 + 4 * words
    if dimension == 3:
        moved += 8 * dimension + 4 + 1  # a row of nodes and whether it is held, accelerations twice
    return Taken(dimension + 4 * dimension - 1 + 2 * degree + 2 + 3 * dimension, moved / family)


def plate(columns: int, rows: int) -> Model:
    """A plate that flies apart without breaking."""
    half = (0.0, 0.0, columns * 1e-3, rows * 0.5e-3)
    settings = Settings(
        material=Material(E=65e9, rho=2235.0, G0=1e9),
        horizon=Horizon(3.0),
        conditions=(InitialVelocity(box=half, x=1.0, y=0.1),),
        run=Run(steps=10, every=10),
    )
    return Model(lattice_grid(columns, rows), settings)


def cube() -> Model:
    """A cube of so many nodes that is pulled."""
    glass = Material(E=65e9, rho=2235.0, G0=1e9, plane="space", micromodulus="constant")
    h = 1.0 / CUBE
    return model_of(meshed(Body(Box((0, 0, 0), (1.0, 1.0, 1.0)), h, glass).load("right", (1e4, 0, 0))))


def roofline(session: Session, precision: str, clock: Callable[[], float]) -> tuple[float, float]:
    """Bytes and operations a second that the device reaches."""
    wide = "double8" if precision == "float64" else "float8"
    source = f"{preamble(precision, 2)}\n#define WIDE_REAL {wide}\n#define CHAIN {CHAINS}\n{SIMPLE}"
    program, kind = session.build(source), np.dtype(precision).type
    a, b = (session.put(np.full(COPIED, 1e-3, dtype=kind)) for _ in range(2))
    copied, summed, items = program.copied, program.summed, COPIED >> 8

    def seconds(*launch: Any) -> float:
        return timed(lambda: (session.launch(*launch), session.finish()), clock)

    works = {"moved": (copied, (COPIED, 64), [a, b]), "added": (summed, (items, 64), [a])}
    for work in works.values():
        seconds(*work)
    best = least({name: partial(seconds, *work) for name, work in works.items()}, ROUNDS)
    return 2 * COPIED * np.dtype(precision).itemsize / best["moved"], 8 * EIGHT * CHAINS * items / best["added"]


def measured(name: str, device: str) -> list[dict[str, Any]]:
    """What a model takes on a device and on one thread, in both precisions."""
    model, rows = cube() if name == "body" else plate(*SIDES[name]), []
    for precision in ("float64", "float32"):
        here = prepare(model, Options("conservative", precision, threads=1))
        there = prepare(on_device(model, device), Options("conservative", precision))
        session = there.system.operator.session  # type: ignore[attr-defined]
        clock = time.process_time if session.about.kind == "CPU" else time.perf_counter
        measures = {
            "processor": partial(timed, partial(here.advance, 1, 1 + STEPS), time.process_time),
            "on the device": partial(timed, partial(there.advance, 1, 1 + STEPS), clock),
        }
        for measure in measures.values():
            measure()  # compiles
        bonds, nodes = float(here.system.directed_bond_count), len(model.grid)
        speeds = {place: STEPS * bonds / seconds for place, seconds in least(measures, ROUNDS).items()}
        bandwidth, operations = roofline(session, precision, clock)
        each = taken(model.grid.dimension, precision, bonds / nodes)
        row = {"model": name, "nodes": nodes, "precision": precision, "device": session.about.summary}
        row |= {"bonds": bonds, **speeds}
        row |= {"bytes a second": bandwidth, "operations a second": operations, **each._asdict()}
        row["roofline"] = min(bandwidth / each.bytes, operations / each.operations)
        rows.append(row)
    return rows


def main() -> None:
    """Print, and write, what was measured."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", default="opencl")
    parser.add_argument("--models", nargs="+", choices=[*SIDES, "body"], default=[*SIDES, "body"])
    parser.add_argument("--lanes", action="store_true", help="a node a work item, as on a GPU, on any device")
    parser.add_argument("-o", "--output", type=Path)
    args = parser.parse_args()
    if args.lanes:
        tiles.together = lambda kind, precision: 1
    rows = [row for name in args.models for row in measured(name, args.device)]
    for row in rows:
        speeds = {name: value for name, value in row.items() if name in ("processor", "on the device")}
        words = ", ".join(f"{name} {value / 1e6:.0f}" for name, value in speeds.items())
        print(
            f"{row['model']} ({row['nodes']} nodes, {row['precision']}): {words} M bonds/s; roofline"
            f" {row['roofline'] / 1e6:.0f} ({row['bytes']:.1f} bytes and {row['operations']:.0f} operations a bond,"
            f" {row['bytes a second'] / 1e9:.3g} GB/s, {row['operations a second'] / 1e9:.3g} Gflop/s)"
        )
    print(rows[0]["device"])
    if args.output:
        args.output.write_text(json.dumps(rows, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
