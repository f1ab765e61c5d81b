"""Results of a study: measures against parameters, one dot a run."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pdmesh import commandline
from pdpost.commands import shared
from pdpost.commands.shared import (
    NO_PICTURE,
    add_csv,
    add_journal,
    add_style,
    picture_path,
)

if TYPE_CHECKING:
    from pdpost.commands.shared import Commands


def add(commands: Commands) -> None:
    """Put `study` on the command line."""
    study = commands.add_parser(
        "study",
        help="draw measures of a study's runs against the parameters that were varied",
        description="Draw measures of a study's runs against a parameter: a dot for each run, the median and the range."
        " Each value of the other varied parameters has a curve of its own.",
    )
    study.add_argument("results", type=Path, metavar="study", help="the table written by pdsolve study")
    study.add_argument(
        "--measure", action="append", default=[], metavar="NAME",
        help="what to draw, such as branching; may be repeated (default: up to four that differ between the runs)",
    )  # fmt: skip
    study.add_argument(
        "--over", metavar="NAME", help="the parameter to draw against (default: the one with the most values)"
    )
    commandline.add_common_options(
        study,
        "the picture, in the format of its suffix (default: the table's name with .study.png; none with --json"
        " or --csv alone)",
        NO_PICTURE,
    )
    add_style(study)
    add_journal(study)
    add_csv(study)
    study.add_argument(
        "--runs", metavar="FILE", help="write all runs as a table of CSV, with column heads in words and SI units"
    )
    study.set_defaults(run=_study)


def _study(args: argparse.Namespace) -> int:
    from pdmesh.files import write_atomically
    from pdpost.reading import scatter, studies

    path = picture_path(args, ".study.png")
    if args.runs is not None:
        runs = commandline.output_path(Path(args.runs), args.results, ".csv", args.force)
        write_atomically(runs, studies.runs_csv(args.results))
    with shared.styled(path, dict(args.assignments)):
        study = studies.read(args.results)
        measures, over = scatter.choose_measures_and_parameter(study, args.measure, args.over)
        nowhere = scatter.measures_without_values(study, args.measure)
        measured = {name: scatter.group_runs_by_parameter(study, name, over) for name in measures}
        if path is not None:
            from pdpost.figures import study_figure, style

            style.save(study_figure.panels_of(study, measured, over), path)
    if nowhere:
        commandline.note(f"pdpost study: in none of {len(study.rows)} runs: {', '.join(nowhere)}", args)
    rows = [
        (
            measure,
            spread.series,
            spread.parameter_value,
            spread.median_value,
            *spread.smallest_and_largest_value,
            len(spread.known_values),
            len(spread.measured_values),
        )
        for measure, spreads in measured.items()
        for spread in spreads
    ]
    header = ("measure", "series", over or "run", "median", "smallest", "largest", "happened", "runs")
    units = {name: study.columns[name].unit for name in measures}
    numbers: dict[str, Any] = {"over": over, "units": units, "failed": study.failed, "waiting": study.waiting}
    numbers["measures"] = [dict(zip(("measure", "series", "value", *header[3:]), row, strict=True)) for row in rows]
    lines = []
    for measure, series, value, median, low, high, happened, count in rows:
        named = (
            ", ".join(filter(None, [series, f"{studies.short(over)} {studies.value_of(value)}" if over else ""]))
            or "all runs"
        )
        line, unit = f"{measure}, {named}: ", f" {units[measure]}" if units[measure] else ""
        line += f"{median:.4g}{unit} in the median, {low:.4g} to {high:.4g}, " if happened else ""
        lines.append(f"{line}in {happened or 'none'} of {count} runs")
    if study.failed or study.waiting:
        lines.append(f"left out: {study.failed} runs that failed, {study.waiting} that wait")
    return shared.deliver(args, numbers, lines, header, rows, path)
