"""Moving pictures: a film of a whole run, and a picture that follows a run in progress."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from pdmesh import commandline
from pdpost.commands.pictures import FIELDS
from pdpost.commands.shared import (
    NO_PICTURE,
    add_clip,
    add_colours,
    add_every,
    add_results,
    add_scale,
    add_style,
    add_window,
    check_window,
    chosen_scale,
    chosen_stride,
    counted,
    drawing_options,
    plane,
    positive,
    seconds,
)

if TYPE_CHECKING:
    from pdpost.commands.shared import Commands


def add(commands: Commands) -> None:
    """Put `animate` and `watch` on the command line."""
    animate = commands.add_parser("animate", help="make a film of a field, as GIF, or as MP4 if ffmpeg is installed")
    _add_field(animate, "the film, .gif or .mp4 (default: the results' name with the field's and .gif)")
    add_every(animate)
    animate.add_argument("--rate", type=positive, default=10.0, metavar="N", help="frames a second (default: 10)")
    cut = animate.add_mutually_exclusive_group()
    add_clip(cut)
    cut.add_argument(
        "--plane", type=plane, metavar="AXIS=M", help="of a body: draw it on this plane (default: on three planes)"
    )
    animate.set_defaults(run=_animate)
    watch = commands.add_parser("watch", help="redraw a field with each new frame of a run in progress")
    _add_field(watch, "the picture (default: the results' name with the field's and .png)")
    watch.add_argument(
        "--patience",
        type=_patience,
        default=600.0,
        metavar="S",
        help="stop after so many seconds, or such as 10min, without a new frame (default: 600)",
    )
    watch.set_defaults(run=_watch)


def _patience(text: str) -> float:
    return positive(str(seconds(text)))


def _add_field(command: argparse.ArgumentParser, output: str) -> None:
    add_results(command)
    commandline.add_common_options(command, output, NO_PICTURE)
    add_style(command)
    command.add_argument(
        "--field",
        choices=FIELDS,
        help="field to draw (default: damage; in models of diffusion content, or concentration)",
    )
    command.add_argument(
        "--component", metavar="NAME", help="component of the field, as in the command with the field's name"
    )
    add_scale(command, default="0")
    add_window(command)
    add_colours(command)


def _animate(args: argparse.Namespace) -> int:
    from matplotlib import rcParams

    from pdmesh.files import write_atomically
    from pdpost.figures import animation, style
    from pdsolve.measures.fields import default_field_name
    from pdsolve.measures.frame_steps import frames
    from pdsolve.results import Results

    settings = dict(args.assignments)
    with style.styled(settings), Results.open(args.results) as results:
        steps, times = frames(results)
        field = args.field or default_field_name(results, int(steps[0]))
        none = args.json and args.output is None
        path = None if none else commandline.output_path(args.output, args.results, f".{field}.gif", args.force)
        kind = None if path is None else animation.check_format(path)
        dpi = rcParams["savefig.dpi"] if "savefig.dpi" in settings else "figure"
        check_window(results, args)
        stride = chosen_stride(results, args)
        how = {
            "part": args.component,
            **drawing_options(args, field, chosen_scale(results, int(steps[-1]), args)),
            "clip": args.clip,
            "plane": args.plane,
            "every": stride,
            "dpi": animation.DPI if dpi == "figure" else float(dpi),
            "progress": counted(args, "drawing"),
        }
        if kind == "gif":
            film = animation.gif(results, field, rate=args.rate, **how)
        elif kind is not None:
            film = animation.mp4(animation.frames(results, field, **how), args.rate)
    count = len(steps[::stride])
    result = {"output": path and str(path), "field": field, "frames": count, "of": len(steps), "rate": args.rate}
    result["end"] = float(times[-1])
    lines = []
    if path is not None:
        write_atomically(path, film)
        lines.append(f"{path}: {field}, {count} of {len(steps)} frames, {len(film) / 1e6:.3g} MB")
    commandline.report(result, lines, args)
    return commandline.OK


def _watch(args: argparse.Namespace) -> int:
    from pdmesh.plain_figure import check_format
    from pdpost.figures import field_figure, style
    from pdpost.reading import watching
    from pdsolve.measures.fields import default_field_name
    from pdsolve.measures.frame_steps import time_text
    from pdsolve.results import Results

    def chosen(field: str) -> Path:
        path = commandline.output_path(args.output, args.results, f".{field}.png", args.force)
        check_format(path)
        return path

    field: str | None = args.field
    path = chosen(field) if field else args.output and chosen("")
    frame_count = 0
    with style.styled(dict(args.assignments)):
        for step in watching.frames(args.results, args.patience, lambda words: commandline.note(words, args)):
            with Results.open(args.results) as results:
                scale = chosen_scale(results, step, args)
                time = step * float(results.meta()["time_step"])
                check_window(results, args)
                field = field or default_field_name(results, step)
                path = path or chosen(field)
                how = drawing_options(args, field, scale)
                figure = field_figure.field(results, field, step, part=args.component, **how)
            style.save(figure, path)
            frame_count += 1
            commandline.note(f"{path}: {field} at {time_text(time)} (step {step})", args)
    with Results.open(args.results) as results:
        status = str(results.meta()["status"])
    result = {"output": path and str(path), "field": field, "drawn": frame_count, "status": status}
    commandline.report(result, [f"{path}: the run is {status}; {frame_count} frames drawn"], args)
    return commandline.OK
