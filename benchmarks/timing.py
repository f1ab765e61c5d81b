"""Clocks, interleaved repeats, and processes that take turns."""

from __future__ import annotations

import contextlib
import json
import os
import resource
import subprocess
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any


def environment(**variables: str) -> dict[str, str]:
    """Variables for a process, with these of its own; Python keeps what it compiles, as on a user's machine."""
    return {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"} | variables


def user_time() -> float:
    """User time of this process, s."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_utime


def timed(work: Callable[[], Any], clock: Callable[[], float] = user_time) -> float:
    """Seconds that some work takes."""
    began = clock()
    work()
    return clock() - began


def least(measures: Mapping[str, Callable[[], float]], rounds: int) -> dict[str, float]:
    """The least of interleaved repeats of each measurement."""
    best = dict.fromkeys(measures, float("inf"))
    for _ in range(rounds):
        for name, measure in measures.items():
            best[name] = min(best[name], measure())
    return best


def least_of_steps(measures: Mapping[str, Callable[[int], float]], rounds: int, sample: float) -> dict[str, float]:
    """Seconds a step, the least of interleaved repeats that take `sample` s; a measurement takes so many steps."""
    steps = {}
    for name, measure in measures.items():
        measure(2)
        steps[name] = max(1, round(3 * sample / (measure(3) + 1e-6)))
    whole = least({name: partial(measure, steps[name]) for name, measure in measures.items()}, rounds)
    return {name: seconds / steps[name] for name, seconds in whole.items()}


class Served:
    """A process that answers each line of its stdin with one of JSON."""

    def __init__(self, words: list[str], folder: Path | None = None, **variables: str) -> None:
        self._process = subprocess.Popen(
            words,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=environment(**variables),
            cwd=folder,
            text=True,
        )

    def ask(self, words: str) -> Any:
        """Its answer to a line. Raises RuntimeError where it has ended."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        with contextlib.suppress(BrokenPipeError):
            self._process.stdin.write(words + "\n")
            self._process.stdin.flush()
        answer = self._process.stdout.readline()
        if not answer:
            raise RuntimeError(f"'{words}' has no answer: the process ended with code {self._process.wait()}")
        return json.loads(answer)

    def close(self) -> None:
        """End it."""
        self._process.communicate()
