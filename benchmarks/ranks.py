"""Ranks beside threads: mpiexec -n 2 python -m benchmarks.ranks [--nodes 400000] [-o FILE].

A square plate of brittle bonds on one lattice marches on all ranks of mpiexec, and in one process on as many threads,
in turns; the least time of a step counts, as the machine may be busy. The exchange of ghosts is measured by itself, all
ranks having waited for each other.

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
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.devices import plate
from benchmarks.models import lattice_grid
from benchmarks.timing import timed
from pdmesh.model.document import Concentration, Horizon, Run, Settings
from pdmesh.model.medium import Medium
from pdsolve.model import Model
from pdsolve.numerics.memory import large_arrays_apart
from pdsolve.numerics.team import Team, team
from pdsolve.options import Options
from pdsolve.run import ranks_start
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import simulate

STEPS, REPEATS = 10, 12  # of a timed march, in turns
RATIO = 3.0


def square(nodes: int) -> Model:
    """A square plate of about so many nodes, which flies apart without breaking."""
    return plate(math.isqrt(nodes), math.isqrt(nodes))


def spreading(nodes: int) -> Model:
    """A square plate of about so many nodes, which a content enters from below."""
    side = math.isqrt(nodes)
    settings = Settings(
        physics="diffusion",
        medium=Medium(D=1.0),
        horizon=Horizon(RATIO),
        conditions=(Concentration(box=(0.0, 0.0, side * 1e-3, 2.5e-3), value=1.0),),
        run=Run(steps=10, every=10),
    )
    return Model(lattice_grid(side, side), settings)


def exchanges(ranks: Team, times: int) -> list[float]:
    """Seconds of so many exchanges of ghosts, begun together."""
    part, seconds = ranks.part, []
    for _ in range(times):
        ranks.comm.Barrier()
        began = time.perf_counter()
        part.ghosts.receive_values(part.operator.tracks.u[0])
        seconds.append(time.perf_counter() - began)
    return seconds


def own_values(ranks: Team) -> NDArray[Any]:
    """The displacements (k, 2) of this rank's own nodes, m."""
    subdomain = ranks.subdomain
    return np.ascontiguousarray(subdomain.state.value[subdomain.own_rows])


def peak(ranks: Team | None) -> float:
    """The largest memory that this process has had so far, MB."""
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def measured(ranks: Team, nodes: int) -> dict[str, Any]:
    """What a plate of so many nodes takes, on all ranks and on as many threads."""
    model = square(nodes)
    on_many = ranks_start.prepare_run_on_ranks(model, Options(), ranks)
    memory = ranks.everywhere(peak)
    on_one = prepare(model, Options(threads=ranks.size))
    times: tuple[list[float], list[float]] = ([], [])
    for turn in range(REPEATS):
        for prepared, seconds in zip((on_many, on_one), times, strict=True):
            steps = partial(prepared.advance, 1 + turn * STEPS, 1 + (turn + 1) * STEPS)
            seconds.append(timed(steps, time.perf_counter) / STEPS)
    displacements = ranks.everywhere(own_values)
    same = np.concatenate(displacements).tobytes() == np.ascontiguousarray(on_one.state.value).tobytes()
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
        "bonds_per_second": on_many.system.directed_bond_count / on_ranks,
    }


def memory_of_a_run(ranks: Team | None, model: Model) -> dict[str, Any]:
    """The largest memory of each rank, or of this process, MB, when a model has been solved and written."""
    with tempfile.TemporaryDirectory() as folder:
        simulate(model, Path(folder) / "plate.sqlite", Options(team=ranks)).close()
    return {"nodes": len(model.grid), "memory": [peak(None)] if ranks is None else ranks.everywhere(peak)}


def lines(measurement: dict[str, Any]) -> list[str]:
    """What to say of a measurement."""
    on_ranks, on_threads = (1e3 * measurement[name] for name in ("step_on_ranks", "step_on_threads"))
    least, median = (1e6 * measurement[name] for name in ("exchange", "exchange_median"))
    return [
        f"{measurement['nodes']} nodes on {measurement['ranks']} ranks: {on_ranks:.2f} ms a step, on as many threads"
        f" {on_threads:.2f} ms ({measurement['speed_of_threads']:.2f} of their speed)",
        f"exchange {least:.0f} us at least, {median:.0f} us median, {measurement['exchange_share']:.1%} of a step;"
        f" the same bits: {measurement['same_bits']}",
        "memory at most, of each rank, MB: " + ", ".join(f"{memory:.0f}" for memory in measurement["memory"]),
    ]


def main() -> int:
    """Measure on all ranks of mpiexec; rank 0 tells."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--nodes", type=int, default=400_000)
    options.add_argument("-o", "--output", type=Path)
    options.add_argument("--memory", action="store_true")
    options.add_argument("--fick", action="store_true")
    args, ranks = options.parse_args(), team()
    large_arrays_apart()
    if ranks is not None and ranks.rank > 0:
        return ranks.serve()
    if args.memory:
        print(json.dumps(memory_of_a_run(ranks, (spreading if args.fick else square)(args.nodes))), flush=True)
        if ranks is not None:
            ranks.end(0)
        return 0
    if ranks is None:
        print("found one process, expected ranks: mpiexec -n 2 python -m benchmarks.ranks", file=sys.stderr)
        return 2
    measurement = measured(ranks, args.nodes)
    print("\n".join(lines(measurement)))
    if args.output is not None:
        args.output.write_text(json.dumps(measurement, indent=2) + "\n", encoding="utf-8")
    ranks.end(0)
    return 0


if __name__ == "__main__":
    sys.exit(main())
