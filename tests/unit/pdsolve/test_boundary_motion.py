"""The motion around a box, for a submodel, and what it cannot be."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest
from messages import naming
from plates import plate, square_grid

from pdmesh.model.document import Displacement, Run
from pdmesh.model.values_at_places import read_table, values_at
from pdsolve import simulate
from pdsolve.measures.boundary_motion import boundary_motion
from pdsolve.results import Results, ResultsError


@pytest.fixture(scope="module")
def results() -> Results:
    """A square of 11 x 11 nodes, 1 mm apart, that stretches as a whole."""
    stretch = Displacement(box=(-1, -1, 1, 1), x="1e-3*x", y=0.0, profile=((0.0, 0.0), (4e-8, 1.0)))
    run = Run(time_step=1e-8, steps=4, every=2)
    return simulate(plate(square_grid(11, 11), conditions=(stretch,), run=run), None)


def test_nodes_around_the_border_of_a_box_move_as_in_the_run(results: Results, tmp_path: Path) -> None:
    motion = boundary_motion(results, (2e-3, 2e-3, 8e-3, 8e-3), 1.5e-3)
    outside, inside = 9 * 9, 1 * 1  # nodes at 1 to 9 mm, less those deeper than 2.5 mm
    assert motion.displacement.shape == (3, outside - inside, 2)
    assert motion.times == pytest.approx([0, 2e-8, 4e-8])
    assert motion.displacement[1, :, 0] == pytest.approx(5e-4 * motion.position[:, 0], rel=1e-6)
    (tmp_path / "rim.csv").write_text(motion.csv)
    for axis, table in enumerate(motion.tables):
        written = read_table(f"rim.csv:u{'xy'[axis]}", tmp_path, 2)
        for each in (table, written):
            found = values_at(each, motion.position, 3e-8)
            assert found == pytest.approx((motion.displacement[1] + motion.displacement[2])[:, axis] / 2, abs=1e-15)


@pytest.mark.parametrize(
    ("box", "depth", "message"),
    [
        ((0, 0, 0, 1, 1, 1), 1e-3, naming("the box", found="6", expected="4")),
        ((8e-3, 2e-3, 2e-3, 8e-3), 1e-3, naming("the box", expected="low corner")),
        ((2e-3, 2e-3, 8e-3, 8e-3), 0.0, naming("depth", found="0")),
        ((2.0, 2.0, 3.0, 3.0), 1e-3, naming("no node", expected="within the model")),
    ],
)
def test_boxes_that_cannot_be_are_refused(results: Results, box: Sequence[float], depth: float, message: str) -> None:
    with pytest.raises(ResultsError, match=message):
        boundary_motion(results, box, depth)


def test_more_rows_than_a_file_may_have_are_refused(results: Results, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("pdsolve.measures.boundary_motion.MOST_ROWS", 200)
    with pytest.raises(ResultsError, match=naming("80 nodes", "3 frames", "200 rows", expected="fewer frames")):
        boundary_motion(results, (2e-3, 2e-3, 8e-3, 8e-3), 1.5e-3)
