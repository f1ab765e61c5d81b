"""The functions of a law as compiled loops call them, bound to the type of its columns; see `pdsolve.laws.law`.

Calls from Python, without compilation, are dispatched by the same types.
"""

from __future__ import annotations

from inspect import Parameter, Signature, signature
from typing import Any

from numba.extending import overload
from numpy.typing import NDArray

from pdsolve.laws.bond_arrays import INLINE, INNER, Bond, Now
from pdsolve.laws.law import Again, Failure, Function, Law, NodeMemory, Pair, Passes, Softening


def gather(law: Any, bond: Bond, now: Now, i: int, j: int, k: int, m: NDArray[Any]) -> None:
    """Add the contribution of bond k to the family sums m[i] of node i."""
    _bound[type(law)]["gather"](law, bond, now, i, j, k, m)


def numbers(law: Any, i: Any, j: Any, k: Any) -> tuple[Any, ...]:
    """The numbers of bond k in the columns."""
    return tuple(_bound[type(law)]["numbers"](law, i, j, k))


def nothing(law: Any, xi: tuple[Any, ...], none: Any) -> tuple[Any, ...]:
    """Initial sums; `none` is the zero they consist of."""
    return tuple(_bound[type(law)]["nothing"](law, xi, none))


def accumulate(law: Any, bond: Bond, c: tuple[Any, ...], sums: tuple[Any, ...]) -> tuple[Any, ...]:
    """The sums plus the contribution of a bond with the numbers c."""
    return tuple(_bound[type(law)]["accumulate"](law, bond, c, sums))


def nodal_numbers(law: Any, xi: tuple[Any, ...], m: NDArray[Any], i: Any) -> tuple[Any, ...]:
    """The numbers of node i that its neighbours need."""
    return tuple(_bound[type(law)]["nodal_numbers"](law, xi, m, i))


def bond_force(
    law: Any, bond: Bond, c: tuple[Any, ...], here: tuple[Any, ...], there: tuple[Any, ...]
) -> tuple[Any, ...]:
    """Force density of a bond with the numbers c on its node, N/m^3, from the numbers of both ends."""
    return tuple(_bound[type(law)]["bond_force"](law, bond, c, here, there))


def finish(law: Any, sums: tuple[Any, ...], own: tuple[Any, ...]) -> tuple[Any, ...]:
    """Nodal numbers between the passes, from the sums."""
    return tuple(_bound[type(law)]["finish"](law, sums, own))


def nears(law: Any, bond: Bond, c: tuple[Any, ...], here: tuple[Any, ...], there: tuple[Any, ...]) -> tuple[Any, Any]:
    """A quantity of a bond and its limit, for failure."""
    found, limit = _bound[type(law)]["nears"](law, bond, c, here, there)
    return found, limit


def close(law: Any, i: int, m: NDArray[Any]) -> None:
    """Convert the sums m[i] to the numbers of the second pass."""
    _bound[type(law)]["close"](law, i, m)


def age(law: Any, bond: Bond, now: Now, m: NDArray[Any], i: int, j: int, k: int) -> float:
    """Update the history of bond k; returns the energy dissipated at node i, J/m^3."""
    return float(_bound[type(law)]["age"](law, bond, now, m, i, j, k))


def pull(law: Any, bond: Bond, now: Now, m: NDArray[Any], i: int, j: int, k: int, f: NDArray[Any]) -> None:
    """Add the force density of bond k on node i to f (w,), N/m^3."""
    _bound[type(law)]["pull"](law, bond, now, m, i, j, k, f)


def energy(law: Any, bond: Bond, now: Now, m: NDArray[Any], i: int, j: int, k: int) -> tuple[float, float]:
    """Contribution of bond k to the energy densities of node i, J/m^3: stored, and dissipated by softening so far."""
    own, gone = _bound[type(law)]["energy"](law, bond, now, m, i, j, k)
    return own, gone


def gather_again(law: Any, bond: Bond, now: Now, i: int, j: int, k: int, m: NDArray[Any], more: NDArray[Any]) -> None:
    """Add to more[i] the contribution of bond k after the first pass of both its nodes."""
    _bound[type(law)]["gather_again"](law, bond, now, i, j, k, m, more)


def close_again(law: Any, i: int, m: NDArray[Any], more: NDArray[Any]) -> None:
    """Convert m[i] and more[i] to the numbers of the last pass, in m[i]."""
    _bound[type(law)]["close_again"](law, i, m, more)


def alert(law: Any, i: int, m: NDArray[Any]) -> bool:
    """Whether a bond of node i may fail."""
    return bool(_bound[type(law)]["alert"](law, i, m))


def fails(law: Any, bond: Bond, now: Now, m: NDArray[Any], i: int, j: int, k: int) -> bool:
    """Whether bond k fails; equal from both its ends."""
    return bool(_bound[type(law)]["fails"](law, bond, now, m, i, j, k))


def remember(law: Any, now: Now, i: int, m: NDArray[Any]) -> None:
    """Update the history of node i."""
    _bound[type(law)]["remember"](law, now, i, m)


def hold(law: Any, i: int, m: NDArray[Any]) -> tuple[float, float]:
    """Energy densities of node i itself, J/m^3: stored, and dissipated so far."""
    own, gone = _bound[type(law)]["hold"](law, i, m)
    return own, gone


def secant(law: Any, stretch: Any, worst: Any, peak: Any, limit: Any) -> Any:
    """Force of a bond over that of a linear one."""
    return _bound[type(law)]["secant"](law, stretch, worst, peak, limit)


def held(law: Any, c: Any, stretch: Any, worst: Any, peak: Any, limit: Any) -> Any:
    """Stored energy of a bond, J/m^3."""
    return _bound[type(law)]["held"](law, c, stretch, worst, peak, limit)


def spent(law: Any, c: Any, worst: Any, peak: Any, limit: Any) -> Any:
    """Energy dissipated by softening of a bond that was stretched to `worst`, J/m^3."""
    return _bound[type(law)]["spent"](law, c, worst, peak, limit)


def total(law: Any, c: Any, peak: Any, limit: Any) -> Any:
    """Energy dissipated by a fully softened bond, J/m^3."""
    return _bound[type(law)]["total"](law, c, peak, limit)


def slope(law: Any, worst: Any, peak: Any, limit: Any) -> Any:
    """Slope of a bond's force over its stiffness while `worst` grows with its stretch."""
    return _bound[type(law)]["slope"](law, worst, peak, limit)


def released(law: Any, c: Any, stretch: Any, before: Any, peak: Any, limit: Any) -> Any:
    """Total energy dissipated by a bond that is found broken at a stretch and last pulled at `before`, J/m^3."""
    return _bound[type(law)]["released"](law, c, stretch, before, peak, limit)


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


_bound: dict[type, dict[str, Function]] = {}  # the functions of a law, by the type of its columns

_pairs: dict[type, Pair] = {}


def pair_of(law: Any) -> Pair:
    """The pair law of columns, or of their numba type."""
    return _pairs[getattr(law, "instance_class", type(law))]


def functions_of(law: Law) -> dict[str, Function]:
    """The functions of a law by the names of this file, with defaults for those it does not have."""
    return _functions(law)


def bind(law: Law) -> None:
    """Bind the functions of a law to its columns' type; numba keeps them for the life of the process."""
    kind = law.Columns
    if kind in _bound:
        return
    # numba calls what it compiles after the names of types: two laws of the same columns would be one
    kind.__name__ = f"{kind.__module__}.{kind.__name__}".replace(".", "_")
    said = _bound[kind] = _functions(law)
    if law.pair is not None:
        _pairs[kind] = law.pair
    for options, functions in _DISPATCHED:
        for function in functions:
            if function.__name__ in said:
                _overload(function, options, kind, said[function.__name__])


def _functions(law: Law) -> dict[str, Function]:
    """The functions of a law, with defaults for those it does not have."""
    passes = law.passes
    found: dict[str, Function] = {"energy": law.energy, "age": law.age or _remember_nothing}
    if isinstance(passes, Passes):
        found |= {"pull": passes.pull, "gather": passes.gather or _gather_nothing}
        found["close"] = passes.close or _close_nothing
    else:
        found |= vars(passes) | {"pull": _not_said, "gather": _gather_nothing}
    again = law.again or Again(_gather_nothing_again, _close_nothing_again)
    found |= {"gather_again": again.gather, "close_again": again.close}
    found |= vars(law.failure or Failure(_never_alert, _fail_never))
    found |= vars(law.nodes or NodeMemory((), _remember_no_node, _hold_nothing))
    curve = law.pair or law.curve
    if curve is not None:
        found |= _of_pair(curve)
    if law.lanes is not None:
        found |= {"finish": law.lanes.finish, "nears": law.lanes.nears}
    return found


def _of_pair(pair: Pair) -> dict[str, Function]:
    """The functions of a pair law."""
    softens = pair.softening is not None
    by_secant = _held_by_secant_of_tension if pair.elastic_in_compression else _held_by_secant
    straight = by_secant if softens else _held_by_line
    found: dict[str, Function] = {"secant": pair.secant or _one, "held": pair.held or straight}
    found |= vars(pair.softening or Softening(_spend_nothing, _hold_no_total, _never_soften))
    if softens:
        found["released"] = _released_softly
    else:
        found["released"] = _released_by_line if pair.held is None else _released_at_once
    return found


def _not_said(*_: Any) -> Any: ...


def _one(law, stretch, worst, peak, limit):  # type: ignore[no-untyped-def]
    return 1.0


def _held_by_line(law, c, stretch, worst, peak, limit):  # type: ignore[no-untyped-def]
    return c * stretch * stretch


def _held_by_secant(law, c, stretch, worst, peak, limit):  # type: ignore[no-untyped-def]
    if worst > 0:
        c *= secant(law, stretch, worst, peak, limit)
    return c * stretch * stretch


def _held_by_secant_of_tension(law, c, stretch, worst, peak, limit):  # type: ignore[no-untyped-def]
    if worst > 0 and stretch > 0:
        c *= secant(law, stretch, worst, peak, limit)
    return c * stretch * stretch


def _spend_nothing(law, c, worst, peak, limit):  # type: ignore[no-untyped-def]
    return 0.0


def _hold_no_total(law, c, peak, limit):  # type: ignore[no-untyped-def]
    return 0.0


def _never_soften(law, worst, peak, limit):  # type: ignore[no-untyped-def]
    return 1.0


def _released_by_line(law, c, stretch, before, peak, limit):  # type: ignore[no-untyped-def]
    return c * (stretch * before)


def _released_at_once(law, c, stretch, before, peak, limit):  # type: ignore[no-untyped-def]
    pulled = before * secant(law, before, 0.0, peak, limit)  # for half a step more
    return held(law, c, before, 0.0, peak, limit) + c * pulled * (stretch - before)


def _released_softly(law, c, stretch, before, peak, limit):  # type: ignore[no-untyped-def]
    if peak < limit:
        return total(law, c, peak, limit)
    return c * (stretch * before)


_DISPATCHED = (  # each by the type of the law, with options of compilation
    (INLINE, (gather, pull, gather_again, fails, secant, numbers, nothing, accumulate, nodal_numbers, bond_force)),
    (INLINE, (finish, nears)),
    (INNER, (close, age, energy, close_again, alert, remember, hold, held, spent, total, slope, released)),
)


def _overload(function: Function, options: dict[str, Any], kind: type, own: Function) -> None:
    """Let compiled calls of `function` with columns of this kind be calls of the law's own function."""

    def chosen(law: Any, *_: Any) -> Function | None:
        return own if getattr(law, "instance_class", None) is kind else None

    parameters = signature(function).parameters.values()  # which numba expects `own` to have
    chosen.__signature__ = Signature([one.replace(annotation=Parameter.empty) for one in parameters])  # type: ignore[attr-defined]
    overload(function, jit_options=options)(chosen)
