"""The part of one rank: its window of the model, and the bonds of its own rows. Functions here are asked of all ranks.

Rows are those of the whole grid where several ranks have to do with them, and those of the rank's window inside.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import BondSource, BondStatistics, Counted, Scheme
from pdsolve.lattice.operator import BlockLattice, TileLattice
from pdsolve.laws import law_of
from pdsolve.model import Model
from pdsolve.numerics.ordered_sums import branches, total
from pdsolve.numerics.team import Team
from pdsolve.operators.bond_list import BondList
from pdsolve.operators.protocol import CheckpointArrays, Operator
from pdsolve.options import Options
from pdsolve.ranks.blocks import Scratch, Seen, blocks_of
from pdsolve.ranks.ghost_exchange import GhostExchange
from pdsolve.ranks.slabs import Slab
from pdsolve.schemes import SCHEMES
from pdsolve.state import Broken

ENDS = ("_source", "_target")  # of bonds, in the names of their history
Made = tuple[Operator, Counted]
Make = Callable[[Model, Options, Scheme, BondSource], Made]  # what makes the operator of a model
MakeTiled = Callable[[Model, Options, Scheme], Made | None]  # the same in tiles; None where they cannot be


class Built(NamedTuple):
    """What a rank says of the bonds of its own nodes."""

    resistance: float  # the largest bound of a node's stiffness, over its density, 1/s^2
    bonds: int  # at the start
    lonely: NDArray[np.int64]  # rows of the whole grid without any
    kernel: str


class Part:
    """What a rank works on."""

    def __init__(self, slab: Slab, model: Model, operator: Operator, counted: Counted, ghosts: GhostExchange) -> None:
        """`model` and `counted` are of the window."""
        self.slab, self.model, self.operator, self.counted, self.ghosts = slab, model, operator, counted, ghosts
        self.own = slice(slab.first - slab.begin, slab.last - slab.begin)


def build(team: Team, options: Options, starts: NDArray[np.int64], share: tuple[Slab, Model]) -> Built | None:
    """Make the bonds of a slab in blocks; None if all nodes are on no lattice."""
    slab, model = share[0], window(*share)
    scheme, law = SCHEMES[options.mode], law_of(model, SCHEMES[options.mode].matches_work)
    filling = scheme.fill(model)
    bond_survey = Seen(BondStatistics(filling, scheme.symmetric), [])
    scratch = Scratch(np.dtype(options.precision).type, options.threads or 1, model.grid.dimension)
    blocks = blocks_of(team, law, filling, slab, bond_survey, scratch)
    softens = any(team.comm.allgather(bond_survey.statistics.softens))
    if blocks is None:
        return None
    statistics = bond_survey.statistics
    arrays: tuple[NDArray[Any], ...] = statistics.stiffness_bound, statistics.family, statistics.count
    around = slab.first - slab.begin, slab.end - slab.last  # nodes of the window that are not its own
    bound, family, count = (np.pad(own_values, around) for own_values in arrays)
    operator = BlockLattice(law, blocks, bound, scheme.symmetric, softens)
    reached = np.unique(np.concatenate(bond_survey.reached)).astype(np.int64)
    return _adopt_bonds(team, starts, Bonded(slab, model, operator, Counted(filling.area, family, count)), reached)


def build_tiles(
    team: Team, options: Options, make: MakeTiled, starts: NDArray[np.int64], share: tuple[Slab, Model]
) -> Built | None:
    """Make the bonds of a whole window in tiles; None where those of any rank cannot be."""
    slab, model = share[0], window(*share)
    made = make(model, options._replace(threads=options.threads or 1), SCHEMES[options.mode])
    can_be = team.comm.allgather(made is not None)
    return None if made is None or not all(can_be) else _adopt_window(team, starts, slab, model, made)


def build_window(
    team: Team, options: Options, make: Make, starts: NDArray[np.int64], share: tuple[Slab, Model]
) -> Built:
    """Make the bonds of a whole window; those of ghosts are there to know what own nodes' bonds ask of them."""
    slab, model = share[0], window(*share)
    scheme = SCHEMES[options.mode]
    made = make(model, options._replace(threads=options.threads or 1), scheme, scheme.fill(model))
    return _adopt_window(team, starts, slab, model, made)


def _adopt_window(team: Team, starts: NDArray[np.int64], slab: Slab, model: Model, made: Made) -> Built:
    """Take over the bonds of a whole window: those of a law without a first pass ask for no more than the motion of
    their ends."""
    operator, counted = made
    reached = np.arange(slab.begin, slab.end)
    if isinstance(operator, BondList | TileLattice) and law_of(model).width is None:
        own_range = slab.first - slab.begin, slab.last - slab.begin
        operator.only(*own_range)
        reached = np.unique(operator.bonds(*own_range)[1]) + slab.begin
    return _adopt_bonds(team, starts, Bonded(slab, model, operator, counted), reached)


def window(slab: Slab, model: Model) -> Model:
    """The model of a slab's window, from that or, of a lattice, from that of all nodes."""
    return model if model.grid.lattice is None else model.window(slab.begin, slab.end)


class Bonded(NamedTuple):
    """The bonds of a window."""

    slab: Slab
    model: Model
    operator: Operator
    counted: Counted


def _adopt_bonds(team: Team, starts: NDArray[np.int64], bonded: Bonded, reached: NDArray[np.int64]) -> Built:
    """Take over these bonds, whose own nodes ask for the motion of those `reached` (k,) by rows of the whole grid."""
    slab, model, operator, counted = bonded
    others = reached[(reached < slab.first) | (reached >= slab.last)]
    part = team.part = Part(slab, model, operator, counted, GhostExchange(team, starts, slab, others))
    own_rows = part.own
    resistance = operator.stiffness_bound()[own_rows] / model.rho[own_rows]
    lonely = np.flatnonzero(counted.bonds[own_rows] == 0) + slab.first
    return Built(float(resistance.max(initial=0.0)), int(counted.bonds[own_rows].sum()), lonely, operator.name)


def added_up(team: Team, values: NDArray[np.float64]) -> float:
    """The sum of the values (k,) of all ranks, in their order. All ranks call this together."""
    counts = team.comm.allgather(len(values))
    first, count = sum(counts[: team.rank]), sum(counts)
    return total(team.comm.allgather(branches(values, first, count)), count)


def broken(part: Part, after: int = 0) -> Broken:
    """Bonds of own nodes broken after a step, by rows of the window."""
    broken_bonds = part.operator.broken(after)
    mine = (broken_bonds.source >= part.own.start) & (broken_bonds.source < part.own.stop)
    return Broken(*(column[mine] for column in broken_bonds))


def own_checkpoint_arrays(part: Part, window_history: CheckpointArrays) -> dict[str, NDArray[Any]]:
    """What own nodes and their bonds have of arrays of a window, by rows of the whole grid."""
    slab, own_history = part.slab, dict[str, NDArray[Any]]()
    for name, values in window_history.items():
        source = _ends(window_history, name, "source")
        if source is None:
            own_history[name] = values[part.own]
            continue
        mine = (source >= part.own.start) & (source < part.own.stop)
        own_history[name] = values[mine] + slab.begin if name.endswith(ENDS) else values[mine]
    return own_history


def _ends(history: CheckpointArrays, name: str, end: str) -> NDArray[np.int64] | None:
    """The sources, or targets, of the bonds that a column of a history is of; None if it is of nodes."""
    stem = name.removesuffix("_edge").removesuffix("_source").removesuffix("_target")
    return history.get(f"{stem}_{end}")


def is_of_bonds(history: CheckpointArrays, name: str) -> bool:
    """Whether a column of a history is of bonds, not of nodes."""
    return _ends(history, name, "source") is not None


def of_window(part: Part, history: CheckpointArrays, broken: Broken) -> tuple[dict[str, NDArray[Any]], Broken]:
    """What a window has of arrays of its nodes and of all bonds, and of broken bonds; in blocks only own nodes have
    bonds."""
    slab, alone = part.slab, isinstance(part.operator, BlockLattice)
    first, last = (slab.first, slab.last) if alone else (slab.begin, slab.end)
    mine = (broken.source >= first) & (broken.source < last)
    mine &= (broken.target >= slab.begin) & (broken.target < slab.end)
    past = Broken(broken.step[mine], broken.source[mine] - slab.begin, broken.target[mine] - slab.begin)
    window_history: dict[str, NDArray[Any]] = {}
    for name, values in history.items():
        source, target = (_ends(history, name, end) for end in ("source", "target"))
        if source is None or target is None:
            window_history[name] = values
            continue
        in_window = (source >= first) & (source < last) & (target >= slab.begin) & (target < slab.end)
        window_history[name] = values[in_window] - slab.begin if name.endswith(ENDS) else values[in_window]
    return window_history, past
