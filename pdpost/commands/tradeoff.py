"""Cost against error for several results of one scene."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from pdmesh import commandline
from pdpost.commands import shared
from pdpost.commands.shared import (
    add_csv,
    add_journal,
    add_style,
    check_csv,
)

if TYPE_CHECKING:
    from pdpost.commands.shared import Commands
    from pdsolve.measures.tradeoff import TradeoffPoint

COSTS = ("wall_time", "bond_updates", "bytes")
ERRORS = ("displacement", "path", "start", "branching", "energy")


def add(commands: Commands) -> None:
    """Put `tradeoff` on the command line."""
    tradeoff = commands.add_parser(
        "tradeoff",
        help="chart the cost of results of one scene against their errors",
        description="Chart the cost of results of one scene against their errors, relative to a reference, in"
        " displacements, crack path, times and energy. Mark the Pareto front, and name the cheapest result within a"
        " given error.",
    )
    tradeoff.add_argument("results", type=Path, nargs="+", help="databases written by pdsolve, or tables of studies")
    tradeoff.add_argument("--reference", type=Path, required=True, metavar="FINE", help="the results to compare with")
    tradeoff.add_argument(
        "--within",
        type=commandline.share,
        metavar="SHARE",
        help="name the cheapest result within this error, such as 2%%",
    )
    tradeoff.add_argument(
        "--by", choices=ERRORS, action="append", default=[], help="an error that counts; may be repeated (default: all)"
    )
    tradeoff.add_argument("--cost", choices=COSTS, default="wall_time", help="the measure of cost")
    commandline.add_common_options(
        tradeoff,
        "the chart, in the format of its suffix, with its numbers in a .tradeoff.json beside it (default:"
        " tradeoff.png and tradeoff.json)",
    )
    add_style(tradeoff)
    add_journal(tradeoff)
    add_csv(tradeoff)
    tradeoff.set_defaults(run=_tradeoff)


def _tradeoff(args: argparse.Namespace) -> int:
    import json

    import numpy as np

    from pdmesh.files import write_atomically
    from pdpost.figures import style, tradeoff_figure
    from pdsolve.measures import tradeoff

    compared, args.results = args.results, args.reference  # what --csv must not overwrite
    picture = commandline.output_path(args.output, Path("tradeoff.sqlite"), ".png", args.force)
    table_suffix = ".json" if args.output is None else ".tradeoff.json"  # x.json may be a grid file
    table = picture.with_suffix(table_suffix)
    commandline.output_path(table, Path("tradeoff.sqlite"), ".json", args.force, is_companion=True)
    check_csv(args, picture, table)
    with style.styled(dict(args.assignments)):
        points = _points(compared, args.reference)
        kinds = _kinds(points, args.by)
        cost = np.array([getattr(point.cost, args.cost) for point in points])
        error = np.array([_worst(point, kinds) for point in points])
        shown = kinds if len(kinds) == 1 else [*kinds, "worst"]
        style.save(tradeoff_figure.tradeoff(points, args.cost, shown, args.within), picture)
    best = tradeoff.pareto_front(cost, error)
    chosen = None if args.within is None else tradeoff.cheapest_point(cost, error, args.within)
    cheapest = None if chosen is None else points[chosen].name
    rated = list(zip(points, error.tolist(), strict=True))
    result = {
        "reference": str(args.reference),
        "cost": args.cost,
        "errors": kinds,
        "points": [
            {
                "name": point.name,
                "nodes": point.node_count,
                **point.cost._asdict(),
                **point.errors._asdict(),
                "worst": worst,
            }
            for point, worst in rated
        ],
        "front": [points[at].name for at in best],
        "within": args.within,
        "cheapest": cheapest,
    }
    write_atomically(table, json.dumps(shared.finite(result), indent=1, allow_nan=False).encode() + b"\n")
    header = ("name", "nodes", *COSTS, *ERRORS, "worst", "front")
    rows = [
        (point.name, point.node_count, *point.cost, *point.errors, worst, at in best)
        for at, (point, worst) in enumerate(rated)
    ]
    lines = []
    for point, worst in (rated[at] for at in best):
        errors = [(kind, getattr(point.errors, kind)) for kind in kinds]
        parts = ", ".join(f"{kind} {share:.2%}" for kind, share in errors if share is not None)
        lines.append(f"on the front: {point.name}, {point.cost.wall_time:.3g} s, within {worst:.2%} ({parts})")
    if args.within is not None:
        lines.append(f"the cheapest within {args.within:.3g}: {cheapest or 'none of them'}")
    return shared.deliver(args, result, lines, header, rows, picture)


def _points(files: list[Path], reference: Path) -> list[TradeoffPoint]:
    """Points of the chart for the results in `files`, named by their paths if file names repeat."""
    from pdpost.reading.studies import stands_for
    from pdsolve.measures import tradeoff
    from pdsolve.results import Results

    points, named = [], stands_for(files)
    with Results.open(reference) as fine:
        for name, path in named:
            with Results.open(path) as results:
                points.append(tradeoff.measure_tradeoff_point(results, path, fine)._replace(name=name))
    if len({point.name for point in points}) < len(points):
        points = [point._replace(name=str(path)) for point, (_, path) in zip(points, named, strict=True)]
    return points


def _kinds(points: list[TradeoffPoint], wanted_kinds: list[str]) -> list[str]:
    """The kinds of error to draw: those asked for, or all available. Raises UsageError naming the available ones."""
    available = [kind for kind in ERRORS if any(getattr(point.errors, kind) is not None for point in points)]
    missing = [kind for kind in wanted_kinds if kind not in available]
    if missing or not available:
        raise commandline.UsageError(
            f"{'--by ' + missing[0] if missing else 'errors'}: the reference has nothing to compare; use one of"
            f" {', '.join(available) or 'none'}"
        )
    return wanted_kinds or available


def _worst(point: TradeoffPoint, kinds: list[str]) -> float:
    errors = [getattr(point.errors, kind) for kind in kinds]
    return max((error for error in errors if error is not None), default=float("nan"))
