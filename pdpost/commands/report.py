"""Everything about a run on one page."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from pdmesh import commandline
from pdpost.commands.shared import add_results, add_style

if TYPE_CHECKING:
    from pdpost.commands.shared import Commands


def add(commands: Commands) -> None:
    """Put `report` on the command line."""
    page = commands.add_parser(
        "report", help="write one HTML page: load-displacement curve, crack, film, fields, energy balance, model"
    )
    add_results(page)
    commandline.add_common_options(page, "the page (default: the results' name with .report.html)")
    page.add_argument(
        "--interactive",
        action="store_true",
        help="with the page of pdpost view in place of the film: larger, and it needs WebGL (needs the extra view)",
    )
    add_style(page)
    page.set_defaults(run=_report)


def _report(args: argparse.Namespace) -> int:
    from pdmesh.files import write_atomically
    from pdpost.browser.page import embedded
    from pdpost.figures.page import report
    from pdpost.figures.style import styled
    from pdsolve.results import Results

    path = commandline.output_path(args.output, args.results, ".report.html", args.force)
    with styled(dict(args.assignments)), Results.open(args.results) as results:
        name = args.results.stem
        page = report(results, name, animation=embedded(results, name) if args.interactive else "").encode()
    write_atomically(path, page)
    commandline.report({"output": str(path), "bytes": len(page)}, [f"{path}: {len(page) / 1e6:.2g} MB"], args)
    return commandline.OK
