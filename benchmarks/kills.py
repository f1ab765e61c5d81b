"""Runs that are ended at the n-th call that changes one of their files: nothing of them may be lost.

A process is started with `kills.c` loaded before all else, solves a model of some kind once, and then again and again
in children, each of which ends (SIGKILL) at another write, truncation, synchronisation, removal or new file; every
other one half way through what it writes. What is left is read, gone on with or begun anew as its state says, and
compared with what a run left alone has written. Linux with a C compiler.
"""

from __future__ import annotations

import ctypes
import importlib
import json
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from pdsolve.model import Model

ROOT = Path(__file__).parent.parent
OWN = ("wall_time", "created", "provenance", "summary", "threads", "kernel")  # keys of meta that say how a run went
STOP = 0.5  # of its steps: where a run is stopped that is killed while it goes on


class Trial(NamedTuple):
    """What became of a run that was ended."""

    kind: str
    resumed: bool  # whether it was going on with another
    call: int  # at which it was ended
    of: int  # calls of a run that is left alone
    state: str  # in which it was left
    fault: str  # what is wrong; empty where the run came to the same end
    trace: bool = False  # whether that is an error nobody expects


def contents(path: Path) -> dict[str, list[tuple[object, ...]]]:
    """The rows of each table, where they are, but for what says when and how a run went."""
    from pdsolve.results.schema import TABLES

    with closing(sqlite3.connect(path)) as connection:
        rows = {table: connection.execute(f"SELECT rowid, * FROM {table}").fetchall() for table in TABLES}
    rows["meta"] = sorted(row[1:] for row in rows["meta"] if row[1] not in OWN)
    rows["checkpoint"] = sorted(row[1:] for row in rows["checkpoint"])
    rows["checksum"] = [row for row in rows["checksum"] if row[1] != "meta"]
    return rows


def module_of_tests(name: str) -> ModuleType:
    """A module of tests/, which is on no path of benchmarks."""
    if str(ROOT / "tests") not in sys.path:
        sys.path.append(str(ROOT / "tests"))
    return importlib.import_module(name)


def compiler() -> str | None:
    """A C compiler, where processes can be ended by its library; None elsewhere."""
    return (shutil.which("cc") or shutil.which("gcc")) if sys.platform == "linux" else None


def trials(jobs: Sequence[tuple[str, bool]], folder: Path, every: int = 1, seconds: float = 3600.0) -> Iterator[Trial]:
    """End runs of kinds, begun or resumed, at each `every`-th call, in a new folder in `folder`: all jobs in turns.

    Of each job from the last call on; but where calls are left out in any order, so that a few of them are of all.
    """
    library = folder / "kills.so"
    if not library.exists():
        source = str(ROOT / "benchmarks" / "kills.c")
        words = [str(compiler()), "-O1", "-shared", "-fPIC", "-o", str(library), source, "-ldl"]
        subprocess.run(words, check=True)
    words = [sys.executable, "-m", "benchmarks.kills", str(folder), str(every), str(seconds), json.dumps(jobs)]
    variables = os.environ | {"LD_PRELOAD": str(library)}
    with subprocess.Popen(words, cwd=ROOT, env=variables, stdout=subprocess.PIPE, text=True) as child:
        assert child.stdout is not None
        try:
            for line in child.stdout:
                yield Trial(*json.loads(line))
        except GeneratorExit:  # enough of them
            child.kill()
            raise
    if child.returncode:
        raise RuntimeError(f"the process that ends runs has itself ended with {child.returncode}")


class _Ended:
    """In the process with the library: runs that are ended, and what becomes of them."""

    def __init__(self, kind: str, folder: Path, resumed: bool) -> None:
        from benchmarks.kinds_of_run import KINDS

        self.kind, self.folder, self.resumed = kind, folder, resumed
        self.model, self.options = KINDS[kind]()
        self.library = ctypes.CDLL(None)
        self.library.kills_arm.argtypes = [ctypes.c_char_p, ctypes.c_long, ctypes.c_int]
        self.library.kills_counted.restype = ctypes.c_long
        self.whole, self.half = folder / "whole.sqlite", folder / "half.sqlite"
        self._solve(self.model, self.whole)
        self.expected = contents(self.whole)
        if resumed:
            from pdsolve.run.simulation import simulate

            end = int(STOP * self.model.settings.run.steps)
            simulate(self.model, self.half, self.options, lambda progress: progress.step >= end).close()

    def _solve(self, model: Model, path: Path) -> None:
        from pdsolve.run.simulation import simulate

        simulate(model, path, self.options).close()

    def _run(self, path: Path) -> None:
        from pdsolve.run.simulation import resume

        if self.resumed:
            resume(path).close()
        else:
            self._solve(self.model, path)

    def calls(self) -> int:
        """How many calls a run makes."""
        path = self._begun("count")
        self.library.kills_arm(str(path.parent).encode(), 0, 0)
        self._run(path)
        calls = int(self.library.kills_counted())
        self.library.kills_arm(b"", 0, 0)
        shutil.rmtree(path.parent)
        return calls

    def _begun(self, name: str) -> Path:
        path = self.folder / name / "x.sqlite"
        path.parent.mkdir()
        if self.resumed:
            shutil.copy(self.half, path)
        return path

    def trial(self, call: int, of: int) -> Trial | None:
        """End a run at a call, and go on with it; None where it makes fewer calls this time.

        Of frames that have to wait several are written at once.
        """
        path = self._begun(str(call))

        def ended() -> str:
            self.library.kills_arm(str(path.parent).encode(), call, call % 2)
            self._run(path)
            return ""

        _, code = forked(ended)
        if code != -signal.SIGKILL:
            shutil.rmtree(path.parent)
            fault = f"ended with {code}, expected SIGKILL"
            return Trial(self.kind, self.resumed, call, of, "", fault, True) if code else None
        answer, code = forked(lambda: "\n".join(self._went_on(path)))
        state, _, fault = answer.partition("\n")
        shutil.rmtree(path.parent)
        if code:
            return Trial(self.kind, self.resumed, call, of, state, fault or f"ended with {code}", True)
        return Trial(self.kind, self.resumed, call, of, state, fault)

    def _went_on(self, path: Path) -> tuple[str, str]:
        """The state of a run that was ended, and what is wrong with how it goes on."""
        from pdsolve.results import Results, ResultsError, StateKind, state_of
        from pdsolve.run.simulation import resume

        state = state_of(path)
        try:
            if state.kind in (StateKind.NONE, StateKind.EMPTY):
                self._solve(self.model, path)
            else:
                with Results.open(path) as results:
                    results.verify()
                    steps, _ = results.frames()
                    if len(steps):
                        results.field(results.stored(int(steps[-1]))[0], int(steps[-1]))
                resume(path).close()
        except ResultsError as error:
            return state.kind.name, str(error)
        left = sorted(file.name for file in path.parent.iterdir())
        if left != [path.name]:
            return state.kind.name, f"left {', '.join(left)}"
        rows = contents(path)
        different = [table for table in self.expected if rows[table] != self.expected[table]]
        return state.kind.name, f"other {', '.join(different)}" if different else ""


def forked(work: Callable[[], str]) -> tuple[str, int]:
    """What `work` answers in a child, and its exit code; that of a traceback is 1."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        code = 0
        try:
            answer = work()
        except BaseException:
            answer, code = "\n" + traceback.format_exc().strip().splitlines()[-1], 1
        os.write(writing, answer.encode()[:4000])
        os._exit(code)
    os.close(writing)
    with open(reading, "rb") as pipe:
        answer = pipe.read().decode(errors="replace")
    return answer, os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])


def _ended(kind: str, resumed: bool, folder: Path, every: int) -> Iterator[Trial]:
    """The trials of a job."""
    folder.mkdir()
    ended = _Ended(kind, folder, resumed)
    of = ended.calls()
    calls = list(range(of, 0, -every))
    if every > 1:
        random.Random(kind).shuffle(calls)
    for call in calls:
        trial = ended.trial(call, of)
        if trial is not None:
            yield trial


def main(folder: str, every: str, seconds: str, jobs: str) -> None:
    """Print a line of JSON for each run that is ended."""
    warnings.simplefilter("ignore")
    until = time.monotonic() + float(seconds)
    with tempfile.TemporaryDirectory(dir=folder, prefix="ended-") as scratch:
        under_way = deque(
            _ended(kind, resumed, Path(scratch) / str(number), int(every))
            for number, (kind, resumed) in enumerate(json.loads(jobs))
        )
        while under_way and time.monotonic() < until:
            trial = next(under_way[0], None)
            if trial is None:
                under_way.popleft()
            else:
                print(json.dumps(trial), flush=True)
                under_way.rotate(-1)


if __name__ == "__main__":
    main(*sys.argv[1:])
