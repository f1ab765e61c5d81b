"""The part of one rank: its window of the model, and the bonds of its own rows, which all ranks make at once.

Functions here are asked of all ranks. Rows are those of the whole grid where several ranks have to do with them, and
those of the rank's window inside.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import BondSource, BondStatistics, FamilyCounts, Scheme
from pdsolve.lattice.layout import LANES
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
from pdsolve.ranks.slabs import Slab, slabs_of, starts_of
from pdsolve.results.schema import CHUNK
from pdsolve.schemes import SCHEMES
from pdsolve.state import Broken

ENDS = ("_source", "_target")  # of bonds, in the names of their history
CountedOperator = tuple[Operator, FamilyCounts]
Make = Callable[[Model, Options, Scheme, BondSource], CountedOperator]  # what makes the operator of a model
MakeTiled = Callable[[Model, Options, Scheme], CountedOperator | None]  # the same in tiles; None where they cannot be


class Built(NamedTuple):
    """What a rank says of the bonds of its own nodes."""

    resistance: float  # the largest bound of a node's stiffness, over its density, 1/s^2
    bonds: int  # at the start
    lonely: NDArray[np.int64]  # rows of the whole grid without any
    kernel: str


class Part:
    """What a rank works on."""

    def __init__(
        self, slab: Slab, model: Model, operator: Operator, counted: FamilyCounts, ghosts: GhostExchange
    ) -> None:
        """`model` and `counted` are of the window."""
        self.slab, self.model, self.operator, self.counted, self.ghosts = slab, model, operator, counted, ghosts
        self.own_rows = slice(slab.first - slab.begin, slab.last - slab.begin)


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
    return _adopt_bonds(team, starts, Bonded(slab, model, operator, FamilyCounts(filling.area, family, count)), reached)


def build_tiles(
    team: Team, options: Options, make: MakeTiled, starts: NDArray[np.int64], share: tuple[Slab, Model]
) -> Built | None:
    """Make the bonds of a whole window in tiles; None where those of any rank cannot be."""
    slab, model = share[0], window(*share)
    counted_operator = make(model, options._replace(threads=options.threads or 1), SCHEMES[options.mode])
    can_be = team.comm.allgather(counted_operator is not None)
    if counted_operator is None or not all(can_be):
        return None
    return _adopt_window(team, starts, slab, model, counted_operator)


def build_window(
    team: Team, options: Options, make: Make, starts: NDArray[np.int64], share: tuple[Slab, Model]
) -> Built:
    """Make the bonds of a whole window; those of ghosts are there to know what own nodes' bonds ask of them."""
    slab, model = share[0], window(*share)
    scheme = SCHEMES[options.mode]
    counted_operator = make(model, options._replace(threads=options.threads or 1), scheme, scheme.fill(model))
    return _adopt_window(team, starts, slab, model, counted_operator)


def _adopt_window(
    team: Team, starts: NDArray[np.int64], slab: Slab, model: Model, counted_operator: CountedOperator
) -> Built:
    """Take over the bonds of a whole window: those of a law without a first pass ask for no more than the motion of
    their ends."""
    operator, counted = counted_operator
    reached = np.arange(slab.begin, slab.end)
    if operator.bond_layout != "blocks" and law_of(model).width is None:
        own_range = slab.first - slab.begin, slab.last - slab.begin
        cast("BondList | TileLattice", operator).only(*own_range)
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
    counted: FamilyCounts


def _adopt_bonds(team: Team, starts: NDArray[np.int64], bonded: Bonded, reached: NDArray[np.int64]) -> Built:
    """Take over these bonds, whose own nodes ask for the motion of those `reached` (k,) by rows of the whole grid."""
    slab, model, operator, counted = bonded
    others = reached[(reached < slab.first) | (reached >= slab.last)]
    part = team.part = Part(slab, model, operator, counted, GhostExchange(team, starts, slab, others))
    own_rows = part.own_rows
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
    is_local = (broken_bonds.source >= part.own_rows.start) & (broken_bonds.source < part.own_rows.stop)
    return Broken(*(column[is_local] for column in broken_bonds))


def own_checkpoint_arrays(part: Part, window_history: CheckpointArrays) -> dict[str, NDArray[Any]]:
    """What own nodes and their bonds have of arrays of a window, by rows of the whole grid."""
    slab, own_history = part.slab, dict[str, NDArray[Any]]()
    for name, values in window_history.items():
        source = _ends(window_history, name, "source")
        if source is None:
            own_history[name] = values[part.own_rows]
            continue
        is_local = (source >= part.own_rows.start) & (source < part.own_rows.stop)
        own_history[name] = values[is_local] + slab.begin if name.endswith(ENDS) else values[is_local]
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
    slab, alone = part.slab, part.operator.bond_layout == "blocks"
    first, last = (slab.first, slab.last) if alone else (slab.begin, slab.end)
    is_local = (broken.source >= first) & (broken.source < last)
    is_local &= (broken.target >= slab.begin) & (broken.target < slab.end)
    past = Broken(broken.step[is_local], broken.source[is_local] - slab.begin, broken.target[is_local] - slab.begin)
    window_history: dict[str, NDArray[Any]] = {}
    for name, values in history.items():
        source, target = (_ends(history, name, end) for end in ("source", "target"))
        if source is None or target is None:
            window_history[name] = values
            continue
        in_window = (source >= first) & (source < last) & (target >= slab.begin) & (target < slab.end)
        window_history[name] = values[in_window] - slab.begin if name.endswith(ENDS) else values[in_window]
    return window_history, past


def built(
    model: Model, options: Options, team: Team, make: Make, make_tiled: MakeTiled
) -> tuple[list[Slab], list[Built]]:
    """The slabs of all ranks, which have their bonds then, and what they say of them.

    `make_tiled` makes the operator of a window in tiles, `make` that of one whose bonds are not in blocks. Raises
    ModelError.
    """
    unit = LANES if len(model.grid) <= options.one_file else math.lcm(LANES, CHUNK)  # whole chunks in each file
    slabs, plain = slabs_of(model, team.size, unit), options._replace(team=None)
    starts = starts_of(slabs)
    # a lattice is a few numbers, from which each rank makes the nodes of its window; other nodes are sent
    shares = [(slab, model if model.grid.lattice else model.window(slab.begin, slab.end)) for slab in slabs]
    built_parts: list[Built | None] = [None]
    if law_of(model).pair is not None and options.kernel != "listed":
        if model.grid.dimension == 3 and (model.grid.lattice or (model.grid.delta == model.grid.delta[0]).all()):
            built_parts = team.everywhere(build_tiles, plain, make_tiled, starts, items=shares)
        if None in built_parts:
            built_parts = team.everywhere(build, plain, starts, items=shares)
        plain = plain if built_parts[0] is not None else plain._replace(kernel="listed")  # as one process has it
    if built_parts[0] is None:
        built_parts = team.everywhere(build_window, plain, make, starts, items=shares)
        if len({built_part.kernel for built_part in built_parts if built_part is not None}) > 1:
            plain = plain._replace(kernel="listed")  # some windows lie on a lattice, others do not
            built_parts = team.everywhere(build_window, plain, make, starts, items=shares)
    return slabs, [built_part for built_part in built_parts if built_part is not None]
