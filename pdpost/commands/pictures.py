"""Pictures of a field of the nodes."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from pdmesh import commandline
from pdpost.commands.shared import add_frame, add_results, chosen_frame

if TYPE_CHECKING:
    from pdpost.commands.shared import Commands


def add(commands: Commands) -> None:
    """Put a command for each field on the command line."""
    for name in ("damage", "energy", "displacement", "velocity", "acceleration"):
        _add_picture(commands, name)


def _add_picture(commands: Commands, name: str) -> None:
    picture = commands.add_parser(name, help=f"draw the {name} of a frame")
    add_results(picture)
    commandline.add_common_options(
        picture,
        output=f"the picture, in the format of its suffix (default: the results' name with .{name}.png)",
        assignment="override a matplotlib setting, such as savefig.dpi=300 or font.size=11",
    )
    add_frame(picture)
    picture.set_defaults(run=_picture, picture=name)


def _picture(args: argparse.Namespace) -> int:
    import matplotlib

    from pdpost import figures
    from pdsolve.results import Results

    name = args.picture
    path = commandline.output_path(args.output, args.results, f".{name}.png", args.force)
    style = figures.styled(dict(args.assignments))
    with Results.open(args.results) as results, matplotlib.rc_context(rc=style):
        step, time = chosen_frame(results, args)
        values = figures.PICTURES[name].values(results, step)
        figures.save(figures.draw(results, name, step), path)
    largest, unit = float(values.max()), figures.PICTURES[name].unit
    result = {"output": str(path), "step": step, "time": time, "largest": largest, "unit": unit}
    commandline.report(result, [f"{path}: {name} at {time * 1e6:.4g} us, up to {largest:.4g} {unit}".rstrip()], args)
    return commandline.OK
