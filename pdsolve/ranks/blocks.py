"""The blocks of a rank's slab: the same, with the same order of sums, as one process has of these rows.

Values that differ by round-off are merged in the order in which they appear, so that the tables of values go from rank
to rank. Each looks at its rows meanwhile, and all use the tables of the last one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import ROWS
from pdsolve.bonds.assembly import BondSource, BondStatistics, Part
from pdsolve.codegen.vector_code import ROW
from pdsolve.lattice.block_bonds import Slots, Tables, bonds_and_lanes, fill_lanes, join_parts, room_of, slots_of
from pdsolve.lattice.blocks import Blocks
from pdsolve.lattice.layout import LANES
from pdsolve.laws.law import Law
from pdsolve.numerics.team import PASSED, Team
from pdsolve.ranks.slabs import Slab


class Seen(NamedTuple):
    """What is seen of the bonds of own nodes while they are made."""

    statistics: BondStatistics
    reached: list[NDArray[np.int32]]  # rows of the whole grid that bonds go to, of each part


class Scratch(NamedTuple):
    """The number type of blocks, how many threads work on them, and the dimension of the bodies."""

    kind: type[np.floating]
    threads: int
    dimension: int


def blocks_of(
    team: Team, law: Law, filling: BondSource, slab: Slab, bond_survey: Seen, scratch: Scratch
) -> Blocks | None:
    """The bonds of a slab in blocks, for a window's rows, of which only its own have bonds; None if the nodes of all
    ranks are on no lattice. `filling` makes the bonds of the window. All ranks call this together."""
    tables: Tables | None = Tables(scratch.dimension)
    if team.rank > 0:
        tables = team.received(team.rank - 1, PASSED)
    slots = None if tables is None else _numbered(filling, slab, tables, bond_survey)
    if team.rank < team.size - 1:
        team.comm.send(tables if slots is not None else None, team.rank + 1, PASSED)
    tables = team.comm.bcast(tables if slots is not None else None, team.size - 1)
    every = team.comm.allgather((0, 0) if slots is None else bonds_and_lanes(slots))
    bonds, lanes = (sum(column) for column in zip(*every, strict=True))
    if tables is None or slots is None or not fill_lanes(bonds, lanes, scratch.dimension):
        return None
    blocks = join_parts(law, tables, slots, scratch.kind, scratch.threads)
    before, after = (slab.first - slab.begin) // LANES, (room_of(slab.end) - room_of(slab.last)) // LANES

    def widened(start: NDArray[np.int64], per_block: int) -> NDArray[np.int64]:
        return np.concatenate([np.zeros(per_block * before, np.int64), start, np.full(per_block * after, start[-1])])

    return blocks._replace(
        start=widened(blocks.start, 1),
        start_of_rows=widened(blocks.start_of_rows, LANES // ROW),
        ids=blocks.ids - np.int32(slab.begin) * (blocks.ids > 0),
        softened=np.zeros(before + len(blocks.softened) + after, dtype=np.bool_),
    )


def _numbered(filling: BondSource, slab: Slab, tables: Tables, bond_survey: Seen) -> list[Slots] | None:
    """The slots of a slab's own rows; new values are added to the tables. None if nodes are on no lattice."""
    all_slots, room = [], room_of(slab.nodes)
    for first in range(*slab.chunks, ROWS):
        last = min(first + ROWS, slab.chunks[1])
        part = filling.part(np.arange(first, last) - slab.begin)
        bonds = part.bonds._replace(neighbour=part.bonds.neighbour + np.int32(slab.begin))
        part = part._replace(first=part.first + slab.begin, bonds=bonds)  # rows of the whole grid
        slots = slots_of(part.bonds, part.first, room, tables)
        if slots is None:
            return None
        begin, end = max(first, slab.first), min(last, slab.last)
        slab_part = rows_of(part, begin, end)
        bond_survey.statistics.look(slab_part)
        bond_survey.reached.append(np.unique(slab_part.bonds.neighbour))
        if (begin, end) != (first, last):
            slots = slots_of(slab_part.bonds, slab_part.first, room, tables)
        assert slots is not None
        all_slots.append(slots)
    return all_slots


def rows_of(part: Part, first: int, last: int) -> Part:
    """The rows `first` to `last` - 1 of a part."""
    start = part.bonds.start[first - part.first : last - part.first + 1]
    bond_slice = slice(int(start[0]), int(start[-1]))
    bonds = part.bonds._replace(
        start=start - start[0], **{name: getattr(part.bonds, name)[bond_slice] for name in part.bonds._fields[1:]}
    )
    return Part(first, bonds, part.family[first - part.first : last - part.first])
