"""Pictures of a frame: a field of the nodes, the nodes themselves, their bonds."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

from pdmesh import commandline
from pdpost.commands.shared import (
    add_clip,
    add_colours,
    add_csv,
    add_frame,
    add_journal,
    add_picture_command,
    add_scale,
    add_window,
    check_window,
    chosen_frame,
    chosen_frames,
    chosen_scale,
    drawing_options,
    numbers,
    picture_path,
    write_csv,
)

if TYPE_CHECKING:
    from pdmesh.plain_figure import Figure
    from pdpost.commands.shared import Commands
    from pdpost.exports.csv_columns import Columns
    from pdsolve.results import Results


RENDER = "pdsuite[render]"  # the extra with PyVista


class Drawn(NamedTuple):
    """A picture and the line printed about it."""

    figure: Figure
    reported: dict[str, Any]  # for --json
    words: str  # for a reader
    table: Callable[[], Columns]  # for --csv


FIELDS = {  # as fields.FIELDS, which is not imported for --help
    "damage": "draw the share of bonds that the run broke at the nodes of a frame",
    "separation": "draw the share of bonds that are gone, cut by pre-cracks or, in load steps, softened",
    "energy": "draw the potential energy of the nodes",
    "displacement": "draw the displacement of the nodes",
    "velocity": "draw the velocity of the nodes",
    "acceleration": "draw the acceleration of the nodes",
    "strain": "draw the strain of the nodes, fitted to their bonds",
    "stress": "draw the stress of the nodes: the model's own, or Hooke's from the fitted strain",
    "plastic": "draw the equivalent plastic strain of the nodes, in plastic materials",
    "rotation": "draw the rotation of the nodes, in models with rotations",
    "volume": "draw the volume of the nodes over their initial volume, in models that compute it",
    "concentration": "draw the concentration of the dissolved substance, in models of diffusion",
    "content": "draw the content: dissolved and solid together",
    "solid": "draw the solid share of each node",
    "temperature": "draw the temperature, in models of heat",
}
PARTS = {
    **dict.fromkeys(("displacement", "velocity", "acceleration"), "magnitude (default), x, y, of a body z"),
    "strain": "largest principal (default), smallest; xx, yy, xy, zz, of a body xz, yz",
    "stress": "largest principal (default), smallest; xx, yy, xy, zz, of a body xz, yz; mises",
}


def add(commands: Commands) -> None:
    """Put a command for each field, `nodes` and `bonds` on the command line."""
    for name, does in FIELDS.items():
        picture = _add_picture(commands, name, does, default="0", several=True)
        if name in PARTS:
            picture.add_argument("--component", metavar="NAME", help=f"component to draw: {PARTS[name]}")
        add_colours(picture)
        add_clip(picture)
        picture.set_defaults(run=_field, component=None)
    nodes = _add_picture(commands, "nodes", "draw the deformed grid, a colour for each spacing", default="auto")
    nodes.set_defaults(run=_nodes)
    bonds = _add_picture(commands, "bonds", "draw the bonds: intact ones blue, broken ones red", default="0")
    bonds.set_defaults(run=_bonds)


def _add_picture(
    commands: Commands, name: str, does: str, default: str, several: bool = False
) -> argparse.ArgumentParser:
    picture = add_picture_command(commands, name, does)
    add_journal(picture)
    add_frame(picture, several)
    add_scale(picture, default)
    add_window(picture)
    add_csv(picture)
    picture.set_defaults(picture=name)
    return picture


def _field(args: argparse.Namespace) -> int:
    from importlib.util import find_spec

    from pdpost.exports import csv_columns
    from pdpost.figures import field_figure
    from pdpost.figures.sheets import seen
    from pdsolve.measures import fields
    from pdsolve.measures.slices import expect_3d_body
    from pdsolve.measures.softened_bonds import separation_history

    name = args.picture
    if args.frames is not None:
        return _sheet(args, name, fields.choose_component(name, args.component))

    def show(results: Results, step: int, scale: float) -> Drawn:
        part = fields.choose_component(name, args.component, results.dimension)
        shown, how = field_figure.values_of(results, name, step, part), drawing_options(args, name, scale)
        if args.clip is not None:
            expect_3d_body(results)
        is_cut_open = args.clip is not None
        if not is_cut_open and results.dimension == 3 and name == "damage":  # wherever PyVista is
            is_cut_open = find_spec("pyvista") is not None
            if not is_cut_open:
                words = f"{args.results}: drawn on three planes; pip install '{RENDER}' draws it cut open"
                commandline.note(words, args)
        if is_cut_open:
            from pdpost.figures import crack_render

            figure = crack_render.frame_cut_open(results, name, part, step, args.clip, how["largest"])
        else:
            figure = field_figure.field(results, name, step, shown=shown, part=part or None, **how)
        unit = fields.FIELDS[name].unit
        visible = shown
        if args.window is not None:
            in_view = seen(results.nodes(step).position, args.window)
            visible = shown._replace(values=shown.values[in_view], torn=shown.torn[in_view])
        reported = {"component": part or None, **numbers(visible), "unit": unit}
        low, high = reported["smallest"], reported["largest"]
        ends = f"{low:.4g} to" if low is not None and fields.component_is_signed(name, part) else "up to"
        words = "nothing known" if high is None else f"{ends} {high:.4g} {unit}".rstrip()
        if name == "damage" and high == 0 and (history := separation_history(results)) is not None:
            words += f"; no bond broke, but bonds have softened: pdpost separation, up to {history.at(step).max():.4g}"
        if reported["torn"]:
            words += f", {reported['torn']} torn nodes left out"
        return Drawn(figure, reported, words, lambda: csv_columns.of_field(results, name, step))

    return _drawn(args, show)


def _sheet(args: argparse.Namespace, name: str, part: str) -> int:
    """Draw several frames of a field on one sheet; returns the exit code."""
    from pdmesh.plain_figure import check_format
    from pdpost.figures import frames_figure, style
    from pdsolve.results import Results

    if args.csv is not None:
        raise commandline.UsageError("--csv cannot be combined with --frames; choose one frame (--frame or --time)")
    path = picture_path(args, f".{name}.frames.png")
    if path is not None:
        check_format(path)
    with style.styled(dict(args.assignments)), Results.open(args.results) as results:
        steps = chosen_frames(results, args)
        check_window(results, args)
        scale = chosen_scale(results, steps[-1], args)
        how = drawing_options(args, name, scale)
        if path is not None:
            style.save(frames_figure.frames(results, name, steps, part=part or None, **how), path)
    result = {"output": None if path is None else str(path), "component": part or None, "steps": steps, "scale": scale}
    commandline.report(result, [f"{path}: {name} after steps {', '.join(map(str, steps))}"], args)
    return commandline.OK


def _nodes(args: argparse.Namespace) -> int:
    import numpy as np

    from pdpost.exports import csv_columns
    from pdpost.figures import scene_figure

    def show(results: Results, step: int, scale: float) -> Drawn:
        spacings, counts = np.unique(results.nodes(step).delta.round(12), return_counts=True)
        pairs = zip(spacings.tolist(), counts.tolist(), strict=True)
        reported = {"levels": [{"spacing": spacing, "nodes": count} for spacing, count in pairs]}
        words = f"{counts.sum()} nodes, {len(counts)} spacing{'s' * (len(counts) > 1)}"
        figure = scene_figure.nodes(results, step, scale=scale, window=args.window)
        return Drawn(figure, reported, words, lambda: csv_columns.of_frame(results, step))

    return _drawn(args, show)


def _bonds(args: argparse.Namespace) -> int:
    from pdpost.exports import csv_columns
    from pdpost.figures import bond_figure
    from pdpost.figures.sheets import seen
    from pdsolve.measures.bond_pairs import read_bond_pairs
    from pdsolve.measures.embedded_model import expect_mechanics

    def show(results: Results, step: int, scale: float) -> Drawn:
        expect_mechanics(results)
        bond_pairs = read_bond_pairs(results, step)
        is_broken = bond_pairs.is_broken
        if args.window is not None:
            is_broken = is_broken[seen(results.nodes(step).position, args.window)[bond_pairs.node_rows].any(axis=1)]
        reported = {"intact": int((~is_broken).sum()), "broken": int(is_broken.sum())}
        words = f"{reported['intact']} bonds intact, {reported['broken']} broken"
        figure = bond_figure.bonds(results, step, scale=scale, window=args.window, bond_pairs=bond_pairs)
        return Drawn(figure, reported, words, lambda: csv_columns.of_bonds(results, step, bond_pairs))

    return _drawn(args, show)


def _drawn(args: argparse.Namespace, show: Callable[[Results, int, float], Drawn]) -> int:
    """Draw the frame asked for and print what it shows; returns the exit code."""
    from pdmesh.plain_figure import check_format
    from pdpost.exports import csv_columns
    from pdpost.figures import style
    from pdsolve.measures.embedded_model import moment
    from pdsolve.results import Results

    path = picture_path(args, f".{args.picture}.png")
    if path is not None:
        check_format(path)
    with style.styled(dict(args.assignments)), Results.open(args.results) as results:
        step, time = chosen_frame(results, args)
        check_window(results, args)
        scale = chosen_scale(results, step, args)
        shown, when = show(results, step, scale), moment(results, step)
        if path is not None:
            style.save(shown.figure, path)
        if args.csv is not None:
            write_csv(args, csv_columns.csv(shown.table()))
    if args.csv != "-":
        output = None if path is None else str(path)
        result = {"output": output, "step": step, "time": time, "scale": scale, **shown.reported}
        commandline.report(result, [f"{path or args.csv}: {args.picture} at {when}, {shown.words}"], args)
    return commandline.OK
