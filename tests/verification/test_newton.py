"""Newton's method: quadratic convergence and symmetric tangents of each law, and nearly incompressible rubber."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import msgspec
import numpy as np
import pytest
from plates import GLASS, plate, shipped, square_grid
from scipy.sparse import diags_array

from pdmesh.model.document import Displacement, Load, Run, Static
from pdsolve.conditions import put_loads
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.rest.equilibrium import EquilibriumConditions
from pdsolve.rest.load_steps import LoadSteps
from pdsolve.rest.newton import Newton
from pdsolve.rest.static_loads import model_with_load_steps
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import simulate
from pdsolve.run.system import PreparedRun

ROUND_OFF = 1e-11  # of the loads: residuals below are not compared
SOFT = msgspec.structs.replace(GLASS, E=1.0, rho=1.0, G0=1.0, plane="strain", nu=0.3)
LAWS = {
    "springs": {"nu": None, "G0": 1e3},
    "neo hooke": {"model": "correspondence", "solid": "neo hooke", "failure": "none"},
    "svk": {"model": "correspondence", "solid": "svk", "failure": "none"},
    "j2": {
        "model": "correspondence",
        "solid": "j2",
        "failure": "none",
        "yield_stress": 4e-3,
        "hardening": 0.05,
    },
}


def pulled(law: dict[str, Any]) -> tuple[PreparedRun, EquilibriumConditions]:
    """A block of 12 x 9 nodes, held on the left, pulled and sheared on the right; and its conditions."""
    material = msgspec.structs.replace(SOFT, **law)
    pull = 5e-3 if material.solid == "j2" else 0.1
    conditions = (
        Displacement(box=(-1.0, -1.0, 0.2, 9.0), x=0.0, y=0.0),
        Load(box=(10.8, -1.0, 12.0, 9.0), body_force=(pull, pull / 4)),
    )
    grid = square_grid(12, 9, 1.0)
    model = plate(grid, 3, material=material, conditions=conditions, run=Run(solver="static"))
    problem = prepare(model_with_load_steps(model), Options(threads=1))
    put_loads(problem.system.drive, 0.0)
    stepper = problem.system.stepper
    assert isinstance(stepper, LoadSteps)
    return problem, EquilibriumConditions(
        problem.system.drive.force.astype(float), stepper.held, np.zeros((len(grid), 2))
    )


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("law", LAWS)
def test_convergence_is_quadratic(law: str) -> None:
    """Each residual is at most a multiple of the square of the one before, as soon as they are small."""
    problem, asked = pulled(LAWS[law])
    residuals: list[float] = []
    newton = Newton(problem.system.operator, problem.system.area, 1e-13, free_component_count=1)
    newton.solve_equilibrium(problem.state, asked, lambda _, residual: residuals.append(residual))
    near = [r for r in residuals if r < 0.1]
    assert len(near) >= 2
    for before, after in pairwise(near):
        assert after < 5 * before**2 + ROUND_OFF  # measured: at most 1.9 times the square


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("law", LAWS)
def test_tangents_of_deformed_bodies_are_symmetric(law: str) -> None:
    problem, asked = pulled(LAWS[law])
    newton = Newton(problem.system.operator, problem.system.area, 1e-8, free_component_count=1)
    newton.solve_equilibrium(problem.state, asked, lambda *_: None)
    K = diags_array(np.repeat(problem.system.area, 2)) @ problem.system.operator.tangent(problem.state)
    assert problem.system.operator.symmetric
    assert abs(K - K.T).max() < 1e-12 * abs(K).max()  # measured: 2e-16 to 6e-16


def rubber(load_steps: int) -> Model:
    """The shipped block with nodes 0.1 m apart and nu = 0.499."""
    made = shipped("rubber_block.py", [("spacing", "0.1")])
    first = made.settings.material
    assert first is not None
    material = msgspec.structs.replace(first, nu=0.499)
    run = msgspec.structs.replace(made.settings.run, static=Static(load_steps=load_steps))
    return Model(made.grid, msgspec.structs.replace(made.settings, material=material, run=run))


@pytest.mark.slow
def test_rubber_that_is_nearly_incompressible_comes_to_rest() -> None:
    """A load step from which no iteration leads to rest is cut; the reaction is that of five load steps."""
    force = []
    for load_steps in (1, 5):
        with simulate(rubber(load_steps), None, Options(threads=1)) as results:
            force.append(float(results.reactions()["force_x"][-1]))
    assert force[0] == pytest.approx(force[1], rel=1e-7)  # measured: 9e-10
