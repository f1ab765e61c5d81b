"""Values at the nodes as CSV."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from pdmesh.plain_text import for_csv
from pdsolve.measures import fields
from pdsolve.results import Nodes, Results

if TYPE_CHECKING:
    from pdsolve.measures.bond_pairs import BondPairs

Columns = Mapping[str, NDArray[np.generic]]


def csv(columns: Columns) -> bytes:
    """CSV text: a line of names, then one line a row. Integers in full, floats to nine digits, "nan" where missing."""
    kinds = ["%d" if column.dtype.kind in "iub" else "%.9g" for column in columns.values()]
    line = ",".join(kinds)
    rows = zip(*(column.tolist() for column in columns.values()), strict=True)
    return "\n".join([",".join(map(for_csv, columns)), *(line % row for row in rows), ""]).encode()


def of_field(results: Results, name: str, step: int) -> dict[str, NDArray[np.generic]]:
    """Node, reference position and all components of a field after `step`, in SI units.

    Strain and stress come with the damage, and with the separation, which tells where they are unreliable.
    """
    nodes = results.nodes(step)
    components = fields.all_field_components(results, name, step)
    named = {f"{name}_{part}" if part else name: values for part, values in components.items()}
    shares = ("damage", "separation") if fields.FIELDS[name].is_fitted_to_bonds else ()
    more = {share: fields.field_values(results, share, step) for share in shares}
    return {"node": nodes.ids, **_places(nodes), **more, **named}


def of_frame(results: Results, step: int, also: Sequence[str] = ()) -> dict[str, NDArray[np.generic]]:
    """Node, reference position, spacing, area (volume in a body), all stored fields of a frame and those in `also`, in
    SI."""
    nodes = results.nodes(step)
    stored = {name: results.field(name, step) for name in results.stored(step)}
    if "damage" in stored:  # in files bonds that pre-cracks cut count
        stored["damage"] = fields.field_values(results, "damage", step).astype(np.float32)
    more = {
        f"{name}_{part}": values
        for name in also
        for part, values in fields.all_field_components(results, name, step).items()
    }
    extent = "area" if results.dimension == 2 else "volume"
    return {"node": nodes.ids, **_places(nodes), "delta": nodes.delta, extent: nodes.area, **stored, **more}


def _places(nodes: Nodes) -> dict[str, NDArray[np.generic]]:
    return dict(zip("xyz", nodes.position.T, strict=False))


def of_bonds(results: Results, step: int, bond_pairs: BondPairs) -> dict[str, NDArray[np.generic]]:
    """Both nodes of each bond in `bond_pairs` after `step`, and 1 if it is broken, else 0."""
    ids = results.nodes(step).ids
    return {
        "node": ids[bond_pairs.node_rows[:, 0]],
        "neighbour": ids[bond_pairs.node_rows[:, 1]],
        "broken": bond_pairs.is_broken.astype(np.int8),
    }
