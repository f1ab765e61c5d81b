"""Pieces of a plate cut by hand."""

from __future__ import annotations

import numpy as np
import pytest
from damaged_results import lattice, run

from pdsolve.measures.fragments import find_plate_fragments


def test_a_plate_in_two() -> None:
    """20 x 9 nodes cut at column 7: 63 and 108 nodes of 1 mm^2, and what is cracked is the rest."""
    nodes = lattice()._replace(cut=np.zeros(180, dtype=np.int64))
    results = run(nodes, [(10, 7, y) for y in range(-4, 5)])
    found = find_plate_fragments(results, 100)
    assert [piece.node_count for piece in found.pieces] == [108, 63]
    assert [piece.area for piece in found.pieces] == pytest.approx([108e-6, 63e-6])
    assert found.pieces[1].centre == pytest.approx((3e-3, 0.0), abs=1e-15)
    assert found.cracked_area == pytest.approx(9e-6)
    whole = sum(piece.area for piece in found.pieces) + found.small_pieces_area + found.cracked_area
    assert whole == pytest.approx(nodes.area.sum(), rel=1e-12)
    assert len(find_plate_fragments(results, 9).pieces) == 1


def test_crumbs_are_no_pieces() -> None:
    """A node inside a ring of cracked ones is 1 of 180: less than 2 per cent."""
    ring = [(5, x, y) for x in (10, 11, 12) for y in (1, 2, 3) if (x, y) != (11, 2)]
    found = find_plate_fragments(run(lattice(), ring), 100)
    assert (len(found.pieces), found.small_piece_count) == (1, 1)
    assert found.small_pieces_area == pytest.approx(1e-6)
    assert found.cracked_area == pytest.approx((8 + 5) * 1e-6)  # and the pre-crack
