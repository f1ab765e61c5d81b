"""Frames for other programs."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from pdmesh import commandline
from pdpost.commands.shared import add_every, add_frame, add_results, chosen_frame, chosen_stride, counted, some_of

if TYPE_CHECKING:
    from pdpost.commands.shared import Commands

LISTED = 12  # conditions in the line about a file


def add(commands: Commands) -> None:
    """Put `export` on the command line."""
    export = commands.add_parser(
        "export",
        help="write frames for ParaView (.pvd, .vtu, .xdmf), for Gmsh (.msh) or as a table (.csv)",
        description="Write frames for other programs. A .pvd, .xdmf or .msh holds all frames, a .vtu or .csv one. A"
        " .pvd lists VTU files in a folder of its name beside it; a .xdmf keeps its numbers in a .bin file beside it."
        " In ParaView, show points as Point Gaussian, or export --squares; Warp By Vector shows the displacement. A"
        " .msh has a view for each field, which --squares shows best.",
    )
    add_results(export)
    commandline.add_common_options(
        export, "the file, in the format of its suffix (default: the results' name with .pvd)"
    )
    add_frame(export)
    add_every(export)
    export.add_argument(
        "--also",
        type=some_of("strain", "stress"),
        default=(),
        metavar="NAMES",
        help="also write fitted tensors: strain,stress",
    )
    export.add_argument(
        "--squares",
        action="store_true",
        help="write a square (in a body a cube) for each node instead of a point (not for .csv)",
    )
    export.add_argument(
        "--inline",
        action="store_true",
        help="write the numbers of a .xdmf into the file itself, as text, which meshio and other readers need",
    )
    export.set_defaults(run=_export)


def _export(args: argparse.Namespace) -> int:
    from pdpost.exports import frame_files, surface_files, xdmf
    from pdsolve.measures.frame_steps import chosen, has_diffusion_only
    from pdsolve.results import Results

    path = commandline.output_path(args.output, args.results, ".pvd", args.force)
    kind = frame_files.check_suffix(path)
    single_frame = kind in (".vtu", ".csv")
    for word, wrong, holds in (
        (
            "--frame, --step or --time",
            not single_frame and (args.frame, args.step, args.time) != (-1, None, None),
            "all frames",
        ),
        ("--every or --stride", single_frame and (args.every, args.stride) != (None, None), "one frame"),
        ("--squares", kind == ".csv" and args.squares, "points"),
        ("--inline", kind != ".xdmf" and args.inline, "its numbers itself"),
    ):
        if wrong:
            raise commandline.UsageError(f"{word} cannot be combined with {kind}, which holds {holds}; leave it out")
    folder = frame_files.beside(path)
    if kind == ".pvd" and folder.is_symlink():
        raise commandline.UsageError(f"{folder} is a link, and a folder is needed; remove it")
    if kind == ".pvd" and folder.exists() and not (folder.is_dir() and args.force):
        raise commandline.UsageError(f"{folder} already exists; use --force to write into it")
    if kind == ".xdmf" and not args.inline:
        commandline.output_path(xdmf.beside(path), args.results, ".bin", args.force, is_companion=True)
    with Results.open(args.results) as results:
        steps = [chosen_frame(results, args)[0]] if single_frame else chosen(results, chosen_stride(results, args))
        progress = counted(args, "writing")
        if kind == ".vtu":
            frame_files.vtu(results, steps[0], path, args.also, args.squares)
        elif kind == ".csv":
            frame_files.table(results, steps[0], path, args.also)
        else:
            series = partial(frame_files.xdmf, inline=args.inline)
            cracks = results.dimension == 3 and not has_diffusion_only(results)
            parts = partial(frame_files.pvd, crack=surface_files.write_frame if cracks else None)
            writes: dict[str, Callable[..., None]] = {".pvd": parts, ".xdmf": series, ".msh": frame_files.msh}
            writes[kind](results, path, steps, args.also, args.squares, progress)
        count = len(results.nodes(steps[-1]).ids)
        sets = {name: int(node_mask.sum()) for name, node_mask in frame_files.node_sets(results, steps[-1]).items()}
    lines = [f"{path}: {count} nodes, {len(steps)} frames"]
    if sets:
        named = ", ".join(f"{name} ({nodes})" for name, nodes in list(sets.items())[:LISTED])
        more = f" and {len(sets) - LISTED} more" if len(sets) > LISTED else ""
        lines.append(f"conditions, with their nodes: {named}{more}")
    result = {"output": str(path), "nodes": count, "frames": len(steps), "steps": steps, "conditions": sets}
    commandline.report(result, lines, args)
    return commandline.OK
