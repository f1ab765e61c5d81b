"""When and where the crack ran."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from pdmesh import commandline
from pdpost.commands.shared import add_results

if TYPE_CHECKING:
    from pdpost.commands.shared import Commands


def add(commands: Commands) -> None:
    """Put `crack` on the command line."""
    crack = commands.add_parser("crack", help="say when and where the crack started, branched, split the plate")
    add_results(crack)
    crack.add_argument("--along", choices=("right", "left", "up", "down"), default="right", help="where the crack runs")
    crack.add_argument("--step", type=int, metavar="N", help="measure directions after this step (default: the last)")
    commandline.add_common_options(
        crack,
        output="write the result as JSON to this file as well",
        assignment="override a definition: cracked=0.35 (damage of a cracked node)",
    )
    crack.set_defaults(run=_crack)


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
