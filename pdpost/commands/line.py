"""A field along a straight line."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from pdpost.commands import shared
from pdpost.commands.pictures import FIELDS
from pdpost.commands.shared import add_frame, chosen_frame, picture_path, place

if TYPE_CHECKING:
    from pdpost.commands.shared import Commands


def add(commands: Commands) -> None:
    """Put `line` on the command line."""
    line = shared.add_command(commands, "line", "draw a field along a straight line")
    for word, where in (("--from", "begins"), ("--to", "ends")):
        line.add_argument(
            word,
            dest=where,
            required=True,
            type=place,
            metavar="X,Y[,Z]",
            help=f"where the line {where}, m, or such as 5,20mm, of a body with z",
        )
    line.add_argument("--field", choices=FIELDS, default="displacement", help="field to draw (default: displacement)")
    line.add_argument(
        "--component",
        action="append",
        dest="components",
        metavar="NAME",
        help="component to draw, as in the command with the field's name; may be repeated (default: the first)",
    )
    add_frame(line)
    line.set_defaults(run=_line)


def _line(args: argparse.Namespace) -> int:
    import numpy as np

    from pdsolve.measures import fields, lines
    from pdsolve.measures.frame_steps import time_text
    from pdsolve.results import Results

    path = picture_path(args, ".line.png")
    field = fields.FIELDS[args.field]
    with shared.styled(path, dict(args.assignments)), Results.open(args.results) as results:
        components = args.components or [None]
        parts = list(
            dict.fromkeys(fields.choose_component(args.field, component, results.dimension) for component in components)
        )
        step, time = chosen_frame(results, args)
        sampled_line = lines.sample_field_along_line(results, args.field, step, args.begins, args.ends)
        if path is not None:
            from pdpost.figures import charts, colours, style

            style.save(charts.line(sampled_line, args.field, parts, f"{field.title} {colours.at(results, step)}"), path)
    words = []
    for part in parts:
        values = sampled_line.component_values[part]
        finite = np.flatnonzero(np.isfinite(values))
        said = f"nothing known at {len(values)} places"
        if len(finite):
            low, high = (int(finite[at]) for at in (values[finite].argmin(), values[finite].argmax()))
            ends = (
                f"{values[at]:.4g} at ({', '.join(f'{x:.4g}' for x in sampled_line.points[at])}) m"
                for at in (low, high)
            )
            said = f"{len(finite)} of {len(values)} places known, from {' to '.join(ends)}"
        words.append(f"{f'{args.field} {part}'.strip()} at {time_text(time)}: {said}")
    names = {
        f"{args.field}_{part}" if part else args.field: values for part, values in sampled_line.component_values.items()
    }
    header = (
        "along, m",
        *(f"{axis}, m" for axis in "xyz"[: sampled_line.points.shape[1]]),
        *(f"{name}, {field.unit}" if field.unit else name for name in names),
    )
    result = {
        "step": step,
        "time": time,
        "field": args.field,
        "components": parts,
        "unit": field.unit,
        "along": sampled_line.distance_from_start,
        "place": sampled_line.points,
        "values": names,
    }
    rows = zip(sampled_line.distance_from_start, *sampled_line.points.T, *names.values(), strict=True)
    return shared.deliver(args, result, words, header, rows, path)
