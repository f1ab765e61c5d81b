"""Numbering of the nodes and cells of a fine zone, and the parts of bonds in cells, in the plane and in space."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from numba import njit

from pdsolve.zone.bond_parts import divide_bonds_at_cell_borders
from pdsolve.zone.cells import (
    COARSE,
    FINE,
    ZoneNumbering,
    cell_around,
    create_body_numbering,
    create_plate_numbering,
    lattice_coordinates,
    mark_and_list_new_fine_cells_near,
    place_number_at,
    place_on_finer_lattice,
)

NUMBERINGS = {"plate": create_plate_numbering(20, 14), "body": create_body_numbering((21, 15, 11), 3)}


@njit(error_model="numpy")
def compiled(numbering, q, cell_kinds, new_cells):  # type: ignore[no-untyped-def]
    """A coarse node's coordinates and place, its fine place, a cell there, and how many cells near it become fine."""
    x = lattice_coordinates(numbering.coarse, q)
    p = place_on_finer_lattice(numbering.coarse, numbering.fine, 2, q)
    fine = lattice_coordinates(numbering.fine, p)
    count = mark_and_list_new_fine_cells_near(numbering.cells, cell_kinds, fine, 6, new_cells, 0)
    return x, place_number_at(numbering.coarse, x), p, cell_around(fine, 1), count


@pytest.mark.parametrize("name", NUMBERINGS)
def test_compiled_places_are_those_of_arrays(name: str) -> None:
    numbering: ZoneNumbering = NUMBERINGS[name]
    for lattice in (numbering.fine, numbering.coarse, numbering.cells):
        x = tuple(along.ravel() for along in np.indices(lattice.counts))
        places = place_number_at(lattice, x)
        assert len(np.unique(places)) == np.prod(lattice.counts)
        assert np.array_equal(
            np.sort(places), np.arange(lattice.place_count).reshape(lattice.shape)[lattice.inner].ravel()
        )
        assert np.array_equal(lattice_coordinates(lattice, places), x)
    cells = np.full(numbering.cells.place_count, COARSE, dtype=np.uint8)
    middle = tuple(count // 2 for count in numbering.coarse.counts)
    q, new = place_number_at(numbering.coarse, middle), np.zeros(len(cells), dtype=np.int64)
    x, place, p, beside, count = compiled(numbering, q, cells, new)
    fine = tuple(2 * along for along in middle)
    assert (x, place, p) == (middle, q, place_number_at(numbering.fine, fine))
    assert beside == cell_around(fine, 1) == (middle[0], *(along - 1 for along in middle[1:]))
    assert np.array_equal(np.sort(new[:count]), np.flatnonzero(cells == FINE))
    every = np.array(list(product(*(range(side) for side in numbering.cells.counts))))
    away = np.maximum(np.abs(np.array(fine) - (2 * every + 1)) - 1, 0)
    near = every[(away**2).sum(axis=1) < 36]
    assert np.array_equal(np.sort(new[:count]), np.sort(place_number_at(numbering.cells, tuple(near.T))))


@pytest.mark.parametrize("dimension", [2, 3])
def test_parts_fill_their_bonds(dimension: int) -> None:
    """Each side of a bond has all of it; parts begin where others end, in a cell that their middle is in."""
    offsets = np.array([xi for xi in product(range(-3, 4), repeat=dimension) if any(xi)])
    parts = divide_bonds_at_cell_borders(offsets)
    for position, k in product(range(2**dimension), range(len(offsets))):
        bounds = parts.part_bounds_of_sides[position, k]
        start = np.array([position >> axis & 1 for axis in range(dimension)])
        sides = 2 ** np.count_nonzero((offsets[k] == 0) & (start == 0))
        assert np.count_nonzero(np.diff(bounds)) == sides
        for side in range(sides):
            own = slice(bounds[side], bounds[side + 1])
            shares = parts.begin_and_end_shares[own]
            assert (shares[0, 0], shares[-1, 1]) == (0.0, 1.0)
            assert np.array_equal(shares[1:, 0], shares[:-1, 1])
            middle = (start + shares.mean(axis=1)[:, None] * offsets[k]) / 2
            assert (np.abs(middle - parts.cell_offset[own] - 0.5) <= 0.5).all()
            ends = parts.end_cells[own] + parts.end_shares_of_cell[own]
            np.testing.assert_allclose(2 * ends, start + shares[..., None] * offsets[k], atol=1e-12)
            assert ((parts.end_shares_of_cell[own] >= 0) & (parts.end_shares_of_cell[own] < 1)).all()
