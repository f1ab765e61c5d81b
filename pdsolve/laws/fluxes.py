"""Fluxes as functions of one bond, for the loops that sum bonds: numbers, or lanes of many bonds.

A bond has its conductance `c`, 1/(s m^d); `bond` is what its ends have (`pdsolve.laws.bond_arrays.Ends`). A node's sum
is over all its bonds.

    Conduction    amount V C of a node; what all bonds bring, without what leaves the node
    Contrast      volume V and a share; V times the difference of both shares, never negative
    Dissolution   volume V, concentration and whether it is solid; V times the difference of concentrations

Bonds are added to two sums in turn, as adding to one has to wait for the last.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.codegen.fused import fused
from pdsolve.laws.calls import bind_functions


class Conduction(NamedTuple):
    """Fick's law of bonds (b,)."""

    g: NDArray[np.float64]  # (b,) 1/(s m^d)
    broken: None = None  # bonds do not break


class Contrast(NamedTuple):
    """Differences between the shares at both ends of bonds (b,)."""

    g: NDArray[np.float64]  # (b,) 1/(s m^d)
    broken: None = None


class Dissolution(NamedTuple):
    """Kinetic dissolution along bonds (b,)."""

    g: NDArray[np.float64]  # (b,) 1/(s m^d)
    C_sat: float  # mol/m^3: a bond from solid to liquid conducts while the liquid is below it
    k_diss: float  # its conductance over that of a bond in liquid
    broken: None = None


def _differ(law, bond, c, sums):  # type: ignore[no-untyped-def]
    difference = bond.far_end[1] - bond.near_end[1]
    return sums[1], fused(c[0] * bond.far_end[0], np.sqrt(difference * difference), sums[0])


def _dissolve(law, bond, c, sums):  # type: ignore[no-untyped-def]
    _, concentration, is_solid = bond.near_end
    V, neighbour_concentration, neighbour_is_solid = bond.far_end
    factor = 0.0  # between two solid nodes
    if is_solid != neighbour_is_solid:
        factor = law.k_diss if (neighbour_concentration if is_solid else concentration) < law.C_sat else 0.0
    elif not is_solid:
        factor = 1.0
    return sums[1], fused(factor * c[0] * V, neighbour_concentration - concentration, sums[0])


def _bring(law, bond, c, sums):  # type: ignore[no-untyped-def]
    return sums[1], fused(c[0], bond.far_end[0], sums[0])


def _join(law, now, i, m):  # type: ignore[no-untyped-def]
    m[i, 0] += m[i, 1]


for _law, _accumulate in ((Conduction, _bring), (Contrast, _differ), (Dissolution, _dissolve)):
    bind_functions(
        _law,
        {
            "numbers": lambda law, i, j, k: (law.g[k],),
            "initial_sums": lambda law, xi, none: (none, none),
            "accumulate": _accumulate,
            "finish_pass": _join,
            "finish_sums": lambda law, sums, node_constants: (node_constants[0] * (sums[0] + sums[1]),),
        },
    )
