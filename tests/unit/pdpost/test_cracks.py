"""Start and branching on cracks drawn by hand."""

from __future__ import annotations

import numpy as np
import pytest

from pdpost.cracks import branch_place, growth
from pdsolve.results import Breaks, Frame, Nodes, Results, Writer


def lattice(columns: int = 20, rows: int = 9) -> Nodes:
    """Nodes 1 mm apart with ten bonds each, those of the first five columns of the middle row cut."""
    y, x = np.mgrid[0:rows, 0:columns]
    position = 1e-3 * np.column_stack([x.ravel(), y.ravel() - rows // 2])
    count = columns * rows
    cut = np.where((position[:, 1] == 0) & (position[:, 0] < 4.5e-3), 4, 0)
    ids = np.arange(1, count + 1)
    return Nodes(ids, position, np.full(count, 1e-3), np.full(count, 1e-6), np.full(count, 10), cut)


def at(nodes: Nodes, x: int, y: int) -> int:
    """The id of a node by its place in mm."""
    return int(nodes.ids[np.isclose(nodes.position, [1e-3 * x, 1e-3 * y]).all(axis=1)].item())


def run(nodes: Nodes, cracked: list[tuple[int, int, int]]) -> Results:
    """Results in which nodes (step, x, y) lose four of their ten bonds."""
    writer = Writer.create(None, nodes, {"time_step": 1e-6})
    rows = [(step, at(nodes, x, y), 1) for step, x, y in cracked for _ in range(4)]
    breaks = Breaks(*np.array(rows, dtype=np.int64).reshape(-1, 3).T)
    writer.write(Frame(100, 1e-4, None, breaks, [], [], {}))
    return Results(writer.connection, "memory")


def test_a_crack_starts_when_its_tip_is_one_and_a_half_spacings_on() -> None:
    found = growth(run(lattice(), [(3, 5, 0), (7, 6, 0), (9, 7, 0)]))
    assert found.initial_tip == pytest.approx(4e-3)
    assert found.start is not None
    assert (found.start.step, found.start.time, found.start.x) == pytest.approx((7, 7e-6, 6e-3))
    assert found.branching is None
    assert found.final_tip == pytest.approx(7e-3)


def test_it_branches_at_the_first_of_three_double_columns() -> None:
    arms = [(10 + x, x, side * (2 + (x > 8))) for x in (7, 8, 9) for side in (-1, 1)]
    found = growth(run(lattice(), [(5, 6, 0), *arms]))
    assert found.branching is not None
    assert (found.branching.step, found.branching.x) == (19, pytest.approx(7e-3))


def test_two_spacings_apart_are_no_branch() -> None:
    nodes = lattice()
    cracked = np.zeros(len(nodes.ids), dtype=bool)
    for x in (7, 8, 9):
        for y in (-1, 1):
            cracked[at(nodes, x, y) - 1] = True
    assert branch_place(nodes, cracked) is None


def test_a_plate_that_does_not_break() -> None:
    found = growth(run(lattice(), []))
    assert (found.start, found.branching) == (None, None)
