"""What several commands ask for: results, a frame."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pdsolve.results import Results

    Commands = argparse._SubParsersAction[argparse.ArgumentParser]


def add_results(command: argparse.ArgumentParser) -> None:
    """The database that every command reads."""
    command.add_argument("results", type=Path, help="a database written by pdsolve")


def add_frame(command: argparse.ArgumentParser) -> None:
    """Which frame: --frame or --time."""
    which = command.add_mutually_exclusive_group()
    which.add_argument("--frame", type=int, default=-1, metavar="N", help="frame, from 0; from the end if negative")
    which.add_argument("--time", type=float, metavar="S", help="the frame nearest to this time, in seconds")


def chosen_frame(results: Results, args: argparse.Namespace) -> tuple[int, float]:
    """Step and time (s) of the frame asked for. Raises ResultsError, saying which there are."""
    import numpy as np

    from pdsolve.results import ResultsError

    steps, times = results.frames()
    count = len(steps)
    if not count:
        raise ResultsError(f"{args.results}: found no frame yet, expected at least one")
    if args.time is not None:
        if not np.isfinite(args.time):
            raise ResultsError(f"--time: found {args.time}, expected seconds, {times[0]:g} to {times[-1]:g}")
        at = int(np.abs(times - args.time).argmin())
    elif -count <= args.frame < count:
        at = args.frame
    else:
        raise ResultsError(f"{args.results}: found no frame {args.frame}, expected 0 to {count - 1} or -{count} to -1")
    return int(steps[at]), float(times[at])
