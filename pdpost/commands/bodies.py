"""Pictures of bodies in space: a plane section, and a rendered view."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from pdmesh import commandline
from pdpost.commands.shared import (
    add_csv,
    add_frame,
    add_largest,
    add_picture_command,
    chosen_frame,
    largest_of,
    picture_path,
    plane,
    positive,
    write_csv,
)

if TYPE_CHECKING:
    from pdpost.commands.shared import Commands


def add(commands: Commands) -> None:
    """Put `slice` and `render` on the command line."""
    command = _add_body_command(commands, "slice", "draw a field of a body on a plane through it")
    command.add_argument(
        "--plane",
        type=plane,
        default=("y", 0.0),
        metavar="AXIS=M",
        help="the plane, m, or such as z=1mm (default: y=0)",
    )
    add_csv(command)
    command.set_defaults(run=_slice)
    about = "draw a body in perspective, without a window (needs the extra render: pip install 'pdsuite[render]')"
    command = _add_body_command(commands, "render", about)
    command.add_argument(
        "--level", type=float, metavar="N", help="draw the surface where the field has this value, SI units"
    )
    command.add_argument("--plane", type=plane, metavar="AXIS=M", help="cut away the part in front of a plane")
    command.add_argument("--crack", action="store_true", help="draw the surfaces of cracks inside a transparent body")
    command.add_argument(
        "--explode",
        type=positive,
        metavar="N",
        help="draw the fragments apart, each moved from the middle by N times its distance from it",
    )
    command.set_defaults(run=_render)


def _add_body_command(commands: Commands, name: str, about: str) -> argparse.ArgumentParser:
    command = add_picture_command(commands, name, about)
    add_frame(command)
    add_largest(command)
    command.add_argument(
        "--field", metavar="NAME", help="field to draw (default: damage; in models of diffusion content)"
    )
    command.add_argument("--component", metavar="NAME", help="component of a vector: magnitude (default), x, y, z")
    return command


def _slice(args: argparse.Namespace) -> int:
    from pdmesh.plain_figure import check_format
    from pdpost.exports import csv_columns
    from pdpost.figures import slice_figure, style
    from pdsolve.measures import fields, slices
    from pdsolve.measures.embedded_model import moment
    from pdsolve.results import Results

    path = picture_path(args, ".slice.png")
    if path is not None:
        check_format(path)
    with style.styled(dict(args.assignments)), Results.open(args.results) as results:
        slices.expect_3d_body(results)
        step, time = chosen_frame(results, args)
        name = args.field or fields.default_field_name(results, step)
        part = fields.choose_component(name, args.component, results.dimension)
        shown = slices.reliable_field_values(results, name, step, part or None)
        section = slices.slice_field_values_by_plane(results, shown, step, *args.plane)
        if path is not None:
            style.save(slice_figure.plane(results, section, name, part, step, largest_of(args, name)), path)
        nodes, when = results.nodes(step), moment(results, step)
        x, y, z = nodes.position[section.node_rows].T
        table = {"node": nodes.ids[section.node_rows], "x": x, "y": y, "z": z, name: section.values}
        if args.csv is not None:
            write_csv(args, csv_columns.csv(table))
    if args.csv != "-":
        smallest, largest = float(section.values.min()), float(section.values.max())
        output = None if path is None else str(path)
        result = {"output": output, "step": step, "time": time, "field": name, "nodes": len(section.node_rows)}
        line = f"{path or args.csv}: {name} at {when}, {len(section.node_rows)} nodes, {smallest:.4g} to {largest:.4g}"
        commandline.report({**result, "smallest": smallest, "largest": largest}, [line], args)
    return commandline.OK


def _render(args: argparse.Namespace) -> int:
    from pdmesh.plain_figure import check_format
    from pdpost.figures import colours, render, style
    from pdsolve.measures import fields, slices
    from pdsolve.measures.embedded_model import counts_load_steps, moment
    from pdsolve.results import Results

    path = picture_path(args, ".render.png")
    if path is not None:
        check_format(path)
    exclusive_options = [option for option, value in (("--crack", args.crack), ("--explode", args.explode)) if value]
    names = ("field", "component", "largest", "level", "plane")  # which say nothing of cracks
    others = [f"--{name}" for name in names if getattr(args, name) is not None]
    if exclusive_options and len(exclusive_options + others) > 1:
        raise commandline.UsageError(
            f"{exclusive_options[0]} cannot be combined with {(exclusive_options + others)[1]}; use one of them"
        )
    with style.styled(dict(args.assignments)), Results.open(args.results) as results:
        slices.expect_3d_body(results)
        step, time = chosen_frame(results, args)
        when = moment(results, step)
        if args.crack or args.explode is not None:
            if path is not None:
                from pdpost.figures import crack_render
                from pdpost.figures.colours import at
                from pdsolve.measures.crack_faces import build_crack_surface, find_opened_face_neighbours

                parted_pairs, nodes = find_opened_face_neighbours(results, step), results.nodes(step)
                if args.explode is not None:
                    figure = crack_render.fragments_apart(
                        nodes, parted_pairs, args.explode, f"Fragments {at(results, step)}"
                    )
                else:
                    figure = crack_render.cracks_in_body(
                        nodes,
                        build_crack_surface(results, step, parted_pairs),
                        f"Cracks {at(results, step)}",
                        counts_load_steps(results),
                    )
                style.save(figure, path)
            output = None if path is None else str(path)
            commandline.report({"output": output, "step": step, "time": time}, [f"{path}: {when}"], args)
            return commandline.OK
        name = args.field or fields.default_field_name(results, step)
        part = fields.choose_component(name, args.component, results.dimension)
        values = slices.reliable_field_values(results, name, step, part or None)
        shown = colours.colours(name, part, values, largest_of(args, name))
        title = colours.title(results, name, part, step, 0.0)
        if args.level is not None:
            title = f"{colours.caption(name, part)} of {args.level:g} {fields.FIELDS[name].unit}".rstrip()
            title = f"{title} {colours.at(results, step)}"
        if path is not None:
            style.save(render.render(results.nodes(step), values, shown, title, args.level, args.plane), path)
    result = {"output": None if path is None else str(path), "step": step, "time": time, "field": name}
    commandline.report(result, [f"{path}: {name} at {when}"], args)
    return commandline.OK
