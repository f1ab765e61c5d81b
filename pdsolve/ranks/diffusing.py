"""A march by forward Euler on all ranks: each has the bonds of its rows, which rank 0 has made, and gets the state of
its window with every order."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pdsolve.conditions import Drive, Entries, chosen
from pdsolve.model import Model
from pdsolve.numerics.team import Team
from pdsolve.operators.protocol import Operator
from pdsolve.ranks.ghost_exchange import GhostExchange
from pdsolve.ranks.slabs import Slab, slabs_of, starts_of
from pdsolve.state import State
from pdsolve.stepper import Stepper
from pdsolve.steppers.euler import ForwardEuler


class Content(Operator, Protocol):
    """An operator of contents that can be divided."""

    solid: NDArray[np.uint8]  # (n,) whether a node is solid

    def part(self, first: int, last: int, begin: int, end: int) -> Content:
        """The operator of the nodes `begin` to `end` - 1, of which `first` to `last` - 1 have bonds."""


class Share(NamedTuple):
    """What a rank needs for its march: a window of m rows of the state, and the sources of now."""

    state: State
    solid: NDArray[np.uint8]  # (m,)
    force: NDArray[np.floating]  # (m, 1) mol/(m^3 s)


class DiffusingPart:
    """What a rank works on."""

    def __init__(self, operator: Content, stepper: ForwardEuler, drive: Drive, own_rows: slice) -> None:
        self.operator, self.stepper, self.drive, self.own_rows = operator, stepper, drive, own_rows


class EulerOnRanks(Stepper):
    """Forward Euler on all ranks together."""

    name = ForwardEuler.name

    def __init__(self, model: Model, team: Team, operator: Content, drive: Drive, dt: float) -> None:
        """Steps of `dt`, s, of the `operator` of all nodes. Raises ModelError for too few nodes."""
        self._team, self._operator, self._drive = team, operator, drive
        self._slabs = slabs_of(model, team.size)
        parts = [
            (slab, operator.part(slab.first, slab.last, slab.begin, slab.end), _of_slab(drive, slab))
            for slab in self._slabs
        ]
        team.everywhere(build, starts_of(self._slabs), dt, items=parts)

    def advance(self, state: State, first_step: int, end_step: int) -> int:
        """Take the steps `first_step` to `end_step` - 1, in place; returns the last one."""
        windows = [slice(slab.begin, slab.end) for slab in self._slabs]
        shares = [
            Share(State(*(values[rows] for values in state)), self._operator.solid[rows], self._drive.force[rows])
            for rows in windows
        ]
        solid = self._operator.solid.copy()
        for slab, share in zip(
            self._slabs, self._team.everywhere(advance, first_step, end_step, items=shares), strict=True
        ):
            rows = slice(slab.first, slab.last)
            for values, new_values in zip(state, share.state, strict=True):
                values[rows] = new_values
            solid[rows], self._drive.force[rows] = share.solid, share.force
        self._operator.solid = solid
        return end_step - 1


def _of_slab(drive: Drive, slab: Slab) -> Drive:
    """The conditions of a slab's own nodes, by rows of its window."""

    def select_own(entries: Entries) -> Entries:
        own_entries = chosen(entries, (entries.node >= slab.first) & (entries.node < slab.last))
        return own_entries._replace(node=own_entries.node - slab.begin)

    force = drive.force[slab.begin : slab.end]
    return drive._replace(loads=select_own(drive.loads), holds=select_own(drive.holds), force=force, before=force)


def build(team: Team, starts: NDArray[np.int64], dt: float, share: tuple[Slab, Content, Drive]) -> None:
    """Take over the bonds and the conditions of a slab; steps are `dt` s long."""
    slab, operator, drive = share
    drive = drive._replace(force=drive.force.copy())
    ghosts = np.concatenate([np.arange(slab.begin, slab.first), np.arange(slab.last, slab.end)])
    stepper = ForwardEuler(operator, drive, dt, GhostExchange(team, starts, slab, ghosts))
    team.part = DiffusingPart(operator, stepper, drive, slice(slab.first - slab.begin, slab.last - slab.begin))


def advance(team: Team, first_step: int, end_step: int, share: Share) -> Share:
    """Take the steps `first_step` to `end_step` - 1; returns what has become of own nodes."""
    part: DiffusingPart = team.part
    state = State(*map(np.array, share.state))  # copies: rank 0 shares rows of its own arrays with itself
    part.operator.solid, part.drive.force[:] = share.solid, share.force
    part.stepper.advance(state, first_step, end_step)
    own_rows = part.own_rows
    return Share(
        State(*(values[own_rows] for values in state)), part.operator.solid[own_rows], part.drive.force[own_rows]
    )
