"""What runs have to endure, in parts that each say what they tried and what fell; see `benchmarks.endurance`."""

from __future__ import annotations

import dataclasses
import json
import resource
import signal
import sys
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np

from benchmarks.corrupted import COUNT, batches
from benchmarks.kills import compiler, contents, forked, module_of_tests, trials
from benchmarks.kinds_of_run import KINDS
from benchmarks.models import with_run
from pdsolve.results import ResultsError, StateKind, remove, state_of
from pdsolve.run.simulation import Progress, resume, simulate

FORGED, BATCH, SEED = 320, 8, 1  # cases that are forged; of them in one process; of their random numbers
KILLS, EVERY = 500, 20  # runs that are to be ended; calls from one to the next


class Part(NamedTuple):
    """What became of a part."""

    tried: int
    of: int  # that were to be tried
    lost: int = 0
    traces: int = 0
    wrong: int = 0
    note: str = ""  # what was found, and what did not fit


Until = Callable[[float], bool]  # whether there is time left for something that takes so many seconds


def kills(folder: Path, until: Until) -> Part:
    """Runs of all kinds, ended at every 20th call that changes a file; every kind anew, and going on with another."""
    if compiler() is None:
        return Part(0, KILLS, note="found no C compiler, or not Linux")
    jobs = [(kind, resumed) for kind in KINDS for resumed in (False, True)]
    ended, died = [], 0
    try:
        for trial in trials(jobs, folder, EVERY, left(until)):
            ended.append(trial)
    except RuntimeError as error:
        print(error, file=sys.stderr, flush=True)
        died = 1
    bad = [trial for trial in ended if trial.fault]
    for trial in bad[:10]:
        print(trial, file=sys.stderr, flush=True)
    met = {(trial.kind, trial.resumed) for trial in ended}
    missing = [f"{kind}, resumed" if resumed else kind for kind, resumed in jobs if (kind, resumed) not in met]
    states = ", ".join(f"{sum(trial.state == kind.name for trial in ended)} {kind.name.lower()}" for kind in StateKind)
    unmet = f"; no time for {', '.join(missing)}" if missing else ""
    note = f"{len(met)} of {len(jobs)} kinds, resumed ones included; left {states}{unmet}"
    traces = sum(trial.trace for trial in bad)
    return Part(len(ended), max(KILLS, len(ended)), len(bad) - traces, traces + died, 0, note)


def left(until: Until) -> float:
    """Seconds that are left, to some."""
    seconds = 1.0
    while until(seconds) and seconds < 3600:
        seconds *= 1.2
    return seconds / 1.2


def corruptions(folder: Path, until: Until) -> Part:
    """Files of each kind, something of them changed: refused in a line, or as if nothing were."""
    every = list(batches(folder, until))
    for batch in every:
        for note in (*batch.fell, *batch.wrong):
            print(f"{batch.kind}: {note}", file=sys.stderr, flush=True)
    tried = Counter[str]()
    for batch in every:
        tried[batch.kind] += batch.tried
    note = ", ".join(f"{count} {kind}" for kind, count in tried.items())
    fell, wrong = (sum(len(getattr(batch, kind)) for batch in every) for kind in ("fell", "wrong"))
    return Part(tried.total(), COUNT * max(len(tried), 1), 0, fell, wrong, note or "no time")


def forgeries(folder: Path, until: Until) -> Part:
    """Forged files beside databases, tables and folders of studies: one line or an answer, and no file of the user
    touched; see `tests/forged_side_files.py`."""
    beside = module_of_tests("forged_side_files")
    tried = Counter[str]()
    lost = traces = 0
    (folder / "sound").mkdir()
    beside.prepare(folder / "sound")
    for first in range(0, FORGED, BATCH):
        if not until(20.0):
            break
        answer, code = forked(
            lambda first=first: json.dumps(  # type: ignore[misc]
                [(case["intact"], f"{case['file']}: {case['command']}: {case['wrong'][-300:]}") for case in
                 beside.forged_cases(folder, SEED, BATCH, first)][:5]
            )
        )  # fmt: skip
        failures = [["True", f"from {first} on: ended with {code} {answer.strip()}"]] if code else json.loads(answer)
        for intact, note in failures:
            print(note, file=sys.stderr, flush=True)
            lost, traces = lost + (intact == "False"), traces + (intact == "True")
        tried.update(beside.TURNS[number % len(beside.TURNS)] for number in range(first, first + BATCH))
    note = ", ".join(f"{count} {kind}" for kind, count in tried.items()) or "no time"
    return Part(tried.total(), FORGED, lost, traces, 0, note)


def full_disks(folder: Path, until: Until) -> Part:
    """A file that may not grow beyond a limit: the run ends in one line, and goes on to the same end with more room."""
    model, options = KINDS["bonds"]()
    whole, path = folder / "whole.sqlite", folder / "full.sqlite"
    simulate(model, whole, options).close()
    expected, size, tried, lost, traces, count = contents(whole), whole.stat().st_size, 0, 0, 0, 20

    def limited(most: int) -> str:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
        with suppress(ResultsError, OSError):
            simulate(model, path, options).close()
            return "finished"
        return "refused"

    for number in range(1, count + 1):
        if not until(3.0):
            break
        remove(path)
        _, code = forked(lambda most=size * number // count: limited(most))  # type: ignore[misc]
        tried, traces = tried + 1, traces + bool(code)
        if state_of(path).kind in (StateKind.NONE, StateKind.EMPTY):
            simulate(model, path, options).close()
        else:
            resume(path).close()
        lost += contents(path) != expected
    return Part(tried, count, lost, traces, 0, "by the process's limit of the size of a file")


def many_frames(folder: Path, until: Until) -> Part:
    """2000 frames: each takes as long as the first, and all are read."""
    model, options = KINDS["bonds"]()
    times: list[float] = []
    path = folder / "frames.sqlite"
    frames = 2000
    if not until(30.0):
        return Part(0, frames, note="no time")

    def watch(_: Progress) -> bool:
        times.append(time.perf_counter())
        return not until(2.0)

    with simulate(with_run(model, steps=frames, every=1, ledger=1), path, options, watch) as results:
        steps = results.frames()[0]
        results.verify()
    longer = np.diff(times)
    part = max(len(longer) // 10, 1)
    grown = np.median(longer[-part:]) / max(np.median(longer[:part]), 1e-9)
    note = f"{path.stat().st_size / 1e6:.0f} MB; a look in the last tenth takes {grown:.2f} times that in the first"
    return Part(len(steps) - 1, frames, note=note)


def order(folder: Path, until: Until) -> Part:
    """The nodes of a model in another order: the same fields by id, but for round-off."""
    worst, tried, wrong = 0.0, 0, 0
    kinds = ("bonds", "bonds, thesis", "bonds, listed", "ordinary", "correspondence", "micropolar", "body")
    for kind in kinds:
        if not until(5.0):
            break
        model, options = KINDS[kind]()
        model = with_run(model, steps=5, every=5, ledger=5)
        places = np.random.default_rng(3).permutation(len(model.grid))
        grid = model.grid
        names = ("ids", "position", "delta", "border", "hole_id", "areas")
        turned = {name: getattr(grid, name)[places] for name in names}
        reordered = dataclasses.replace(model, grid=dataclasses.replace(grid, **turned))
        with simulate(model, None, options) as usual, simulate(reordered, None, options) as mixed:
            fields = [results.field("uy", 5)[np.argsort(results.nodes(5).ids)] for results in (usual, mixed)]
        worst = max(worst, float(np.abs(fields[0] - fields[1]).max() / np.abs(fields[0]).max()))
        tried, wrong = tried + 1, wrong + (worst > 1e-5)
    note = f"after 5 steps displacements differ by {worst:.1e} of the largest" if tried else "no time"
    return Part(tried, len(kinds), 0, 0, wrong, note)
