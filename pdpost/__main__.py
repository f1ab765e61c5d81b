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
    for name in ("damage", "energy", "displacement", "velocity", "acceleration"):
        _add_picture(commands, name)
    crack = commands.add_parser("crack", help="say when and where the crack started, branched, split the plate")
    crack.add_argument("results", type=Path, help="a database written by pdsolve")
    crack.add_argument("--along", choices=("right", "left", "up", "down"), default="right", help="where the crack runs")
    crack.add_argument("--step", type=int, metavar="N", help="measure directions after this step (default: the last)")
    commandline.add_common_options(
        crack,
        output="write the result as JSON to this file as well",
        assignment="override a definition: cracked=0.35 (damage of a cracked node)",
    )
    crack.set_defaults(run=_crack)
    return program


def _add_picture(commands: argparse._SubParsersAction[argparse.ArgumentParser], name: str) -> None:
    picture = commands.add_parser(name, help=f"draw the {name} of a frame")
    picture.add_argument("results", type=Path, help="a database written by pdsolve")
    commandline.add_common_options(
        picture,
        output=f"the picture, in the format of its suffix (default: the results' name with .{name}.png)",
        assignment="override a matplotlib setting, such as savefig.dpi=300 or font.size=11",
    )
    which = picture.add_mutually_exclusive_group()
    which.add_argument("--frame", type=int, default=-1, metavar="N", help="frame, from 0; from the end if negative")
    which.add_argument("--time", type=float, metavar="S", help="draw the frame nearest to this time, in seconds")
    picture.set_defaults(run=_picture, picture=name)


def _picture(args: argparse.Namespace) -> int:
    import matplotlib

    from pdpost import figures
    from pdsolve.results import Results

    name = args.picture
    path = commandline.output_path(args.output, args.results, f".{name}.png", args.force)
    style = figures.styled(dict(args.assignments))
    with Results.open(args.results) as results, matplotlib.rc_context(rc=style):
        step, time = _chosen_frame(results, args)
        values = figures.PICTURES[name].values(results, step)
        figures.save(figures.draw(results, name, step), path)
    largest, unit = float(values.max()), figures.PICTURES[name].unit
    result = {"output": str(path), "step": step, "time": time, "largest": largest, "unit": unit}
    commandline.report(result, [f"{path}: {name} at {time * 1e6:.4g} us, up to {largest:.4g} {unit}".rstrip()], args)
    return commandline.OK


def _crack(args: argparse.Namespace) -> int:
    import dataclasses
    import json

    from pdmesh.files import write_atomically
    from pdpost import cracks
    from pdsolve.results import Results

    path = None if args.output is None else commandline.output_path(args.output, args.results, ".json", args.force)
    threshold = _threshold(args)
    with Results.open(args.results) as results:
        growth = cracks.growth(results, cracks.DIRECTIONS[args.along], threshold)
        last = int(results.history()["step"][-1])
        step = last if args.step is None else args.step
        if not 0 <= step <= last:
            raise commandline.UsageError(f"--step: found {step}, expected 0 to {last}")
        directions = cracks.directions(results, step, threshold)
    found = {**dataclasses.asdict(growth), "directions": [dataclasses.asdict(way) for way in directions]}
    lines = [
        f"{name.replace('_', ' ')}: step {event.step}, {event.time * 1e6:.4g} us"
        + ("" if event.along is None else f", {event.along * 1e3:.4g} mm {args.along}")
        for name in ("first_break", "start", "branching", "split")
        if (event := getattr(growth, name)) is not None
    ]
    lines += [f"from ({way.tip[0]:g}, {way.tip[1]:g}) m: {way.angle:+.1f} degrees from the notch" for way in directions]
    if path is not None:
        write_atomically(path, json.dumps(found, indent=2).encode() + b"\n")
    commandline.report(found, lines or ["nothing broke"], args)
    return commandline.OK


def _threshold(args: argparse.Namespace) -> float:
    from pdpost.cracks import CRACKED

    threshold = CRACKED
    for name, value in args.assignments:
        try:
            threshold = float(value)
        except ValueError:
            threshold = -1.0
        if name != "cracked" or not 0 <= threshold < 1:
            raise commandline.UsageError(f"--set {name}={value}: expected cracked= and a damage from 0 to below 1")
    return threshold


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
