"""A bond that breaks is cut at both of its ends."""

from __future__ import annotations

from types import SimpleNamespace as Part

import numpy as np
import pytest

from pdsolve.adaptivity.collocation.layout import CUT, EDGE, WHOLE
from pdsolve.adaptivity.collocation.simd_rows import break_bond
from pdsolve.codegen.vector_code import ROW

WAYS = np.array([1, 7, 40, -1, -7, -40])  # the second half leads back


@pytest.mark.parametrize("k", range(len(WAYS)))
def test_a_bond_breaks_at_both_ends(k: int) -> None:
    """Every way, the first of the second half among them; rows of full families become rows of cut ones."""
    zone = Part(cut_bond_bits=np.zeros((8, len(WAYS)), dtype=np.uint16), simd_row_kinds=np.full(8, WHOLE))
    p = 3 * ROW + 5
    j = p + WAYS[k]
    zone.simd_row_kinds[j // ROW] = EDGE if j // ROW != p // ROW else WHOLE
    break_bond.py_func(Part(neighbour_offsets=WAYS), zone, p, k)
    cuts = {
        (16 * row + bit, way)
        for row, way in np.argwhere(zone.cut_bond_bits)
        for bit in range(16)
        if zone.cut_bond_bits[row, way] >> bit & 1
    }
    back = int(np.flatnonzero(-WAYS[k] == WAYS)[0])
    assert cuts == {(p, k), (j, back)}
    assert zone.simd_row_kinds[p // ROW] == CUT
    assert zone.simd_row_kinds[j // ROW] == (EDGE if j // ROW != p // ROW else CUT)
