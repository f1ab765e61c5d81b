"""How to query the database in SQL."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from pdmesh import commandline
from pdpost.commands.shared import add_results

if TYPE_CHECKING:
    from pdpost.commands.shared import Commands


def add(commands: Commands) -> None:
    """Put `sql` on the command line."""
    sql = commands.add_parser("sql", help="print the tables of the database, and queries to begin with")
    add_results(sql)
    sql.add_argument("--json", action="store_true", help="print the result as JSON on stdout")
    sql.set_defaults(run=_sql, quiet=False)


def _sql(args: argparse.Namespace) -> int:
    import shlex

    from pdpost.reading.tables import queries, tables
    from pdsolve.results import Results

    with Results.open(args.results) as results:
        shown, example_queries = tables(results), queries(results)
    lines = []
    for table in shown:
        columns = ", ".join(f"{name} [{unit}]" if unit else name for name, unit in table.columns)
        lines += [f"{table.name}: {table.about}", f"    {columns}"]
    for query in example_queries:
        lines += ["", f"{query.asks}:", f'    sqlite3 {shlex.quote(str(args.results))} "{query.sql}"']
    result = {
        "tables": {table.name: {"about": table.about, "columns": dict(table.columns)} for table in shown},
        "queries": [query._asdict() for query in example_queries],
    }
    commandline.report(result, lines, args)
    return commandline.OK
