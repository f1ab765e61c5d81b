"""The part of one rank: its bonds, its state and its march. Functions here are asked of all ranks by rank 0.

Rows are those of the whole grid where rank 0 has to do with them, and those of the rank's window inside.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import BondStatistics, Counted, Filling
from pdsolve.conditions import Drive, Entries, Profiles
from pdsolve.laws import law_of
from pdsolve.model import Model
from pdsolve.numerics.team import Team
from pdsolve.operators.protocol import Kept, Operator
from pdsolve.operators.simd_lattice.operator import SimdLattice
from pdsolve.options import Options
from pdsolve.ranks.blocks import Scratch, Seen, blocks_of
from pdsolve.ranks.ghost_exchange import GhostExchange
from pdsolve.ranks.slabs import Slab
from pdsolve.schemes import SCHEMES
from pdsolve.schemes.scheme import Scheme
from pdsolve.state import Broken, State, Unknown
from pdsolve.steppers.protocol import Stepper
from pdsolve.steppers.verlet import Verlet
from pdsolve.steppers.verlet_blocks import VerletBlocks


class Counts(NamedTuple):
    """What is counted of k own nodes."""

    area: NDArray[np.float64]  # (k,) m^2
    family: NDArray[np.int64]  # (k,) bonds that count in damage
    bonds: NDArray[np.int64]  # (k,) at the start
    stiffest: NDArray[np.float64]  # (k,) N/m^4, a bound of the stiffness
    bytes: int  # of all arrays of the operator
    kernel: str
    unknowns: tuple[Unknown, ...]


class Share(NamedTuple):
    """Conditions and state of a window of m rows; held nodes are own ones alone."""

    profiles: Profiles
    loads: Entries
    holds: Entries
    varies: bool
    force: NDArray[np.floating]  # (m, d)
    before: NDArray[np.floating]  # (m, d)
    held_force: NDArray[np.float64]  # (holds,)
    held_speed: NDArray[np.float64]  # (holds,)
    rho: NDArray[np.floating]  # (m,)
    damping: NDArray[np.float64]  # (m,) 1/s
    state: State


class Own(NamedTuple):
    """State of k own nodes, and the force densities that hold their held components."""

    state: State
    held_force: NDArray[np.float64]


Make = Callable[[Model, Options, Scheme, Filling], tuple[Operator, Counted]]  # what makes the operator of a model


class Part:
    """What a rank works on."""

    def __init__(self, slab: Slab, operator: Operator, ghosts: GhostExchange) -> None:
        self.slab, self.operator, self.ghosts = slab, operator, ghosts
        self.own = slice(slab.first - slab.begin, slab.last - slab.begin)
        self.stepper: Stepper | None = None
        self.held_force = np.zeros(0)
        self.state: State | None = None


def build(team: Team, options: Options, starts: NDArray[np.int64], given: tuple[Slab, Model]) -> Counts | None:
    """Make the bonds of a slab in blocks, from the model of its window; None if all nodes are on no lattice."""
    slab, model = given
    scheme, law = SCHEMES[options.mode], law_of(model)
    filling = scheme.fill(model)
    seen = Seen(BondStatistics(filling, scheme.symmetric), [])
    scratch = Scratch(np.dtype(options.precision).type, options.threads or 1)
    blocks = blocks_of(team, law, filling, slab, seen, scratch)
    softens = any(team.comm.allgather(seen.survey.softens))
    if blocks is None:
        return None
    survey, stiffest = seen.survey, np.zeros(len(model.grid))
    stiffest[slab.first - slab.begin : slab.last - slab.begin] = survey.stiffness_bound
    operator = SimdLattice(law, blocks, stiffest, scheme.symmetric, softens)
    reached = np.unique(np.concatenate(seen.reached)).astype(np.int64)
    part = _with_ghosts(team, starts, slab, operator, reached)
    return _counts(operator, Counted(filling.area[part.own], survey.family, survey.count), survey.stiffness_bound)


def build_window(
    team: Team, options: Options, make: Make, starts: NDArray[np.int64], given: tuple[Slab, Model]
) -> Counts:
    """Make the bonds of a whole window; those of ghosts are there to know what own nodes' bonds ask of them."""
    slab, model = given
    scheme = SCHEMES[options.mode]
    operator, counted = make(model, options._replace(threads=options.threads or 1), scheme, scheme.fill(model))
    part = _with_ghosts(team, starts, slab, operator, np.arange(slab.begin, slab.end))
    own = part.own
    return _counts(
        operator, Counted(counted.area[own], counted.family[own], counted.bonds[own]), operator.stiffness_bound()[own]
    )


def _with_ghosts(
    team: Team, starts: NDArray[np.int64], slab: Slab, operator: Operator, reached: NDArray[np.int64]
) -> Part:
    """The part of this rank, whose nodes ask for the motion of those `reached` (k,) by rows of the whole grid."""
    others = reached[(reached < slab.first) | (reached >= slab.last)]
    part = team.part = Part(slab, operator, GhostExchange(team, starts, slab, others))
    return part


def _counts(operator: Operator, counted: Counted, stiffest: NDArray[np.float64]) -> Counts:
    return Counts(*counted, stiffest, operator.bytes(), operator.name, operator.unknowns)


def put(team: Team, dt: float, share: Share) -> None:
    """Take over conditions and state of the window; steps are `dt` s long."""
    part: Part = team.part
    operator, drive = part.operator, Drive(*share[:8])
    part.state, part.held_force = operator.place(share.state), drive.held_force
    if isinstance(operator, SimdLattice) and not share.damping.any():
        part.stepper = VerletBlocks(operator, drive, share.rho, dt, ghosts=part.ghosts)
    else:
        part.stepper = Verlet(operator, drive, share.rho, dt, share.damping, part.ghosts)


def march(team: Team, first: int, last: int) -> None:
    """Take the steps `first` to `last` - 1."""
    part: Part = team.part
    assert part.stepper is not None
    assert part.state is not None
    part.stepper.march(part.state, first, last)


def own(team: Team) -> Own:
    """The state of own nodes."""
    part: Part = team.part
    assert part.state is not None
    return Own(State(*(np.ascontiguousarray(values[part.own]) for values in part.state)), part.held_force)


def fields(team: Team) -> dict[str, NDArray[np.float64]]:
    """Other fields (k,) of own nodes."""
    part: Part = team.part
    assert part.state is not None
    return {name: values[part.own] for name, values in part.operator.fields(part.state).items()}


def energies(team: Team) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Energy densities (k,) of own nodes, J/m^3: stored, and dissipated by softening so far."""
    part: Part = team.part
    assert part.state is not None
    held, spent = part.operator.energies(part.state)
    return held[part.own], spent[part.own]


def broken(team: Team, after: int) -> Broken:
    """Bonds of own nodes broken after a step, by rows of the whole grid."""
    part: Part = team.part
    found, slab = part.operator.broken(after), part.slab
    mine = (found.source >= part.own.start) & (found.source < part.own.stop)
    return Broken(found.step[mine], found.source[mine] + slab.begin, found.target[mine] + slab.begin)


def bonds(team: Team, first: int, last: int, start: bool) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Ends (k,) of the bonds of own nodes among the rows `first` to `last` - 1, in order."""
    part: Part = team.part
    slab = part.slab
    first, last = max(first, slab.first), min(last, slab.last)
    if first >= last:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    source, target = part.operator.bonds(first - slab.begin, last - slab.begin, start)
    return source + slab.begin, target + slab.begin


ENDS = ("_source", "_target")  # of bonds, in the names of their history


def keep(team: Team) -> Kept:
    """History of own nodes and of their bonds, by rows of the whole grid."""
    part: Part = team.part
    slab = part.slab
    kept, found = part.operator.keep(), {}
    for name, values in kept.items():
        source = _ends(kept, name, "source")
        if source is None:
            found[name] = values[part.own]
            continue
        mine = (source >= part.own.start) & (source < part.own.stop)
        found[name] = values[mine] + slab.begin if name.endswith(ENDS) else values[mine]
    return found


def _ends(kept: Kept, name: str, end: str) -> NDArray[np.int64] | None:
    """The sources, or targets, of the bonds that a column of a history is of; None if it is of nodes."""
    stem = name.removesuffix("_edge").removesuffix("_source").removesuffix("_target")
    return kept.get(f"{stem}_{end}")


def back(team: Team, kept: Kept, broken: Broken) -> None:
    """Restore the history of a window, of which arguments are those of all nodes; in blocks only own nodes' bonds."""
    part: Part = team.part
    slab, alone = part.slab, isinstance(part.operator, SimdLattice)
    first, last = (slab.first, slab.last) if alone else (slab.begin, slab.end)
    mine = (broken.source >= first) & (broken.source < last)
    mine &= (broken.target >= slab.begin) & (broken.target < slab.end)
    past = Broken(broken.step[mine], broken.source[mine] - slab.begin, broken.target[mine] - slab.begin)
    own: dict[str, NDArray[Any]] = {}
    for name, values in kept.items():
        source, target = (_ends(kept, name, end) for end in ("source", "target"))
        if source is None or target is None:
            own[name] = values[slab.begin : slab.end]
            continue
        here = (source >= first) & (source < last) & (target >= slab.begin) & (target < slab.end)
        own[name] = values[here] - slab.begin if name.endswith(ENDS) else values[here]
    part.operator.back(own, past)
