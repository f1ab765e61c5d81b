"""Curves over time: nodes, the ledger, the conditions."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pdmesh import commandline
from pdpost.commands import shared
from pdpost.commands.shared import lengths, picture_path

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pdpost.commands.shared import Commands
    from pdsolve.measures.forces import ConditionForceHistory
    from pdsolve.measures.histories import NodeHistory
    from pdsolve.measures.measured_curve import MeasuredCurve
    from pdsolve.results import Results

    Floats = NDArray[np.float64]

PLACE = "m, or such as 5,20mm, of a body with z"
Place = tuple[str, tuple[float, ...]]


def add(commands: Commands) -> None:
    """Put `history`, `balance` and `reaction` on the command line."""
    history = shared.add_command(
        commands, "history", "draw a node's motion over time, or the masses of a model of diffusion"
    )
    for name, words, count, text in (
        ("--node", "ID", (1,), "a node by its id"),
        ("--at", "X,Y", (2, 3), f"the node nearest to a place, {PLACE}"),
        (
            "--box",
            "X0,Y0,X1,Y1",
            (4, 6),
            "the mean by mass of the nodes in a box, m, and their range; in a body six",
        ),
    ):
        history.add_argument(
            name,
            action="append",
            dest="places",
            type=_place(name, *count),
            metavar=words,
            help=f"{text}; may be repeated",
        )
    history.add_argument("--quantity", choices=("displacement", "velocity", "acceleration"), default="displacement")
    history.add_argument(
        "--component",
        action="append",
        dest="components",
        choices=("x", "y", "z", "magnitude"),
        help="component to draw (z only in a body); may be repeated (default: magnitude)",
    )
    history.set_defaults(run=_history)
    shared.add_command(commands, "balance", "draw where the energy went, and how well it balances").set_defaults(
        run=_balance
    )
    _add_reaction(commands)


def _add_reaction(commands: Commands) -> None:
    """Put `reaction` on the command line."""
    reaction = shared.add_command(commands, "reaction", "draw the forces of loads and grips over time and displacement")
    reaction.add_argument(
        "--condition",
        action="append",
        default=[],
        metavar="NAME",
        help="a load or grip, by name or number; may be repeated",
    )
    reaction.add_argument(
        "--component",
        choices=("x", "y", "z"),
        help="the component of force and displacement (z only in a body; default: the one with the larger force)",
    )
    reaction.add_argument(
        "--gap",
        nargs="+",
        metavar=("NAME", "X,Y"),
        help="draw the force against an opening, its peak and the area under the curve: a gap of the model by name, or"
        " two places, m, between whose nearest nodes it is (X,Y,Z in a body)",
    )
    reaction.add_argument(
        "--smooth", type=int, default=1, metavar="N", help="with --gap: average over N steps (default: 1)"
    )
    reaction.add_argument(
        "--measured",
        type=Path,
        metavar="CSV",
        help='draw a measured curve as points: columns with heads such as "lift, mm","load, N"; of one --condition',
    )
    reaction.add_argument(
        "--thickness",
        type=lambda text: lengths(text, 1)[0],
        metavar="M",
        help="with --measured: thickness of the specimen of a 2D model, m, or such as 100mm, by which forces in N are"
        " divided",
    )
    reaction.set_defaults(run=_reaction)


def _place(name: str, *counts: int) -> Any:
    def place(text: str) -> Place:
        if name != "--node":
            return name, lengths(text, *counts)
        if not text.isdecimal():
            raise argparse.ArgumentTypeError(f"'{text}' is not an id; use a whole number")
        return name, (float(text),)

    return place


def _history(args: argparse.Namespace) -> int:
    from pdmesh.model.output_fields import FIELDS
    from pdsolve.measures.embedded_model import counts_load_steps
    from pdsolve.measures.histories import usual_history_nodes
    from pdsolve.measures.json_keys import fields_by_json_key
    from pdsolve.results import Results

    path = picture_path(args, ".history.png")
    with shared.styled(path, dict(args.assignments)), Results.open(args.results) as results:
        moves = len(results.history()) and (args.places or args.components)
        if len(results.masses()) and not moves:
            return _masses(args, results, path)
        by_steps = counts_load_steps(results)
        parts = list(dict.fromkeys(args.components or ["magnitude"]))
        usual = () if args.places else usual_history_nodes(results)
        places = args.places or [("--node", (float(node),)) for node in usual]
        curves = [_curve(results, place, args.quantity, part) for place in places for part in parts]
        if path is not None:
            from pdpost.figures import charts, style

            style.save(charts.histories(curves, args.quantity, by_steps), path)
    unit = FIELDS[args.quantity].unit
    result = {
        "quantity": args.quantity,
        "components": parts,
        "unit": unit,
        "curves": [fields_by_json_key(curve) for curve in curves],
    }
    rows = [
        (curve.label, curve.component, *row)
        for curve in curves
        for row in zip(curve.time, curve.value, curve.smallest, curve.largest, strict=True)
    ]
    when = "load step" if by_steps else "time, s"
    header = ("curve", "component", when, f"{args.quantity}, {unit}", "smallest", "largest")
    return shared.deliver(args, result, [_history_line(curve, unit) for curve in curves], header, rows, path)


def _masses(args: argparse.Namespace, results: Results, path: Path | None) -> int:
    """The history of a substance that diffuses, or of heat."""
    from pdmesh.model.amounts import amounts_line
    from pdsolve.measures.balance import mass_balance_with_unit
    from pdsolve.measures.frame_steps import time_text
    from pdsolve.measures.json_keys import fields_by_json_key

    if args.places or args.components:
        raise commandline.UsageError("history: masses are of the whole model; leave out nodes and components")
    books, unit = mass_balance_with_unit(results)
    if path is not None:
        from pdpost.figures import charts, style

        style.save(charts.masses(books, unit), path)
    by_json_key = fields_by_json_key(books)
    last = {name: float(column[-1]) for name, column in by_json_key.items()}
    amounts_now = amounts_line(unit, last["inside"], last["through"], last["supplied"], last["error"])
    lines = [f"at {time_text(last['time'])}, {amounts_now}"]
    if last["left"] == last["left"]:
        lines.append(
            f"solid left {last['left']:.2%}, surface {last['surface'] / float(books.solid_surface_area[0]):.2%}"
            f" of that at the start, dissolved {last['dissolved']:.6g} mol"
        )
    result = {"units": results.meta()["units"], "unit": unit, "last": last, **by_json_key}
    ways = (f"{way}, {unit}" for way in ("inside", "gone out", "supplied"))
    header = ("step", "time, s", *ways, "solid", "dissolved, mol", "surface", "share left", "error")
    return shared.deliver(args, result, lines, header, zip(*books, strict=True), path)


def _curve(results: Results, place: Place, *what: str) -> NodeHistory:
    """History of a quantity and its component at a place; `what` is (quantity, component)."""
    from pdsolve.measures import histories

    option, values = place
    if option == "--node":
        return histories.node_history(results, int(values[0]), *what)
    if option == "--at":
        return histories.nearest_node_history(results, values, *what)
    return histories.mean_history_in_box(results, values, *what)


def _history_line(curve: NodeHistory, unit: str) -> str:
    import numpy as np

    where = "" if curve.place is None else f" at ({', '.join(f'{x:g}' for x in curve.place)}) m"
    off = f", {curve.distance_from_place:.3g} m from the place asked for" if curve.distance_from_place > 0 else ""
    finite = np.isfinite(curve.value)
    if not finite.any():
        return f"{curve.label}{where}{off}, {curve.component}: at none of {len(curve.time)} times by {curve.source}"
    low, high = float(np.min(curve.value[finite])), float(np.max(curve.value[finite]))
    values = f"{finite.sum()} times by {curve.source}, {low:.4g} to {high:.4g} {unit}"
    if len(curve.node_ids) > 1 and curve.place is None:  # the mean of several, not the nearest of them
        low, high = float(np.min(curve.smallest[finite])), float(np.max(curve.largest[finite]))
        values += f"; single nodes {low:.4g} to {high:.4g} {unit}"
    return f"{curve.label}{where}{off}, {curve.component}: {values}"


def _balance(args: argparse.Namespace) -> int:
    import numpy as np

    from pdsolve.measures.balance import energy_balance, energy_loss_warnings, thickness_unit_suffix
    from pdsolve.measures.embedded_model import counts_load_steps
    from pdsolve.measures.frame_steps import moment_text
    from pdsolve.results import Results

    path = picture_path(args, ".balance.png")
    with shared.styled(path, dict(args.assignments)), Results.open(args.results) as results:
        books, by_steps = energy_balance(results), counts_load_steps(results)
        per = thickness_unit_suffix(results)
        said = energy_loss_warnings(results)
        if path is not None:
            from pdpost.figures import charts, style

            style.save(charts.balance(books, per, by_steps), path)
    last = {name: float(column[-1]) for name, column in books._asdict().items()}
    worst = int(np.abs(books.error).argmax())
    damping_known = np.isfinite(last["damped"])
    damped = f" + damped {last['damped']:.4g}" if damping_known else " with what damping took"
    damped += f" + friction {last['friction']:.4g}" if last["friction"] else ""
    lines = [
        f"at {moment_text(last['time'], by_steps)}, J{per}: put in {last['work']:.4g} ="
        f" kinetic {last['kinetic']:.4g} + strain {last['strain']:.4g}"
        f" + dissipated {last['dissipated']:.4g}{damped} (balance error {last['error']:+.1e})",
        f"largest balance error: {books.error[worst]:+.1e} of the energy supplied,"
        f" at {moment_text(float(books.time[worst]), by_steps)}",
        *said,
    ]
    result = {
        "remarks": said,
        "units": _units(per),
        "last": last,
        "largest_error": float(books.error[worst]),
        **books._asdict(),
    }
    header = (
        "step",
        "load step" if by_steps else "time, s",
        *(f"{name}, J{per}" for name in ("kinetic", "strain", "dissipated", "damped", "friction", "put in", "total")),
    )
    header = (*header, "error", f"momentum x, N s{per}", f"momentum y, N s{per}")
    return shared.deliver(args, result, lines, header, zip(*books, strict=True), path)


def _reaction(args: argparse.Namespace) -> int:
    from pdsolve.measures.balance import thickness_unit_suffix
    from pdsolve.measures.embedded_model import counts_load_steps
    from pdsolve.measures.forces import read_condition_force_histories, select_condition_force_histories
    from pdsolve.results import Results

    if args.gap is not None:
        return _gap(args)
    if args.smooth != 1:
        raise commandline.UsageError("--smooth needs --gap; give both, or leave it out")
    path = picture_path(args, ".reaction.png")
    with shared.styled(path, dict(args.assignments)), Results.open(args.results) as results:
        by_steps = counts_load_steps(results)
        axis, per, ways = _axis(results, args), thickness_unit_suffix(results), "xyz"[: results.dimension]
        chosen_reactions = select_condition_force_histories(read_condition_force_histories(results), args.condition)
        measured = _measured(results, args, chosen_reactions, axis)
        if path is not None:
            from pdpost.figures import charts, style

            style.save(charts.reactions(chosen_reactions, axis, per, measured, by_steps), path)
    lines = []
    for curve in chosen_reactions:
        along = curve.main_axis if axis is None else axis
        force, way = float(curve.force[-1, along]), float(curve.displacement[-1, along])
        most = float(curve.force[abs(curve.force[:, along]).argmax(), along])
        lines.append(
            f"{curve.name} ({curve.kind}): {force:+.4g} N{per} along {ways[along]} at {way * 1e3:+.4g} mm in the end,"
            f" {most:+.4g} N{per} at most"
            + (f"; all components together {curve.peak_resultant:.4g} N{per}" if curve.is_oblique(along) else "")
        )
    if measured is not None:
        (curve,) = chosen_reactions
        along = curve.main_axis if axis is None else axis
        lines.append(_measured_line(measured, curve.displacement[:, along], curve.force[:, along]))
    rows = [
        (curve.name, curve.kind, step, time, *force, *way)
        for curve in chosen_reactions
        for step, time, force, way in zip(curve.step, curve.time, curve.force, curve.displacement, strict=True)
    ]
    header = (
        "condition",
        "kind",
        "step",
        "load step" if by_steps else "time, s",
        *(f"force {way}, N{per}" for way in ways),
        *(f"displacement {way}, m" for way in ways),
    )
    conditions = [curve._asdict() | {"peak_resultant": curve.peak_resultant} for curve in chosen_reactions]
    result = {"units": _units(per), "conditions": conditions}
    return shared.deliver(args, result, lines, header, rows, path)


def _gap(args: argparse.Namespace) -> int:
    from pdsolve.measures.balance import thickness_unit_suffix
    from pdsolve.measures.forces import (
        force_over_gap_opening,
        measure_gap_between_places,
        read_condition_force_histories,
        read_named_gap,
        select_condition_force_histories,
    )
    from pdsolve.measures.json_keys import fields_by_json_key
    from pdsolve.results import Results

    if args.smooth < 1:
        raise commandline.UsageError(f"--smooth is {args.smooth}; use 1 or more")
    path = picture_path(args, ".gap.png")
    with shared.styled(path, dict(args.assignments)), Results.open(args.results) as results:
        axis, per = _axis(results, args), thickness_unit_suffix(results)
        opened = (
            read_named_gap(results, args.gap[0])
            if len(args.gap) == 1
            else measure_gap_between_places(results, *_two_places(args.gap))
        )
        conditions = select_condition_force_histories(read_condition_force_histories(results), args.condition)
        opening_curves = [
            force_over_gap_opening(opened, curve, curve.main_axis if axis is None else axis, args.smooth)
            for curve in conditions
        ]
        measured = _measured(results, args, conditions, axis)
        if path is not None:
            from pdpost.figures import charts, style

            style.save(charts.openings(opening_curves, per, measured), path)
    lines = [f"between nodes {opened.node_ids[0]} and {opened.node_ids[1]}"]
    for condition, curve in zip(conditions, opening_curves, strict=True):
        last, most = (
            f"{curve.force[k]:+.4g} N{per} at {curve.opening[k] * 1e3:+.4g} mm" for k in (-1, curve.peak_force_index)
        )
        area = f"area {abs(curve.work_under_curve):.4g} J{per}"
        lines.append(
            f"{curve.condition_name}, along {'xyz'[curve.axis]}: {last} of opening in the end, {most} at most, {area}"
        )
        if condition.is_oblique(curve.axis):
            lines.append(
                f"{curve.condition_name} has other components too, {condition.peak_resultant:.4g} N{per} together at"
                " most: the area is not its work, which pdpost balance prints"
            )
    if measured is not None:
        (curve,) = opening_curves
        lines.append(_measured_line(measured, curve.opening, curve.force))
    rows = [
        (curve.condition_name, opening, force)
        for curve in opening_curves
        for opening, force in zip(curve.opening, curve.force, strict=True)
    ]
    forces = [
        fields_by_json_key(curve) | {"peak": float(curve.force[curve.peak_force_index]), "area": curve.work_under_curve}
        for curve in opening_curves
    ]
    result = {"units": _units(per), "nodes": opened.node_ids, "forces": forces}
    return shared.deliver(args, result, lines, ("condition", "opening, m", f"force, N{per}"), rows, path)


def _measured(
    results: Results, args: argparse.Namespace, conditions: list[ConditionForceHistory], axis: int | None
) -> MeasuredCurve | None:
    """The measured curve of --measured with forces as the model has them, and with the signs of the one condition."""
    from pdsolve.measures.measured_curve import read_measured_curve, scale_to_model

    if args.measured is None:
        if args.thickness is not None:
            raise commandline.UsageError("--thickness needs --measured; give both, or leave it out")
        return None
    if len(conditions) != 1:
        raise commandline.UsageError(
            f"--measured is of one force, and {len(conditions)} are drawn; give one --condition"
        )
    curve = scale_to_model(read_measured_curve(args.measured), results.dimension, args.thickness, "--thickness")
    (condition,) = conditions
    along = condition.main_axis if axis is None else axis
    peak = int(abs(condition.force[:, along]).argmax())
    if condition.force[peak, along] < 0:
        curve = curve._replace(force=-curve.force)
    if args.gap is None and condition.displacement[peak, along] < 0:
        curve = curve._replace(displacement=-curve.displacement)
    return curve


def _measured_line(measured: MeasuredCurve, displacement: Floats, force: Floats) -> str:
    """How far a measured curve is from a computed one, in words."""
    import numpy as np

    from pdsolve.measures.measured_curve import misfit

    share, number = misfit(measured, displacement, force)
    least = "" if number == len(measured.force) else f" of {len(measured.force)}"
    if not np.isfinite(share):
        return f"{measured.name}: no measured point is within the computed curve"
    return f"{measured.name}: {share:.3%} of its largest force off at {number}{least} points (root mean square)"


def _two_places(words: list[str]) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """The places of a gap. Raises UsageError."""
    if len(words) != 2:
        raise commandline.UsageError(f"--gap has {len(words)} words; give a name, or two places X,Y")
    try:
        first_place, second_place = (_place("--gap", 2, 3)(word)[1] for word in words)
    except argparse.ArgumentTypeError as error:
        raise commandline.UsageError(f"--gap: {error}") from None
    return first_place, second_place


def _axis(results: Results, args: argparse.Namespace) -> int | None:
    """The component asked for, 0 to 2, or None. Raises ResultsError for z in a plate."""
    from pdsolve.results import ResultsError

    if args.component == "z" and results.dimension == 2:
        raise ResultsError(f"--component is z, and {results.name} is a plate; use x or y")
    return None if args.component is None else "xyz".index(args.component)


def _units(per: str) -> str:
    return "SI, per unit thickness" if per else "SI"


__all__ = ["add"]
