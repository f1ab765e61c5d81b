"""How fast bodies in space are: tiles against the list of bonds, in one interleaved run.

`python -m benchmarks.space` writes space.json and tables of docs/verification/accuracy_and_cost.md. Times are
CPU time of one thread, the least of `ROUNDS` interleaved repeats. Bytes are what the process of a large body has at its
peak beyond that of a small one.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

import msgspec

from benchmarks.models import lattice_grid, shaken
from benchmarks.pages import DOCS, markdown_table, write_block
from benchmarks.timing import least, timed
from pdmesh import VERSION
from pdmesh.model.document import Horizon, Material, Run, Settings
from pdsolve.model import Model
from pdsolve.numerics.memory import large_arrays_apart
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun

PAGE = DOCS / "verification" / "accuracy_and_cost.md"
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
}

STORED = Path(__file__).parent / "space.json"


def cube(side: int, material: Material = GLASS) -> Model:
    """A cube of so many nodes a side, 1 mm apart, m = 3."""
    settings = Settings(material=material, horizon=Horizon(3.0), run=Run(time_step=2e-8))
    return Model(lattice_grid(side, side, side), settings)


def marched(model: Model, names: Iterable[str]) -> dict[str, PreparedRun]:
    """Runs of a model in small random motion that breaks nothing, one for each variant, compiled."""
    runs = {name: shaken(model, VARIANTS[name]) for name in names}
    for run in runs.values():
        run.advance(1, 2)
    return runs


def repeated(takes: dict[str, Callable[[], Any]], rounds: int = ROUNDS) -> dict[str, float]:
    """CPU seconds that each takes, the least of interleaved repeats."""
    return least({name: partial(timed, take, time.process_time) for name, take in takes.items()}, rounds)


def measured(side: int, names: list[str]) -> dict[str, Any]:
    """us a node of a step and of preparing, and bytes a node of the operator."""
    model, nodes = cube(side), side**3
    runs = marched(model, names)
    takes = {name: partial(run.advance, 1, 1 + STEPS) for name, run in runs.items()}
    step = repeated(takes)
    assert not any(len(run.system.operator.broken().step) for run in runs.values())
    operators = {name: run.system.operator.bytes() / nodes for name, run in runs.items()}  # type: ignore[attr-defined]
    bonds = runs["tiles, float64"].system.directed_bond_count / nodes
    del runs, takes
    preparing = repeated({name: partial(prepare, model, VARIANTS[name]) for name in names}, PREPARED)
    return {
        "nodes": nodes,
        "bonds a node": bonds,
        "step": {name: 1e6 * seconds / nodes / STEPS for name, seconds in step.items()},
        "preparing": {name: 1e6 * seconds / nodes for name, seconds in preparing.items()},
        "operator": operators,
    }


def ordinary(side: int) -> dict[str, Any]:
    """us a node of a step of ordinary families that may break, in a list and in tiles."""
    runs = marched(cube(side, msgspec.structs.replace(GLASS, model="ordinary", nu=0.25)), VARIANTS)
    step = repeated({name: partial(run.advance, 1, 1 + STEPS) for name, run in runs.items()})
    assert not any(len(run.system.operator.broken().step) for run in runs.values())
    bonds = runs["tiles, float64"].system.directed_bond_count / side**3
    microseconds = {name: 1e6 * seconds / side**3 / STEPS for name, seconds in step.items()}
    return {"nodes": side**3, "bonds a node": bonds, "step": microseconds}


def peak(side: int, precision: str) -> int:
    """Bytes of a process that prepares a cube and takes ten steps, at its peak."""
    command = [sys.executable, "-m", "benchmarks.space", "--peak", str(side), "--precision", precision]
    return int(subprocess.run(command, check=True, capture_output=True, text=True).stdout)


def whole(side: int) -> dict[str, dict[str, float]]:
    """CPU seconds and peak bytes of each program on a cube of so many nodes a side, from a script to a picture."""
    used_by, programs = {}, Path(sys.executable).parent
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "cube.py").write_text(DRAWN.replace("SIDE", str(side)), encoding="utf-8")
        for name, line in WHOLE.items():
            program, *arguments = line.split()
            process = subprocess.Popen([programs / program, *arguments], cwd=folder, stdout=subprocess.DEVNULL)
            _, status, used = os.wait4(process.pid, 0)
            assert status == 0, name
            used_by[name] = {"seconds": used.ru_utime + used.ru_stime, "bytes": 1024.0 * used.ru_maxrss}
    return used_by


def write_blocks(measurement: dict[str, Any]) -> None:
    """Write the blocks of the page, and print them."""
    blocks = {"bodies in space": _of_bodies(measurement["bodies"])}
    peaks = ", ".join(f"{value:.0f} bytes a node in {name}" for name, value in measurement["peak"].items())
    blocks["a million nodes"] = (
        "All in all, with the grid, the state and what preparing takes for a while, a process has at its peak\n"
        f"{peaks}, of a million nodes.\n\n{_of_programs(measurement, 'whole', 'a million nodes')}"
    )
    blocks["eight million nodes"] = _of_programs(measurement, "largest", "eight million nodes")
    blocks["ordinary families"] = _of_ordinary(measurement)
    for name, block in blocks.items():
        write_block(PAGE, name, block)
        print(block)


def _of_bodies(bodies: list[dict[str, Any]]) -> str:
    rows = []
    for body in bodies:
        listed, bonds = body["step"].get("list, float64"), body["bonds a node"]
        for name, step in body["step"].items():
            times = f"{listed / step:.1f}" if listed else ""
            cells = [body["nodes"], f"{bonds:.0f}", name, f"{step:.4f}", f"{1e3 * step / bonds:.2f}", times]
            rows.append([*cells, f"{body['preparing'][name]:.1f}", f"{body['operator'][name]:.0f}"])
    header = ["nodes", "bonds a node", "kernel", "us a node and step", "ns a bond", "times the list"]
    return markdown_table([*header, "preparing, us a node", "operator, B a node"], rows)


def _of_ordinary(measurement: dict[str, Any]) -> str:
    families = measurement["ordinary"]
    rows = []
    for name, step in families["step"].items():
        times, per_bond = families["step"]["list, float64"] / step, 1e3 * step / families["bonds a node"]
        rows.append([name, f"{step:.3f}", f"{per_bond:.2f}", f"{times:.1f}"])
    return (
        f"The same for `ordinary` families that may break, of {families['nodes']} nodes"
        f" (`python -m benchmarks.space --ordinary`), {_version(measurement, 'ordinary')}:\n\n"
        + markdown_table(["kernel", "us a node and step", "ns a bond", "times the list"], rows)
    )


def _of_programs(measurement: dict[str, Any], key: str, nodes: str) -> str:
    rows = [[name, f"{of['seconds']:.1f}", f"{of['bytes'] / 1e6:.0f}"] for name, of in measurement[key].items()]
    return f"From a script to a picture, {nodes} in float64, {_version(measurement, key)}:\n\n" + markdown_table(
        ["", "CPU time, s", "peak, MB"], rows
    )


def _version(measurement: dict[str, Any], key: str) -> str:
    """With which version something was measured: older numbers do not tell theirs."""
    version = measurement["versions"].get(key)
    return f"measured with version {version}" if version else "measured before version 1.1.0"


def main() -> None:
    """Measure all, or what is asked for; write and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--ordinary", action="store_true", help="ordinary families alone")
    parser.add_argument("--largest", action="store_true", help="eight million nodes alone; they take 4 GB")
    parser.add_argument("--peak", type=int, help=argparse.SUPPRESS)
    parser.add_argument("--precision", default="float64", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.peak:
        large_arrays_apart()
        prepare(cube(args.peak), Options(precision=args.precision, threads=1)).advance(1, 11)
        print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)
        return
    measurement: dict[str, Any] = {}
    if args.ordinary:
        measurement["ordinary"] = ordinary(SMALL)
    elif args.largest:
        measurement["largest"] = whole(LARGEST)
    else:
        more = LARGE**3 - TINY**3  # first, as a process is said to have had what the one that starts it has
        measurement["peak"] = {
            precision: (peak(LARGE, precision) - peak(TINY, precision)) / more for precision in ("float64", "float32")
        }
        measurement["whole"] = whole(LARGE)
        in_tiles = [name for name in VARIANTS if "list" not in name]
        measurement["bodies"] = [measured(SMALL, list(VARIANTS)), measured(LARGE, in_tiles)]
    before = json.loads(STORED.read_text(encoding="utf-8"))
    versions = before["versions"] | dict.fromkeys(measurement, VERSION)
    measurement = before | measurement | {"versions": versions}
    STORED.write_text(json.dumps(measurement, indent=1) + "\n", encoding="utf-8")
    write_blocks(measurement)


if __name__ == "__main__":
    main()
