"""The branching crack with more and more nodes in one horizon: does it converge, and is it plausible?"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import numpy as np
import pytest
from plates import plate, square_grid

from pdmesh.model.document import Load, Run
from pdsolve.measures.cracks import find_crack_events
from pdsolve.model import Model
from pdsolve.run.simulation import Options, simulate

HORIZON = 4e-3
LENGTH, WIDTH = 0.1, 0.04


class Crack(NamedTuple):
    """What became of the crack in 40 us."""

    start: float  # s
    branching: float | None  # s
    place: float | None  # of the branching, m
    area: float  # of cracked nodes, m^2
    lopsided: float  # largest difference of damage between the halves of the plate


def duran(m: int) -> Model:
    """The Duran plate of one scale, 12 MPa over a layer of one horizon, the horizon 4 mm whatever its ratio m."""
    delta = HORIZON / m
    columns, rows = round(LENGTH / delta), round(WIDTH / delta)
    grid = square_grid(columns, rows, delta)
    index = np.arange(columns * rows)
    x, y = delta * (index % columns + 0.5), delta * (index // columns - (rows - 1) / 2)  # y symmetric, bit for bit
    grid = dataclasses.replace(grid, position=np.column_stack([x, y]), cracks=np.array([[0.0, 0.0, LENGTH / 2, 0.0]]))
    edge = WIDTH / 2 - HORIZON
    loads = (
        Load(box=(0.0, edge, LENGTH, WIDTH), traction=(0.0, 12e6), rows=m, length=LENGTH),
        Load(box=(0.0, -WIDTH, LENGTH, -edge), traction=(0.0, -12e6), rows=m, length=LENGTH),
    )
    return plate(grid, m, conditions=loads, run=Run(time_step=80e-9, steps=500, every=500, fields=("damage",)))


def crack(m: int, mode: str) -> Crack:
    """Follow it; 80 ns is surely stable up to m = 8."""
    with simulate(duran(m), options=Options(mode)) as results:
        found = find_crack_events(results)
        damage = results.field("damage", 500).reshape(round(WIDTH * m / HORIZON), -1)
    assert found.start is not None
    branch = found.branching
    area = float((damage > 0.35).sum()) * (HORIZON / m) ** 2
    lopsided = float(np.abs(damage - damage[::-1]).max())
    return Crack(found.start.time, branch and branch.time, branch and branch.along, area, lopsided)


# Start and branching (us), place (mm) and cracked area (mm^2); the classical speed of sound crosses 1 mm in 0.2 us.
CONSERVATIVE = {
    4: (9.68, 26.16, 70.80, 262),
    6: (9.12, 24.52, 70.47, 308),
    8: (8.88, 25.24, 71.03, 268.5),
}
THESIS = {4: (11.68, 35.44, 80.94, 216), 6: (11.12, 33.52, 77.04, 200)}


@pytest.mark.slow
def test_the_conservative_mode_converges() -> None:
    """The thesis warns that more neighbours at a fixed horizon give implausible cracks. Here they do not: the crack
    starts a little earlier each time, by less each time, comes to where it branches within 1.7 us and 0.6 mm of the
    others, and stays symmetric, bit for bit."""
    found = {m: crack(m, "conservative") for m in CONSERVATIVE}
    for m, (start, branching, place, area) in CONSERVATIVE.items():
        assert found[m].lopsided == 0
        assert 1e6 * found[m].start == pytest.approx(start, abs=0.17)
        assert 1e6 * (found[m].branching or 0) == pytest.approx(branching, abs=1)
        assert 1e3 * (found[m].place or 0) == pytest.approx(place, abs=1.1)
        assert 1e6 * found[m].area == pytest.approx(area, rel=0.05)
    starts = [found[m].start for m in CONSERVATIVE]
    assert 0 < starts[1] - starts[2] < starts[0] - starts[1]  # measured 0.24 and 0.56 us
    times, places = ([getattr(found[m], name) or 0 for m in CONSERVATIVE] for name in ("branching", "place"))
    assert max(times) - min(times) < 2e-6  # measured 1.64 us
    assert max(places) - min(places) < 1e-3  # measured 0.56 mm


@pytest.mark.slow
def test_the_thesis_mode_changes_more() -> None:
    """The crack of the thesis mode, on one scale, branches later, and 4 mm nearer to its notch with m = 6 than with 4.
    Late, not implausible."""
    for m, (start, branching, place, area) in THESIS.items():
        found = crack(m, "thesis")
        assert found.lopsided == 0
        assert 1e6 * found.start == pytest.approx(start, abs=0.17)
        assert 1e6 * (found.branching or 0) == pytest.approx(branching, abs=1)
        assert 1e3 * (found.place or 0) == pytest.approx(place, abs=1.1)
        assert 1e6 * found.area == pytest.approx(area, rel=0.05)
