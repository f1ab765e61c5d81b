"""Which nodes contact looks at, their normals, and when it looks anew."""

from __future__ import annotations

import numpy as np
import pytest
from contact_bars import bar, grid_of, moving

from pdmesh.model.mechanical_conditions import Contact
from pdsolve.operators.contact.candidates import candidates
from pdsolve.operators.contact.kernel import farthest
from pdsolve.operators.contact.operator import PenaltyContact
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

H, ROWS, COLUMNS = 0.01, 6, 8


@pytest.fixture(scope="module")
def contact() -> PenaltyContact:
    """Two blocks side by side, one spacing between their columns."""
    parts = [bar(0, COLUMNS * H, H, ROWS), bar(COLUMNS * H, COLUMNS * H, H, ROWS)]
    found = prepare(moving(grid_of(parts, H), (0.0, 0.0), Contact()), Options(threads=1)).system.contact
    assert found is not None
    return found


def test_nodes_of_the_outermost_rows_are_the_surface(contact: PenaltyContact) -> None:
    inside = np.zeros((ROWS, COLUMNS), dtype=bool)
    inside[1:-1, 1:-1] = True
    assert (contact._joined.surface == np.tile(~inside.ravel(), 2)).all()


def test_normals_point_out(contact: PenaltyContact) -> None:
    middle = ROWS // 2 * COLUMNS
    faces = contact._joined.faces(np.array([middle, middle + COLUMNS - 1]))
    way = 1 + np.sqrt(2)  # one bond across, two at 45 degrees
    assert faces.still[:, :2] == pytest.approx(np.array([[-way, 0.0], [way, 0.0]]), abs=1e-9)
    assert faces.bent.tolist() == [0.0, 0.0]


def test_pairs_are_of_both_blocks_and_near(contact: PenaltyContact) -> None:
    joined, x = contact._joined, contact._joined.nodes.x
    rows, still = np.flatnonzero(joined.surface), np.zeros((2 * ROWS * COLUMNS, 2))
    i, j = candidates(joined, still, rows, np.full(len(rows), 1.1 * H))
    assert len(i) == ROWS  # straight across
    assert ((i < ROWS * COLUMNS) & (j >= ROWS * COLUMNS)).all()
    assert x[j] - x[i] == pytest.approx(np.tile([H, 0.0], (ROWS, 1)))
    i, _ = candidates(joined, still, rows, np.full(len(rows), 1.5 * H))
    assert len(i) == ROWS + 2 * (ROWS - 1)  # and at 45 degrees
    apart = np.where(np.arange(len(still))[:, None] < ROWS * COLUMNS, [-0.2 * H, 0.0], 0.0)
    assert len(candidates(joined, apart, rows, np.full(len(rows), 1.1 * H))[0]) == 0


def test_the_farthest_way_is_that_since_the_last_look() -> None:
    u = np.array([[0.0, 0.0], [3.0, 5.0], [9.0, 9.0]])
    before = np.array([[1.0, 0.0], [0.0, 1.0]])
    assert farthest(u, before, np.array([0, 1])) == 25.0
