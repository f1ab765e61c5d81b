"""The functions of a law as compiled loops call them, bound to the type of its columns; see `pdsolve.laws.law`.

Calls from Python, without compilation, are dispatched by the same types.
"""

from __future__ import annotations

from inspect import Parameter, Signature, signature
from typing import Any

from numba.extending import overload, register_jitable
from numpy.typing import NDArray

from pdsolve.laws.bond_arrays import INLINE, INNER, AnyList, Bond, Now
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
    law: Any, bond: Bond, c: tuple[Any, ...], node_numbers: tuple[Any, ...], neighbour_numbers: tuple[Any, ...]
) -> tuple[Any, ...]:
    """Force density of a bond with the numbers c on its node, N/m^3, from the numbers of both ends."""
    return tuple(_bound[type(law)]["bond_force"](law, bond, c, node_numbers, neighbour_numbers))


def finish(law: Any, sums: tuple[Any, ...], node_constants: tuple[Any, ...]) -> tuple[Any, ...]:
    """Nodal numbers between the passes, from the sums."""
    return tuple(_bound[type(law)]["finish"](law, sums, node_constants))


def nears(
    law: Any, bond: Bond, c: tuple[Any, ...], node_numbers: tuple[Any, ...], neighbour_numbers: tuple[Any, ...]
) -> tuple[Any, Any]:
    """A quantity of a bond and its limit, for failure."""
    failure_measure, limit = _bound[type(law)]["nears"](law, bond, c, node_numbers, neighbour_numbers)
    return failure_measure, limit


def close(law: Any, i: int, m: NDArray[Any]) -> None:
    """Convert the sums m[i] to the numbers of the second pass."""
    _bound[type(law)]["close"](law, i, m)


def age(law: Any, bond: Bond, now: Now, m: NDArray[Any], i: int, j: int, k: int, f: NDArray[Any]) -> float:
    """Update the history of bond k, and add to f (w,) the force density, N/m^3, with which it breaks; returns the
    energy dissipated at node i, J/m^3."""
    return float(_bound[type(law)]["age"](law, bond, now, m, i, j, k, f))


def pull(law: Any, bond: Bond, now: Now, m: NDArray[Any], i: int, j: int, k: int, f: NDArray[Any]) -> None:
    """Add the force density of bond k on node i to f (w,), N/m^3."""
    _bound[type(law)]["pull"](law, bond, now, m, i, j, k, f)


def energy(law: Any, bond: Bond, now: Now, m: NDArray[Any], i: int, j: int, k: int) -> tuple[float, float]:
    """Contribution of bond k to the energy densities of node i, J/m^3: stored, and dissipated by softening so far."""
    strain_energy, dissipated = _bound[type(law)]["energy"](law, bond, now, m, i, j, k)
    return strain_energy, dissipated


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


def threshold(law: Any, bond: Bond, now: Now, m: NDArray[Any], i: int, j: int, k: int) -> float:
    """The stretch at which bond k, which fails now, would have failed if all stretches were scaled; -1 if unknown."""
    return float(_bound[type(law)]["threshold"](law, bond, now, m, i, j, k))


def remember(law: Any, bonds: AnyList, now: Now, i: int, m: NDArray[Any]) -> None:
    """Update the history of node i and its bonds."""
    _bound[type(law)]["remember"](law, bonds, now, i, m)


def hold(law: Any, i: int, m: NDArray[Any]) -> tuple[float, float]:
    """Energy densities of node i itself, J/m^3: stored, and dissipated so far."""
    strain_energy, dissipated = _bound[type(law)]["hold"](law, i, m)
    return strain_energy, dissipated


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
    """Total energy dissipated by a bond that is gone at a stretch and last pulled at `before`, J/m^3."""
    return _bound[type(law)]["released"](law, c, stretch, before, peak, limit)


def tension(law: Any, stretch: Any, worst: Any, peak: Any, limit: Any) -> Any:
    """Force of a bond over its stiffness."""
    return _bound[type(law)]["tension"](law, stretch, worst, peak, limit)


def matching_pull(law: Any, stretch: Any, before: Any, worst: Any, peak: Any, limit: Any) -> Any:
    """Force over stiffness that a bond adds to the step in which it softens or breaks: dW / ds - (f_n + f_(n+1)) / 2.

    dW is the area below the law's curve, over stiffness, from the stretch `before` one step ago to the stretch of now
    or the limit, ds the growth of the stretch, and f_n and f_(n+1) the forces at both. Verlet takes f_n ds / 2 and
    f_(n+1) ds / 2 from the motion, and of a force that acts in this step alone f ds, half of it in the next step:
    together dW, however long the step is. `worst` is the largest stretch above the peak before this step; it or the
    peak stands for a larger `before`. The force is 0 for a bond that was over its limit one step ago already, or has
    not grown.
    """
    return _bound[type(law)]["matching_pull"](law, stretch, before, worst, peak, limit)


@register_jitable(**INNER)
def added_pull(law, stretch, before, worst, peak, limit):  # type: ignore[no-untyped-def]
    """Force over stiffness that a bond adds as it softens or breaks at a stretch, the largest it has had.

    It is 0 for laws whose work is not matched.
    """
    if law.matches_work:  # in double precision, as small differences of energies are divided by small growths
        return matching_pull(law, 1.0 * stretch, 1.0 * before, 1.0 * worst, 1.0 * peak, 1.0 * limit)
    return 0.0


@register_jitable(**INNER)
def broken_energy(law, c, stretch, before, peak, limit):  # type: ignore[no-untyped-def]
    """Energy dissipated by a bond that breaks at a stretch, J/m^3, with its `added_pull`."""
    if law.matches_work and before < limit:
        return total(law, c, peak, limit)
    return released(law, c, stretch, before, peak, limit)


def _gather_nothing(law, bond, now, i, j, k, m):  # type: ignore[no-untyped-def]
    pass


def _close_nothing(law, i, m):  # type: ignore[no-untyped-def]
    pass


def _remember_nothing(law, bond, now, m, i, j, k, f):  # type: ignore[no-untyped-def]
    return 0.0


def _gather_nothing_again(law, bond, now, i, j, k, m, more):  # type: ignore[no-untyped-def]
    pass


def _close_nothing_again(law, i, m, more):  # type: ignore[no-untyped-def]
    pass


def _never_alert(law, i, m):  # type: ignore[no-untyped-def]
    return False


def _fail_never(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    return False


def _no_threshold(law, bond, now, m, i, j, k):  # type: ignore[no-untyped-def]
    return -1.0


def _remember_no_node(law, bonds, now, i, m):  # type: ignore[no-untyped-def]
    pass


def _hold_nothing(law, i, m):  # type: ignore[no-untyped-def]
    return 0.0, 0.0


GROWTH = 1e-9  # of the stretch in a step: less may be round-off

_bound: dict[type, dict[str, Function]] = {}  # the functions of a law, by the type of its columns

_pairs: dict[type, Pair] = {}


def pair_of(law: Any) -> Pair:
    """The pair law of columns, or of their numba type."""
    return _pairs[getattr(law, "instance_class", type(law))]


def bind(law: Law) -> None:
    """Bind the functions of a law to its columns' type; numba keeps them for the life of the process."""
    kind = law.Columns
    if kind in _bound:
        return
    # numba calls what it compiles after the names of types: two laws of the same columns would be one
    kind.__name__ = f"{kind.__module__}.{kind.__name__}".replace(".", "_")
    said = _bound[kind] = functions_of(law)
    if law.pair is not None:
        _pairs[kind] = law.pair
    for options, functions in _DISPATCHED:
        for function in functions:
            if function.__name__ in said:
                _overload(function, options, kind, said[function.__name__])


def functions_of(law: Law) -> dict[str, Function]:
    """The functions of a law by the names of this file, with defaults for those it does not have."""
    passes = law.passes
    functions: dict[str, Function] = {"energy": law.energy, "age": law.age or _remember_nothing}
    if isinstance(passes, Passes):
        functions |= {"pull": passes.pull, "gather": passes.gather or _gather_nothing}
        functions["close"] = passes.close or _close_nothing
    else:
        functions |= vars(passes) | {"pull": _pull_by_numbers, "gather": _gather_nothing}
    again = law.again or Again(_gather_nothing_again, _close_nothing_again)
    functions |= {"gather_again": again.gather, "close_again": again.close}
    failure = law.failure or Failure(_never_alert, _fail_never)
    functions |= vars(failure) | {"threshold": failure.threshold or _no_threshold}
    functions |= vars(law.nodes or NodeMemory((), _remember_no_node, _hold_nothing))
    curve = law.pair or law.curve
    if curve is not None:
        functions |= _of_pair(curve)
    if law.lanes is not None:
        functions |= {"finish": law.lanes.finish, "nears": law.lanes.nears}
    return functions


def _of_pair(pair: Pair) -> dict[str, Function]:
    """The functions of a pair law."""
    softens = pair.softening is not None
    by_secant = _held_by_secant_of_tension if pair.elastic_in_compression else _held_by_secant
    straight = by_secant if softens else _held_by_line
    functions: dict[str, Function] = {"secant": pair.secant or _one, "held": pair.held or straight}
    functions |= vars(pair.softening or Softening(_spend_nothing, _held_at_limit, _never_soften))
    line = _tension_if_stretched if pair.elastic_in_compression else _tension_by_secant
    functions |= {"matching_pull": _match_work, "tension": line if pair.held is None else _tension_of_curve}
    if softens:
        functions["released"] = _released_softly
    else:
        functions["released"] = _released_by_line if pair.held is None else _released_at_once
    return functions


def _pull_by_numbers(law, bond, now, m, i, j, k, f):  # type: ignore[no-untyped-def]
    node_numbers, neighbour_numbers = nodal_numbers(law, bond.xi, m, i), nodal_numbers(law, bond.xi, m, j)
    force = bond_force(law, bond, numbers(law, i, j, k), node_numbers, neighbour_numbers)
    for a in range(len(force)):
        f[a] += force[a]


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


def _held_at_limit(law, c, peak, limit):  # type: ignore[no-untyped-def]
    return held(law, c, limit, 0.0, peak, limit)


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


def _tension_by_secant(law, stretch, worst, peak, limit):  # type: ignore[no-untyped-def]
    force = stretch
    if worst > 0:
        force *= secant(law, stretch, worst, peak, limit)
    return force


def _tension_if_stretched(law, stretch, worst, peak, limit):  # type: ignore[no-untyped-def]
    force = stretch
    if worst > 0 and stretch > 0:
        force *= secant(law, stretch, worst, peak, limit)
    return force


def _tension_of_curve(law, stretch, worst, peak, limit):  # type: ignore[no-untyped-def]
    return stretch * secant(law, stretch, worst, peak, limit)


def _match_work(law, stretch, before, worst, peak, limit):  # type: ignore[no-untyped-def]
    if before >= limit or stretch - before <= GROWTH:
        return 0.0
    softened = peak
    if worst > peak:
        softened = worst
    if before > softened:  # motion brought the bond no further: more is round-off or was given
        before = softened
    work = total(law, 0.5, peak, limit)
    force = tension(law, before, worst, peak, limit)
    if stretch <= limit:
        force += tension(law, stretch, stretch, peak, limit)
        work = held(law, 0.5, stretch, stretch, peak, limit) + spent(law, 0.5, stretch, peak, limit)
    work -= held(law, 0.5, before, worst, peak, limit)
    if worst > 0:
        work -= spent(law, 0.5, worst, peak, limit)
    return work / (stretch - before) - force / 2


_DISPATCHED = (  # each by the type of the law, with options of compilation
    (INLINE, (gather, pull, gather_again, fails, secant, numbers, nothing, accumulate, nodal_numbers, bond_force)),
    (INLINE, (finish, nears)),
    (INNER, (close, age, energy, close_again, alert, remember, hold, held, spent, total, slope, released)),
    (INNER, (tension, matching_pull, threshold)),
)


def _overload(function: Function, options: dict[str, Any], kind: type, law_function: Function) -> None:
    """Let compiled calls of `function` with columns of this kind be calls of the law's own function."""

    def chosen(law: Any, *_: Any) -> Function | None:
        return law_function if getattr(law, "instance_class", None) is kind else None

    parameters = signature(function).parameters.values()  # which numba expects `own` to have
    chosen.__signature__ = Signature([parameter.replace(annotation=Parameter.empty) for parameter in parameters])  # type: ignore[attr-defined]
    overload(function, jit_options=options)(chosen)
