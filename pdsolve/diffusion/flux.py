"""Fick's law of a bond and of a node: functions that the processor's kernels and those of devices are made of.

Symbols: h content and p potential, mol/m^3; V volume, m^d; g conductance, 1/(s m^d); a = p V amount of a cell, mol;
s and t sums over bonds. What is rounded once is `fused`, in the order that is written.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.extending import register_jitable

from pdsolve.codegen.fused import fused
from pdsolve.codegen.inner_functions import INNER

INLINE = INNER | {"forceinline": True}


def saturated(h: Any, C_sat: float) -> Any:
    """Potential of a content that dissolves up to C_sat."""
    return np.minimum(h, C_sat)


@register_jitable(**INLINE)
def flux(g, V, node_potential, neighbour_potential, t):  # type: ignore[no-untyped-def]
    """t and what a bond to a node of volume V adds to it, from the potentials of both ends."""
    return fused(g * V, neighbour_potential - node_potential, t)


@register_jitable(**INLINE)
def two(g0, a0, g1, a1):  # type: ignore[no-untyped-def]
    """What two bonds bring, from the amounts in the cells at their ends."""
    return fused(g1, a1, g0 * a0)


@register_jitable(**INLINE)
def four(g0, a0, g1, a1, g2, a2, g3, a3):  # type: ignore[no-untyped-def]
    """What four bonds bring."""
    return fused(g3, a3, fused(g2, a2, two(g0, a0, g1, a1)))


@register_jitable(**INLINE)
def gained(scale, s, outflow, p):  # type: ignore[no-untyped-def]
    """Rate of a node to which its bonds bring s, and take `outflow` times its potential."""
    return scale * (s - outflow * p)


FUNCTIONS = {function.__name__: function for function in (saturated, flux, two, four, gained)}
