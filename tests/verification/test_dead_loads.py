"""Loads that do not grow, under which bonds soften before the path begins."""

from __future__ import annotations

import numpy as np
import pytest
from plates import plate, square_grid

from pdmesh.model.document import Displacement, Load, Material, Run, Static
from pdsolve.model import Model
from pdsolve.rest.equilibrium import NotConvergedError
from pdsolve.run.simulation import Options, simulate

RAMP = ((0.0, 0.0), (1.0, 1.0))
CONCRETE = Material(E=30e9, rho=2400, G0=100, law="cohesive", f_t=3e6, shape="linear", micromodulus="constant")
F_T, H = 3e6, 0.01


def bar(dead: float) -> Model:
    """0.2 x 0.08 m with a row of notches; a traction that is there from the start, and one end that is moved."""
    grid = square_grid(20, 8, H, x0=H / 2, y0=H / 2)
    right = tuple((np.flatnonzero(grid.position[:, 0] > 0.2 - H) + 1).tolist())
    left = tuple((np.flatnonzero(grid.position[:, 0] < H) + 1).tolist())
    middle = tuple((np.flatnonzero(np.abs(grid.position[:, 0] - 0.155) < H / 2) + 1).tolist())
    conditions = (
        Displacement(name="left", nodes=left, x=0.0, y=0.0),
        Load(name="dead", nodes=middle, body_force=(dead / H, 0.0), breakable=True),
        Displacement(name="right", nodes=right, x=2e-4, profile=RAMP),
    )
    run = Run(solver="static", static=Static(load_steps=20))
    return plate(grid, 3, material=CONCRETE, conditions=conditions, run=run)


@pytest.mark.slow
def test_bonds_may_soften_under_what_does_not_grow() -> None:
    """The dead load has softened bonds before the first step, and the books of work balance."""
    with simulate(bar(1.3 * F_T), None, Options(threads=1)) as results:
        books, table = results.history(), results.reactions()
    assert books["dissipated"][1] > 0
    dead = table["force_x"][table["condition"] == 1]
    assert dead[1:] == pytest.approx(np.full(len(dead) - 1, dead[1]), rel=1e-9)
    missing = books["strain"] + books["dissipated"] - books["work"]
    assert abs(missing[1]) < 1e-4 * books["work"][1]  # measured: 1.2e-5
    assert np.abs(missing).max() < 0.015 * books["work"].max()  # measured: 8e-3, in steps as long as these


@pytest.mark.slow
def test_a_dead_load_that_no_equilibrium_bears_is_said_with_its_share() -> None:
    with pytest.raises(NotConvergedError, match=r"path step 1: under \d+% of what does not grow"):
        simulate(bar(20 * F_T), None, Options(threads=1))
