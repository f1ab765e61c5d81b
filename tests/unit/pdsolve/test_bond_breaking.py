"""A bond that breaks is cut at both of its ends."""

from __future__ import annotations

from collections import namedtuple

import numpy as np
import pytest
from numba import njit

from pdsolve.adaptivity.collocation.bond_breaking import cut_bond
from pdsolve.adaptivity.collocation.row_stiffness import COMPUTED, UNCORRECTED, WHOLE
from pdsolve.codegen.vector_code import ROW

Lattice = namedtuple("Lattice", "neighbour_offsets")
Zone = namedtuple("Zone", "cut_bond_bits stiffness_index_of_row")
WAYS = np.array([1, 7, 40, -1, -7, -40])  # the second half leads back


@njit
def cut(lattice, zone, p, k):  # type: ignore[no-untyped-def]
    """Cut a bond."""
    cut_bond(lattice, zone, p, k)


@pytest.mark.parametrize("k", range(len(WAYS)))
def test_a_bond_breaks_at_both_ends(k: int) -> None:
    """Every way, the first of the second half among them; rows of full families become rows of cut ones."""
    zone = Zone(np.zeros((8, len(WAYS)), dtype=np.uint16), np.full(8, WHOLE))
    p = 3 * ROW + 5
    j = p + WAYS[k]
    zone.stiffness_index_of_row[j // ROW] = COMPUTED if j // ROW != p // ROW else WHOLE
    cut(Lattice(WAYS), zone, p, k)
    cuts = {
        (16 * row + bit, way)
        for row, way in np.argwhere(zone.cut_bond_bits)
        for bit in range(16)
        if zone.cut_bond_bits[row, way] >> bit & 1
    }
    back = int(np.flatnonzero(-WAYS[k] == WAYS)[0])
    assert cuts == {(p, k), (j, back)}
    assert zone.stiffness_index_of_row[p // ROW] == UNCORRECTED
    assert zone.stiffness_index_of_row[j // ROW] == (COMPUTED if j // ROW != p // ROW else UNCORRECTED)
