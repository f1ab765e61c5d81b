"""A cube of bonds with a penny-shaped crack of radius 1 in its middle, at rest, its outer layers held."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from static_solution import settled

from pdmesh.model.document import Horizon, Material, Settings
from pdmesh.model.lattice_calibration import lattice_ratios
from pdmesh.model.material_constants import C11, C66
from pdmesh.model.node_grid import Grid
from pdsolve.bonds.assembly import Assembly
from pdsolve.laws.pair_laws import brittle
from pdsolve.model import Model
from pdsolve.operators.bond_list import BondList
from pdsolve.schemes.average_horizon import Corrections, fill

GLASS = Material(E=1.0, rho=1.0, G0=1e30, micromodulus="constant")
Outer = Callable[[NDArray[np.float64], float, float], NDArray[np.float64]]  # u (n, 3) at places, by E and nu


class Penny(NamedTuple):
    """The cube and its displacements under unit stress."""

    nodes_of_radius: int
    position: NDArray[np.float64]  # (n, 3)
    whole: Assembly
    u: NDArray[np.float64]  # (n, 3)
    E: float  # of the lattice, along its axes
    nu: float


def disc(corners: int) -> NDArray[np.float64]:
    """Triangles (t, 9) of a disc of radius 1, but for those bonds that meet its very edge."""
    angle = 2 * np.pi * np.arange(corners + 1) / corners
    ring = (1 - 1e-6) * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    return np.column_stack([np.zeros((corners, 3)), ring[:-1], ring[1:]])


def pulled(position: NDArray[np.float64], E: float, nu: float) -> NDArray[np.float64]:
    """Displacements (n, 3) of unit tension along z without a crack."""
    return np.asarray(position * np.array([-nu, -nu, 1]) / E)


def sheared(position: NDArray[np.float64], E: float, nu: float) -> NDArray[np.float64]:
    """Displacements (n, 3) of unit shear in x on the planes of z without a crack."""
    return np.column_stack([position[:, 2] * 2 * (1 + nu) / E, np.zeros((len(position), 2))])


def opened(nodes_of_radius: int, half: float, outer: Outer = pulled) -> Penny:
    """A cube of half-width `half` crack radii, its outer three layers held as `outer` has them; bonds as in the bare
    lattice, with the moduli of that."""
    side, h = round(2 * half * nodes_of_radius), 1 / nodes_of_radius
    along = (np.arange(side) + 0.5) * h - half
    position = np.stack(np.meshgrid(along, along, along, indexing="ij"), axis=-1).reshape(-1, 3)
    count = len(position)
    nothing = np.full(count, -1)
    grid = Grid(np.arange(1, count + 1), position, np.full(count, h), nothing >= 0, nothing, disc(256))
    model = Model(grid, Settings(material=GLASS, horizon=Horizon(3.0)))
    whole = fill(model, Corrections(partial_cells=True, calibration=False, surfaces=False)).whole()
    ratios = lattice_ratios(3.0, "constant", "space", True)
    c11, c12 = ratios.c11 * C11["space"], ratios.c12 * C66["space"]
    E, nu = (c11 - c12) * (c11 + 2 * c12) / (c11 + c12), c12 / (c11 + c12)
    operator = BondList(brittle.LAW, model, whole.bonds, True)
    held = np.repeat((np.abs(position) >= half - 3 * h).any(axis=1)[:, None], 3, axis=1)
    u = settled(operator, np.full(count, h**3), held, outer(position, E, nu))
    return Penny(nodes_of_radius, position, whole, u, E, nu)
