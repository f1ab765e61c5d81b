"""Cubes of bonds in tiles with a crack in their middle, at rest under unit stress, their outer layers held."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from prescribed_results import results_of
from static_solution import settled

from pdmesh.model.document import Horizon, Lattice, Material, Settings
from pdmesh.model.lattice_calibration import calibration, lattice_ratios
from pdmesh.model.material_constants import C11, C66
from pdmesh.model.node_grid import whole_lattice
from pdsolve.measures.intensities_3d import FrontIntensities, compute_front_intensities
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.results import Families, Nodes
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun

GLASS = Material(E=1.0, rho=1.0, G0=1e30, micromodulus="constant", plane="space")
SMALL = 1e-6  # stress: displacements are linear
LAYERS = 3  # that are held
Outer = Callable[[NDArray[np.float64], float, float], NDArray[np.float64]]  # u (n, 3) at places, by E and nu


class Block(NamedTuple):
    """A block, prepared, and its displacements under the stress `SMALL`."""

    system: PreparedRun
    u: NDArray[np.float64]  # (n, 3)
    E: float  # of the lattice, along its axes
    nu: float
    crack: NDArray[np.float64]  # (t, 9) triangles


def flat(corners: NDArray[np.float64], turn: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
    """Triangles (t, 9) between the origin and a ring of `corners` (t, 3), turned by a matrix (3, 3)."""
    ring = corners if turn is None else corners @ turn.T
    return np.column_stack([np.zeros_like(ring), ring, np.roll(ring, -1, axis=0)])


def ellipse(a: float, b: float, corners: int = 256) -> NDArray[np.float64]:
    """Corners (t, 3) of an ellipse in z = 0 with the half-axes a along x and b along y."""
    angle = 2 * np.pi * np.arange(corners) / corners
    return (1 - 1e-6) * np.column_stack([a * np.cos(angle), b * np.sin(angle), 0 * angle])


def turned(degrees: float) -> NDArray[np.float64]:
    """The matrix (3, 3) of a turn about y."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def pulled(position: NDArray[np.float64], E: float, nu: float) -> NDArray[np.float64]:
    """Displacements (n, 3) of unit tension along z without a crack."""
    return np.asarray(position * np.array([-nu, -nu, 1]) / E)


def at_rest(
    h: float, counts: tuple[int, int, int], crack: NDArray[np.float64], outer: Outer, held: tuple[int, ...] = (0, 1, 2)
) -> Block:
    """A block of nodes `h` apart around the origin, with triangles (t, 9) of a crack; its outer layers along the axes
    `held` are held as `outer` has them."""
    origin = tuple((-(count - 1) / 2 * h) for count in counts)
    grid = whole_lattice(Lattice(origin, h, *counts), cracks=crack)
    found = prepare(Model(grid, Settings(material=GLASS, horizon=Horizon(3.0))), Options(threads=1))
    ratios, scale = lattice_ratios(3.0, "constant", "space", True), calibration(3.0, GLASS).stiffness
    c11, c12 = scale * ratios.c11 * C11["space"], scale * ratios.c12 * C66["space"]
    E, nu = (c11 - c12) * (c11 + 2 * c12) / (c11 + c12), c12 / (c11 + c12)
    reach = np.array(counts) * h / 2 - LAYERS * h
    outermost = np.repeat((np.abs(grid.position) >= reach)[:, list(held), None].any(axis=1), 3, axis=1)
    start = SMALL * outer(grid.position, E, nu)
    return Block(found, settled(found.system.operator, found.system.area, outermost, start), E, nu, crack)


def front_of(block: Block) -> FrontIntensities:
    """What is found along the front, the first of several, for the stress `SMALL`."""
    system, grid = block.system.system, block.system.system.model.grid
    nodes = Nodes(
        grid.ids,
        grid.position,
        grid.delta,
        system.area,
        system.family_sizes,
        system.family_sizes - system.initial_bond_counts,
    )
    material = {"E": block.E, "rho": 1.0, "G0": 1.0, "plane": "space", "model": "ordinary", "nu": block.nu}
    model = {"notch": [], "nodes": [], "version": 2, "run": {"solver": "static"}, "material": material}
    source, target = system.operator.bonds()
    start = np.concatenate([[0], np.cumsum(np.bincount(source, minlength=len(grid)))])
    results = results_of(nodes, Families(start, target), block.u, [], model | {"horizon": {"ratio": 3.0}}, block.crack)
    return compute_front_intensities(results, 10)[0]
