"""How fast bodies in space are: tiles against the list of bonds, in one interleaved run.

`python -m benchmarks.space` writes space.json and a section of docs/verification/accuracy_and_cost.md. Times of one
thread are CPU time, those of two are by the clock; each is the least of `ROUNDS` interleaved repeats. Bytes are what
the process of a large body has at its peak beyond that of a small one.
"""

from __future__ import annotations

import argparse
import importlib.metadata
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from benchmarks.pages import put_section
from benchmarks.timing import least, timed
from pdmesh.model.document import Horizon, Lattice, Material, Run, Settings
from pdmesh.model.node_grid import whole_lattice
from pdsolve.model import Model
from pdsolve.numerics.memory import large_arrays_apart
from pdsolve.numerics.thread_team import cores
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun

PAGE = Path(__file__).parent.parent / "docs" / "verification" / "accuracy_and_cost.md"
GLASS = Material(E=65e9, rho=2235.0, G0=204.0, micromodulus="constant", plane="space")
DRAWN = """from pdmesh import Body, Box, Material, Run
glass = Material(E=65e9, rho=2235.0, G0=204.0, micromodulus="constant", plane="space")
scene = Body(Box((0, 0, 0), (0.1, 0.1, 0.1)), 0.1 / SIDE, glass, 3.0, Run(steps=100, every=50))
scene = scene.load("left", (-1e6, 0, 0)).load("right", (1e6, 0, 0))
"""
WHOLE = {
    "pdmesh build": "pdmesh build cube.py -o cube.json --trust",
    "pdsolve, 100 steps, 3 frames": "pdsolve cube.json -o cube.sqlite --threads 1",
    "pdpost damage": "pdpost damage cube.sqlite -o cube.png",
}
ROUNDS, PREPARED, STEPS = 7, 3, 10  # repeats of steps and of preparing; steps at once, as marches fuse them
SMALL, LARGE, TINY, LARGEST = 46, 100, 16, 200  # nodes a side
VARIANTS = {
    "list, float64": Options(kernel="listed", threads=1),
    "tiles, float64": Options(threads=1),
    "tiles, float32": Options(precision="float32", threads=1),
    "tiles, float64, 2 threads": Options(threads=min(2, cores())),
}


STORED = Path(__file__).parent / "space.json"


def cube(side: int, material: Material = GLASS) -> Model:
    """A cube of so many nodes a side, 1 mm apart, m = 3."""
    grid = whole_lattice(Lattice((0.0, 0.0, 0.0), 1e-3, side, side, side), cracks=np.zeros((0, 9)))
    return Model(grid, Settings(material=material, horizon=Horizon(3.0), run=Run(time_step=2e-8)))


def shaken(model: Model, options: Options) -> PreparedRun:
    """A body in small random motion that breaks nothing."""
    problem = prepare(model, options)
    problem.state.value[:] = 1e-10 * np.random.default_rng(0).standard_normal(problem.state.value.shape)
    problem.advance(1, 2)
    return problem


def repeated(takes: dict[str, Callable[[], Any]], rounds: int = ROUNDS) -> dict[str, float]:
    """Seconds that each takes, the least of interleaved repeats: by the clock where there are several threads."""
    clocks = {name: time.perf_counter if "threads" in name else time.process_time for name in takes}
    return least({name: partial(timed, take, clocks[name]) for name, take in takes.items()}, rounds)


def measured(side: int, names: list[str]) -> dict[str, Any]:
    """us a node of a step and of preparing, and bytes a node of the operator."""
    model, nodes = cube(side), side**3
    problems = {name: shaken(model, VARIANTS[name]) for name in names}
    clocked = {"tiles, float64, 1 of 2 threads": "tiles, float64"} if "tiles, float64, 2 threads" in names else {}
    takes = {name: problems[clocked.get(name, name)] for name in (*names, *clocked)}
    step = repeated({name: lambda problem=problem: problem.advance(1, 1 + STEPS) for name, problem in takes.items()})
    assert not any(len(problem.system.operator.broken().step) for problem in problems.values())
    operators = {name: problem.system.operator.bytes() / nodes for name, problem in problems.items()}  # type: ignore[attr-defined]
    bonds = problems["tiles, float64"].system.directed_bond_count / nodes
    del problems, takes
    options = {name: VARIANTS[name] for name in names if "threads" not in name}
    preparing = repeated({name: lambda of=of: prepare(model, of) for name, of in options.items()}, PREPARED)
    return {
        "nodes": nodes,
        "bonds a node": bonds,
        "step": {name: 1e6 * seconds / nodes / STEPS for name, seconds in step.items()},
        "preparing": {name: 1e6 * seconds / nodes for name, seconds in preparing.items()},
        "operator": operators,
    }


def ordinary(side: int) -> dict[str, Any]:
    """us a node of a step of ordinary families that may break, in a list and in tiles."""
    model, problems = cube(side, msgspec.structs.replace(GLASS, model="ordinary", nu=0.25)), {}
    for name in ("list, float64", "tiles, float64", "tiles, float32"):
        problems[name] = shaken(model, VARIANTS[name])
    step = repeated({name: lambda problem=problem: problem.advance(1, 1 + STEPS) for name, problem in problems.items()})
    assert not any(len(problem.system.operator.broken().step) for problem in problems.values())
    bonds = problems["tiles, float64"].system.directed_bond_count / side**3
    return {
        "nodes": side**3,
        "bonds a node": bonds,
        "step": {name: 1e6 * seconds / side**3 / STEPS for name, seconds in step.items()},
    }


def peak(side: int, precision: str) -> int:
    """Bytes of a process that prepares a cube and takes ten steps, at its peak."""
    command = [sys.executable, "-m", "benchmarks.space", "--peak", str(side), "--precision", precision]
    return int(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def whole(side: int) -> dict[str, dict[str, float]]:
    """CPU seconds and peak bytes of each program on a cube of so many nodes a side, from a script to a picture."""
    found, programs = {}, Path(sys.executable).parent
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "cube.py").write_text(DRAWN.replace("SIDE", str(side)), encoding="utf-8")
        for name, line in WHOLE.items():
            program, *arguments = line.split()
            process = subprocess.Popen([programs / program, *arguments], cwd=folder, stdout=subprocess.DEVNULL)
            _, status, used = os.wait4(process.pid, 0)
            assert status == 0, name
            found[name] = {"seconds": used.ru_utime + used.ru_stime, "bytes": 1024.0 * used.ru_maxrss}
    return found


def section(found: dict[str, Any]) -> str:
    """The section of the page."""
    clocked = ", two by the clock" if any("2 threads" in name for name in found["bodies"][0]["step"]) else ""
    versions = found.get("versions", {})
    lines = [
        "## Bodies in space",
        "",
        f"Cubes of glass, constant micromodulus, m = 3, {STEPS} whole steps at once. `python -m benchmarks.space`",
        f"measures them on a machine with other work: one thread by CPU time{clocked}, each the least of",
        "interleaved repeats.",
        "",
        "| nodes | bonds a node | kernel | us a node and step | ns a bond | times the list |"
        " preparing, us a node | operator, B a node |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for body in found["bodies"]:
        listed = body["step"].get("list, float64")
        for name, step in body["step"].items():
            bonds = body["bonds a node"]
            times = f"{listed / step:.1f}" if listed else ""
            preparing = f"{body['preparing'][name]:.1f}" if name in body["preparing"] else ""
            operator = f"{body['operator'][name]:.0f}" if name in body["operator"] else ""
            lines.append(
                f"| {body['nodes']} | {bonds:.0f} | {name} | {step:.4f} | {1e3 * step / bonds:.2f} | {times} |"
                f" {preparing} | {operator} |"
            )
    if "ordinary" in found:
        lines += _of_ordinary(found["ordinary"], _measured(versions.get("ordinary")))
    lines += [
        "",
        "All in all, with the grid, the state and what preparing takes for a while, a process has at its peak",
    ]
    peaks = ", ".join(f"{value:.0f} bytes a node in {name}" for name, value in found["peak"].items())
    lines += [f"{peaks}, of a million nodes.", ""]
    for key, nodes in (("whole", "a million nodes"), ("largest", "eight million nodes")):
        if key in found:
            lines += [
                f"From a script to a picture, {nodes} in float64, {_measured(versions.get(key))}:",
                "",
                "| | CPU time, s | peak, MB |",
                "|---|---|---|",
            ]
            lines += [f"| {name} | {of['seconds']:.1f} | {of['bytes'] / 1e6:.0f} |" for name, of in found[key].items()]
            lines.append("")
    return "\n".join(lines)


def _measured(version: str | None) -> str:
    """With which version: older numbers do not tell theirs."""
    return f"measured with version {version}" if version else "measured before version 1.1.0"


def _of_ordinary(of: dict[str, Any], measured_with: str) -> list[str]:
    """Lines of the section on ordinary families."""
    lines = [
        "",
        f"The same for `ordinary` families that may break, of {of['nodes']} nodes"
        f" (`python -m benchmarks.space --ordinary`), {measured_with}:",
        "",
        "| kernel | us a node and step | ns a bond | times the list |",
        "|---|---|---|---|",
    ]
    for name, step in of["step"].items():
        times = of["step"]["list, float64"] / step
        lines.append(f"| {name} | {step:.3f} | {1e3 * step / of['bonds a node']:.2f} | {times:.1f} |")
    return lines


def told(found: dict[str, Any]) -> None:
    """Keep the numbers, put the section on its page, and print it."""
    STORED.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")
    put_section(PAGE, section(found))
    print(section(found))


def main() -> None:
    """Measure, write, tell."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--two-threads", action="store_true", help="too; it wants two quiet cores")
    parser.add_argument("--ordinary", action="store_true", help="ordinary families alone")
    parser.add_argument("--largest", action="store_true", help="eight million nodes alone; they take 4 GB")
    parser.add_argument("--peak", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--precision", default="float64", help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.peak:
        large_arrays_apart()
        prepare(cube(asked.peak), Options(precision=asked.precision, threads=1)).advance(1, 11)
        print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)
        return
    stored = json.loads(STORED.read_text(encoding="utf-8"))
    versions, version = stored.get("versions", {}), importlib.metadata.version("pdsuite")
    if asked.ordinary:
        told(stored | {"ordinary": ordinary(SMALL), "versions": versions | {"ordinary": version}})
        return
    if asked.largest:
        told(stored | {"largest": whole(LARGEST), "versions": versions | {"largest": version}})
        return
    more = LARGE**3 - TINY**3  # first, as a process is said to have had what the one that starts it has
    peaks = {kind: (peak(LARGE, kind) - peak(TINY, kind)) / more for kind in ("float64", "float32")}
    ended = whole(LARGE)
    names = [name for name in VARIANTS if asked.two_threads or "threads" not in name]
    bodies = [measured(SMALL, names), measured(LARGE, [name for name in names if "list" not in name])]
    told(stored | {"bodies": bodies, "peak": peaks, "whole": ended, "versions": versions | {"whole": version}})


if __name__ == "__main__":
    main()
