"""The bonds of all ranks as one operator, and their march as one stepper; both ask every rank for its part.

Rank 0 has the nodes, their state and the books of the whole grid, as one process does, and of bonds only its own. The
state is collected when somebody asks for energies or for a checkpoint, and not before.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NoReturn

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Counted
from pdsolve.conditions import Drive, chosen
from pdsolve.laws import law_of
from pdsolve.model import Model
from pdsolve.numerics.team import Team
from pdsolve.operators.protocol import Kept
from pdsolve.options import Options
from pdsolve.ranks import part
from pdsolve.ranks.slabs import slabs_of, starts_of
from pdsolve.schemes.scheme import Scheme
from pdsolve.state import Broken, State

if TYPE_CHECKING:
    from scipy.sparse import csr_array


class AcrossRanks:
    """The bonds of n nodes on the ranks of a team; see `Operator`."""

    def __init__(self, model: Model, options: Options, scheme: Scheme, team: Team, make: part.Make) -> None:
        """`make` makes the operator of a window where bonds are not in blocks of the plane. Raises ModelError."""
        self.team, self.symmetric = team, scheme.symmetric
        self.slabs = slabs_of(model, team.size)
        starts, plain = starts_of(self.slabs), options._replace(team=None)
        windows = [(slab, model.window(slab.begin, slab.end)) for slab in self.slabs]
        found: list[part.Counts | None] = [None]
        if law_of(model).pair is not None and model.grid.dimension == 2 and options.kernel != "listed":
            found = team.everywhere(part.build, plain, starts, each=windows)
            plain = plain if found[0] is not None else plain._replace(kernel="listed")  # as one process has it
        if found[0] is None:
            found = team.everywhere(part.build_window, plain, make, starts, each=windows)
            if len({one.kernel for one in found if one is not None}) > 1:
                plain = plain._replace(kernel="listed")  # some windows lie on a lattice, others do not
                found = team.everywhere(part.build_window, plain, make, starts, each=windows)
        parts = [one for one in found if one is not None]
        *columns, self._stiffest = (np.concatenate(values) for values in zip(*(one[:4] for one in parts), strict=True))
        self.counted, self._bytes = Counted(*columns), sum(one.bytes for one in parts)
        self.name, self.unknowns = parts[0].kernel, parts[0].unknowns
        self.stepper: VerletOnRanks | None = None
        self._broken = _none()

    def place(self, state: State) -> State:
        """The state as it is: rank 0 has that of all nodes."""
        return state

    def marched(
        self, drive: Drive, rho: NDArray[np.floating], dt: float, damping: NDArray[np.float64]
    ) -> VerletOnRanks:
        """The stepper under conditions of all nodes of density `rho` (n,) and `damping` (n,), 1/s; steps are `dt` s
        long."""
        self.stepper = VerletOnRanks(self, drive, rho, dt, damping)
        return self.stepper

    def add(self, state: State, out: NDArray[Any], step: int, dt: float) -> NoReturn:
        """Not possible: forces are summed where nodes move, by `VerletOnRanks`."""
        raise NotImplementedError("forces of bonds on ranks are summed in their march")

    def energies(self, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Energy densities (n,), J/m^3: stored, and dissipated by softening so far. Brings the state up to date."""
        if self.stepper is not None:
            self.stepper.lend(state)
        self._collect(state)
        held, spent = zip(*self.team.everywhere(part.energies), strict=True)
        return np.concatenate(held), np.concatenate(spent)

    def fields(self, state: State) -> dict[str, NDArray[np.float64]]:
        """Other stored fields (n,), by result column, in SI units."""
        self._collect(state)
        if self.stepper is None or not self.stepper.marches:
            return {}
        found = self.team.everywhere(part.fields)
        return {name: np.concatenate([one[name] for one in found]) for name in found[0]}

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
        known = int(self._broken.step.max(initial=0))  # no bond breaks in a step that is over
        found = self._broken, *self.team.everywhere(part.broken, known)
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
        self.team.everywhere(part.back, {name: kept[name] for name in self._kept() if name in kept}, broken)
        self._broken = _none()
        if self.stepper is not None:
            self.stepper.forget()

    def _kept(self) -> set[str]:
        """The names of what the operator keeps."""
        return {name for one in self.team.everywhere(part.keep) for name in one}

    def bytes(self) -> int:
        """Memory of all arrays of all ranks, bytes."""
        return self._bytes

    def _collect(self, state: State) -> None:
        if self.stepper is not None:
            self.stepper.collect(state)


class VerletOnRanks:
    """Velocity Verlet on all ranks together."""

    def __init__(
        self,
        operator: AcrossRanks,
        drive: Drive,
        rho: NDArray[np.floating],
        dt: float,
        damping: NDArray[np.float64],
    ) -> None:
        self._operator, self.drive, self._rho, self._dt, self._damping = operator, drive, rho, dt, damping
        self._there, self._fresh = False, True  # whether ranks have the state; whether rank 0 does
        owner = np.searchsorted([slab.first for slab in operator.slabs], drive.holds.node, side="right") - 1
        self._held = [np.flatnonzero(owner == rank) for rank in range(operator.team.size)]
        self.state: Any = None  # as it was given last

    @property
    def marches(self) -> bool:
        """Whether ranks have a state."""
        return self._there

    def forget(self) -> None:
        """Send the state to all ranks before the next step."""
        self._there = False

    def lend(self, state: State) -> None:
        """Send the state to all ranks if they have none of their own; the next step sends it anew."""
        if not self._there:
            self._operator.team.everywhere(part.put, self._dt, each=self._shares(state))

    def march(self, state: State, first: int, last: int) -> None:
        """Take the steps `first` to `last` - 1; the state is brought up to date when it is asked for."""
        team, self.state = self._operator.team, state
        self.lend(state)
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
            still = self._rho[window], self._damping[window]
            found.append(part.Share(drive.profiles, loads, holds, drive.varies, *varying, *still, local))
        return found


def _none() -> Broken:
    return Broken(*np.zeros((3, 0), dtype=np.int64))
