"""Any law over a list of bonds, one by one, in the plane and in space: the reference operator."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Bonds, ends, find, in_precision, stiffness_bound
from pdsolve.checkpoint_validation import entry, like, read_pending_pulls
from pdsolve.laws.bond_arrays import AnyList, Now, SwollenList, list_of
from pdsolve.laws.calls import bind
from pdsolve.laws.law import Law, Sums
from pdsolve.model import Model
from pdsolve.numerics.thread_team import share
from pdsolve.operators import bond_list_loops as loops
from pdsolve.operators.family_stiffness_bound import resistance
from pdsolve.operators.protocol import BondLayout, CheckpointArrays, Motion
from pdsolve.state import Broken, State, Unknown

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from pdsolve.stepper import Stepper


class BondList:
    """The bonds of n nodes under one law; see `Operator`."""

    name = "listed"
    bond_layout: BondLayout = "listed"

    def __init__(
        self, law: Law, model: Model, exact: Bonds, symmetric: bool, precision: str = "float64", threads: int = 1
    ) -> None:
        """The model's law for bonds in double precision, to be summed in this `precision`."""
        bind(law)
        sums = isinstance(law.passes, Sums)
        self._loops = (
            (loops.first_pass_rows_of_sums, loops.bond_force_rows)
            if sums
            else (loops.first_pass_rows, loops.force_rows)
        )
        bonds = in_precision(exact, precision)
        self.symmetric, self._threads = symmetric, threads
        self._nodes, self._every = len(bonds.start) - 1, np.arange(len(bonds.start) - 1)
        self._summed = 0, self._nodes  # rows, of a law without a first pass
        self.unknowns: tuple[Unknown, ...] = law.unknowns(bonds.xi.shape[1])
        self.law, self._bonds, self._model = law, bonds, model
        columns = law.columns(model, exact)
        if law.scale is None:
            self._stiffness_bound = stiffness_bound(exact, columns.stiffness, symmetric)
        else:
            self._take(columns, exact)
            self._stiffness_bound = self._resistance(law, exact)
        self._take(columns if precision == "float64" else law.columns(model, bonds), bonds)
        self._failing, none = np.zeros(len(bonds.neighbour), dtype=np.bool_), np.zeros(0, dtype=np.int64)
        self._torn_bonds, self._torn_in = loops.torn_bonds(none, none, 0), -1  # the last that failed, and the step

    def _take(self, columns: Any, bonds: Bonds) -> None:
        """Replace the columns and the bonds."""
        self.columns = columns if self.law.pair is None else columns._replace(matches_work=self.law.matches_work)
        self._list: AnyList = list_of(bonds)

    def _resistance(self, law: Law, bonds: Bonds) -> NDArray[np.float64]:
        """Bound of each node's stiffness, N/m^4, with the intact bonds, of a law with a first pass."""
        assert law.scale is not None

        def pulls(value: NDArray[np.float64]) -> NDArray[np.float64]:
            out = np.zeros_like(value)
            now = Now(value, np.zeros_like(value), 0, 0.0)
            self._accumulate_bond_forces(now, self._between(now), out)
            return out

        width = sum(unknown.width for unknown in self.unknowns)
        still = pulls(np.zeros((self._nodes, width)))
        return resistance(lambda value: pulls(value) - still, law.scale(self.columns, bonds), bonds, width)

    def only(self, first: int, last: int) -> None:
        """Sum and break the bonds of the nodes `first` to `last` - 1 alone, of a law without a first pass."""
        assert self.law.width is None
        self._summed, self._every = (first, last), np.arange(first, last)

    def accumulate_force(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """Add the force densities (n, w), N/m^3, to `out`; bonds over their limit break in this `step`, `dt` s long."""
        now = Now(state.value, state.rate, step, dt)
        between = self._between(now)
        if not between.shape[1]:
            begin, end = self._summed
            add = partial(loops.update_rows, self._list, self.columns, now, between, out, state.dissipated)
            share(lambda first, last: add(begin + first, begin + last), end - begin, self._threads)
            return
        if step > 0:
            self._pull_again(now, out)
        torn = self._torn(now, between) if step > 0 else None
        if torn is not None:
            before = np.zeros_like(out)
            self._accumulate_bond_forces(now, between, before)
            matched, dissipated_share = self._match_work(now, between, torn)
            released = np.zeros(self._nodes)
            between = self._fail(now, between, torn, released)
        pulls = out if torn is None else np.zeros_like(out)
        self._accumulate_bond_forces(now, between, pulls)
        if step > 0 and self._node_history_names():  # after forces, which are those of the history so far
            self._share(loops.update_history_rows, now, between)
        if torn is not None:
            self._book(state, dt, before - pulls, matched, released, dissipated_share)
            out += pulls + matched

    def failing(self, value: NDArray[np.float64]) -> NDArray[np.int64]:
        """Bonds (k,) that are over their limit at values (n, w), of a law with a first pass; none of them breaks."""
        now = Now(value, np.zeros_like(value), 0, 0.0)
        self._torn(now, self._between(now))
        bonds = np.flatnonzero(self._failing)
        self._failing[bonds] = False
        return bonds

    def sever(self, state: State, bonds: NDArray[np.int64], step: int) -> None:
        """Break these bonds (k,) of a law with a first pass, and book the energy that is lost where nodes are."""
        now = Now(state.value, state.rate, step, 0.0)
        self._failing[bonds] = True
        self._fail(now, self._between(now), np.unique(ends(self._bonds, bonds)[0]), state.dissipated)

    def _torn(self, now: Now, between: NDArray[Any]) -> NDArray[np.int64] | None:
        """Nodes (k,) with a bond that fails now, None without any; the bonds are marked."""
        near, torn = self._near(now, between), np.zeros(self._nodes, dtype=np.bool_)
        if near.any():
            self._share(loops.fail_rows, now, between, near, self._failing, torn)
        return np.flatnonzero(torn) if torn.any() else None

    def _match_work(
        self, now: Now, between: NDArray[Any], torn: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Force densities (n, w), N/m^3, that match the work of the marked bonds of these nodes (k,), and which share
        (n,) they spend of the energy that they release at a node, 0 at other nodes; -1 where it is unknown."""
        matched, dissipated, bonds = np.zeros(now.value.shape), np.zeros(self._nodes), self._marked(torn)
        self._torn_bonds = loops.torn_bonds(bonds, ends(self._bonds, bonds)[0], now.value.shape[1])
        self._torn_in = now.step
        self._share_some(loops.match_rows, torn, now, between, self._torn_bonds, matched, dissipated)
        return matched, dissipated

    def _marked(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """The bonds (b,) of these nodes (k,) that are marked as failing."""
        start = self._list.start
        return np.concatenate([start[i] + np.flatnonzero(self._failing[start[i] : start[i + 1]]) for i in rows])

    def _pull_again(self, now: Now, out: NDArray[Any]) -> None:
        """Add the second pulls of bonds that failed one step ago to `out` (n, w), N/m^3."""
        if self._torn_in == now.step - 1:
            loops.pull_again(self._list, now, self._torn_bonds, out)

    def _book(
        self,
        state: State,
        dt: float,
        lost: NDArray[np.float64],
        matched: NDArray[np.float64],
        released: NDArray[np.float64],
        dissipated: NDArray[np.float64],
    ) -> None:
        """Book the energy that failing bonds take: the share `dissipated` (n,) of what they `released` (n,), J/m^3.

        If some is unknown: the last half step went without the forces `lost` (n, w), N/m^3, but with those `matched`.
        """
        if (dissipated >= 0).all():
            state.dissipated[:] += released * dissipated
        else:
            state.dissipated[:] += released + dt / 2 * ((lost - 2 * matched) * state.rate).sum(axis=1)

    def _near(self, now: Now, between: NDArray[Any]) -> NDArray[np.bool_]:
        """Mask (n,) of nodes whose bonds must be checked."""
        near = np.zeros(self._nodes, dtype=np.bool_)
        self._share(loops.may_fail_rows, now, between, near)
        return near

    def _fail(
        self, now: Now, between: NDArray[Any], rows: NDArray[np.int64], released: NDArray[np.float64]
    ) -> NDArray[Any]:
        """Let the marked bonds of these nodes (k,) fail, and add the energy lost to `released` (n,), J/m^3.

        Returns the new nodal numbers.
        """
        start, touched, bonds = self._list.start, rows, self._marked(rows)
        if self.law.again is not None:
            near = np.zeros(self._nodes, dtype=np.bool_)
            near[rows] = True
            near[self._list.neighbour[np.concatenate([np.arange(start[i], start[i + 1]) for i in rows])]] = True
            touched = np.flatnonzero(near)
        strain_energy, dissipated = np.zeros((2, self._nodes))
        self._share_some(loops.energy_rows, touched, now, between, strain_energy, dissipated)
        before = strain_energy[touched]
        self.columns.broken[bonds] = now.step
        self._failing[bonds] = False
        self._lose(bonds, rows)
        if self.law.again is not None:
            between = self._between(now)
        else:
            self._share_some(self._loops[0], rows, now, between)
        self._share_some(loops.energy_rows, touched, now, between, strain_energy, dissipated)
        released[touched] += before - strain_energy[touched]
        return between

    def update_history(self, state: State) -> None:
        """Update the history of nodes at an equilibrium; no bond breaks."""
        if self._node_history_names():
            now = Now(state.value, state.rate, 0, 0.0)
            self._share(loops.update_history_rows, now, self._between(now))

    def energies(self, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Energy densities (n,), J/m^3: stored, and dissipated by softening so far."""
        now, (strain_energy, dissipated) = Now(state.value, state.rate, 0, 0.0), np.zeros((2, self._nodes))
        self._share_some(loops.energy_rows, self._every, now, self._between(now), strain_energy, dissipated)
        return strain_energy, dissipated

    def fields(self, state: State) -> Mapping[str, NDArray[np.float64]]:
        """Stored fields (n,) besides displacements, by result column, in SI units."""
        if self.law.fields is None:
            return {}
        return self.law.fields(self.columns, state.value, self._between(Now(state.value, state.rate, 0, 0.0)))

    def swell(self, strain: NDArray[np.float64]) -> None:
        """Let bonds stretch from what they are long at these strains (n,) of free nodes, from now on."""
        self._list = SwollenList(*self._list[:4], strain.astype(self._list.length.dtype))

    def stiffness_bound(self) -> NDArray[np.float64]:
        """A bound (n,) of each node's stiffness, N/m^4; see `Operator`."""
        return self._stiffness_bound

    def intact_stiffness_bound(self) -> NDArray[np.float64] | None:
        """A bound (n,) of each node's stiffness with the bonds that are left, N/m^4; None without families' shapes."""
        return None if self.law.scale is None else self._resistance(self.law, self._bonds)

    def march(self, motion: Motion) -> Stepper | None:
        """None: Verlet takes the steps."""
        return None

    def tangent(self, state: State) -> csr_array:
        """The tangent (n w, n w), N/m^4: minus the derivative of the force densities by the values."""
        from pdsolve.operators import tangent  # SciPy takes as long to import as numba, and few runs ask

        def pulls(value: NDArray[np.complex128]) -> NDArray[np.complex128]:
            now, out = Now(value, value, 0, 0.0), np.zeros_like(value)
            self._accumulate_bond_forces(now, self._between(now), out)
            return out

        value = state.value.astype(np.complex128)
        if self.law.width is not None:
            return tangent.of_passes(self._list, pulls, value, 2 if self.law.again is None else 3)
        return tangent.of_pairs(self._list, self.columns, Now(value, value, 0, 0.0))

    def bonds(
        self, first_row: int = 0, end_row: int | None = None, at_start: bool = False
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Source and target rows (k,) of the intact bonds of nodes `first_row` to `end_row` - 1, or of those at the
        start, if `at_start`."""
        begin, end = self._list.start[[first_row, self._nodes if end_row is None else end_row]]
        return ends(self._bonds, begin + np.flatnonzero((self._steps()[begin:end] == 0) | at_start))

    def broken(self, after_step: int = 0) -> Broken:
        """Bonds broken after a step: step, source row and target row of each."""
        step = self._steps()
        which = np.flatnonzero(step > after_step)
        return Broken(step[which].astype(np.int64), *ends(self._bonds, which))

    def checkpoint_arrays(self) -> CheckpointArrays:
        """History of bonds for a checkpoint, by the rows of their nodes."""
        checkpoint: dict[str, NDArray[Any]] = {}
        for name in self._bond_history_names():
            column = getattr(self.columns, name)
            which = np.flatnonzero(column)
            source, target = ends(self._bonds, which)
            checkpoint |= {name: column[which], f"{name}_source": source, f"{name}_target": target}
        if len(self._torn_bonds.bond):
            _, target = ends(self._bonds, self._torn_bonds.bond)
            force_and_growth = np.column_stack([self._torn_bonds.force, self._torn_bonds.growth])
            checkpoint |= {"torn": force_and_growth, "torn_source": self._torn_bonds.source, "torn_target": target}
        return checkpoint | {name: getattr(self.columns, name).copy() for name in self._node_history_names()}

    def restore(self, checkpoint: CheckpointArrays, broken: Broken) -> None:
        """Restore the history of bonds and the broken bonds of a checkpoint."""
        memory: dict[str, Any] = {"broken": broken}
        for name in self._bond_history_names():
            if name == "pending":
                pending = read_pending_pulls(checkpoint, self._nodes, self.columns.pending.dtype)
                memory[name] = pending.stretch, pending.source, pending.target
                continue
            values = entry(checkpoint, name, (None,), getattr(self.columns, name).dtype)
            ends_of = (f"{name}_source", f"{name}_target")
            memory[name] = (
                values,
                *(entry(checkpoint, end, values.shape, np.int64, 0, self._nodes - 1) for end in ends_of),
            )
        for name, (values, source, target) in memory.items():
            column, bonds = getattr(self.columns, name), find(self._bonds, source, target)
            column[:] = 0
            column[bonds] = values
        for name in self._node_history_names():
            column = getattr(self.columns, name)
            column[:] = like(checkpoint, name, column)
        if not checkpoint.keys().isdisjoint(("torn", "torn_source", "torn_target")):
            width = sum(unknown.width for unknown in self.unknowns)
            torn = entry(checkpoint, "torn", (None, width + 1), float)
            source, target = (
                entry(checkpoint, f"torn_{end}", (len(torn),), np.int64, 0, self._nodes - 1)
                for end in ("source", "target")
            )
            bonds, self._torn_in = find(self._bonds, source, target), int(self._steps().max(initial=0))
            self._torn_bonds = loops.TornBonds(bonds, source, torn[:, :-1].copy(), torn[:, -1].copy())
        self._lose(np.flatnonzero(self._steps()), self._every)

    def reweigh(self, share: NDArray[np.float64]) -> None:
        """Set each bond to a share (b,) of its initial weight, or stiffness; broken bonds and other history stay."""
        names = *self._bond_history_names(), *self._node_history_names(), "broken"
        history = {name: getattr(self.columns, name).copy() for name in names}
        share = share.astype(self._bonds.xi.dtype)
        bonds = self._bonds._replace(weight=self._bonds.weight * share, stiffness=self._bonds.stiffness * share)
        self._take(self.law.columns(self._model, bonds), bonds)
        for name, values in history.items():
            getattr(self.columns, name)[:] = values
        self._lose(np.flatnonzero(self._steps()), self._every)

    def bytes(self) -> int:
        """Memory of all arrays, bytes."""
        arrays = *self._bonds, *self._list.xi, self._list.length, *self.columns
        return sum(getattr(array, "nbytes", 0) for array in arrays)

    def to_own_layout(self, state: State) -> State:
        """The state in this operator's own array layout."""
        return state

    def _bond_history_names(self) -> tuple[str, ...]:
        """Names of the columns that change, except `broken`."""
        return self.law.bond_history

    def _node_history_names(self) -> tuple[str, ...]:
        """Names of the existing nodal columns that the law changes."""
        names = self.law.nodes.columns if self.law.nodes is not None else ()
        return tuple(name for name in names if getattr(self.columns, name).size)

    def _steps(self) -> NDArray[np.int32]:
        """The step (b,) in which each bond broke, 0 while intact."""
        steps: NDArray[np.int32] = self.columns.broken
        return steps

    def _between(self, now: Now) -> NDArray[Any]:
        """Nodal numbers between the passes."""
        law, dimension = self.law, len(self._list.xi)
        wide = law.width(self.columns, dimension) if law.width is not None else 0
        between = np.empty((self._nodes, wide), dtype=now.value.dtype)
        if wide:
            self._share_some(self._loops[0], self._every, now, between)
        if law.again is not None:
            more = np.empty((self._nodes, dimension * dimension), dtype=now.value.dtype)
            self._share(loops.intermediate_pass_rows, now, between, more)
            self._share(loops.finish_intermediate_pass_rows, now, between, more)
        return between

    def _accumulate_bond_forces(self, now: Now, between: NDArray[Any], out: NDArray[Any]) -> None:
        """Add the forces of bonds, given the nodal numbers between the passes."""
        self._share(self._loops[1], now, between, out)

    def _lose(self, bonds: NDArray[np.int64], rows: NDArray[np.int64]) -> None:
        """Remove these bonds (b,), which belong to the nodes (k,) that have failed."""
        if self.law.update_after_breakage is not None:
            self.law.update_after_breakage(self.columns, self._list, rows)

    def _share(self, loop: Callable[..., None], *arrays: Any) -> None:
        share(lambda first, last: loop(self._list, self.columns, *arrays, first, last), self._nodes, self._threads)

    def _share_some(self, loop: Callable[..., None], rows: NDArray[np.int64], *arrays: Any) -> None:
        share(lambda first, last: loop(self._list, self.columns, *arrays, rows, first, last), len(rows), self._threads)
