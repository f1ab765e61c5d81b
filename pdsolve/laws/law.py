"""A law as plain functions of one bond or one node, in a frozen structure; each file of a law makes one.

The functions see one bond or one node and never a loop. `pdsolve.laws.calls.bind` binds those that are compiled to the
type of the law's columns, so that one compiled loop serves every law and a second process finds it compiled. The loops
(`pdsolve.operators.bond_list`) call them in this order:

    first_pass, finish_pass             what nodes have between the passes (`Passes` or `Sums`)
    intermediate_pass,                  the same, from what both ends of bonds have (`IntermediatePass`)
        finish_intermediate_pass
    may_fail, fails                     which bonds fail now (`Failure`)
    update_bond                         history of bonds, and how they break, of pair laws, which have no first pass
    accumulate_bond_force               the force density of a bond on its node, N/m^3
    update_history                      history of nodes (`NodeHistory`)
    energy, nodal_energy                the energy densities of bonds and nodes, J/m^3

Symbols, for the bond k from node i to node j:
    xi      x_j - x_i, reference vector, m              eta      u_j - u_i, m
    q       |xi + eta| / |xi|                           stretch  q - 1, free of cancellation for small displacements
    m       (n, width) what nodes have between the passes
    now     the state as loops know it (`pdsolve.laws.bond_arrays.Now`); `now.dt`, s, is the time since the history of
            nodes: the time step within a step; 0 in quasi-static analysis, where no time passes, and in energies and
            fields after a step, whose time is that of the history. A law that depends on the rate takes 0 as no time:
            its stiffness is the instantaneous one
    law     the columns (`Law.columns_type`): arrays of all bonds (b,) and nodes (n,)

The stretches at which a bond changes are such that a crack costs its fracture energy: a pair law has a function
`limits(material, bonds)`, not compiled: the stretches at which a bond begins to soften and breaks. On the way it
dissipates c xi s_c^2 / 2, as a brittle bond with the critical stretch s_c does, or else so much that all bonds across a
crack together do.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.material import Material
from pdsolve.bonds.assembly import Bonds
from pdsolve.laws.bond_arrays import INLINE as INLINE
from pdsolve.laws.bond_arrays import INNER as INNER
from pdsolve.laws.bond_arrays import AnyList, Tabled
from pdsolve.model import Model
from pdsolve.state import Unknown

Function = Callable[..., Any]  # that numba compiles
Array = NDArray[np.floating]


class Sizes(NamedTuple):
    """What the limits of bonds (b,) depend on, besides their material."""

    critical: NDArray[np.float64]  # (b,) s_c, stretch at which brittle bonds break
    length: NDArray[np.float64]  # (b,) |xi|, m
    horizon: NDArray[np.float64]  # (b,) the mean of both ends', m
    ratio: float  # of horizon to spacing


class Limits(NamedTuple):
    """Stretches at which a bond softens and breaks."""

    peak: NDArray[np.float64]  # begins to soften
    limit: NDArray[np.float64]  # is gone


@dataclass(frozen=True)
class Softening:
    """Energy dissipated by softening of a bond, J/m^3; symbols as in `Pair`."""

    dissipated_energy: Function  # (law, c, worst, peak, limit) once it was stretched to `worst`, above the peak
    total_dissipated_energy: Function  # (law, c, peak, limit) once it is gone
    softening_slope: Function  # (law, worst, peak, limit) of force / stiffness by the stretch, as `worst` grows with it


@dataclass(frozen=True, kw_only=True)
class Pair:
    """A law of independent bonds: the form that every operator supports, including the fast kernel.

    A bond pulls with stiffness * stretch * secant until its stretch exceeds `limit`; then it is broken. The functions
    add, subtract, multiply, divide and take roots, and do not branch: they receive numbers, arrays and lanes.

        law       the columns, for their type              peak, limit  of the bond, from `limits`; both infinite if
        stretch   of the bond now                                       unbreakable
        worst     the largest it has had above the peak,   c            stiffness |xi| / 4, J/m^3: energy at the node
                  0 until then, or without softening                    at unit stretch, if it were linear
    """

    limits: Callable[[Material, Sizes], Limits]
    secant: Function | None = None  # (law, stretch, worst, peak, limit), at most 1; None: 1
    bond_strain_energy: Function | None = None  # (law, c, stretch, worst, peak, limit), J/m^3, of a bond that is no
    # straight line; None: it is one, through the origin
    softening: Softening | None = None  # None: a bond has no history until it is gone
    elastic_in_compression: bool = False  # a softened bond has its secant under tension, all its stiffness else

    @property
    def is_curved(self) -> bool:
        """Whether the force of an intact bond is no straight line."""
        return self.bond_strain_energy is not None


@dataclass(frozen=True)
class Passes:
    """The passes of a law in terms of bond and node indices."""

    accumulate_bond_force: Function  # (law, bond, now, m, i, j, k, f) adds the force density on node i to f (w,)
    first_pass: Function | None = None  # (law, bond, now, i, j, k, m) adds to m[i] what bond k says of node i's family
    finish_pass: Function | None = None  # (law, now, i, m) turns m[i] into what `accumulate_bond_force` wants


@dataclass(frozen=True)
class Sums:
    """The passes of a law without indices, on tuples that stay in registers."""

    numbers: Function  # (law, i, j, k) what the columns have of bond k
    initial_sums: Function  # (law, xi, none) what a node's sums begin with; `none` is the 0 they are made of
    accumulate: Function  # (law, bond, c, sums) those sums plus the contribution of a bond with the numbers c
    finish_pass: Function  # (law, now, i, m) turns the sums in m[i] into what `nodal_numbers` reads
    nodal_numbers: Function  # (law, xi, m, i) what the bonds of node i, from both their ends, need of it
    bond_force: Function  # (law, bond, c, node_numbers, neighbour_numbers): N/m^3
    # on a bond's node, from the nodal numbers of both ends


@dataclass(frozen=True)
class IntermediatePass:
    """An intermediate pass, which uses the results of the first pass at both ends."""

    intermediate_pass: Function  # (law, bond, now, i, j, k, m, more) adds to more[i]
    finish_intermediate_pass: Function  # (law, now, i, m, more) puts into m[i] what the last pass wants


@dataclass(frozen=True)
class Failure:
    """Failure of bonds, for laws with a first pass: all bonds that fail in a step do so before any pulls."""

    may_fail: Function  # (law, now, i, m) whether a bond of node i may fail; none fails of which neither end may
    fails: Function  # (law, bond, now, m, i, j, k) whether bond k does; the same from both its ends
    failure_stretch: Function | None = None  # likewise: the stretch at which a bond that fails would have failed,
    # were all stretches of now scaled alike: it then pulls in the step in which it breaks; None: it is gone at once


@dataclass(frozen=True)
class NodeHistory:
    """History of nodes, and of bonds that only their own node changes."""

    columns: tuple[str, ...]  # that `update_history` changes; those without an entry are not there
    update_history: Function  # (law, bonds, now, i, m), of the bonds as loops have them
    nodal_energy: Function  # (law, now, i, m) what node i itself adds to its energies, J/m^3: stored, and dissipated


@dataclass(frozen=True)
class Lanes:
    """Additional functions of a law of `Sums` for blocks, where a number stands for many lanes."""

    finish_sums: Function  # (law, sums, node_constants) what a node has between the passes, as `finish_pass`,
    # from what `standing` has of it
    margin: Function  # (law, bond, c, node_numbers, neighbour_numbers) a quantity of a bond and its limit
    tabled: Callable[[Any, Bonds], Tabled]  # the numbers of all bonds, the first never 0
    standing: Callable[[Any, NDArray[np.int64]], Array]  # (., k) what `finish_sums` wants of nodes (k,)
    by_lanes: Callable[[Any], bool]  # whether `finish_sums` can stand for `finish_pass`
    in_space: bool = (
        False  # whether `finish_sums` is written for three dimensions too; numbers of bonds then are pairs: one,
    )
    # and that of the bond the other way, times V_j / V_i


def displacement(dimension: int) -> tuple[Unknown, ...]:
    """The unknown of laws without others: the displacement."""
    return (Unknown("u", dimension, 2),)


@dataclass(frozen=True, kw_only=True)
class Law:
    """A law as operators use it. Arrays in `columns_type` named `broken` (b,) are steps in which bonds broke, or 0."""

    columns_type: type[Any]  # a NamedTuple of its own
    columns: Callable[[Model, Bonds], Any]
    passes: Passes | Sums
    energy: Function  # (law, bond, now, m, i, j, k) what bond k adds to node i, J/m^3: stored, and dissipated
    width: Callable[[Any, int], int] | None = None  # of m, by columns and dimension; None: no first pass
    scale: Callable[[Any, Bonds], NDArray[np.float64]] | None = (
        None  # how the resistance of nodes (n,) compares, N/m^4; likewise
    )
    failure: Failure | None = None
    again: IntermediatePass | None = None
    nodes: NodeHistory | None = None
    lanes: Lanes | None = None
    update_after_breakage: Callable[[Any, AnyList, NDArray[np.int64]], None] | None = None  # (law, bonds, rows)
    torn_stiffness: Callable[[Any, NDArray[np.float64]], NDArray[np.float64]] | None = None  # bound (n,) of nodes that
    # have lost bonds, N/m^4, from the bound at the start; None: they are no stiffer
    fields: Callable[[Any, Array, Array], Mapping[str, NDArray[np.float64]]] | None = None  # (columns, value, m), SI
    unknowns: Callable[[int], tuple[Unknown, ...]] = displacement
    update_bond: Function | None = None  # (law, bond, now, m, i, j, k, f) of pair laws; J/m^3 that node i dissipates
    bond_history: tuple[str, ...] = ()  # columns of bonds that `update_bond` changes, but for `broken`
    pair: Pair | None = None  # of a law of bonds that know nothing of others; see `pdsolve.laws.pair.pair_law`
    matches_work: bool = True  # of pair laws: bonds that soften or break in a step add `calls.matching_force` to it
    curve: Pair | None = None  # how bonds that are not of `pair` soften by their drive, an equivalent stretch

    @property
    def softens(self) -> bool:
        """Whether bonds soften before they break."""
        curve = self.pair or self.curve
        return curve is not None and curve.softening is not None
