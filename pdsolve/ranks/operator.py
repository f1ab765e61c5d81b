"""The bonds of all ranks as one operator, and their march as one stepper; both ask every rank for its part.

Rank 0 has the nodes, their state and the books of the whole grid, as one process does, and of bonds only its own. The
state is collected when somebody asks for energies or for a checkpoint, and not before.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Counted
from pdsolve.checkpoint_validation import entry
from pdsolve.conditions import Drive, chosen
from pdsolve.model import Model, ModelError
from pdsolve.numerics.team import Team
from pdsolve.operators.protocol import Kept
from pdsolve.options import Options
from pdsolve.ranks import part
from pdsolve.ranks.slabs import slabs_of, starts_of
from pdsolve.schemes.scheme import Scheme
from pdsolve.state import Broken, State, Unknown

if TYPE_CHECKING:
    from scipy.sparse import csr_array


class AcrossRanks:
    """The bonds of n nodes on the ranks of a team; see `Operator`."""

    name = "blocks"
    unknowns: tuple[Unknown, ...] = (Unknown("u", 2, 2),)

    def __init__(self, model: Model, options: Options, scheme: Scheme, team: Team) -> None:
        """Raises ModelError for nodes that are on no lattice, or fewer than ranks need."""
        self.team, self.symmetric = team, scheme.symmetric
        self.slabs = slabs_of(model, team.size)
        plain = options._replace(team=None)
        windows = [(slab, model.window(slab.begin, slab.end)) for slab in self.slabs]
        found: list[part.Counts] = [
            one for one in team.everywhere(part.build, plain, starts_of(self.slabs), each=windows) if one is not None
        ]
        if len(found) < team.size:
            raise ModelError(f"{model.name}: found nodes on no lattice, expected one on {team.size} ranks: one process")
        area, family, bonds, self._stiffest, _ = (
            np.concatenate([np.atleast_1d(column) for column in columns]) for columns in zip(*found, strict=True)
        )
        self.counted = Counted(area, family, bonds)
        self._bytes = sum(one.bytes for one in found)
        self.stepper: VerletOnRanks | None = None
        self._broken = _none()

    def place(self, state: State) -> State:
        """The state as it is: rank 0 has that of all nodes."""
        return state

    def marched(self, drive: Drive, rho: NDArray[np.floating], dt: float) -> VerletOnRanks:
        """The stepper of these bonds under conditions of all nodes of density `rho` (n,); steps are `dt` s long."""
        self.stepper = VerletOnRanks(self, drive, rho, dt)
        return self.stepper

    def add(self, state: State, out: NDArray[Any], step: int, dt: float) -> NoReturn:
        """Not possible: forces are summed where nodes move, by `VerletOnRanks`."""
        raise NotImplementedError("forces of bonds on ranks are summed in their march")

    def energies(self, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Energy densities (n,), J/m^3: stored, and dissipated by softening so far. Brings the state up to date."""
        self._collect(state)
        held, spent = zip(*self.team.everywhere(part.energies), strict=True)
        return np.concatenate(held), np.concatenate(spent)

    def fields(self, state: State) -> dict[str, NDArray[np.float64]]:
        """Empty: a pair law stores no fields besides displacements."""
        return {}

    def stiffness_bound(self) -> NDArray[np.float64]:
        """A bound (n,) of each node's stiffness, N/m^4; see `Operator`."""
        return self._stiffest

    def tangent(self, state: State) -> csr_array:
        """Not possible: runs at rest are those of one process."""
        raise NotImplementedError("there is no tangent of bonds on ranks")

    def bonds(
        self, first: int = 0, last: int | None = None, start: bool = False
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Source and target rows (k,) of the intact bonds of nodes `first` to `last` - 1, or of those at the
        `start`."""
        last = len(self._stiffest) if last is None else last
        source, target = zip(*self.team.everywhere(part.bonds, first, last, start), strict=True)
        return np.concatenate(source), np.concatenate(target)

    def broken(self, after: int = 0) -> Broken:
        """The bonds broken after a step."""
        found = self._broken, *self.team.everywhere(part.newly_broken)
        self._broken = Broken(*(np.concatenate(columns) for columns in zip(*found, strict=True)))
        later = self._broken.step > after
        return Broken(*(column[later] for column in self._broken))

    def keep(self) -> Kept:
        """History of bonds for a checkpoint, by the rows of their nodes. Brings the state up to date."""
        assert self.stepper is not None
        self._collect(self.stepper.state)
        found = self.team.everywhere(part.keep)
        return {name: np.concatenate([one[name] for one in found]) for name in found[0]}

    def back(self, kept: Kept, broken: Broken) -> None:
        """Restore the history of bonds and the broken bonds of a checkpoint; the state goes to all ranks anew."""
        nodes = len(self._stiffest) - 1
        (count,) = entry(kept, "worst_source", (None,), np.int64, 0, nodes).shape
        entry(kept, "worst_target", (count,), np.int64, 0, nodes)
        known = {name: values for name, values in kept.items() if name.startswith("worst")}
        self.team.everywhere(part.back, known, broken)
        self._broken = _none()
        if self.stepper is not None:
            self.stepper.forget()

    def bytes(self) -> int:
        """Memory of all arrays of all ranks, bytes."""
        return self._bytes

    def _collect(self, state: State) -> None:
        if self.stepper is not None:
            self.stepper.collect(state)


class VerletOnRanks:
    """Velocity Verlet on all ranks together."""

    def __init__(self, operator: AcrossRanks, drive: Drive, rho: NDArray[np.floating], dt: float) -> None:
        self._operator, self.drive, self._rho, self._dt = operator, drive, rho, dt
        self._there, self._fresh = False, True  # whether ranks have the state; whether rank 0 does
        owner = np.searchsorted([slab.first for slab in operator.slabs], drive.holds.node, side="right") - 1
        self._held = [np.flatnonzero(owner == rank) for rank in range(operator.team.size)]
        self.state: Any = None  # as it was given last

    def forget(self) -> None:
        """Send the state to all ranks before the next step."""
        self._there = False

    def march(self, state: State, first: int, last: int) -> None:
        """Take the steps `first` to `last` - 1; the state is brought up to date when it is asked for."""
        team, self.state = self._operator.team, state
        if not self._there:
            team.everywhere(part.put, self._dt, each=self._shares(state))
            self._there = True
        team.everywhere(part.march, first, last)
        self._fresh = self._fresh and last <= first

    def collect(self, state: State) -> None:
        """Bring `state` up to date."""
        if self._fresh or not self._there:
            return
        for slab, held, found in zip(
            self._operator.slabs, self._held, self._operator.team.everywhere(part.own), strict=True
        ):
            for values, own in zip(state, found.state, strict=True):
                values[slab.first : slab.last] = own
            self.drive.held_force[held] = found.held_force
        self._fresh = True

    def _shares(self, state: State) -> list[part.Share]:
        """The windows of conditions and state of all ranks."""
        drive, found = self.drive, []
        for slab, held in zip(self._operator.slabs, self._held, strict=True):
            window = slice(slab.begin, slab.end)
            here = (drive.loads.node >= slab.first) & (drive.loads.node < slab.last)
            mask = np.zeros(len(drive.holds.node), dtype=bool)
            mask[held] = True
            loads, holds = (
                some._replace(node=some.node - slab.begin)
                for some in (chosen(drive.loads, here), chosen(drive.holds, mask))
            )
            varying = drive.force[window], drive.before[window], drive.held_force[held], drive.held_speed[held]
            local = State(*(values[window] for values in state))
            found.append(part.Share(drive.profiles, loads, holds, drive.varies, *varying, self._rho[window], local))
        return found


def _none() -> Broken:
    return Broken(*np.zeros((3, 0), dtype=np.int64))
