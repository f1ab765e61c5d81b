"""Ranks beside threads: mpiexec -n 2 python -m benchmarks.ranks [--nodes 400000] [-o FILE].

A square plate of brittle bonds on one lattice marches on all ranks of mpiexec, and in one process on as many threads,
in turns; the least time of a step counts, as the machine may be busy. The exchange of ghosts is measured by itself, all
ranks having waited for each other. What follows for more ranks than are here is computed from that and from a network
of LATENCY and BANDWIDTH, and is marked so.

`--step` takes steps on the ranks alone, or in one process on one thread, and prints as JSON the processor time of the
rank that works longest, without that in which it waits for others, and the least time of an exchange: neither depends
on what else the machine does.

`--cuts` counts by geometry, without a run, what the rank with most of a cube of CUBE^3 nodes has to do with others, if
the cube is cut into slabs, as it is, and if it is bisected across its longest axis again and again; and measures the
messages of one step of both, of 64 parts, between two ranks.

`--memory` solves and writes ten steps and two frames on the ranks, or in one process, and prints the largest memory of
each, MB; with `--fick`, of a content that spreads in the plate.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
import time
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Concentration, Horizon, InitialVelocity, Lattice, Material, Run, Settings
from pdmesh.model.medium import Medium
from pdmesh.model.node_grid import whole_lattice
from pdsolve.model import Model
from pdsolve.numerics.memory import large_arrays_apart
from pdsolve.numerics.team import Team, team
from pdsolve.options import Options
from pdsolve.ranks.slabs import BESIDE
from pdsolve.run.on_ranks import start
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import simulate
from pdsolve.run.system import PreparedRun

STEPS, REPEATS = 10, 12  # of a timed march, in turns
LATENCY, BANDWIDTH = 2e-6, 10e9  # s, bytes/s: supposed of a network
RATIO = 3.0
NEIGHBOURS = {2: 28, 3: 122}  # of a node, horizon 3 spacings
CUBE = 464  # nodes along each axis of the body that is computed, 1e8 of them
RANKS = 64
PARTS = (2, 4, 8, 16, 32, 64)
REACH = int(RATIO)  # layers of ghosts whose motion is asked for
AROUND = BESIDE * (REACH + 1)  # layers whose bonds are made beside own ones
Box = tuple[tuple[int, int], ...]  # first node along each axis, and the one after the last


def plate(nodes: int) -> Model:
    """A square plate of about so many nodes, which flies apart without breaking."""
    side = math.isqrt(nodes)
    lattice = Lattice(origin=(0.0, 0.0), spacing=1e-3, columns=side, rows=side)
    half = (0.0, 0.0, side * 1e-3, side * 0.5e-3)
    settings = Settings(
        material=Material(E=65e9, rho=2235.0, G0=1e9),
        horizon=Horizon(RATIO),
        conditions=(InitialVelocity(box=half, x=1.0, y=0.1),),
        run=Run(steps=10, every=10),
    )
    return Model(whole_lattice(lattice, cracks=np.empty((0, 4))), settings)


def spreading(nodes: int) -> Model:
    """A square plate of about so many nodes, which a content enters from below."""
    side = math.isqrt(nodes)
    lattice = Lattice(origin=(0.0, 0.0), spacing=1e-3, columns=side, rows=side)
    settings = Settings(
        physics="diffusion",
        medium=Medium(D=1.0),
        horizon=Horizon(RATIO),
        conditions=(Concentration(box=(0.0, 0.0, side * 1e-3, 2.5e-3), value=1.0),),
        run=Run(steps=10, every=10),
    )
    return Model(whole_lattice(lattice, cracks=np.empty((0, 4))), settings)


def exchanges(ranks: Team, times: int) -> list[float]:
    """Seconds of so many exchanges of ghosts, begun together."""
    part, found = ranks.part, []
    for _ in range(times):
        ranks.comm.Barrier()
        began = time.perf_counter()
        part.ghosts.receive_values(part.operator.tracks.u[0])
        found.append(time.perf_counter() - began)
    return found


def own_values(ranks: Team) -> NDArray[Any]:
    """The displacements (k, 2) of this rank's own nodes, m."""
    part = ranks.part
    return np.ascontiguousarray(part.now.state.value[part.own])


def peak(ranks: Team | None) -> float:
    """The largest memory that this process has had so far, MB."""
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def marched(prepared: PreparedRun, first: int) -> float:
    """Seconds of a step, of those from `first` on."""
    began = time.perf_counter()
    prepared.advance(first, first + STEPS)
    return (time.perf_counter() - began) / STEPS


def measured(ranks: Team, nodes: int) -> dict[str, Any]:
    """What a plate of so many nodes takes, on all ranks and on as many threads."""
    model = plate(nodes)
    many = start.prepare_run_on_ranks(model, Options(), ranks)
    memory = ranks.everywhere(peak)
    one = prepare(model, Options(threads=ranks.size))
    times: tuple[list[float], list[float]] = ([], [])
    for turn in range(REPEATS):
        for prepared, found in zip((many, one), times, strict=True):
            found.append(marched(prepared, 1 + turn * STEPS))
    found = ranks.everywhere(own_values)
    same = np.concatenate(found).tobytes() == np.ascontiguousarray(one.state.value).tobytes()
    swaps = np.max(ranks.everywhere(exchanges, 200), axis=0)
    on_ranks, on_threads = min(times[0]), min(times[1])
    return {
        "nodes": len(model.grid),
        "ranks": ranks.size,
        "step_on_ranks": on_ranks,
        "step_on_threads": on_threads,
        "speed_of_threads": on_threads / on_ranks,
        "exchange": float(swaps.min()),
        "exchange_median": float(np.median(swaps)),
        "exchange_share": float(swaps.min()) / on_ranks,
        "same_bits": same,
        "memory": memory,
        "bonds_per_second": many.system.directed_bond_count / on_ranks,
    }


def memory_of_a_run(ranks: Team | None, model: Model) -> dict[str, Any]:
    """The largest memory of each rank, or of this process, MB, when a model has been solved and written."""
    with tempfile.TemporaryDirectory() as folder:
        simulate(model, Path(folder) / "plate.sqlite", Options(team=ranks)).close()
    return {"nodes": len(model.grid), "memory": [peak(None)] if ranks is None else ranks.everywhere(peak)}


def step_alone(ranks: Team | None, nodes: int) -> dict[str, float]:
    """The least time of a step of a plate of about so many nodes, and of an exchange in it, s."""
    alone = Options(threads=1)
    prepared = prepare(plate(nodes), alone) if ranks is None else start.prepare_run_on_ranks(plate(nodes), alone, ranks)
    found, nodes = [], len(prepared.system.model.grid)
    prepared.advance(1, 2)
    for first in range(2, 2 + 6 * REPEATS * STEPS, STEPS):
        if ranks is not None:
            found.append(max(ranks.everywhere(worked, first, first + STEPS)) / STEPS)
            continue
        began = time.process_time()
        prepared.advance(first, first + STEPS)
        found.append((time.process_time() - began) / STEPS)
    swap = 0.0 if ranks is None else float(np.max(ranks.everywhere(exchanges, 200), axis=0).min())
    return {"nodes": nodes, "step": min(found) + swap, "exchange": swap}


def worked(ranks: Team, first: int, last: int) -> float:
    """Processor time of the steps `first` to `last` - 1 of this rank without exchanges, s."""
    ghosts, waited = ranks.part.ghosts, [0.0]
    fill = ghosts.receive_values

    def timed(values: NDArray[Any]) -> None:
        began = time.process_time()
        fill(values)
        waited[0] += time.process_time() - began

    ghosts.receive_values, began = timed, time.process_time()
    start.advance_this_rank(ranks, first, last)
    spent = time.process_time() - began
    del ghosts.receive_values
    return spent - waited[0]


def computed(rate: float, slabs: bool = False) -> dict[str, float]:
    """What 1e8 nodes in space take on RANKS ranks in cubes, or in slabs as they are cut now, where each updates `rate`
    bonds/s: nothing of it is measured."""
    own, side = CUBE**3 / RANKS, CUBE / round(RANKS ** (1 / 3))
    ghosts = 2 * RATIO * CUBE**2 if slabs else (side + 2 * RATIO) ** 3 - side**3
    step = own * NEIGHBOURS[3] / rate
    swap = (2 if slabs else 26) * LATENCY + ghosts * 3 * 8 / BANDWIDTH
    return {"ghosts": ghosts, "step": step, "exchange": swap, "share": swap / (step + swap)}


def slabs(parts: int) -> list[Box]:
    """A cube in layers."""
    cuts = [CUBE * part // parts for part in range(parts + 1)]
    return [((0, CUBE), (0, CUBE), ends) for ends in pairwise(cuts)]


def bisected(parts: int) -> list[Box]:
    """A cube halved across its longest axis, and its halves again, into a power of 2 of parts."""
    boxes: list[Box] = [((0, CUBE),) * 3]
    while len(boxes) < parts:
        halves: list[Box] = []
        for box in boxes:
            axis = max(range(3), key=lambda axis: box[axis][1] - box[axis][0])
            low, high = box[axis]
            for ends in ((low, (low + high) // 2), ((low + high) // 2, high)):
                halves.append((*box[:axis], ends, *box[axis + 1 :]))
        boxes = halves
    return boxes


def beside(box: Box, layers: int) -> int:
    """Nodes of a cube so many layers beside a box or fewer."""
    grown = math.prod(min(high + layers, CUBE) - max(low - layers, 0) for low, high in box)
    return grown - math.prod(high - low for low, high in box)


def messages(own: Box, boxes: list[Box]) -> list[int]:
    """Bytes of each message that a part gets in a step: the nodes of one other part within REACH."""
    found = []
    for other in boxes:
        both = [
            min(high + REACH, last) - max(low - REACH, first)
            for (low, high), (first, last) in zip(own, other, strict=True)
        ]
        if other != own and min(both) > 0:
            found.append(math.prod(both) * 3 * 8)
    return found


def swapped(ranks: Team, sizes: list[int], times: int) -> list[float]:
    """Seconds in which this rank and another one send each other messages of these sizes, begun together."""
    other, found = 1 - ranks.rank, []
    sent, into = ([np.ones(size // 8) for size in sizes] for _ in range(2))
    for _ in range(times):
        ranks.comm.Barrier()
        began = time.perf_counter()
        waits = [ranks.comm.Irecv(values, other, number) for number, values in enumerate(into)]
        waits += [ranks.comm.Isend(values, other, number) for number, values in enumerate(sent)]
        for wait in waits:
            wait.Wait()
        found.append(time.perf_counter() - began)
    return found


def cuts(ranks: Team) -> list[dict[str, Any]]:
    """What slabs and bisected boxes have beside them, of the part with most; the messages of RANKS are measured."""
    rows: list[dict[str, Any]] = []
    for how, parted in (("slabs", slabs), ("bisected", bisected)):
        for parts in PARTS:
            boxes = parted(parts)
            most = max(boxes, key=lambda box: beside(box, REACH))
            sizes = messages(most, boxes)
            row = {"how": how, "parts": parts, "own": CUBE**3 // parts, "messages": len(sizes), "bytes": sum(sizes)}
            row |= {"ghosts": beside(most, REACH), "window": max(beside(box, AROUND) for box in boxes)}
            if parts == RANKS and ranks.size == 2:
                row["measured"] = float(np.max(ranks.everywhere(swapped, sizes, 40), axis=0).min())
            rows.append(row)
    return rows


def lines(found: dict[str, Any], one: float) -> list[str]:
    """What to say of a measurement, and of what is computed from `one` rank's bonds/s."""
    ways = (("cubes", computed(one)), ("slabs", computed(one, slabs=True)))
    return [
        f"{found['nodes']} nodes on {found['ranks']} ranks: {found['step_on_ranks'] * 1e3:.2f} ms a step, on as many"
        f" threads {found['step_on_threads'] * 1e3:.2f} ms ({found['speed_of_threads']:.2f} of their speed)",
        f"exchange {found['exchange'] * 1e6:.0f} us at least, {found['exchange_median'] * 1e6:.0f} us median,"
        f" {found['exchange_share']:.1%} of a step; the same bits: {found['same_bits']}",
        "memory at most, of each rank, MB: " + ", ".join(f"{one:.0f}" for one in found["memory"]),
        *(
            f"computed, not measured: {CUBE}^3 nodes in space on {RANKS} ranks in {how}, {one / 1e6:.0f} M bonds/s each"
            f", {LATENCY:g} s and {BANDWIDTH:g} B/s: {far['step'] * 1e3:.0f} ms a step,"
            f" exchange {far['exchange'] * 1e3:.2f} ms ({far['share']:.1%})"
            for how, far in ways
        ),
    ]


def told(rows: list[dict[str, Any]], ranks: Team | None) -> int:
    """Print rows as JSON and end all ranks; returns the exit code."""
    print("\n".join(map(json.dumps, rows)), flush=True)
    if ranks is not None:
        ranks.end(0)
    return 0


def main() -> int:
    """Measure on all ranks of mpiexec; rank 0 tells."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--nodes", type=int, default=400_000)
    options.add_argument("-o", "--output", type=Path)
    options.add_argument("--step", action="store_true")
    options.add_argument("--memory", action="store_true")
    options.add_argument("--fick", action="store_true")
    options.add_argument("--cuts", action="store_true")
    given, ranks = options.parse_args(), team()
    large_arrays_apart()
    if ranks is not None and ranks.rank > 0:
        return ranks.serve()
    if given.step:
        return told([step_alone(ranks, given.nodes)], ranks)
    if given.memory:
        return told([memory_of_a_run(ranks, (spreading if given.fick else plate)(given.nodes))], ranks)
    if ranks is None:
        print("found one process, expected ranks: mpiexec -n 2 python -m benchmarks.ranks", file=sys.stderr)
        return 2
    if given.cuts:
        return told(cuts(ranks), ranks)
    found = measured(ranks, given.nodes)
    rate = found["bonds_per_second"] / ranks.size
    found["computed"] = {"cubes": computed(rate), "slabs": computed(rate, slabs=True)}
    print("\n".join(lines(found, rate)))
    if given.output is not None:
        given.output.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    ranks.end(0)
    return 0


if __name__ == "__main__":
    sys.exit(main())
