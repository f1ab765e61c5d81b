"""Plates of bonds around which the displacements of a crack in an infinite plate are imposed."""

from __future__ import annotations

import dataclasses
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray
from plates import GLASS, plate, square_grid
from system_checks import bonds_of, equilibrium

from benchmarks.griffith import Griffith
from pdmesh.model.material_constants import BONDS_NU
from pdsolve.fracture.domain_integrals import FractureParameters, Ring, Sampled, integrals
from pdsolve.fracture.fields import Elastic
from pdsolve.fracture.gradients import Stiffness, gradients_of, green, hooke
from pdsolve.options import Options
from pdsolve.run.prepare import prepare


class Lattice(NamedTuple):
    """The fields on a lattice of bonds."""

    exact: Griffith
    sampled: Sampled

    def feels(self, inner: float, outer: float) -> FractureParameters:
        """What the tip feels, by a ring."""
        return integrals(self.sampled, self.exact.way, self.exact.way, Ring(inner, outer), self.exact.plate)


def on_lattice(
    fineness: int, angle: float, half: float = 2.5, solved: bool = True, m: float = 3.0, **material: Any
) -> Lattice:
    """A square of half-width `half` with `fineness` spacings for half the crack; the classical displacements are
    imposed within 2 m spacings of its edge, or everywhere."""
    made = msgspec.structs.replace(GLASS, **({"E": 1.0, "G0": 1e9, "micromodulus": "constant"} | material))
    exact = Griffith(Elastic(1.0, BONDS_NU[made.plane], made.plane), angle)
    delta, side = 1 / fineness, 2 * round(half * fineness)
    grid = square_grid(side, side, delta, (1 - side) * delta / 2, (1 - side) * delta / 2)
    grid = dataclasses.replace(grid, cracks=np.array([[*-exact.way, *exact.way]]))
    problem = prepare(plate(grid, m, material=made), Options(threads=1))
    u = exact.displacement(grid.position)
    if solved:
        outer = np.abs(grid.position).max(axis=1) > half - 2 * m * delta
        u = equilibrium(problem, np.column_stack([outer, outer]), u)
    return Lattice(exact, sampled(problem, u, exact.plate))


def sampled(problem: Any, u: NDArray[np.float64], of: Elastic) -> Sampled:
    """Displacements (n, 2) of a prepared plate as the integrals take them."""
    bonds, grid, small = bonds_of(problem), problem.system.model.grid, 1e-6
    area = problem.system.area
    gradient = gradients_of(grid.position, area, u, bonds.start, bonds.neighbour)
    strain = green(small * gradient) / small
    stress = hooke(strain, Stiffness(np.full(len(u), of.E), np.full(len(u), of.nu), of.plane))
    return Sampled(grid.position, area, gradient, strain, stress[:, :3])
