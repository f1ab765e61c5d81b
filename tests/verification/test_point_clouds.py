"""Bodies of points that are on no lattice, by way of their file: mass, energy of a uniform stretch, rigid motions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from pdmesh.drawing.file_reading import build_file
from pdsolve.model import Model
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import Options, simulate
from pdsolve.run.system import System
from pdsolve.state import State

AXES = np.array([8.0, 7.0, 6.5])  # m, of the ellipsoid
DENSITY = 2.0
PARAMETERS = [("Material/E", "1"), ("Material/rho", f"{DENSITY}"), ("Material/G0", "1e-4")]
VOLUME = float(4 / 3 * np.pi * AXES.prod())
pytestmark = pytest.mark.slow


def places(by: float) -> NDArray[np.float64]:
    """Points of an ellipsoid 1 apart, each moved at random by so much at most along each axis."""
    along = np.arange(-8, 8) + 0.5
    grid = np.stack(np.meshgrid(along, along, along, indexing="ij"), axis=-1).reshape(-1, 3)
    inside = ((grid / AXES) ** 2).sum(axis=1) < 1
    return np.asarray((grid + by * np.random.default_rng(2).uniform(-1, 1, grid.shape))[inside])


def model(folder: Path, by: float, *more: tuple[str, str]) -> Model:
    """The ellipsoid read from its file."""
    where = places(by)
    size = VOLUME / len(where)
    path = folder / "ellipsoid.txt"
    path.write_text("".join(f"{x!r} {y!r} {z!r} 1 {size!r}\n" for x, y, z in where.tolist()))
    built = build_file(path, [*PARAMETERS, *more])
    return Model(built.grid, built.settings)


def system(folder: Path, by: float, *more: tuple[str, str]) -> System:
    return prepare(model(folder, by, *more), Options(threads=1)).system


def moved(u: NDArray[np.float64]) -> State:
    return State(u, np.zeros_like(u), np.zeros_like(u), *np.zeros((3, len(u))))


def forces(cloud: System, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Densities (n, 3) at displacements (n, 3)."""
    out = np.zeros_like(u)
    cloud.operator.accumulate_force(moved(u), out, 0, 0.0)
    return out


def stretched(cloud: System) -> NDArray[np.float64]:
    """Energy density of a uniaxial strain away from the surface, over that of the continuum."""
    position, nu = cloud.model.grid.position, cloud.model.materials[0].nu or 0.25
    u = np.zeros_like(position)
    u[:, 0] = 1e-6 * position[:, 0]
    first = (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    inner = (np.abs(position) < AXES - 3.8).all(axis=1)
    return np.asarray(cloud.operator.energies(moved(u))[0][inner] / (first * 1e-12 / 2))


def test_bonds_of_a_cloud_are_as_stiff_as_those_of_a_lattice(tmp_path: Path) -> None:
    """The mean over the same places: points moved by .2 of their distance are 1.0 % stiffer."""
    lattice, cloud = (stretched(system(tmp_path, by)) for by in (0.0, 0.2))
    assert cloud.mean() / lattice.mean() == pytest.approx(1.0, abs=0.02)  # measured 1.0102
    assert cloud.std() < 0.05  # measured .034, with a spread of .03 by the surface


def test_families_of_a_cloud_have_the_energy_of_the_continuum(tmp_path: Path) -> None:
    energies = stretched(system(tmp_path, 0.2, ("Material/Model", "ordinary"), ("Material/nu", "0.3")))
    assert energies == pytest.approx(np.ones(len(energies)), abs=1e-5)


def test_a_rigid_motion_of_a_cloud_has_no_force_and_forces_sum_to_none(tmp_path: Path) -> None:
    cloud = system(tmp_path, 0.2)
    position = cloud.model.grid.position
    turned = position @ Rotation.from_rotvec([0.1, 0.7, -0.3]).as_matrix().T - position + [1.0, -2.0, 3.0]
    shaken = 1e-3 * np.random.default_rng(5).standard_normal(position.shape)
    out = forces(cloud, shaken)
    scale = np.abs(out).max()
    assert np.abs(forces(cloud, turned)).max() < 1e-10 * scale
    volume = cloud.area[:, None]
    assert np.abs((volume * out).sum(axis=0)).max() < 1e-12 * scale * VOLUME
    turn = np.cross(position + shaken, volume * out).sum(axis=0)
    assert np.abs(turn).max() < 1e-11 * scale * VOLUME * AXES.max()


def test_a_cloud_that_flies_keeps_its_momentum_and_mass(tmp_path: Path) -> None:
    flight = ("Moves/all/Box", "-9 -9 -9 9 9 9"), ("Moves/all/Initial velocity x", "1e-3")
    run = ("Run/Time step", "0.1"), ("Run/Duration", "2"), ("Run/Frame every", "20")
    cloud = model(tmp_path, 0.2, *flight, *run)
    assert cloud.grid.size == pytest.approx(VOLUME)
    with simulate(cloud, None, Options(threads=1)) as results:
        books = results.history()
        u = np.column_stack([results.field(name, 20) for name in ("ux", "uy", "uz")])
    assert books["kinetic"] == pytest.approx(DENSITY * VOLUME * 1e-6 / 2)
    assert books["strain"].max() < 1e-20
    assert u == pytest.approx(np.tile([2e-3, 0.0, 0.0], (len(u), 1)), abs=1e-9)  # single precision
