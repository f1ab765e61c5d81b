"""Entries in the ledger, probes and reactions of all ranks, to the bits of one process."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.conditions import factor_now
from pdsolve.errors import UnstableError
from pdsolve.numerics.ordered_sums import Branches, branches, total
from pdsolve.numerics.team import PASSED, Team
from pdsolve.ranks.part import Part, broken
from pdsolve.results import Results
from pdsolve.run.inversion_checks import Extent, MotionChecks, extent_of
from pdsolve.run.measures import Asked, Ledger, ask, terms
from pdsolve.run.motion_accounts import MotionAccounts, motion_of, unstable_words
from pdsolve.run.on_ranks.start import Here, OnRanks
from pdsolve.run.reactions import Reaction
from pdsolve.state import Broken, State

Array = NDArray[np.float64]


class Said(NamedTuple):
    """What a rank says of a step."""

    sums: dict[str, Branches]  # of the ledger
    broken: int  # directed bonds so far
    latest: int  # step of the last one
    finite: bool  # whether all displacements of own nodes are finite
    extent: Extent


class Known(NamedTuple):
    """What all ranks say of a step."""

    ledger: Ledger
    latest: int  # step of the last broken bond, 0 without any
    finite: bool
    extent: Extent


class AccountsOnRanks(MotionAccounts):
    """The accounts of a motion on all ranks; see `pdsolve.run.accounts.Accounts`."""

    def __init__(self, system: OnRanks, step: int, results: Results | None) -> None:
        """`results` are those of a resumed run after `step`, else None."""
        assert system.team is not None
        self._team, self._whole = system.team, system
        self._start(system, step, results)
        grid, run = system.model.grid, system.model.settings.run
        places = [*run.probes, *(end for gap in run.gaps for end in gap.ends)]
        rows = dict.fromkeys(grid.nearest(places)[1].tolist() if places else [])
        self._owned = [[row for row in rows if slab.first <= row < slab.last] for slab in system.slabs]
        self._order = {row: number for number, row in enumerate(rows)}
        subdomain: Here = self._team.part.now
        self._kinds, self._checks = subdomain.grips, subdomain.watch
        lengths_of_all = self._team.everywhere(lengths_known)
        self._team.everywhere(know, lengths_of_all)
        self.known = self._ask(step)
        self.last, self._clamped = self.known.ledger, 0.0

    def settle(self, state: State, step: int, bond_state: Asked | None) -> None:
        """Make this step the last entry."""
        if self.last.step != step:
            self.known = self._ask(step)
            self.last = self.known.ledger

    def take(self, state: State, step: int, bond_state: Asked | None) -> None:
        """Record the ledger, the probes and the reactions of this step. Raises UnstableError."""
        self.settle(state, step, bond_state)
        if self._is_unstable(self.last, self.known.finite):  # the error is that of one process
            worst = self._team.everywhere(wildest, self.known.finite)
            most = max(speed for speed, _ in worst)
            node = next(node for speed, node in worst if speed == most)
            raise UnstableError(unstable_words(self._whole, self.last, max(self._most, self._clamped), node))
        self._most = max(self._most, abs(self.last.work))
        extent = self.known.extent
        if self._checks.is_crushed(extent):
            words = next((words for words in self._team.everywhere(crushed) if words is not None), None)
            if words is not None:
                self._checks.say_crushed(words, step)
        self._checks.say_vague(extent, step)
        self._ledgers.append(self.last)
        time = self.last.time
        if self._order:
            probe_values = [
                probe for rank_probes in self._team.everywhere(probes, items=self._owned) for probe in rank_probes
            ]
            probe_values.sort(key=lambda probe: self._order[probe[0]])
            self._probes += [(step, time, *values) for _, *values in probe_values]
        if self._kinds:
            self._reactions += self._team.everywhere(reactions, step, time)[-1]

    def _ask(self, step: int) -> Known:
        """The ledger entry after a step, from all ranks."""
        said: list[Said] = self._team.everywhere(say, step)
        count = len(self._whole.model.grid)
        sums = {name: total([report.sums[name] for report in said], count) for name in said[0].sums}
        ledger = Ledger(step, step * self._whole.time_step, broken=sum(report.broken for report in said), **sums)
        least, most = (
            tuple(pick(values) for values in zip(*(getattr(report.extent, end) for report in said), strict=True))
            for end, pick in (("least", min), ("most", max))
        )
        extent = Extent(least, most, said[0].extent.kind)
        return Known(ledger, max(report.latest for report in said), all(report.finite for report in said), extent)


def asked(team: Team, step: int) -> Asked:
    """What the operator says of the window's state after a step, asked once."""
    subdomain: Here = team.part.now
    if subdomain.step != step:
        subdomain.asked, subdomain.step = ask(subdomain.system, subdomain.state), step
    return subdomain.asked


def say(team: Team, step: int) -> Said:
    """What this rank says of the state after a step."""
    part: Part = team.part
    subdomain: Here = part.now
    bond_state, slab = asked(team, step), part.slab
    with np.errstate(over="ignore", invalid="ignore"):  # of a run that becomes unstable
        values = terms(subdomain.system, subdomain.state, bond_state.held, bond_state.spent)
        sums = {name: branches(of()[part.own], slab.first, slab.nodes) for name, of in values.items()}
    mine, u = broken(part), subdomain.state.value[part.own]
    d = subdomain.system.model.grid.dimension
    finite = bool(np.isfinite(u).all())
    return Said(sums, len(mine.step), int(mine.step.max(initial=0)), finite, extent_of(u[:, :d]))


def lengths_known(team: Team) -> tuple[float, float]:
    """The lengths by which this rank's window looks at the motion."""
    return _watch(team).lengths


def know(team: Team, of_all: list[tuple[float, float]]) -> None:
    """Look at the motion of own nodes by the lengths of all ranks."""
    _watch(team).know(of_all, team.part.own)


def crushed(team: Team) -> str | None:
    """An inverted triangle of own nodes, in words."""
    subdomain: Here = team.part.now
    return subdomain.watch.crushed(subdomain.state.value[:, :2], Broken(*broken(team.part)))


def wildest(team: Team, finite: bool) -> tuple[float, int]:
    """The speed of the fastest own node along all axes, m/s, and its id; or 1 and the first that is not finite, or
    0."""
    part: Part = team.part
    state, ids = part.now.state, part.model.grid.ids[part.own]
    if finite:
        speed = np.abs(state.rate[part.own]).sum(axis=1)
        return float(speed.max()), int(ids[speed.argmax()])
    wrong = ~np.isfinite(state.value[part.own]).all(axis=1)
    return float(wrong.any()), int(ids[wrong.argmax()])


def probes(team: Team, rows: list[int]) -> list[tuple[Any, ...]]:
    """The motion of own nodes at rows of the whole grid: row, id, and what is recorded of it."""
    part: Part = team.part
    subdomain: Here = part.now
    d = part.model.grid.dimension
    at, ids = [row - part.slab.begin for row in rows], part.model.grid.ids
    return [
        (row, int(ids[local_row]), *motion_of(subdomain.state, local_row, d))
        for row, local_row in zip(rows, at, strict=True)
    ]


def reactions(team: Team, step: int, time: float) -> list[Reaction]:
    """The reactions of all ranks, on the last one: each adds to the sums of those before it, node by node."""
    part: Part = team.part
    subdomain: Here = part.now
    system, state, d = subdomain.system, subdomain.state, subdomain.system.model.grid.dimension
    drive, area, rho = system.drive, system.area, system.model.rho
    holds, loads, count = drive.holds, drive.loads, len(subdomain.grips)
    pulls, pushes = np.zeros((2, count * d))
    sums = _Sums(pulls, pushes, np.zeros((count, d)), np.zeros(count, dtype=np.int64))
    if team.rank > 0:
        sums = team.received(team.rank - 1, PASSED)
    pull = area[holds.node] * (rho[holds.node] * state.second[holds.node, holds.axis].astype(float) - drive.held_force)
    np.add.at(sums.pull, d * holds.profile + holds.axis, pull)
    np.add.at(sums.push, d * loads.profile + loads.axis, area[loads.node] * loads.value)
    for number, grip in enumerate(subdomain.grips):
        displacement = state.value[grip.rows, :d].astype(float)
        sums.moved[number] = np.add.reduce(np.concatenate([sums.moved[number : number + 1], displacement]), axis=0)
        sums.nodes[number] += len(grip.rows)
    if team.rank < team.size - 1:
        team.comm.send(sums, team.rank + 1, PASSED)
        return []
    at, all_reactions = system.load_time(step), list[Reaction]()
    for number, grip in enumerate(subdomain.grips):
        components = slice(d * number, d * number + d)
        factor = float(factor_now(drive.profiles, number, at))
        force = (sums.pull[components] + factor * sums.push[components]).tolist()
        mean = (sums.moved[number] / sums.nodes[number]).tolist()
        all_reactions.append(Reaction(step, time, grip.number, grip.kind, *force[:2], *mean[:2], *force[2:], *mean[2:]))
    return all_reactions


class _Sums(NamedTuple):
    pull: Array  # (grips d,) of holding forces
    push: Array  # (grips d,) of loads at factor 1
    moved: Array  # (grips, d) of displacements
    nodes: NDArray[np.int64]  # (grips,)


def _watch(team: Team) -> MotionChecks:
    subdomain: Here = team.part.now
    return subdomain.watch
