"""The command `pdpost`: pictures and figures from a database of results."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from pdmesh import commandline

if TYPE_CHECKING:
    from pdsolve.results import Results


def parser() -> argparse.ArgumentParser:
    """The command line of pdpost."""
    program = commandline.program("pdpost", "Show what a peridynamic run has found.")
    commands = program.add_subparsers(dest="command", required=True, metavar="COMMAND")
    damage = commands.add_parser("damage", help="draw the damage of a frame")
    damage.add_argument("results", type=Path, help="a database written by pdsolve")
    commandline.add_common_options(
        damage,
        output="the picture, in the format of its suffix (default: the results' name with .damage.png)",
        assignment="override a matplotlib setting, such as savefig.dpi=300 or font.size=11",
    )
    which = damage.add_mutually_exclusive_group()
    which.add_argument(
        "--frame", type=int, default=-1, metavar="N", help="frame to draw, from 0; negative from the end"
    )
    which.add_argument("--time", type=float, metavar="S", help="draw the frame nearest to this time, in seconds")
    damage.set_defaults(run=_damage)
    return program


def _damage(args: argparse.Namespace) -> int:
    import matplotlib

    from pdpost import figures
    from pdsolve.results import Results

    path = commandline.output_path(args.output, args.results, ".damage.png", args.force)
    style = figures.styled(dict(args.assignments))
    with Results.open(args.results) as results, matplotlib.rc_context(rc=style):
        step, time = _chosen_frame(results, args)
        figures.save(figures.damage(results, step), path)
        values = results.field("damage", step)
    result = {"output": str(path), "step": step, "time": time, "largest_damage": float(values.max())}
    commandline.report(result, [f"{path}: damage at {time * 1e6:.4g} us, up to {values.max():.3f}"], args)
    return commandline.OK


def _chosen_frame(results: Results, args: argparse.Namespace) -> tuple[int, float]:
    """Step and time (s) of the frame asked for."""
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


def main(argv: Sequence[str] | None = None) -> int:
    """Run pdpost; returns its exit code."""
    args = parser().parse_args(argv)
    return commandline.run("pdpost", lambda: int(args.run(args)), _exits)


def _exits() -> dict[type[Exception], int]:
    from pdpost.figures import FigureError
    from pdsolve.results import ResultsError

    return dict.fromkeys((FigureError, ResultsError), commandline.BAD_INPUT)


if __name__ == "__main__":
    sys.exit(main())
