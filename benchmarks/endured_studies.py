"""Studies whose processes are killed again and again; see `benchmarks.endurance`."""

from __future__ import annotations

import os
import random
import signal
import socket
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from benchmarks.endured import Part, Until
from benchmarks.kills import ROOT, contents
from benchmarks.kinds_of_run import KINDS
from benchmarks.models import with_run
from pdmesh.model.document import write_file
from pdmesh.model.node_grid import document_of
from pdsolve.model import read_model
from pdsolve.run.simulation import simulate
from pdsolve.study.table import FINISHED, Table

RUNS, FEWER = 500, 40  # of a study by processes of its own; by those of a scheduler
SOON, LATE, STUCK = 10.0, 40.0, 240.0  # s from one kill to the next; in which nothing that goes on is at an end
LOOKED_AT = 10  # runs that are compared with ones that were left alone


class Study:
    """A study in a folder, and the process that solves it."""

    def __init__(self, folder: Path, runs: int, *words: str) -> None:
        model, _ = KINDS["bonds"]()
        run = with_run(model, steps=10, every=10, ledger=10)
        write_file(document_of(model.grid, run.settings), folder / "plate.json")
        values = ", ".join(f"{3 + number / 100:g}" for number in range(runs))
        (folder / "study.toml").write_text(f'drawing = "plate.json"\n[vary.model]\nmaterial.G0 = [{values}]\n')
        self.folder, self.table, self.runs = folder, folder / "study.sqlite", runs
        self.words, self.kills, self.traces, self.rows = words, Counter[str](), 0, b""

    def begin(self) -> subprocess.Popen[bytes]:
        """Begin it, or go on with it, as a user does."""
        words = [sys.executable, "-m", "pdsolve", "study", str(self.folder / "study.toml"), "-o", str(self.table)]
        with (self.folder / "stderr").open("wb") as stderr, (self.folder / "rows").open("wb") as rows:
            return subprocess.Popen(
                [*words, *self.words, "--json"], cwd=ROOT, stdout=rows, stderr=stderr, start_new_session=True
            )

    def ended(self, child: subprocess.Popen[bytes]) -> None:
        """What became of the process."""
        stderr = (self.folder / "stderr").read_bytes()
        if b"Traceback" in stderr:
            self.traces += 1
            print(stderr.decode(), file=sys.stderr, flush=True)
        self.rows = (self.folder / "rows").read_bytes() if child.returncode in (0, 1) else b""

    def part(self) -> Part:
        """What came of it; of some runs that are finished it is asked whether they are as if left alone."""
        by = ", ".join(f"{count} of {what}" for what, count in self.kills.items())
        if not self.table.exists():
            return Part(0, self.runs, traces=self.traces, note="no time")
        with Table.open(self.table) as table:
            rows = table.rows()
        states = Counter(row.status for row in rows)
        finished = [row for row in rows if row.status == FINISHED]
        wrong = 0
        for row in random.Random(3).sample(finished, min(LOOKED_AT, len(finished))):
            alone = self.folder / "alone.sqlite"
            values = [(name, str(value)) for name, value in row.values.items() if name == "material.G0"]
            simulate(read_model(self.folder / "plate.json", None, values), alone).close()
            wrong += contents(row.file) != contents(alone)
        over = bool(self.rows)
        note = f"kills: {by or 'none'}; {'all' if over else len(finished)} runs solved{'' if over else ', no time'}"
        return Part(states.total() - states["waiting"], self.runs, states["failed"], self.traces, wrong, note)


def _worker(process: int, dice: random.Random) -> None:
    """Kill one of the processes that a process has begun."""
    children = Path(f"/proc/{process}/task/{process}/children").read_text().split()
    if children:
        os.kill(int(dice.choice(children)), signal.SIGKILL)


def _alone(process: int, _: random.Random) -> None:
    """Kill who writes the table; the workers are left to themselves, and are to stop."""
    os.kill(process, signal.SIGKILL)


def _all(process: int, _: random.Random) -> None:
    os.killpg(process, signal.SIGKILL)


VICTIMS: dict[str, Callable[[int, random.Random], None]] = {
    "a worker": _worker,
    "who keeps the table": _alone,
    "all": _all,
}


def studies(folder: Path, until: Until) -> Part:
    """A study of 500 small runs: a worker, who keeps the table, or all are killed; it goes on until all are solved."""
    study, dice, turn = Study(folder, RUNS, "--workers", "2"), random.Random(2), 0
    while until(20.0) and not study.rows:
        child = study.begin()
        while child.poll() is None and until(10.0):
            with suppress(subprocess.TimeoutExpired):
                child.wait(dice.uniform(SOON, LATE))
            if child.poll() is None:
                name = list(VICTIMS)[turn % len(VICTIMS)]
                with suppress(ProcessLookupError, FileNotFoundError):
                    VICTIMS[name](child.pid, dice)
                    study.kills[name] += 1
                turn += 1
        if child.poll() is None:
            child.send_signal(signal.SIGINT)
        child.wait()
        study.ended(child)
    return study.part()


def scheduled(folder: Path, until: Until) -> Part:
    """A study by the workers of a scheduler: a worker, who keeps the table, or the scheduler is killed."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    study = Study(folder, FEWER, "--scheduler", address)

    def dask(*words: str) -> subprocess.Popen[bytes]:
        whole = [sys.executable, "-m", "dask", *words, "--host", "127.0.0.1", "--no-dashboard"]
        return subprocess.Popen(whole, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def worker() -> subprocess.Popen[bytes]:
        return dask("worker", address, "--nthreads", "1", "--no-nanny", "--death-timeout", "60")

    def begun() -> dict[str, subprocess.Popen[bytes]]:
        return {"the scheduler": dask("scheduler", "--port", str(port)), "a worker": worker()}

    lost, workers, dice = 0, begun(), random.Random(4)
    try:
        while until(60.0) and not study.rows:
            child = study.begin()
            victims = workers | {"who keeps the table": child}
            name = sorted(victims)[study.kills.total() % len(victims)]
            if _goes_on(child, until, dice.uniform(SOON, LATE)):
                victims[name].kill()
                study.kills[name] += 1
            if name == "a worker":
                _end(workers.pop(name))
                workers[name] = worker()
            lost += not _ends(study, child, until)
            study.ended(child)
            if name == "the scheduler":
                _end(*workers.values())
                workers = begun()
    finally:
        _end(*workers.values())
    part = study.part()
    return part._replace(lost=part.lost + lost)


def _goes_on(child: subprocess.Popen[bytes], until: Until, seconds: float) -> bool:
    """Whether a process goes on for so many seconds."""
    end = time.monotonic() + seconds
    while child.poll() is None and time.monotonic() < end and until(30.0):
        time.sleep(0.2)
    return child.poll() is None


def _ends(study: Study, child: subprocess.Popen[bytes], until: Until) -> bool:
    """Whether a process comes to its end, or at least on with its runs as long as there is time."""
    files, since = -1, time.monotonic()
    while child.poll() is None:
        time.sleep(0.5)
        if not until(20.0):
            child.send_signal(signal.SIGINT)
            child.wait()
        elif (count := len(list(study.table.with_suffix(".runs").glob("*.sqlite")))) != files:
            files, since = count, time.monotonic()
        elif time.monotonic() - since > STUCK:
            child.kill()
            child.wait()
            return False
    return True


def _end(*processes: subprocess.Popen[bytes]) -> None:
    for process in processes:
        process.kill()
        process.wait()
