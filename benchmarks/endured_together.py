"""What runs have to endure that several processes share, and very large ones; see `benchmarks.endurance`."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

from benchmarks.endured import Part, Until
from benchmarks.kills import ROOT, contents
from benchmarks.kinds_of_run import ALONE, KINDS, lattice
from benchmarks.models import with_run
from pdmesh.model.document import write_file
from pdmesh.model.node_grid import document_of
from pdsolve.results import Results, ResultsError, StateKind, state_of
from pdsolve.run.simulation import simulate

SIDE = 1415  # nodes: of a plate of two million
WRITTEN = 30  # s that it goes on after its first frame


def large(folder: Path, until: Until) -> Part:
    """2 million nodes, stopped by Ctrl-C: memory over time, and a checkpoint."""
    if not until(400.0):
        return Part(0, 1, note="no time")
    model, _ = KINDS["bonds"]()
    path, output = folder / "large.json", folder / "large.sqlite"
    settings = with_run(model, time_step=None, steps=100_000, every=50, ledger=50).settings
    write_file(document_of(lattice(SIDE, SIDE), settings), path)
    with subprocess.Popen([sys.executable, "-m", "pdsolve", str(path), "-o", str(output), "-q"], cwd=ROOT) as child:
        used = list(_memory(child.pid, output, lambda: child.poll() is None and until(60.0)))
        began = time.monotonic()
        child.send_signal(signal.SIGINT)
        code = child.wait()
    heard, begun, state, late = time.monotonic() - began, output.exists(), state_of(output), used[-WRITTEN:]
    note = (
        f"{max(used) / 1e9:.2f} GB at most, in the end {late[-1] / late[0]:.2f} times what it is at the first frame;"
        f" Ctrl-C heard in {heard:.1f} s; {state.message}"
    )
    right = code == 130 and (state.kind is StateKind.STOPPED or not begun)
    return Part(int(begun), 1, int(not right), note=note)


def _memory(process: int, output: Path, goes_on: Callable[[], bool]) -> Iterator[int]:
    """Bytes of a process every second, until it has written for a while."""
    written = 0
    while goes_on() and written < WRITTEN:
        time.sleep(1.0)
        with suppress(OSError, StopIteration):
            status = Path(f"/proc/{process}/status").read_text()
            yield 1024 * int(next(line.split()[1] for line in status.splitlines() if line.startswith("VmRSS")))
        written += output.exists()


def readers(folder: Path, until: Until) -> Part:
    """50 processes that read a database again and again while a run writes to it; it comes to the same end."""
    model, options = KINDS["bonds"]()
    model = with_run(model, steps=400, every=4, ledger=4)
    whole, path = folder / "alone.sqlite", folder / "read.sqlite"
    simulate(model, whole, options).close()
    children = []
    for _ in range(50):
        child = os.fork()
        if child == 0:
            os._exit(_read(path))
        children.append(child)
    simulate(model, path, options).close()
    codes = [os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) for child in children]
    lost = contents(path) != contents(whole)
    return Part(
        50,
        50,
        int(lost),
        sum(code == 1 for code in codes),
        sum(code == 2 for code in codes),
        "each until it is finished",
    )


def _read(path: Path) -> int:
    """Read until the run is finished: 0; 1 after an error that nobody expects, 2 where frames are fewer than before."""
    seen, end = 0, time.monotonic() + 300
    while time.monotonic() < end:
        try:
            with Results.open(path) as results:
                status, count = results.meta().get("status"), len(results.frames()[0])
            if count < seen:
                return 2
            seen = count
            if status == "finished":
                return 0
        except ResultsError:
            if path.exists() and seen:
                return 1
        except Exception:
            return 1
        time.sleep(0.05)
    return 1


def caches(folder: Path, until: Until) -> Part:
    """A compile cache of its own, filled by two processes at once: nothing is compiled again, results are the same."""
    if not until(150.0):
        return Part(0, 2, note="no time")
    model, _ = KINDS["bonds"]()
    grid, cache = folder / "plate.json", folder / "cache"
    write_file(document_of(model.grid, model.settings), grid)
    cache.mkdir(mode=0o700)

    def begun(name: str) -> subprocess.Popen[bytes]:
        words = [sys.executable, "-m", "pdsolve", str(grid), "-o", str(folder / name), "-q", "--threads", "1"]
        return subprocess.Popen(
            words, cwd=ROOT, env=os.environ | {"NUMBA_CACHE_DIR": str(cache)}, stderr=subprocess.PIPE
        )

    def compiled() -> dict[str, int]:
        return {str(file): file.stat().st_mtime_ns for file in cache.rglob("*.nb[ic]")}

    both = [begun("one.sqlite"), begun("two.sqlite")]
    errors = [child.communicate()[1] for child in both]
    after = compiled()
    third = begun("three.sqlite")
    errors.append(third.communicate()[1])
    again = {file for file, changed in compiled().items() if after.get(file) != changed}
    databases = [contents(folder / f"{name}.sqlite") for name in ("one", "two", "three")]
    usual = folder / "usual.sqlite"
    simulate(model, usual, ALONE).close()
    wrong = sum(database != contents(usual) for database in databases)
    traces = sum(b"Traceback" in error for error in errors)
    return Part(
        2,
        2,
        int(bool(again)),
        traces,
        wrong,
        f"{len(after)} files kept, {len(again)} compiled again by a third process",
    )
