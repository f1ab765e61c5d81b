"""What a law may say of one bond or one node, and how the loops find what it says.

A law is a file: a NamedTuple `Law` of columns, one value a bond or a node, and some of the functions below, which see
one bond or one node and never a loop. `bind` binds them to the tuple's type, so that one compiled loop serves every
law and a second process finds it compiled. The loops (`pdsolve.operators.listed`) call them in this order:

    gather   adds what bond k says of node i's family to the node's row of `m`     (first pass; pair laws have none)
    close    turns that row into what the second pass wants                        (likewise)
    age      lets bond k remember: soften, break; returns what node i spends on it in this step, J/m^3
    pull     adds the force density of bond k on node i to `f`, N/m^3
    energy   what bond k adds to the energy density of node i, J/m^3: held now, and spent on softening so far

Where there is a first pass, bonds do not age one by one: all that fail in a step do so before any pulls, and what they
cost is what their nodes held before and do not hold after. Such a law may say instead of `age`

    alert    whether a bond of node i may fail; one of which neither end is alert does not
    fails    whether bond k does
    remember lets node i remember: yield
    hold     what node i itself adds to its energy density, J/m^3: held now, and spent so far
    spread, gather_again, close_again    a pass between the first two, with the first one's rows of both ends

and, not compiled, `mend(law, bonds, rows)`, which brings columns up to date at nodes (k,) whose bonds have failed.

Symbols, for the bond k from node i to node j:
    xi      x_j - x_i, reference vector, m              eta      u_j - u_i, m
    q       |xi + eta| / |xi|                           stretch  q - 1, free of cancellation for small displacements
`now` is the state as loops know it, `m` (n, rows) what nodes have between the two passes.

A law that says nothing else has no `rows(law, dimension)`, how wide `m` is, and MEMORY, the names of the columns (b,)
that `age` changes, is empty; but for `broken`, which if it is there is the step in which a bond broke, 0 while intact.
NODE_MEMORY are the columns of nodes that `remember` changes.
"""

from __future__ import annotations

from collections.abc import Callable
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
from numba import njit
from numba.extending import overload
from numpy.typing import NDArray

# Of functions that only compiled code calls: no references are counted, and divisions are numpy's
INNER: dict[str, Any] = {"_nrt": False, "error_model": "numpy"}
INLINE = INNER | {
    "forceinline": True
}  # of those that see every bond: to pass a law's columns on takes longer than to use them


class List(NamedTuple):
    """Bonds as loops read them, those of node i at start[i]:start[i + 1]; b of them, in d dimensions."""

    start: NDArray[np.int64]  # (n + 1,)
    neighbour: NDArray[np.int32]  # (b,)
    xi: tuple[NDArray[np.floating], ...]  # d times (b,), m; a tuple, as compilers know its length


class Now(NamedTuple):
    """The state at a step as loops read it; n nodes, w components of all unknowns."""

    value: NDArray[Any]  # (n, w)
    rate: NDArray[Any]  # (n, w) per s; within a step the mean since the last one
    step: int
    dt: float  # s since the last step, 0 at rest


class Bond(NamedTuple):
    """One deformed bond."""

    xi: tuple[Any, ...]
    eta: tuple[Any, ...]
    length: Any  # |xi|, m
    q: Any
    stretch: Any


Function = Callable[..., Any]


def gather(law: Any, bond: Bond, now: Now, i: int, j: int, k: int, m: NDArray[Any]) -> None:
    """Add to m[i] what bond k says of node i's family."""
    _said[type(law)].gather(law, bond, now, i, j, k, m)


def close(law: Any, i: int, m: NDArray[Any]) -> None:
    """Turn m[i] into what the second pass wants."""
    _said[type(law)].close(law, i, m)


def age(law: Any, bond: Bond, now: Now, m: NDArray[Any], i: int, j: int, k: int) -> float:
    """Let bond k remember what it has been through; returns what node i spends on it, J/m^3."""
    return float(_said[type(law)].age(law, bond, now, m, i, j, k))


def pull(law: Any, bond: Bond, now: Now, m: NDArray[Any], i: int, j: int, k: int, f: NDArray[Any]) -> None:
    """Add the force density of bond k on node i to f (w,), N/m^3."""
    _said[type(law)].pull(law, bond, now, m, i, j, k, f)


def energy(law: Any, bond: Bond, now: Now, m: NDArray[Any], i: int, j: int, k: int) -> tuple[float, float]:
    """What bond k adds to the energy density of node i, J/m^3: held, and spent on softening so far."""
    held, spent = _said[type(law)].energy(law, bond, now, m, i, j, k)
    return held, spent


def gather_again(law: Any, bond: Bond, now: Now, i: int, j: int, k: int, m: NDArray[Any], more: NDArray[Any]) -> None:
    """Add to more[i] what bond k says now that both its nodes are closed."""
    _said[type(law)].gather_again(law, bond, now, i, j, k, m, more)


def close_again(law: Any, i: int, m: NDArray[Any], more: NDArray[Any]) -> None:
    """Turn m[i] and more[i] into what the last pass wants, in m[i]."""
    _said[type(law)].close_again(law, i, m, more)


def alert(law: Any, i: int, m: NDArray[Any]) -> bool:
    """Whether a bond of node i may fail."""
    return bool(_said[type(law)].alert(law, i, m))


def fails(law: Any, bond: Bond, now: Now, m: NDArray[Any], i: int, j: int, k: int) -> bool:
    """Whether bond k fails; the same from both its ends."""
    return bool(_said[type(law)].fails(law, bond, now, m, i, j, k))


def remember(law: Any, now: Now, i: int, m: NDArray[Any]) -> None:
    """Let node i remember what it has been through."""
    _said[type(law)].remember(law, now, i, m)


def hold(law: Any, i: int, m: NDArray[Any]) -> tuple[float, float]:
    """What node i itself adds to its energy density, J/m^3: held, and spent so far."""
    held, spent = _said[type(law)].hold(law, i, m)
    return held, spent


class _Said(NamedTuple):
    """What a law says."""

    gather: Function
    close: Function
    age: Function
    pull: Function
    energy: Function
    gather_again: Function
    close_again: Function
    alert: Function
    fails: Function
    remember: Function
    hold: Function


def _gather_nothing(law, bond, now, i, j, k, m):  # type: ignore[no-untyped-def]
    pass


def _close_nothing(law, i, m):  # type: ignore[no-untyped-def]
    pass


def _remember_nothing(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    return 0.0


def _gather_nothing_again(law, bond, now, i, j, k, m, more):  # type: ignore[no-untyped-def]
    pass


def _close_nothing_again(law, i, m, more):  # type: ignore[no-untyped-def]
    pass


def _never_alert(law, i, m):  # type: ignore[no-untyped-def]
    return False


def _fail_never(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    return False


def _remember_no_node(law, now, i, m):  # type: ignore[no-untyped-def]
    pass


def _hold_nothing(law, i, m):  # type: ignore[no-untyped-def]
    return 0.0, 0.0


_said: dict[type, _Said] = {}  # by the type of the law's columns: what Python itself looks up where nothing is compiled


def bind(law: ModuleType) -> None:
    """Let the loops know what a law says; numba keeps it for the life of the process."""
    kind = law.Law
    if kind in _said:
        return
    said = _said[kind] = _Said(
        getattr(law, "gather", _gather_nothing),
        getattr(law, "close", _close_nothing),
        getattr(law, "age", _remember_nothing),
        law.pull,
        law.energy,
        getattr(law, "gather_again", _gather_nothing_again),
        getattr(law, "close_again", _close_nothing_again),
        getattr(law, "alert", _never_alert),
        getattr(law, "fails", _fail_never),
        getattr(law, "remember", _remember_no_node),
        getattr(law, "hold", _hold_nothing),
    )

    _bind_bonds(kind, said)
    _bind_families(kind, said)


def _chosen(found: Any, kind: type, function: Function) -> Function | None:
    return function if getattr(found, "instance_class", None) is kind else None


def _bind_bonds(kind: type, said: _Said) -> None:
    """What all laws may say."""

    @overload(gather, jit_options=INLINE)
    def _gather(law, bond, now, i, j, k, m):  # type: ignore[no-untyped-def]
        return _chosen(law, kind, said.gather)

    @overload(close, jit_options=INNER)
    def _close(law, i, m):  # type: ignore[no-untyped-def]
        return _chosen(law, kind, said.close)

    @overload(age, jit_options=INNER)
    def _age(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
        return _chosen(law, kind, said.age)

    @overload(pull, jit_options=INLINE)
    def _pull(law, bond, now, m, i, j, k, f):  # type: ignore[no-untyped-def]
        return _chosen(law, kind, said.pull)

    @overload(energy, jit_options=INNER)
    def _energy(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
        return _chosen(law, kind, said.energy)


def _bind_families(kind: type, said: _Said) -> None:
    """What only those with a first pass may."""

    @overload(gather_again, jit_options=INNER)
    def _gather_again(law, bond, now, i, j, k, m, more):  # type: ignore[no-untyped-def]
        return _chosen(law, kind, said.gather_again)

    @overload(close_again, jit_options=INNER)
    def _close_again(law, i, m, more):  # type: ignore[no-untyped-def]
        return _chosen(law, kind, said.close_again)

    @overload(alert, jit_options=INNER)
    def _alert(law, i, m):  # type: ignore[no-untyped-def]
        return _chosen(law, kind, said.alert)

    @overload(fails, jit_options=INLINE)
    def _fails(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
        return _chosen(law, kind, said.fails)

    @overload(remember, jit_options=INNER)
    def _remember(law, now, i, m):  # type: ignore[no-untyped-def]
        return _chosen(law, kind, said.remember)

    @overload(hold, jit_options=INNER)
    def _hold(law, i, m):  # type: ignore[no-untyped-def]
        return _chosen(law, kind, said.hold)


@njit(**INNER)
def deformed(bonds, value, i, j, k):  # type: ignore[no-untyped-def]
    """Bond k, from node i to node j, at these values."""
    xi, eta = _reference(bonds.xi, k), _difference(bonds.xi, value, i, j)
    squared, along, more = xi[0] * xi[0], xi[0] * eta[0], eta[0] * eta[0]
    for a in range(1, len(xi)):
        squared += xi[a] * xi[a]
        along += xi[a] * eta[a]
    e = 2 * along + more
    for a in range(1, len(xi)):
        e += eta[a] * eta[a]
    e /= squared
    q = np.sqrt(1 + e)
    return Bond(xi, eta, np.sqrt(squared), q, e / (q + 1))


@njit(**INNER)
def stretch_before(bond, now, i, j):  # type: ignore[no-untyped-def]
    """The stretch of the bond from i to j one step ago."""
    squared = now.dt * 0
    for a in range(len(bond.xi)):
        x = bond.xi[a] + now.value[j, a] - now.value[i, a] - now.dt * (now.rate[j, a] - now.rate[i, a])
        squared += x * x
    return np.sqrt(squared) / bond.length - 1


def _reference(xi: tuple[NDArray[Any], ...], k: int) -> tuple[Any, ...]:
    return tuple(component[k] for component in xi)


def _difference(xi: tuple[NDArray[Any], ...], value: NDArray[Any], i: int, j: int) -> tuple[Any, ...]:
    return tuple(value[j, : len(xi)] - value[i, : len(xi)])


@overload(_reference, jit_options=INNER)
def _reference_of(xi, k):  # type: ignore[no-untyped-def]
    if len(xi) == 2:
        return lambda xi, k: (xi[0][k], xi[1][k])
    return lambda xi, k: (xi[0][k], xi[1][k], xi[2][k])


@overload(_difference, jit_options=INNER)
def _difference_of(xi, value, i, j):  # type: ignore[no-untyped-def]
    if len(xi) == 2:
        return lambda xi, value, i, j: (value[j, 0] - value[i, 0], value[j, 1] - value[i, 1])
    return lambda xi, value, i, j: (value[j, 0] - value[i, 0], value[j, 1] - value[i, 1], value[j, 2] - value[i, 2])
