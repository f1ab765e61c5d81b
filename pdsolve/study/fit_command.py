"""The command `pdsolve fit`: fits parameters of a model to a measured load-displacement curve."""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pdmesh import commandline, stopping
from pdmesh.file_kinds import FileKind
from pdmesh.plain_text import for_csv, print_to_stderr
from pdsolve.study import command

if TYPE_CHECKING:
    from pdsolve.study.fit import Fit, FitProgress, FittedParameter


def parser() -> argparse.ArgumentParser:
    """The command line of pdsolve fit."""
    program = commandline.program(
        "pdsolve fit",
        "Fit parameters of a model to a measured load-displacement curve by least squares over runs. Print them with"
        " their standard errors, and draw the measured, the first and the fitted curve with the residual. After an"
        " interruption the same command continues: finished runs are not solved again.",
    )
    program.add_argument("study", type=Path, help="the study as a TOML file (drawing, set, fit)")
    program.add_argument(
        "--measured",
        type=Path,
        required=True,
        metavar="CSV",
        help='the measured curve: columns with heads such as "lift, mm","load, N"',
    )
    program.add_argument(
        "-o", "--output", type=Path, metavar="FILE",
        help="the table of the runs (default: the study's name with .sqlite, in the current folder); the runs'"
        " databases are in a folder beside it, with .runs",
    )  # fmt: skip
    program.add_argument(
        "--picture",
        type=Path,
        metavar="FILE",
        help="the picture, in the format of its suffix (default: the study's name with .fit.png; none with --json)",
    )
    program.add_argument("--csv", type=Path, metavar="FILE", help="write the compared curves as a table, in SI units")
    command.add_run_options(program)
    program.add_argument("--json", action="store_true", help="print the result as JSON on stdout")
    program.add_argument("-q", "--quiet", action="store_true", help="print nothing but errors and warnings")
    return program


def main(argv: Sequence[str]) -> int:
    """Run pdsolve fit; returns its exit code."""
    args = parser().parse_args(argv)
    return commandline.run("pdsolve fit", lambda: _fit(args), _exits)


def _fit(args: argparse.Namespace) -> int:
    commandline.expect(args.study, FileKind.STUDY)
    commandline.expect_other_outputs(args)
    workers = command.chosen_workers(args)
    from pdsolve.measures.measured_curve import read_measured_curve
    from pdsolve.study.description import read_study
    from pdsolve.study.fit import fit_study

    study, measured = read_study(args.study), read_measured_curve(args.measured)
    path = commandline.output_path(args.output, args.study, ".sqlite", force=True)  # what is there is gone on with
    picture = None
    if args.picture is not None or not args.json:  # which a fit overwrites, as it does the table
        from pdmesh import plain_figure
        from pdsolve.study import fit_figure

        picture = commandline.output_path(args.picture, args.study, ".fit.png", force=True)
        plain_figure.check_format(picture)
    if args.csv is not None:
        commandline.output_path(args.csv, args.study, ".csv", force=True)
    with stopping.patience(stopping.WORKERS):
        try:
            fit = fit_study(study, measured, path, workers, _watch(args), args.again, args.force)
        except KeyboardInterrupt:
            commandline.note("pdsolve fit: interrupted; the same command goes on", args)
            raise
    settings = study.description.fit
    abscissa = "opening" if settings is not None and settings.gap else "displacement"
    per = "/m" if fit.is_per_thickness else ""
    if args.csv is not None:
        _write_csv(fit, args.csv, abscissa, per)
    lines = [f"{path}: the runs"]
    if picture is not None:
        plain_figure.save(fit_figure.draw(fit, abscissa, per), picture)
        lines.append(f"{picture}: the picture")
    for remark in fit.remarks:
        commandline.warn(f"pdsolve fit: warning: {remark}")
    result = {"output": str(path), "picture": None if picture is None else str(picture), **_json(fit)}
    commandline.report(result, [*lines, *_lines(fit)], args)
    return commandline.OK


def _watch(args: argparse.Namespace) -> Any:
    """What prints a line for each set of parameters that was tried."""

    def watch(progress: FitProgress) -> None:
        named = ", ".join(f"{name} = {value:g}" for name, value in progress.values.items())
        misfit = "the run failed" if progress.misfit is None else f"misfit {progress.misfit:.3%}"
        print_to_stderr(f"{progress.evaluation}: {named}: {misfit}")

    return None if args.quiet else watch


def _lines(fit: Fit) -> list[str]:
    """A fit in words."""
    lines = [_parameter_line(parameter) for parameter in fit.parameters]
    for one, parameter in enumerate(fit.parameters):
        lines += [
            f"correlation of {other.name} and {parameter.name}: {fit.correlation[one, at]:+.3f}"
            for at, other in enumerate(fit.parameters[:one])
            if math.isfinite(fit.correlation[one, at])
        ]
    lines.append(
        f"root mean square of the residual: {fit.misfit:.3%} of the largest force ({fit.first_misfit:.3%} at first), at"
        f" {len(fit.comparison.measured)} points"
    )
    lines.append(f"{fit.runs} runs for {fit.evaluations} sets of parameters; {fit.run_file}: the fitted run")
    return lines


def _parameter_line(parameter: FittedParameter) -> str:
    unit = f" {parameter.unit}" if parameter.unit else ""
    error = "" if parameter.standard_error is None else f" +- {parameter.standard_error:.2g}"
    return f"{parameter.name} = {parameter.value:.6g}{error}{unit} (first guess {parameter.first:.6g})"


def _json(fit: Fit) -> dict[str, Any]:
    """A fit for JSON, with null in the place of numbers that there are not."""
    finite = [[float(value) if math.isfinite(value) else None for value in row] for row in fit.correlation]
    return {
        "parameters": [parameter._asdict() for parameter in fit.parameters],
        "correlation": finite,
        "misfit": fit.misfit,
        "first_misfit": fit.first_misfit,
        "runs": fit.runs,
        "evaluations": fit.evaluations,
        "converged": fit.is_converged,
        "remarks": list(fit.remarks),
        "fitted_run": str(fit.run_file),
        "units": "SI, per unit thickness" if fit.is_per_thickness else "SI",
        "points": {name: column.tolist() for name, column in fit.comparison._asdict().items()},
    }


def _write_csv(fit: Fit, path: Path, abscissa: str, per: str) -> None:
    """Write the compared curves as a table."""
    from pdmesh.files import write_atomically

    points = fit.comparison
    names = ("measured", "first guess", "fitted", "residual")
    heads = [f"{abscissa}, m", *(f"{name}, N{per}" for name in names), "weight"]
    columns = (points.displacement, points.measured, points.first, points.fitted, points.fitted - points.measured)
    rows = zip(*(column.tolist() for column in (*columns, points.weight)), strict=True)
    write_atomically(path, "".join(",".join(map(for_csv, line)) + "\n" for line in (heads, *rows)).encode())


def _exits() -> dict[type[Exception], int]:
    from pdsolve.measures.measured_curve import MeasuredCurveError

    errors: list[type[Exception]] = [MeasuredCurveError]
    if "pdmesh.plain_figure" in sys.modules:
        from pdmesh.plain_figure import FigureError

        errors.append(FigureError)
    return command.exits() | dict.fromkeys(errors, commandline.BAD_INPUT)
