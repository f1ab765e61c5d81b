"""Forces are minus the slope of the energy, for every law, micromodulus and plane of the conservative mode."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from plates import GLASS, plate, two_scale_grid

from pdmesh.grid import Run
from pdsolve.energy import strain_energies
from pdsolve.kernels.bond_sums import force_on
from pdsolve.system import Options, Prepared, prepare

LAWS = {"brittle": {"law": "brittle"}, "bilinear": {"law": "bilinear", "kr": 3.0}}
NODES = (0, 3, 57, 100, 110, 131)  # corner, edge, middle, both sides of the interface, the other corner


def deformed(law: str, profile: str, plane: str) -> Prepared:
    """A two-scale plate, its bonds partly broken and partly softened by a large random displacement, then let go."""
    material = msgspec.structs.replace(GLASS, micromodulus=profile, plane=plane, **LAWS[law])
    problem = prepare(
        plate(two_scale_grid(), 3, material=material, run=Run(time_step=1e-12)), Options(threads=1, kernel="listed")
    )
    motion, random = problem.motion, np.random.default_rng(3)
    motion.u[:] = 1.2e-6 * random.standard_normal(motion.u.shape)
    motion.v[:] = 0
    problem.march(1, 2)  # breaks and softens
    motion.u[:] = 0.4 * motion.u  # below every bond's worst stretch
    return problem


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("profile", ["constant", "conical"])
@pytest.mark.parametrize("plane", ["stress", "strain"])
def test_forces_derive_from_the_energy(law: str, profile: str, plane: str) -> None:
    """By central differences in both components of six nodes: each bond on its elastic or its unloading line."""
    problem = deformed(law, profile, plane)
    bonds, motion, area = problem.assembly.bonds, problem.motion, problem.assembly.area
    assert 0 < np.count_nonzero(motion.broken) < len(motion.broken) / 2
    assert (law == "bilinear") == bool(motion.worst.any())
    scale = np.abs([force_on(bonds, motion, i, 2, 1e-12) for i in range(len(area))]).max() * area.max()
    step = 1e-10

    def energy() -> float:
        return float(np.sum(area * strain_energies(bonds, motion)[0]))

    for node in NODES:
        force = force_on(bonds, motion, node, 2, 1e-12)
        for axis in (0, 1):
            at = motion.u[node, axis]
            motion.u[node, axis] = at + step
            above = energy()
            motion.u[node, axis] = at - step
            slope = (above - energy()) / (2 * step)
            motion.u[node, axis] = at
            assert -slope == pytest.approx(area[node] * force[axis], abs=1e-7 * scale)  # measured 1e-9 of the force


@pytest.mark.parametrize("law", LAWS)
def test_softening_spends_what_the_force_takes(law: str) -> None:
    """Loading on: the work of the forces along a small step is the change of held and of spent energy."""
    problem = deformed(law, "conical", "stress")
    bonds, motion, area = problem.assembly.bonds, problem.motion, problem.assembly.area
    motion.u[:] /= 0.4
    problem.assembly.bonds.limit[:] = np.where(motion.broken == 0, bonds.limit * 1.0, np.inf)

    def held_and_spent() -> float:
        strain, softened = strain_energies(bonds, motion)
        return float(np.sum(area * (strain + softened)))

    def force() -> np.ndarray:
        return np.array([force_on(bonds, motion, i, 2, 1e-12) for i in range(len(area))])

    first, before, u = force(), held_and_spent(), motion.u.copy()
    gone = np.count_nonzero(motion.broken)
    motion.u[:] = u * (1 + 1e-6)
    second = force()
    assert np.count_nonzero(motion.broken) == gone
    work = -float(np.sum(area[:, None] * (first + second) / 2 * (motion.u - u)))
    assert held_and_spent() - before == pytest.approx(work, rel=1e-8)  # measured 6e-11
