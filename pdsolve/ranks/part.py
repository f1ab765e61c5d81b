"""The part of one rank: its bonds, its state and its march. Functions here are asked of all ranks by rank 0.

Rows are those of the whole grid where rank 0 has to do with them, and those of the rank's window inside.
"""

from __future__ import annotations

import warnings
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import BondStatistics
from pdsolve.conditions import Drive, Entries, Profiles
from pdsolve.laws import law_of
from pdsolve.model import Model
from pdsolve.numerics.team import Team
from pdsolve.operators.protocol import Kept
from pdsolve.operators.simd_lattice import layout
from pdsolve.operators.simd_lattice.operator import SimdLattice
from pdsolve.options import Options
from pdsolve.ranks.blocks import Scratch, blocks_of
from pdsolve.ranks.ghosts import Ghosts
from pdsolve.ranks.slabs import Slab
from pdsolve.schemes import SCHEMES
from pdsolve.state import Broken, State
from pdsolve.steppers.verlet_blocks import VerletBlocks


class Counts(NamedTuple):
    """What is counted of k own nodes."""

    area: NDArray[np.float64]  # (k,) m^2
    family: NDArray[np.int64]  # (k,) bonds that count in damage
    bonds: NDArray[np.int64]  # (k,) at the start
    stiffest: NDArray[np.float64]  # (k,) N/m^4, a bound of the stiffness
    bytes: int  # of all arrays of the operator


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
    state: State


class Own(NamedTuple):
    """State of k own nodes, and the force densities that hold their held components."""

    state: State
    held_force: NDArray[np.float64]


class Part:
    """What a rank works on."""

    def __init__(self, slab: Slab, operator: SimdLattice, ghosts: Ghosts) -> None:
        self.slab, self.operator, self.ghosts = slab, operator, ghosts
        self.own = slice(slab.first - slab.begin, slab.last - slab.begin)
        self.told = 0  # broken bonds that rank 0 knows
        self.stepper: VerletBlocks | None = None
        self.state: State | None = None


def build(team: Team, options: Options, starts: NDArray[np.int64], given: tuple[Slab, Model]) -> Counts | None:
    """Make the bonds of a slab from the model of its window; None if all nodes are on no lattice."""
    slab, model = given
    scheme, law = SCHEMES[options.mode], law_of(model)
    with warnings.catch_warnings():
        if team.rank > 0:
            warnings.simplefilter("ignore")  # rank 0 has the whole model to warn of
        filling = scheme.fill(model)
    survey = BondStatistics(filling, scheme.symmetric)
    scratch = Scratch(np.dtype(options.precision).type, options.threads or 1)
    blocks = blocks_of(team, law, filling, slab, survey, scratch)
    softens = any(team.comm.allgather(survey.softens))
    if blocks is None:
        return None
    stiffest = np.zeros(len(model.grid))
    stiffest[slab.first - slab.begin : slab.last - slab.begin] = survey.stiffness_bound
    operator = SimdLattice(law, blocks, stiffest, scheme.symmetric, softens)
    reached = np.unique(layout.ends(blocks, layout.there(blocks.mask))[1]) + slab.begin
    ghosts = Ghosts(team, starts, slab, reached[(reached < slab.first) | (reached >= slab.last)])
    part = team.part = Part(slab, operator, ghosts)
    return Counts(filling.area[part.own], survey.family, survey.count, survey.stiffness_bound, operator.bytes())


def put(team: Team, dt: float, share: Share) -> None:
    """Take over conditions and state of the window; steps are `dt` s long."""
    part: Part = team.part
    part.state = part.operator.place(share.state)
    drive = Drive(*share[:8])
    part.stepper = VerletBlocks(part.operator, drive, share.rho, dt, ghosts=part.ghosts)


def march(team: Team, first: int, last: int) -> None:
    """Take the steps `first` to `last` - 1."""
    part: Part = team.part
    assert part.stepper is not None
    assert part.state is not None
    part.stepper.march(part.state, first, last)


def own(team: Team) -> Own:
    """The state of own nodes."""
    part: Part = team.part
    assert part.stepper is not None
    assert part.state is not None
    held = part.stepper.drive.held_force
    return Own(State(*(np.ascontiguousarray(values[part.own]) for values in part.state)), held)


def energies(team: Team) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Energy densities (k,) of own nodes, J/m^3: stored, and dissipated by softening so far."""
    part: Part = team.part
    assert part.state is not None
    held, spent = part.operator.energies(part.state)
    return held[part.own], spent[part.own]


def newly_broken(team: Team) -> Broken:
    """Bonds of own nodes that rank 0 does not know to be broken, by rows of the whole grid."""
    part: Part = team.part
    found = part.operator.broken()
    new = slice(part.told, None)
    part.told = len(found.step)
    begin = part.slab.begin
    return Broken(found.step[new], found.source[new] + begin, found.target[new] + begin)


def bonds(team: Team, first: int, last: int, start: bool) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Ends (k,) of the bonds of own nodes among the rows `first` to `last` - 1, in order."""
    part: Part = team.part
    slab = part.slab
    first, last = max(first, slab.first), min(last, slab.last)
    if first >= last:
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    source, target = part.operator.bonds(first - slab.begin, last - slab.begin, start)
    return source + slab.begin, target + slab.begin


def keep(team: Team) -> Kept:
    """History of the bonds of own nodes."""
    part: Part = team.part
    return {
        name: values + part.slab.begin if name.endswith(("_source", "_target")) else values
        for name, values in part.operator.keep().items()
    }


def back(team: Team, kept: Kept, broken: Broken) -> None:
    """Restore the history of the bonds of own nodes; arguments are those of all nodes."""
    part: Part = team.part
    slab = part.slab
    mine = (broken.source >= slab.first) & (broken.source < slab.last)
    past = Broken(broken.step[mine], broken.source[mine] - slab.begin, broken.target[mine] - slab.begin)
    part.operator.back(_of(kept, slab), past)
    part.told = 0


def _of(kept: Kept, slab: Slab) -> dict[str, NDArray[Any]]:
    """The history of bonds of a slab's own nodes, by rows of its window."""
    source = kept["worst_source"]
    mine = (source >= slab.first) & (source < slab.last)
    return {
        name: values[mine] - slab.begin if name.endswith(("_source", "_target")) else values[mine]
        for name, values in kept.items()
        if name.startswith("worst")
    }
