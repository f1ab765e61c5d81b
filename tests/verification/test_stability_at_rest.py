"""Loss of equilibrium under dead loads: a column below and beyond Euler's load."""

from __future__ import annotations

import numpy as np
import pytest
from messages import naming
from plates import plate, square_grid

from pdmesh.model.document import Displacement, Load, Material, Run, Static
from pdsolve.model import Model
from pdsolve.run.simulation import NotConvergedError, Options, simulate

RUBBER = Material(E=1e6, rho=1000.0, G0=1e9)
WIDE, LONG, H = 8, 80, 1e-3  # nodes, m


def column(share: float) -> Model:
    """A column that is clamped below and pressed on top by a dead load, a share of Euler's."""
    grid = square_grid(WIDE, LONG, H, x0=-(WIDE - 1) / 2 * H)
    width, length = WIDE * H, (LONG - 0.5) * H
    critical = np.pi**2 * RUBBER.E * width**3 / 12 / (4 * length**2)  # N/m
    load = Load(
        box=(-1, (LONG - 1.5) * H, 1, 1),
        body_force=(0.0, -share * critical / (width * H)),
        profile=((0.0, 0.0), (1.0, 1.0)),
    )
    run = Run(solver="static", static=Static(load_steps=2))
    return plate(
        grid, 3, material=RUBBER, conditions=(Displacement(box=(-1, -1, 1, H / 2), x=0.0, y=0.0), load), run=run
    )


def test_a_column_stands_below_eulers_load() -> None:
    with simulate(column(0.85), None, Options(threads=1)) as results:
        assert np.abs(results.field("ux", 2)).max() < 2e-4 * LONG * H


def test_a_column_is_not_said_to_stand_beyond_it() -> None:
    """Newton's method finds the straight column in equilibrium, which is not stable."""
    with pytest.raises(NotConvergedError, match=naming(found=("not stable", "1 independent"), expected="motion")):
        simulate(column(1.25), None, Options(threads=1))
