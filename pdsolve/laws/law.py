"""What a law may say of one bond or one node, and how the loops find what it says.

A law is a file: a NamedTuple `Law` of columns, one value a bond or a node, and some of the functions below, which see
one bond or one node and never a loop. `bind` binds them to the tuple's type, so that one compiled loop serves every
law and a second process finds it compiled. The loops (`pdsolve.operators.bond_list`) call them in this order:

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

A law says its two passes best without numbers of bonds and nodes, in tuples that stay in registers, instead of
`gather` and `pull`:

    numbers  what the columns have of bond k
    nothing  what a node's sums begin with
    say      those sums and what a bond says more
    shows    what neighbours see of a closed node, from its row of `m`
    exchange the force density of a bond on its node, from what both ends show

Such a law can be summed in blocks, where a number is that of many lanes, if it says besides

    finish   what a node has between the passes, as `close`, from its sums and what `standing` has of it
    nears    what of a bond must not be above what

and, not compiled, `tabled`, the numbers of all bonds, the first never 0; `standing`; and `by_lanes`, whether `finish`
can stand for `close`.

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

from numba.extending import overload
from numpy.typing import NDArray

from pdsolve.laws.bond_arrays import INLINE as INLINE
from pdsolve.laws.bond_arrays import INNER as INNER
from pdsolve.laws.bond_arrays import Bond as Bond
from pdsolve.laws.bond_arrays import List as List
from pdsolve.laws.bond_arrays import Now as Now
from pdsolve.laws.bond_arrays import Tabled as Tabled
from pdsolve.laws.bond_arrays import deformed as deformed
from pdsolve.laws.bond_arrays import list_of as list_of
from pdsolve.laws.bond_arrays import stretch_before as stretch_before

Function = Callable[..., Any]
TUPLES = ("numbers", "nothing", "say", "shows", "exchange", "finish", "nears")


def gather(law: Any, bond: Bond, now: Now, i: int, j: int, k: int, m: NDArray[Any]) -> None:
    """Add to m[i] what bond k says of node i's family."""
    _said[type(law)].gather(law, bond, now, i, j, k, m)


def numbers(law: Any, i: Any, j: Any, k: Any) -> tuple[Any, ...]:
    """What the columns have of bond k."""
    return tuple(_said[type(law)].numbers(law, i, j, k))


def nothing(law: Any, xi: tuple[Any, ...], none: Any) -> tuple[Any, ...]:
    """What sums begin with; `none` is the 0 they are made of."""
    return tuple(_said[type(law)].nothing(law, xi, none))


def say(law: Any, bond: Bond, c: tuple[Any, ...], sums: tuple[Any, ...]) -> tuple[Any, ...]:
    """The sums and what a bond with the numbers c says of its node's family."""
    return tuple(_said[type(law)].say(law, bond, c, sums))


def shows(law: Any, xi: tuple[Any, ...], m: NDArray[Any], i: Any) -> tuple[Any, ...]:
    """What neighbours see of node i."""
    return tuple(_said[type(law)].shows(law, xi, m, i))


def exchange(
    law: Any, bond: Bond, c: tuple[Any, ...], here: tuple[Any, ...], there: tuple[Any, ...]
) -> tuple[Any, ...]:
    """The force density of a bond with the numbers c on its node, N/m^3, from what both ends show."""
    return tuple(_said[type(law)].exchange(law, bond, c, here, there))


def finish(law: Any, sums: tuple[Any, ...], own: tuple[Any, ...]) -> tuple[Any, ...]:
    """What nodes have between the passes."""
    return tuple(_said[type(law)].finish(law, sums, own))


def nears(law: Any, bond: Bond, c: tuple[Any, ...], here: tuple[Any, ...], there: tuple[Any, ...]) -> tuple[Any, Any]:
    """What of a bond must not be above what."""
    found, limit = _said[type(law)].nears(law, bond, c, here, there)
    return found, limit


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
    """The functions that a law has."""

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
    numbers: Function
    nothing: Function
    say: Function
    shows: Function
    exchange: Function
    finish: Function
    nears: Function


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
    # numba calls what it compiles after the names of types: two laws of the same columns would be one
    kind.__name__ = f"{kind.__module__}.{kind.__name__}".replace(".", "_")
    said = _said[kind] = _Said(
        getattr(law, "gather", _gather_nothing),
        getattr(law, "close", _close_nothing),
        getattr(law, "age", _remember_nothing),
        getattr(law, "pull", _not_said),
        law.energy,
        getattr(law, "gather_again", _gather_nothing_again),
        getattr(law, "close_again", _close_nothing_again),
        getattr(law, "alert", _never_alert),
        getattr(law, "fails", _fail_never),
        getattr(law, "remember", _remember_no_node),
        getattr(law, "hold", _hold_nothing),
        *(getattr(law, name, _not_said) for name in TUPLES),
    )

    _bind_bonds(kind, said)
    _bind_families(kind, said)
    if in_tuples(law):
        _bind_tuples(kind, said)


def in_tuples(law: ModuleType) -> bool:
    """Whether a law says its passes so."""
    return hasattr(law, "exchange")


def _not_said(*_: Any) -> Any: ...


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

    @overload(gather_again, jit_options=INLINE)
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


def _bind_tuples(kind: type, said: _Said) -> None:
    """What those that say their passes in tuples do."""

    @overload(numbers, jit_options=INLINE)
    def _numbers(law, i, j, k):  # type: ignore[no-untyped-def]
        return _chosen(law, kind, said.numbers)

    @overload(nothing, jit_options=INLINE)
    def _nothing(law, xi, none):  # type: ignore[no-untyped-def]
        return _chosen(law, kind, said.nothing)

    @overload(say, jit_options=INLINE)
    def _say(law, bond, c, sums):  # type: ignore[no-untyped-def]
        return _chosen(law, kind, said.say)

    @overload(shows, jit_options=INLINE)
    def _shows(law, xi, m, i):  # type: ignore[no-untyped-def]
        return _chosen(law, kind, said.shows)

    @overload(exchange, jit_options=INLINE)
    def _exchange(law, bond, c, here, there):  # type: ignore[no-untyped-def]
        return _chosen(law, kind, said.exchange)

    @overload(finish, jit_options=INLINE)
    def _finish(law, sums, own):  # type: ignore[no-untyped-def]
        return _chosen(law, kind, said.finish)

    @overload(nears, jit_options=INLINE)
    def _nears(law, bond, c, here, there):  # type: ignore[no-untyped-def]
        return _chosen(law, kind, said.nears)
