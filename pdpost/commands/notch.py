"""Write a run's cracks of particles as pre-cracks of another run."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from pdmesh import commandline
from pdpost.commands import number_options
from pdpost.commands.shared import add_csv, add_frame, add_results, check_csv, chosen_frame

if TYPE_CHECKING:
    from pdpost.commands.shared import Commands


def add(commands: Commands) -> None:
    """Put `notch` on the command line."""
    notch = commands.add_parser(
        "notch",
        help="write the model of a run with its grown cracks as the notch, to solve it again",
        description="Write the grid file of a run with --cracks particles, with its cracks at a frame as the notch. The"
        " cracked plate can then be solved under other loads. --csv and --json give the cracks as polylines.",
    )
    add_results(notch)
    commandline.add_common_options(
        notch,
        output="the grid file (default: the results' name with .notch.json; none with --json or --csv alone)",
        assignment="none is known here",
    )
    add_frame(notch)
    add_csv(notch)
    notch.set_defaults(run=_notch)


def _notch(args: argparse.Namespace) -> int:
    import msgspec

    from pdmesh.model.crack_particles import arms, polylines, until
    from pdmesh.model.document import read_document, write_file
    from pdsolve.results import Results, ResultsError

    if args.assignments:
        raise commandline.UsageError(f"--set {args.assignments[0][0]}: found a setting, notch has none")
    none = args.output is None and (args.json or args.csv is not None)
    path = None if none else commandline.output_path(args.output, args.results, ".notch.json", args.force)
    check_csv(args, path)
    with Results.open(args.results) as results:
        step, time = chosen_frame(results, args)
        particles = until(results.particles(), step)
        if not len(particles.place):
            raise ResultsError(f"{args.results}: found no particles, expected a run with --cracks particles")
        document = read_document(results.model(), results.name)
    segments, lines = arms(particles), polylines(particles)
    if path is not None:
        notch = tuple((x0, y0, 0.0, x1, y1, 0.0) for x0, y0, x1, y1 in segments.tolist())
        write_file(msgspec.structs.replace(document, notch=notch), path)
    rows = ((number, *place) for number, line in enumerate(lines) for place in line.tolist())
    written = [] if path is None else [f"{path}: the grid file, with {len(segments)} segments of cracks"]
    words = [*written, f"{len(lines)} polylines of {len(particles.place)} particles, at {time:.4g} s"]
    result = {"output": None if path is None else str(path), "step": step, "time": time, "lines": lines}
    return number_options.deliver(args, result, words, ("line", "x, m", "y, m"), rows, None)
