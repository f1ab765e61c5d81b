"""Forces are minus the slope of the energy, for every law, micromodulus and plane of the conservative mode."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from plates import GLASS, plate, two_scale_grid
from system_checks import broken, forces, worst

from pdmesh.model.document import Run
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun

LAWS = {"brittle": {"law": "brittle"}, "bilinear": {"law": "bilinear", "kr": 3.0}}
NODES = (0, 3, 57, 100, 110, 131)  # corner, edge, middle, both sides of the interface, the other corner


def deformed(law: str, profile: str, plane: str) -> PreparedRun:
    """A two-scale plate, its bonds partly broken and partly softened by a large random displacement, then let go."""
    material = msgspec.structs.replace(GLASS, micromodulus=profile, plane=plane, **LAWS[law])
    problem = prepare(
        plate(two_scale_grid(), 3, material=material, run=Run(time_step=1e-12)), Options(threads=1, kernel="listed")
    )
    state, random = problem.state, np.random.default_rng(3)
    state.value[:] = 1.2e-6 * random.standard_normal(state.value.shape)
    state.rate[:] = 0
    problem.advance(1, 2)  # breaks and softens
    state.value[:] = 0.4 * state.value  # below every bond's worst stretch
    return problem


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("profile", ["constant", "conical"])
@pytest.mark.parametrize("plane", ["stress", "strain"])
def test_forces_derive_from_the_energy(law: str, profile: str, plane: str) -> None:
    """By central differences in both components of six nodes: each bond on its elastic or its unloading line."""
    problem = deformed(law, profile, plane)
    u, area = problem.state.value, problem.system.area
    assert 0 < len(broken(problem).step) < problem.system.directed_bond_count / 2
    assert (law == "bilinear") == bool(worst(problem).any())
    force = forces(problem, 2, 1e-12)
    scale, step = np.abs(force).max() * area.max(), 1e-10

    def energy() -> float:
        return float(np.sum(area * problem.system.operator.energies(problem.state)[0]))

    for node in NODES:
        for axis in (0, 1):
            at = u[node, axis]
            u[node, axis] = at + step
            above = energy()
            u[node, axis] = at - step
            slope = (above - energy()) / (2 * step)
            u[node, axis] = at
            assert -slope == pytest.approx(
                area[node] * force[node, axis], abs=1e-7 * scale
            )  # measured 1e-9 of the force


@pytest.mark.parametrize("law", LAWS)
def test_softening_spends_what_the_force_takes(law: str) -> None:
    """Loading on: the work of the forces along a small step is the change of held and of spent energy."""
    problem = deformed(law, "conical", "stress")
    u, area = problem.state.value, problem.system.area
    u[:] /= 0.4

    def held_and_spent() -> float:
        strain, softened = problem.system.operator.energies(problem.state)
        return float(np.sum(area * (strain + softened)))

    first, before, start = forces(problem, 2, 1e-12), held_and_spent(), u.copy()
    gone = len(broken(problem).step)
    u[:] = start * (1 + 1e-6)
    second = forces(problem, 2, 1e-12)
    assert len(broken(problem).step) == gone
    work = -float(np.sum(area[:, None] * (first + second) / 2 * (u - start)))
    assert held_and_spent() - before == pytest.approx(work, rel=1e-8)  # measured 6e-11
