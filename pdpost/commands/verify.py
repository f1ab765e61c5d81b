"""Check that a database holds what was written to it."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from pdmesh import commandline
from pdpost.commands.shared import add_results

if TYPE_CHECKING:
    from pdpost.commands.shared import Commands


def add(commands: Commands) -> None:
    """Put `verify` on the command line."""
    about = "read the whole database and check that it is intact"
    verify = commands.add_parser(
        "verify",
        help=about,
        description=f"{about[0].upper()}{about[1:]}: its pages, all checksums, the order and the number of steps,"
        " frames, fields, nodes and bonds, and whether broken bonds and energies agree with each other. The exit code"
        " is 0 if the database is intact, and 2 if not; one line then says what is wrong, and where.",
    )
    add_results(verify)
    verify.add_argument("--json", action="store_true", help="print the result as JSON on stdout")
    verify.set_defaults(run=_verify, quiet=False)


def _verify(args: argparse.Namespace) -> int:
    from pdsolve.measures.json_keys import fields_by_json_key
    from pdsolve.measures.verification import verify_database
    from pdsolve.results import Results

    with Results.open(args.results) as results:
        counts = verify_database(results)
    nodes, bonds = f"{counts.node_count} nodes", f"{counts.bond_count} bonds, {counts.broken_bond_count} of them broken"
    frames = f"{counts.frame_count} frames of {counts.field_count} fields, steps 0 to {counts.last_step}"
    rest = f"{frames}; the run is '{counts.status}'"
    line = f"{args.results}: ok: {nodes}, {bonds}, {rest}" + ("" if counts.has_checksums else "; it has no checksums")
    commandline.report({"results": str(args.results), "ok": True, **fields_by_json_key(counts)}, [line], args)
    return commandline.OK
