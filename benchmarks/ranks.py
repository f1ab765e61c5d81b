"""Ranks beside threads: mpiexec -n 2 python -m benchmarks.ranks [--nodes 400000] [-o FILE].

A square plate of brittle bonds on one lattice marches on all ranks of mpiexec, and in one process on as many threads,
in turns; the least time of a step counts, as the machine may be busy. The exchange of ghosts is measured by itself, all
ranks having waited for each other. What follows for more ranks than are here is computed from that and from a network
of LATENCY and BANDWIDTH, and is marked so.

`--step` takes steps on the ranks alone, or in one process on one thread, and prints as JSON, for
`benchmarks.rank_curves`, the processor time of the rank that works longest, without that in which it waits for others,
and the least time of an exchange: neither depends on what else the machine does.

`--memory` solves and writes ten steps and two frames on the ranks, and prints the largest memory of each, MB.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Horizon, InitialVelocity, Lattice, Material, Run, Settings
from pdmesh.model.node_grid import whole_lattice
from pdsolve.model import Model
from pdsolve.numerics.memory import large_arrays_apart
from pdsolve.numerics.team import Team, team
from pdsolve.options import Options
from pdsolve.run.on_ranks import start
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import simulate
from pdsolve.run.system import Prepared

STEPS, REPEATS = 10, 12  # of a timed march, in turns
LATENCY, BANDWIDTH = 2e-6, 10e9  # s, bytes/s: supposed of a network
RATIO = 3.0
NEIGHBOURS = {2: 28, 3: 122}  # of a node, horizon 3 spacings
CUBE = 464  # nodes along each axis of the body that is computed, 1e8 of them
RANKS = 64


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


def exchanges(ranks: Team, times: int) -> list[float]:
    """Seconds of so many exchanges of ghosts, begun together."""
    part, found = ranks.part, []
    for _ in range(times):
        ranks.comm.Barrier()
        began = time.perf_counter()
        part.ghosts.fill(part.operator.tracks.u[0])
        found.append(time.perf_counter() - began)
    return found


def own_values(ranks: Team) -> NDArray[Any]:
    """The displacements (k, 2) of this rank's own nodes, m."""
    part = ranks.part
    return np.ascontiguousarray(part.now.state.value[part.own])


def peak(ranks: Team) -> float:
    """The largest memory that this process has had so far, MB."""
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def marched(prepared: Prepared, first: int) -> float:
    """Seconds of a step, of those from `first` on."""
    began = time.perf_counter()
    prepared.march(first, first + STEPS)
    return (time.perf_counter() - began) / STEPS


def measured(ranks: Team, nodes: int) -> dict[str, Any]:
    """What a plate of so many nodes takes, on all ranks and on as many threads."""
    model = plate(nodes)
    many = start.prepare(model, Options(), ranks)
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
        "bonds_per_second": many.system.bonds / on_ranks,
    }


def memory_of_a_run(ranks: Team, nodes: int) -> dict[str, Any]:
    """The largest memory of each rank, MB, when a plate of about so many nodes has been solved and written."""
    model = plate(nodes)
    with tempfile.TemporaryDirectory() as folder:
        simulate(model, Path(folder) / "plate.sqlite", Options(team=ranks)).close()
    return {"nodes": len(model.grid), "memory": ranks.everywhere(peak)}


def step_alone(ranks: Team | None, nodes: int) -> dict[str, float]:
    """The least time of a step of a plate of about so many nodes, and of an exchange in it, s."""
    alone = Options(threads=1)
    prepared = prepare(plate(nodes), alone) if ranks is None else start.prepare(plate(nodes), alone, ranks)
    found, nodes = [], len(prepared.system.model.grid)
    prepared.march(1, 2)
    for first in range(2, 2 + 6 * REPEATS * STEPS, STEPS):
        if ranks is not None:
            found.append(max(ranks.everywhere(worked, first, first + STEPS)) / STEPS)
            continue
        began = time.process_time()
        prepared.march(first, first + STEPS)
        found.append((time.process_time() - began) / STEPS)
    swap = 0.0 if ranks is None else float(np.max(ranks.everywhere(exchanges, 200), axis=0).min())
    return {"nodes": nodes, "step": min(found) + swap, "exchange": swap}


def worked(ranks: Team, first: int, last: int) -> float:
    """Processor time of the steps `first` to `last` - 1 of this rank without exchanges, s."""
    ghosts, waited = ranks.part.ghosts, [0.0]
    fill = ghosts.fill

    def timed(values: NDArray[Any]) -> None:
        began = time.process_time()
        fill(values)
        waited[0] += time.process_time() - began

    ghosts.fill, began = timed, time.process_time()
    start.march(ranks, first, last)
    spent = time.process_time() - began
    del ghosts.fill
    return spent - waited[0]


def computed(rate: float, slabs: bool = False) -> dict[str, float]:
    """What 1e8 nodes in space take on RANKS ranks in cubes, or in slabs as they are cut now, where each updates `rate`
    bonds/s: nothing of it is measured."""
    own, side = CUBE**3 / RANKS, CUBE / round(RANKS ** (1 / 3))
    ghosts = 2 * RATIO * CUBE**2 if slabs else (side + 2 * RATIO) ** 3 - side**3
    step = own * NEIGHBOURS[3] / rate
    swap = (2 if slabs else 26) * LATENCY + ghosts * 3 * 8 / BANDWIDTH
    return {"ghosts": ghosts, "step": step, "exchange": swap, "share": swap / (step + swap)}


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


def main() -> int:
    """Measure on all ranks of mpiexec; rank 0 tells."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--nodes", type=int, default=400_000)
    options.add_argument("-o", "--output", type=Path)
    options.add_argument("--step", action="store_true")
    options.add_argument("--memory", action="store_true")
    given, ranks = options.parse_args(), team()
    large_arrays_apart()
    if ranks is not None and ranks.rank > 0:
        return ranks.serve()
    if given.step:
        print(json.dumps(step_alone(ranks, given.nodes)), flush=True)
        if ranks is not None:
            ranks.end(0)
        return 0
    if ranks is None:
        print("found one process, expected ranks: mpiexec -n 2 python -m benchmarks.ranks", file=sys.stderr)
        return 2
    if given.memory:
        print(json.dumps(memory_of_a_run(ranks, given.nodes)), flush=True)
        ranks.end(0)
        return 0
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
