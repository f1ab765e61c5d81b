"""All that a database holds, to compare, and what is in it while a run goes on."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.kills import contents
from pdsolve.results import Results, ResultsError

__all__ = ["contents", "kill_when", "newest"]


def newest(path: Path, at_least: int) -> int:
    """The step of the newest frame of a file that a run writes to, waited for: it is written while the run goes on."""
    for _ in range(500):
        with Results.open(path) as results:
            step = int(results.frames()[0].max())
        if step >= at_least:
            break
        time.sleep(0.02)
    return step


def kill_when(met: Callable[[Results], bool], path: Path, words: list[str]) -> None:
    """Run Python with these words and kill -9 it as soon as the results it writes to `path` are so."""
    child = subprocess.Popen([sys.executable, *words])
    while child.poll() is None:
        time.sleep(0.01)
        try:
            with Results.open(path) as results:
                if met(results):
                    break
        except ResultsError:
            continue
    os.kill(child.pid, signal.SIGKILL)
    assert child.wait() == -signal.SIGKILL
