"""Any law over a list of bonds, one by one: the reference, in the plane and in space, in one pass or two.

A row is summed by one thread in the order of its neighbours: the result does not depend on the number of threads.
"""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.bonds import Bonds, ends, find, in_precision, stiffest
from pdsolve.laws.law import List, Now, age, bind, close, deformed, energy, gather, pull
from pdsolve.model import Model
from pdsolve.operators.operator import Kept
from pdsolve.state import Broken, State, Unknown
from pdsolve.threads import share

if TYPE_CHECKING:
    from scipy.sparse import csr_array

KERNEL: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy"}


@njit(**KERNEL)
def _gather_rows(bonds, law, now, m, first, last):  # type: ignore[no-untyped-def]
    """Fill the rows `first` to `last` - 1 of m."""
    for i in range(first, last):
        m[i] = 0
        for k in range(bonds.start[i], bonds.start[i + 1]):
            j = bonds.neighbour[k]
            gather(law, deformed(bonds, now.value, i, j, k), now, i, j, k, m)
        close(law, i, m)


@njit(**KERNEL)
def add_rows(bonds, law, now, m, out, spent, first, last):  # type: ignore[no-untyped-def]
    """Add to the rows of `out` and `spent` what bonds pull with, and spend."""
    f = np.empty(out.shape[1], dtype=out.dtype)
    for i in range(first, last):
        f[:] = 0
        for k in range(bonds.start[i], bonds.start[i + 1]):
            j = bonds.neighbour[k]
            bond = deformed(bonds, now.value, i, j, k)
            spent[i] += age(law, bond, now, m, i, j, k)
            pull(law, bond, now, m, i, j, k, f)
        for a in range(len(f)):
            out[i, a] += f[a]


@njit(**KERNEL)
def _pull_rows(bonds, law, now, m, out, first, last):  # type: ignore[no-untyped-def]
    """The same, of bonds that do not age; at complex values too, which gives derivatives without cancellation."""
    f = np.empty(out.shape[1], dtype=out.dtype)
    for i in range(first, last):
        f[:] = 0
        for k in range(bonds.start[i], bonds.start[i + 1]):
            j = bonds.neighbour[k]
            pull(law, deformed(bonds, now.value, i, j, k), now, m, i, j, k, f)
        for a in range(len(f)):
            out[i, a] += f[a]


@njit(**KERNEL)
def _energy_rows(bonds, law, now, m, held, spent, first, last):  # type: ignore[no-untyped-def]
    """Fill the rows with what bonds hold, and have spent on softening."""
    for i in range(first, last):
        held[i] = spent[i] = 0.0
        for k in range(bonds.start[i], bonds.start[i + 1]):
            j = bonds.neighbour[k]
            own = energy(law, deformed(bonds, now.value, i, j, k), now, m, i, j, k)
            held[i] += own[0]
            spent[i] += own[1]


class Listed:
    """The bonds of n nodes under one law; see `Operator`."""

    name = "listed"

    def __init__(
        self,
        law: ModuleType,
        model: Model,
        exact: Bonds,
        symmetric: bool,
        precision: str = "float64",
        threads: int = 1,
    ) -> None:
        """The law of the model for bonds in double precision, to be summed in this `precision`."""
        bind(law)
        self._stiffest = stiffest(exact, law.springs(law.columns(model, exact), exact), symmetric)
        bonds = in_precision(exact, precision)
        xi = tuple(np.ascontiguousarray(bonds.xi[:, axis]) for axis in range(bonds.xi.shape[1]))
        self.unknowns: tuple[Unknown, ...] = (Unknown("u", len(xi), 2),)
        self.symmetric = symmetric
        self.law, self.columns, self._bonds = law, law.columns(model, bonds), bonds
        self._list, self._nodes, self._threads = List(bonds.start, bonds.neighbour, xi), len(bonds.start) - 1, threads

    def add(self, state: State, out: NDArray[Any], step: int, dt: float) -> None:
        """As in `Operator`."""
        now = Now(state.value, state.rate, step, dt)
        self._share(add_rows, now, self._between(now), out, state.dissipated)

    def energies(self, state: State) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """As in `Operator`."""
        now, held, spent = Now(state.value, state.rate, 0, 0.0), np.empty(self._nodes), np.empty(self._nodes)
        self._share(_energy_rows, now, self._between(now), held, spent)
        return held, spent

    def stiffest(self) -> NDArray[np.float64]:
        """As in `Operator`."""
        return self._stiffest

    def tangent(self, state: State) -> csr_array:
        """As in `Operator`."""
        from pdsolve.operators import tangent  # SciPy takes as long to import as numba, and few runs ask

        def pulls(value: NDArray[np.complex128]) -> NDArray[np.complex128]:
            now, out = Now(value, value, 0, 0.0), np.zeros_like(value)
            self._share(_pull_rows, now, self._between(now), out)
            return out

        value = state.value.astype(np.complex128)
        if getattr(self.law, "ROWS", 0):
            return tangent.of_two_passes(self._list, pulls, value)
        return tangent.of_pairs(self._list, self.columns, Now(value, value, 0, 0.0))

    def bonds(
        self, first: int = 0, last: int | None = None, start: bool = False
    ) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """As in `Operator`."""
        begin, end = self._list.start[[first, self._nodes if last is None else last]]
        return ends(self._bonds, begin + np.flatnonzero((self._steps()[begin:end] == 0) | start))

    def broken(self, after: int = 0) -> Broken:
        """As in `Operator`."""
        step = self._steps()
        which = np.flatnonzero(step > after)
        return Broken(step[which].astype(np.int64), *ends(self._bonds, which))

    def keep(self) -> Kept:
        """As in `Operator`."""
        kept: dict[str, NDArray[Any]] = {}
        for name in self._remembered():
            column = getattr(self.columns, name)
            which = np.flatnonzero(column)
            source, target = ends(self._bonds, which)
            kept |= {name: column[which], f"{name}_source": source, f"{name}_target": target}
        return kept

    def back(self, kept: Kept, broken: Broken) -> None:
        """As in `Operator`."""
        memory = {name: (kept[name], kept[f"{name}_source"], kept[f"{name}_target"]) for name in self._remembered()}
        for name, (values, source, target) in {"broken": broken, **memory}.items():
            column = getattr(self.columns, name, None)
            if column is not None:
                column[:] = 0
                column[find(self._bonds, source, target)] = values

    def bytes(self) -> int:
        """As in `Operator`."""
        return sum(column.nbytes for column in (*self._bonds, *self._list.xi, *self.columns))

    def place(self, state: State) -> State:
        """As in `Operator`."""
        return state

    def _remembered(self) -> tuple[str, ...]:
        """Names of the columns that change, but for who is broken."""
        return getattr(self.law, "MEMORY", ())

    def _steps(self) -> NDArray[np.int32]:
        """The step (b,) in which each bond broke, 0 while intact."""
        return getattr(self.columns, "broken", np.zeros(len(self._list.neighbour), dtype=np.int32))

    def _between(self, now: Now) -> NDArray[Any]:
        """What nodes have between the two passes."""
        between = np.empty((self._nodes, getattr(self.law, "ROWS", 0)), dtype=now.value.dtype)
        if between.shape[1]:
            self._share(_gather_rows, now, between)
        return between

    def _share(self, loop: Callable[..., None], *arrays: Any) -> None:
        share(lambda first, last: loop(self._list, self.columns, *arrays, first, last), self._nodes, self._threads)
