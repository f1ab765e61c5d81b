"""A field of several runs of one scene, side by side with one colour bar."""

from __future__ import annotations

import argparse
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from pdmesh import commandline
from pdpost.commands.pictures import FIELDS
from pdpost.commands.shared import (
    NO_PICTURE,
    add_colours,
    add_frame,
    add_journal,
    add_scale,
    add_style,
    add_window,
    check_window,
    chosen_frame,
    chosen_scale,
    drawing_options,
    picture_path,
)

if TYPE_CHECKING:
    from pdpost.commands.shared import Commands


def add(commands: Commands) -> None:
    """Put `compare` on the command line."""
    compare = commands.add_parser(
        "compare",
        help="draw a field of several runs of one scene side by side",
        description="Draw a field of several runs of one scene - laws, spacings, methods - side by side, with one"
        " colour bar.",
    )
    compare.add_argument("results", type=Path, nargs="+", help="databases written by pdsolve, two or more")
    compare.add_argument("--field", choices=FIELDS, default="damage", help="what is drawn (default: damage)")
    compare.add_argument("--component", metavar="NAME", help="the component of the field, as its own command has it")
    compare.add_argument(
        "--titles", metavar="A,B,...", help="what stands above the pictures (default: the names of the files)"
    )
    commandline.add_common_options(
        compare, "the picture, in the format of its suffix (default: compare.png)", NO_PICTURE
    )
    add_style(compare)
    add_journal(compare)
    add_frame(compare)
    add_scale(compare, "0")
    add_colours(compare)
    add_window(compare)
    compare.set_defaults(run=_compare)


def _compare(args: argparse.Namespace) -> int:
    from pdmesh.plain_figure import check_format
    from pdpost.figures import frames_figure, style
    from pdsolve.measures import fields
    from pdsolve.measures.frame_steps import time_text
    from pdsolve.measures.plate_geometry import expect_same_plate
    from pdsolve.results import Results

    files: list[Path] = args.results
    if len(files) < 2:
        raise commandline.UsageError(f"compare: only {len(files)} database is given; give two or more")
    names = [file.stem for file in files]
    titles = names if len(set(names)) == len(names) else list(map(str, files))
    if args.titles is not None:
        titles = [title.strip() for title in args.titles.split(",")]
        if len(titles) != len(files):
            raise commandline.UsageError(f"--titles has {len(titles)} titles; give {len(files)}, one for each database")
    args.results = files[0].with_name("compare.sqlite")
    path = picture_path(args, ".png")
    if path is not None:
        check_format(path)
    part = fields.choose_component(args.field, args.component)
    with style.styled(dict(args.assignments)), ExitStack() as stack:
        runs = [stack.enter_context(Results.open(file)) for file in files]
        panels, compared_frames = [], []
        for file, results, title in zip(files, runs, titles, strict=True):
            expect_same_plate(results, runs[0])
            args.results = file  # which a message names
            step, time = chosen_frame(results, args)
            panels.append(frames_figure.Panel(results, step, f"{title}, {time_text(time, micro='µs')}"))
            compared_frames.append({"results": str(file), "title": title, "step": step, "time": time})
        check_window(runs[0], args)
        scale = chosen_scale(runs[0], panels[0].step, args)
        how = drawing_options(args, args.field, scale)
        if path is not None:
            style.save(frames_figure.panels(panels, args.field, part=part or None, **how), path)
    result = {
        "output": None if path is None else str(path),
        "field": args.field,
        "component": part or None,
        "scale": scale,
        "runs": compared_frames,
    }
    commandline.report(result, [f"{path}: {args.field} of {', '.join(titles)}"], args)
    return commandline.OK
