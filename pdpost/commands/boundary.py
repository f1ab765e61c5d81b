"""The motion of the border of a part, for a model of this part alone."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from pdmesh import commandline
from pdpost.commands.shared import add_results, lengths

if TYPE_CHECKING:
    from pdpost.commands.shared import Commands


def add(commands: Commands) -> None:
    """Put `boundary` on the command line."""
    boundary = commands.add_parser(
        "boundary",
        help="write the motion around a box as CSV, for a submodel",
        description="Write the displacements of the nodes around the border of a box at all frames as CSV, which a"
        " smaller model prescribes on its rim (x = FILE.csv:ux).",
    )
    add_results(boundary)
    commandline.add_common_options(boundary, "the CSV file (default: the results' name with .boundary.csv)")
    boundary.add_argument(
        "--box",
        required=True,
        type=lambda text: lengths(text, 4, 6),
        metavar="X0,Y0,X1,Y1",
        help="outline of the smaller model, m, or such as 5,5,20,20mm; in a body six numbers",
    )
    boundary.add_argument(
        "--depth",
        required=True,
        type=lambda text: lengths(text, 1, 1),
        metavar="LENGTH",
        help="depth of its rim, m, or such as 3mm: the horizon of the smaller model",
    )
    boundary.set_defaults(run=_boundary)


def _boundary(args: argparse.Namespace) -> int:
    from pdmesh.files import write_atomically
    from pdsolve.measures.boundary_motion import boundary_motion
    from pdsolve.results import Results

    path = commandline.output_path(args.output, args.results, ".boundary.csv", args.force)
    with Results.open(args.results) as results:
        motion = boundary_motion(results, args.box, *args.depth)
    write_atomically(path, motion.csv.encode())
    nodes, times = len(motion.position), len(motion.times)
    line = f"{path}: {nodes} nodes, {times} times to {motion.times[-1]:.4g} s"
    commandline.report({"output": str(path), "nodes": nodes, "times": times}, [line], args)
    return commandline.OK
