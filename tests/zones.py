"""Plates with a fine zone of any shape, to ask questions of."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Material
from pdsolve.adaptive.arrays import PIECES, Ground, Zone, ground_of, zone_of
from pdsolve.adaptive.energy import books
from pdsolve.adaptive.family import fine_springs
from pdsolve.adaptive.lattice import COARSE, FINE, FREE, coarse_place, fine_place, lattice_of
from pdsolve.adaptive.march import march
from pdsolve.adaptive.precracks import begin_bits, begin_coarse, begin_lack, lengthened
from pdsolve.conditions import Profiles

H = 1e-3  # m
NO_PROFILES = Profiles(np.zeros(1, dtype=np.int64), np.zeros(0), np.zeros(0))
_fine = getattr(fine_place, "py_func", fine_place)
_coarse = getattr(coarse_place, "py_func", coarse_place)

Where = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[Any]]


class Zoned(NamedTuple):
    """A plate, and where its nodes that move are."""

    ground: Ground
    zone: Zone
    material: Material

    def lattices(self) -> Iterable[tuple[Any, NDArray[np.int64], NDArray[np.float64]]]:
        """Fine and coarse nodes, the places (k,) of those that move, and where they are (k, 2), m."""
        at = self.ground.at
        for nodes, place, step in ((self.zone.fine, _fine, 1), (self.zone.coarse, _coarse, 2)):
            y, x = (index.ravel() for index in np.mgrid[0 : at.ny // step + 1, 0 : at.nx // step + 1])
            places = place(at, x, y)
            free = nodes.kind[places] == FREE
            yield nodes, places[free], step * H * np.column_stack([x, y])[free]

    def put(self, displacement: Where | None = None, velocity: Where | None = None) -> None:
        """Give all nodes that move displacements, m, and velocities, m/s, by where they are."""
        for nodes, places, position in self.lattices():
            if displacement is not None:
                nodes.u[0][:, places] = displacement(*position.T)
            if velocity is not None:
                nodes.v[:, places] = velocity(*position.T)
        self.march(1, 1)

    def march(self, first: int, last: int) -> None:
        """Take steps, an even number of times from one buffer of displacements to the other."""
        now = 0
        _, _, now = march(self.ground, self.zone, NO_PROFILES, now, first, last, False, 0)
        if now == 1:
            for nodes in (self.zone.fine, self.zone.coarse):
                nodes.u[0] = nodes.u[1]

    def forces(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Forces (k, 2), N/m, on all nodes that move, and where these are (k, 2), m."""
        found = [(nodes.f[:, places].T, position) for nodes, places, position in self.lattices()]
        return np.concatenate([force for force, _ in found]), np.concatenate([place for _, place in found])

    def energy(self) -> float:
        """Kinetic and strain energy, J/m."""
        out = np.zeros(4)
        books(self.ground, self.zone, 0, out)
        return float(out[0] + out[1])

    def conserved(self) -> float:
        """The energy that leapfrog conserves where forces are linear, J/m: that of the velocities half a step before
        and half a step after, v^2 - (a dt / 2)^2."""
        found = self.energy()
        for nodes, places, _ in self.lattices():
            found -= float((nodes.light[places] * (nodes.f[:, places] * self.ground.dt / 2) ** 2).sum() / 2)
        return found

    @property
    def pieces(self) -> int:
        """How many pieces of clipped bonds there are."""
        return int(self.zone.number[PIECES])


def zoned(
    columns: int,
    rows: int,
    fine: Callable[[NDArray[Any], NDArray[Any]], NDArray[np.bool_]],
    material: Material,
    ratio: float = 4.0,
    step: float = 1.0,
    cracks: Iterable[tuple[float, float, float, float]] = (),
) -> Zoned:
    """A plate of `columns` by `rows` fine spacings, whose cells are fine where `fine(x, y)` of their columns and rows
    is true; steps of `step` times h sqrt(rho / E), `cracks` in spacings."""
    at = lattice_of(columns, rows)
    springs = fine_springs(material, ratio, H)
    ground = ground_of(at, springs, H, material.rho, step * H * (material.rho / material.E) ** 0.5)
    ground = ground._replace(cracks=lengthened(np.array(list(cracks), dtype=float).reshape(-1, 4)))
    zone = zone_of(at, len(springs.dx), at.places // 16)
    begin_bits(ground, zone.bits)
    begin_coarse(ground)
    begin_lack(ground, zone.bits)
    cell = np.arange(at.cells)
    wanted = fine(cell % at.cell_stride - 6, cell // at.cell_stride - 6) & (zone.cells == COARSE)
    zone.cells[wanted] = FINE
    new = np.flatnonzero(wanted)
    zone.new[: len(new)] = new
    march(ground, zone, NO_PROFILES, 0, 1, 0, False, len(new))
    return Zoned(ground, zone, material)
