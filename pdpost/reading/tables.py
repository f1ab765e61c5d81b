"""The tables of a database for SQL users: columns, units, and example queries."""

from __future__ import annotations

from typing import NamedTuple

import msgspec

from pdmesh.model.medium import Medium
from pdmesh.model.output_fields import UNITS as OF_FIELDS
from pdsolve.measures.embedded_model import read
from pdsolve.results import Results

SHOWN = {  # what is in it
    "node_state": "every node there is, at every frame; NULL where a field was not stored",
    "node": "the nodes, undeformed, from the step of their birth on; an id is one node's at a time",
    "node_death": "the first step without a node, by its row in 'node'; the others live on",
    "epoch": "the steps at which nodes are born and die, and how many there are then",
    "frame": "when the fields were written",
    "history": "the ledger, per unit thickness; 'broken' counts the rows of 'bond_break'",
    "mass": "of diffusion: what there is of a substance, or of heat over its capacity, and where it has gone",
    "reaction": "what each condition, counted from 0, does to the plate, per unit thickness",
    "probe": "the nodes at the probes, as often as the ledger",
    "bond_break": "every broken bond; one of both its nodes is there twice",
    "crack": "segments of pre-cracks",
    "crack_face": "triangles of those of a body in space",
    "crack_particle": "cracks that are particles: their first step, their place, and the one each grew from",
    "meta": "what the run says of itself; 'model' is the grid file",
}
UNITS: dict[str, str] = {
    **OF_FIELDS,
    **dict.fromkeys([f"{axis}{end}" for axis in "xyz" for end in ("", "0", "1", "2")], "m"),
    **dict.fromkeys(("delta", "displacement_x", "displacement_y", "displacement_z"), "m"),
    **dict.fromkeys(("kinetic", "strain", "dissipated", "damped", "friction", "work", "refinement"), "J/m"),
    **dict.fromkeys(("momentum_x", "momentum_y", "momentum_z"), "N s/m"),
    **dict.fromkeys(("force_x", "force_y", "force_z"), "N/m"),
    **dict.fromkeys(("inside", "through", "supplied", "dissolved"), "mol"),
    "time": "s",
    "area": "m^2",
}
OF_BODIES = {  # which are not per unit thickness
    **dict.fromkeys(("kinetic", "strain", "dissipated", "damped", "friction", "work", "refinement"), "J"),
    **dict.fromkeys(("momentum_x", "momentum_y", "momentum_z"), "N s"),
    **dict.fromkeys(("force_x", "force_y", "force_z"), "N"),
    "area": "m^3",
}


class _Model(msgspec.Struct):
    """The key of the grid file that says what amounts are of."""

    medium: Medium | None = None


class TableColumns(NamedTuple):
    """A table or view and its columns."""

    name: str
    about: str
    columns: tuple[tuple[str, str], ...]  # name, unit; "" for numbers without one


class Query(NamedTuple):
    """A question and its SQL."""

    asks: str
    sql: str


def tables(results: Results) -> list[TableColumns]:
    """The tables for users, the most useful first."""
    medium = read(results, _Model).medium
    heats = medium is not None and medium.carries == "heat"
    content = dict.fromkeys(("inside", "through", "supplied"), f"K m^{results.dimension}") if heats else {}
    user_tables, units_of = [], UNITS | (OF_BODIES if results.dimension == 3 else {}) | content
    for name, about in SHOWN.items():
        columns = [row[1] for row in results.connection.execute(f"PRAGMA table_info({name})")]
        units = tuple((column, units_of.get(column, "").removesuffix("1")) for column in columns)
        user_tables += [TableColumns(name, about, units)] * bool(columns)  # older files have fewer
    return user_tables


_MOST_DAMAGED = (
    "SELECT s.node, s.x, s.y, (s.damage * n.family - n.cut) / max(n.family - n.cut, 1) AS damage FROM node_state s"
    " JOIN node n ON n.node = s.node WHERE s.step = (SELECT max(step) FROM frame) ORDER BY 4 DESC, s.node LIMIT 10"
)
_MOST_SEPARATED = (  # where nodes are born during the run, whose `cut` has what broke before
    "SELECT node, x, y, damage FROM node_state WHERE step = (SELECT max(step) FROM frame)"
    " ORDER BY damage DESC, node LIMIT 10"
)


def queries(results: Results) -> list[Query]:
    """Three example queries that this database can answer."""
    ids = results.nodes().ids
    node = 7 if 7 in ids else int(ids[0])
    return [
        Query("a node against time", f"SELECT time, uy FROM node_state WHERE node = {node}"),
        Query(
            "the most damaged nodes at the end",
            _MOST_DAMAGED if len(results.epochs()) == 1 else _MOST_SEPARATED,
        ),
        Query(
            "bonds broken in each microsecond",
            "SELECT CAST(1e6 * step * value AS INTEGER) AS microsecond, count(*) / 2 AS bonds FROM bond_break"
            " JOIN meta ON key = 'time_step' GROUP BY microsecond",
        ),
    ]
