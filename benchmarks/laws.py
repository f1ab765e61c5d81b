"""How fast state-based laws are: operators against a bond list in numpy and textbook loops, in one interleaved run.

`python -m benchmarks.laws` writes laws.json and laws.png: ns for the forces of one directed bond, on one thread.
benchmarks/README.md says how each number is made.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import msgspec
import numba
import numpy as np
from llvmlite.binding import get_host_cpu_name

from benchmarks import textbook
from benchmarks.speed import PLATES, ROUNDS, Variant, interleaved, square
from pdmesh.model.document import Horizon, Material, Run, Settings
from pdsolve.model import Model, ModelError
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import Prepared

SOLID = Material(E=65e9, rho=2235.0, G0=204.0, nu=0.3, influence="cubic spline", failure="none")
MATERIALS = {
    "ordinary": {"model": "ordinary"},
    "correspondence": {"model": "correspondence"},
    "correspondence, svk": {"model": "correspondence", "solid": "svk"},
    "correspondence, wan": {"model": "correspondence", "control": "wan"},
    "breitzman-dayal": {"model": "correspondence", "control": "breitzman-dayal"},
}
LOOPS: dict[str, dict[str, Callable[..., Any]]] = {
    "ordinary": {"numpy": textbook.ordinary_in_numpy, "textbook": textbook.ordinary_in_loops},
    "correspondence": {"numpy": textbook.correspondence_in_numpy, "textbook": textbook.correspondence_in_loops},
}
TORN = 0.02  # of all bonds


def prepared(plate: str, name: str, kernel: str, threads: int) -> Prepared | None:
    """A plate in small random motion; None where the kernel does not take it."""
    material = msgspec.structs.replace(SOLID, **MATERIALS[name])
    model = Model(square(*PLATES[plate]), Settings(material=material, horizon=Horizon(3.0), run=Run(time_step=2e-8)))
    try:
        problem = prepare(model, Options("conservative", "float64", threads, kernel))
    except ModelError:
        return None
    problem.state.value[:] = 1e-9 * np.random.default_rng(0).standard_normal(problem.state.value.shape)
    return problem


def tear(problem: Prepared, step: int = 1) -> None:
    """Break some of the bonds, both ways."""
    source, target = problem.system.operator.bonds()
    low, high = np.minimum(source, target), np.maximum(source, target)
    gone = (low * 7919 + high * 104729) % 10007 < TORN * 10007
    operator = problem.system.operator
    broken = operator.broken()._replace(
        step=np.full(np.count_nonzero(gone), step, dtype=np.int64), source=source[gone], target=target[gone]
    )
    operator.back(operator.keep(), broken)


def forces(problem: Prepared) -> Callable[[int], None]:
    """Sums of all forces, so many times."""
    state, operator = problem.state, problem.system.operator
    out = np.zeros(state.value.shape)

    def take(steps: int) -> None:
        for _ in range(steps):
            out[:] = 0
            operator.add(state, out, 0, 0.0)

    return take


def repeated(function: Callable[..., Any], *arguments: Any) -> Callable[[int], None]:
    """A function, so many times."""

    def take(steps: int) -> None:
        for _ in range(steps):
            function(*arguments)

    return take


def measure(plate: str, name: str, torn: bool, rounds: int) -> dict[str, Any]:
    """ns a bond of all variants of a law on a plate, and ratios of them."""
    variants, bonds, several = [], 0, min(2, numba.config.NUMBA_NUM_THREADS)
    for kernel, threads in dict.fromkeys([("listed", 1), ("blocks", 1), ("blocks", several)]):
        problem = prepared(plate, name, kernel, threads)
        if problem is None:
            continue
        if torn:
            tear(problem)
        label = kernel if threads == 1 else f"{kernel}, {threads} threads"
        variants.append(Variant(label, threads, forces(problem)))
        if kernel == "listed":
            bonds, t = problem.system.bonds, textbook.bonds_of(problem.system)
            source, target = problem.system.operator.bonds()
            t.intact[:] = np.isin(t.i * len(t.volume) + t.j, source * len(t.volume) + target)
            for label, function in LOOPS.get(name, {}).items():
                variants.append(Variant(label, 1, repeated(function, t, problem.state.value.copy())))
    ns = {key: 1e9 * value / bonds for key, value in interleaved(variants, rounds).items()}
    pairs = [("numpy", "listed"), ("textbook", "listed"), ("textbook", "blocks"), ("listed", "blocks")]
    ratios = {f"{slow} / {quick}": ns[slow] / ns[quick] for slow, quick in pairs if slow in ns and quick in ns}
    return {"plate": plate, "bonds": bonds, "law": name, "torn": TORN if torn else 0.0, "ns": ns, "ratios": ratios}


def tell(row: dict[str, Any]) -> None:
    """A line or two on a measurement."""
    print(f"{row['plate']}, {row['law']}, {100 * row['torn']:g} % broken")
    print("   ns a bond: " + ", ".join(f"{name} {value:.3g}" for name, value in row["ns"].items()))
    print("   " + "; ".join(f"{name}: {value:.3g}" for name, value in row["ratios"].items()), flush=True)


def chart(rows: list[dict[str, Any]], path: Path) -> None:
    """ns a bond of each law and variant, side by side."""
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    plates = list(dict.fromkeys((row["plate"], row["torn"]) for row in rows))
    figure, axes = plt.subplots(len(plates), 1, figsize=(9, 3.4 * len(plates)), squeeze=False, layout="constrained")
    names = list(dict.fromkeys(name for row in rows for name in row["ns"]))
    for axis, (plate, torn) in zip(axes[:, 0], plates, strict=True):
        mine = [row for row in rows if (row["plate"], row["torn"]) == (plate, torn)]
        for place, name in enumerate(names):
            at = [
                law + (place - len(names) / 2) / (len(names) + 1) for law, row in enumerate(mine) if name in row["ns"]
            ]
            bars = axis.bar(
                at, [row["ns"][name] for row in mine if name in row["ns"]], 0.9 / (len(names) + 1), label=name
            )
            axis.bar_label(bars, fmt="%.2g", fontsize=7)
        axis.set_xticks(range(len(mine)), [row["law"] for row in mine], fontsize=8)
        axis.set(yscale="log", ylabel="ns per directed bond", title=f"{plate} nodes, {100 * torn:g} % of bonds broken")
    axes[0, 0].legend(fontsize="x-small", ncols=len(names))
    figure.savefig(path, dpi=150)


def main(arguments: list[str] | None = None) -> int:
    """Measure; returns the exit code."""
    parser = argparse.ArgumentParser(prog="benchmarks.laws", description=__doc__)
    parser.add_argument("--plates", default="64k", help="some of " + ", ".join(PLATES))
    parser.add_argument("--laws", default=";".join(MATERIALS), help="some of these, between semicolons")
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    parser.add_argument("-o", "--output", type=Path, default=Path("laws.json"))
    args = parser.parse_args(arguments)
    rows = []
    for plate in args.plates.split(","):
        for torn in (False, True):
            for name in args.laws.split(";"):
                rows.append(measure(plate, name, torn, args.rounds))
                tell(rows[-1])
    machine = {"processor": get_host_cpu_name(), "cores": os.cpu_count(), "numba": numba.__version__}
    args.output.write_text(json.dumps({"machine": machine, "rows": rows}, indent=1) + "\n")
    chart(rows, args.output.with_suffix(".png"))
    return 0


if __name__ == "__main__":
    sys.exit(main())
