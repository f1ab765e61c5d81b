"""The functions of a law as compiled loops call them, bound to the type of its columns; see `pdsolve.laws.law`.

Calls from Python, without compilation, are dispatched by the same types.
"""

from __future__ import annotations

from inspect import Parameter, Signature, signature
from typing import Any

import numpy as np
from numba.extending import overload, register_jitable
from numpy.typing import NDArray

from pdsolve.laws.bond_arrays import INLINE, INNER, AnyList, Bond, Ends, Now
from pdsolve.laws.law import Function, Law, Pair, Passes


def first_pass(law: Any, bond: Bond, now: Now, i: int, j: int, k: int, m: NDArray[Any]) -> None:
    """Add the contribution of bond k to the family sums m[i] of node i."""
    _bound[type(law)]["first_pass"](law, bond, now, i, j, k, m)


def numbers(law: Any, i: Any, j: Any, k: Any) -> tuple[Any, ...]:
    """The numbers of bond k in the columns."""
    return tuple(_bound[type(law)]["numbers"](law, i, j, k))


def initial_sums(law: Any, xi: tuple[Any, ...], none: Any) -> tuple[Any, ...]:
    """Initial sums; `none` is the zero they consist of."""
    return tuple(_bound[type(law)]["initial_sums"](law, xi, none))


def accumulate(law: Any, bond: Bond | Ends, c: tuple[Any, ...], sums: tuple[Any, ...]) -> tuple[Any, ...]:
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


def finish_sums(law: Any, sums: tuple[Any, ...], node_constants: tuple[Any, ...]) -> tuple[Any, ...]:
    """Nodal numbers between the passes, from the sums."""
    return tuple(_bound[type(law)]["finish_sums"](law, sums, node_constants))


def margin(
    law: Any, bond: Bond, c: tuple[Any, ...], node_numbers: tuple[Any, ...], neighbour_numbers: tuple[Any, ...]
) -> tuple[Any, Any]:
    """A quantity of a bond and its limit, for failure."""
    failure_measure, limit = _bound[type(law)]["margin"](law, bond, c, node_numbers, neighbour_numbers)
    return failure_measure, limit


def finish_pass(law: Any, now: Now, i: int, m: NDArray[Any]) -> None:
    """Convert the sums m[i] to the numbers of the second pass."""
    _bound[type(law)]["finish_pass"](law, now, i, m)


def update_bond(law: Any, bond: Bond, now: Now, m: NDArray[Any], i: int, j: int, k: int, f: NDArray[Any]) -> float:
    """Update the history of bond k, and add to f (w,) the force density, N/m^3, with which it breaks; returns the
    energy dissipated at node i, J/m^3."""
    return float(_bound[type(law)]["update_bond"](law, bond, now, m, i, j, k, f))


def accumulate_bond_force(
    law: Any, bond: Bond, now: Now, m: NDArray[Any], i: int, j: int, k: int, f: NDArray[Any]
) -> None:
    """Add the force density of bond k on node i to f (w,), N/m^3."""
    _bound[type(law)]["accumulate_bond_force"](law, bond, now, m, i, j, k, f)


def energy(law: Any, bond: Bond, now: Now, m: NDArray[Any], i: int, j: int, k: int) -> tuple[float, float]:
    """Contribution of bond k to the energy densities of node i, J/m^3: stored, and dissipated by softening so far."""
    strain_energy, dissipated = _bound[type(law)]["energy"](law, bond, now, m, i, j, k)
    return strain_energy, dissipated


def intermediate_pass(
    law: Any, bond: Bond, now: Now, i: int, j: int, k: int, m: NDArray[Any], more: NDArray[Any]
) -> None:
    """Add to more[i] the contribution of bond k after the first pass of both its nodes."""
    _bound[type(law)]["intermediate_pass"](law, bond, now, i, j, k, m, more)


def finish_intermediate_pass(law: Any, now: Now, i: int, m: NDArray[Any], more: NDArray[Any]) -> None:
    """Convert m[i] and more[i] to the numbers of the last pass, in m[i]."""
    _bound[type(law)]["finish_intermediate_pass"](law, now, i, m, more)


def may_fail(law: Any, now: Now, i: int, m: NDArray[Any]) -> bool:
    """Whether a bond of node i may fail."""
    return bool(_bound[type(law)]["may_fail"](law, now, i, m))


def fails(law: Any, bond: Bond, now: Now, m: NDArray[Any], i: int, j: int, k: int) -> bool:
    """Whether bond k fails; equal from both its ends."""
    return bool(_bound[type(law)]["fails"](law, bond, now, m, i, j, k))


def failure_stretch(law: Any, bond: Bond, now: Now, m: NDArray[Any], i: int, j: int, k: int) -> float:
    """The stretch at which bond k, which fails now, would have failed if all stretches were scaled; -1 if unknown."""
    return float(_bound[type(law)]["failure_stretch"](law, bond, now, m, i, j, k))


def update_history(law: Any, bonds: AnyList, now: Now, i: int, m: NDArray[Any]) -> None:
    """Update the history of node i and its bonds."""
    _bound[type(law)]["update_history"](law, bonds, now, i, m)


def nodal_energy(law: Any, now: Now, i: int, m: NDArray[Any]) -> tuple[float, float]:
    """Energy densities of node i itself, J/m^3: stored, and dissipated so far."""
    strain_energy, dissipated = _bound[type(law)]["nodal_energy"](law, now, i, m)
    return strain_energy, dissipated


def secant(law: Any, stretch: Any, worst: Any, peak: Any, limit: Any) -> Any:
    """Force of a bond over that of a linear one."""
    return _bound[type(law)]["secant"](law, stretch, worst, peak, limit)


def bond_strain_energy(law: Any, c: Any, stretch: Any, worst: Any, peak: Any, limit: Any) -> Any:
    """Stored energy of a bond, J/m^3."""
    return _bound[type(law)]["bond_strain_energy"](law, c, stretch, worst, peak, limit)


def dissipated_energy(law: Any, c: Any, worst: Any, peak: Any, limit: Any) -> Any:
    """Energy dissipated by softening of a bond that was stretched to `worst`, J/m^3."""
    return _bound[type(law)]["dissipated_energy"](law, c, worst, peak, limit)


def total_dissipated_energy(law: Any, c: Any, peak: Any, limit: Any) -> Any:
    """Energy dissipated by a fully softened bond, J/m^3."""
    return _bound[type(law)]["total_dissipated_energy"](law, c, peak, limit)


def softening_slope(law: Any, worst: Any, peak: Any, limit: Any) -> Any:
    """Slope of a bond's force over its stiffness while `worst` grows with its stretch."""
    return _bound[type(law)]["softening_slope"](law, worst, peak, limit)


def dissipated_at_break(law: Any, c: Any, stretch: Any, before: Any, peak: Any, limit: Any) -> Any:
    """Total energy dissipated by a bond that is gone at a stretch and last pulled at `before`, J/m^3."""
    return _bound[type(law)]["dissipated_at_break"](law, c, stretch, before, peak, limit)


def force_over_stiffness(law: Any, stretch: Any, worst: Any, peak: Any, limit: Any) -> Any:
    """Force of a bond over its stiffness."""
    return _bound[type(law)]["force_over_stiffness"](law, stretch, worst, peak, limit)


def matching_force(law: Any, stretch: Any, before: Any, worst: Any, peak: Any, limit: Any) -> Any:
    """Force over stiffness that a bond adds to the step in which it softens or breaks: dW / ds - (f_n + f_(n+1)) / 2.

    dW is the area below the law's curve, over stiffness, from the stretch `before` one step ago to the stretch of now
    or the limit, ds the growth of the stretch, and f_n and f_(n+1) the forces at both. Verlet takes f_n ds / 2 and
    f_(n+1) ds / 2 from the motion, and of a force that acts in this step alone f ds, half of it in the next step:
    together dW, however long the step is. `worst` is the largest stretch above the peak before this step; it or the
    peak stands for a larger `before`. The force is 0 for a bond that was over its limit one step ago already, or has
    not grown.
    """
    return _bound[type(law)]["matching_force"](law, stretch, before, worst, peak, limit)


@register_jitable(**INNER)
def added_force(law, stretch, before, worst, peak, limit):  # type: ignore[no-untyped-def]
    """Force over stiffness that a bond adds as it softens or breaks at a stretch, the largest it has had.

    It is 0 for laws whose work is not matched.
    """
    if law.matches_work:  # in double precision, as small differences of energies are divided by small growths
        return matching_force(law, 1.0 * stretch, 1.0 * before, 1.0 * worst, 1.0 * peak, 1.0 * limit)
    return 0.0


@register_jitable(**INNER)
def second_share(growth, next_growth):  # type: ignore[no-untyped-def]
    """What a bond adds one step after the step in which it broke, over its `matching_force` f of that step.

    There its stretch grew by a, the `growth`, and f does its work in halves, f a / 2 and f b / 2, as if the
    `next_growth` b of this step were a; but f slows the nodes, and b is smaller. A force g f in this step does the
    rest, in halves too, and slows the nodes further in proportion: g b / 2 + g (b - g (a - b)) / 2 = (a - b) / 2, thus
    with r = a / b - 1: g = r / (1 + sqrt(1 - r^2)). It is at most 1, and 0 where the stretch does not grow.
    """
    if next_growth <= GROWTH or growth <= GROWTH:
        return 0.0
    r = growth / next_growth - 1
    return r / (1 + np.sqrt(1 - r * r)) if r < 1 else 1.0


@register_jitable(**INNER)
def second_force(law, stretch, before, first, worst, peak, limit):  # type: ignore[no-untyped-def]
    """Force over stiffness that a bond adds one step after the step in which it broke and had the stretches `first` and
    `before`; see `second_share`."""
    then, start = 1.0 * before, 1.0 * first
    if not law.matches_work:
        return 0.0
    over_limit = max(then, limit * (1 + GROWTH))  # round-off of displacements does not mend the bond
    pull = matching_force(law, over_limit, start, 1.0 * worst, 1.0 * peak, 1.0 * limit)
    return pull * second_share(then - start, stretch - then)


@register_jitable(**INNER)
def broken_energy(law, c, stretch, before, peak, limit):  # type: ignore[no-untyped-def]
    """Energy dissipated by a bond that breaks at a stretch, J/m^3, with its `added_force`."""
    if law.matches_work and before < limit:
        return total_dissipated_energy(law, c, peak, limit)
    return dissipated_at_break(law, c, stretch, before, peak, limit)


_DEFAULTS: dict[str, Function] = {  # of what a law does not have
    "first_pass": lambda law, bond, now, i, j, k, m: None,
    "finish_pass": lambda law, now, i, m: None,
    "update_bond": lambda law, bond, now, m, i, j, k, f: 0.0,
    "intermediate_pass": lambda law, bond, now, i, j, k, m, more: None,
    "finish_intermediate_pass": lambda law, now, i, m, more: None,
    "may_fail": lambda law, now, i, m: False,
    "fails": lambda law, bond, now, m, i, j, k: False,
    "failure_stretch": lambda law, bond, now, m, i, j, k: -1.0,
    "update_history": lambda law, bonds, now, i, m: None,
    "nodal_energy": lambda law, now, i, m: (0.0, 0.0),
}

GROWTH = 1e-9  # of the stretch in a step: less may be round-off

_bound: dict[type, dict[str, Function]] = {}  # the functions of a law, by the type of its columns

_pairs: dict[type, Pair] = {}


def pair_of(law: Any) -> Pair:
    """The pair law of columns, or of their numba type."""
    return _pairs[getattr(law, "instance_class", type(law))]


def bind(law: Law) -> None:
    """Bind the functions of a law to its columns' type; numba keeps them for the life of the process."""
    if law.columns_type in _bound:
        return
    bind_functions(law.columns_type, functions_of(law))
    if law.pair is not None:
        _pairs[law.columns_type] = law.pair


def bind_functions(kind: type[Any], functions: dict[str, Function]) -> None:
    """Bind functions, by the names of this file, to a type of columns."""
    # numba calls what it compiles after the names of types: two laws of the same columns would be one
    kind.__name__ = f"{kind.__module__}.{kind.__name__}".replace(".", "_")
    _bound[kind] = functions
    for options, dispatched in _DISPATCHED:
        for function in dispatched:
            if function.__name__ in functions:
                _overload(function, options, kind, functions[function.__name__])


def bound_functions(columns: Any) -> dict[str, Function]:
    """The functions that are bound to the type of columns, by the names of this file."""
    return _bound[type(columns)]


def functions_of(law: Law) -> dict[str, Function]:
    """The functions of a law by the names of this file, with defaults for those it does not have."""
    functions: dict[str, Function | None] = {"energy": law.energy, "update_bond": law.update_bond}
    if not isinstance(law.passes, Passes):
        functions["accumulate_bond_force"] = _accumulate_by_numbers
    for part in (law.passes, law.again, law.failure, law.nodes):
        functions |= {} if part is None else vars(part)
    curve = law.pair or law.curve
    if curve is not None:
        functions |= _of_pair(curve)
    if law.lanes is not None:
        functions |= {"finish_sums": law.lanes.finish_sums, "margin": law.lanes.margin}
    return _DEFAULTS | {name: function for name, function in functions.items() if function is not None}


def _of_pair(pair: Pair) -> dict[str, Function]:
    """The functions of a pair law."""
    one_sided = pair.elastic_in_compression
    functions: dict[str, Function] = {
        "secant": pair.secant or (lambda law, stretch, worst, peak, limit: 1.0),
        "matching_force": _match_work,
        "force_over_stiffness": _force_if_stretched if one_sided else _force_by_secant,
    }
    if pair.is_curved:
        functions["force_over_stiffness"] = lambda law, stretch, worst, peak, limit: (
            stretch * secant(law, stretch, worst, peak, limit)
        )
    if pair.softening is None:
        functions |= {
            "bond_strain_energy": lambda law, c, stretch, worst, peak, limit: c * stretch * stretch,
            "dissipated_energy": lambda law, c, worst, peak, limit: 0.0,
            "total_dissipated_energy": lambda law, c, peak, limit: bond_strain_energy(law, c, limit, 0.0, peak, limit),
            "softening_slope": lambda law, worst, peak, limit: 1.0,
            "dissipated_at_break": lambda law, c, stretch, before, peak, limit: c * (stretch * before),
        }
        if pair.is_curved:
            functions["dissipated_at_break"] = _dissipated_at_once
    else:
        functions |= vars(pair.softening)
        functions["bond_strain_energy"] = _energy_by_secant_of_tension if one_sided else _energy_by_secant
        functions["dissipated_at_break"] = _dissipated_softly
    if pair.bond_strain_energy is not None:
        functions["bond_strain_energy"] = pair.bond_strain_energy
    return functions


def _accumulate_by_numbers(law, bond, now, m, i, j, k, f):  # type: ignore[no-untyped-def]
    node_numbers, neighbour_numbers = nodal_numbers(law, bond.xi, m, i), nodal_numbers(law, bond.xi, m, j)
    force = bond_force(law, bond, numbers(law, i, j, k), node_numbers, neighbour_numbers)
    for a in range(len(force)):
        f[a] += force[a]


def _energy_by_secant(law, c, stretch, worst, peak, limit):  # type: ignore[no-untyped-def]
    if worst > 0:
        c *= secant(law, stretch, worst, peak, limit)
    return c * stretch * stretch


def _energy_by_secant_of_tension(law, c, stretch, worst, peak, limit):  # type: ignore[no-untyped-def]
    if worst > 0 and stretch > 0:
        c *= secant(law, stretch, worst, peak, limit)
    return c * stretch * stretch


def _dissipated_at_once(law, c, stretch, before, peak, limit):  # type: ignore[no-untyped-def]
    pulled = before * secant(law, before, 0.0, peak, limit)  # for half a step more
    return bond_strain_energy(law, c, before, 0.0, peak, limit) + c * pulled * (stretch - before)


def _dissipated_softly(law, c, stretch, before, peak, limit):  # type: ignore[no-untyped-def]
    if peak < limit:
        return total_dissipated_energy(law, c, peak, limit)
    return c * (stretch * before)


def _force_by_secant(law, stretch, worst, peak, limit):  # type: ignore[no-untyped-def]
    force = stretch
    if worst > 0:
        force *= secant(law, stretch, worst, peak, limit)
    return force


def _force_if_stretched(law, stretch, worst, peak, limit):  # type: ignore[no-untyped-def]
    force = stretch
    if worst > 0 and stretch > 0:
        force *= secant(law, stretch, worst, peak, limit)
    return force


def _match_work(law, stretch, before, worst, peak, limit):  # type: ignore[no-untyped-def]
    if before >= limit or stretch - before <= GROWTH:
        return 0.0
    softened = peak
    if worst > peak:
        softened = worst
    if before > softened:  # motion brought the bond no further: more is round-off or was given
        before = softened
    work = total_dissipated_energy(law, 0.5, peak, limit)
    force = force_over_stiffness(law, before, worst, peak, limit)
    if stretch <= limit:
        force += force_over_stiffness(law, stretch, stretch, peak, limit)
        work = bond_strain_energy(law, 0.5, stretch, stretch, peak, limit) + dissipated_energy(
            law, 0.5, stretch, peak, limit
        )
    work -= bond_strain_energy(law, 0.5, before, worst, peak, limit)
    if worst > 0:
        work -= dissipated_energy(law, 0.5, worst, peak, limit)
    return work / (stretch - before) - force / 2


_DISPATCHED = (  # each by the type of the law, with options of compilation
    (
        INLINE,
        (
            first_pass,
            accumulate_bond_force,
            update_bond,
            intermediate_pass,
            fails,
            secant,
            numbers,
            initial_sums,
            accumulate,
        ),
    ),
    (INLINE, (nodal_numbers, bond_force, finish_sums, margin)),
    (INNER, (finish_pass, energy, finish_intermediate_pass, may_fail, update_history, nodal_energy)),
    (INNER, (bond_strain_energy, dissipated_energy, total_dissipated_energy, softening_slope, dissipated_at_break)),
    (INNER, (force_over_stiffness, matching_force, failure_stretch)),
)


def _overload(function: Function, options: dict[str, Any], kind: type, law_function: Function) -> None:
    """Let compiled calls of `function` with columns of this kind be calls of the law's own function."""

    def chosen(law: Any, *_: Any) -> Function | None:
        return law_function if getattr(law, "instance_class", None) is kind else None

    parameters = signature(function).parameters.values()  # which numba expects `own` to have
    chosen.__signature__ = Signature([parameter.replace(annotation=Parameter.empty) for parameter in parameters])  # type: ignore[attr-defined]
    overload(function, jit_options=options)(chosen)
