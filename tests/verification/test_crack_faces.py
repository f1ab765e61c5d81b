"""Faces of pre-cracks are free surfaces: what correcting them is worth, next to none and to sparing the tip."""

from __future__ import annotations

import dataclasses
from typing import Literal, NamedTuple

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray
from plates import GEOMETRIES, GLASS, plate, square_grid
from system_checks import bonds_of, equilibrium, sources

from pdmesh.model.node_grid import Grid
from pdsolve.bonds.assembly import BondSource, Part
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.assembly import prepare_explicit_motion
from pdsolve.run.prepare import prepare
from pdsolve.run.recorder import list_breaks_since
from pdsolve.run.system import PreparedRun
from pdsolve.schemes import SCHEMES, average_horizon

ONE = Options(threads=1)
UNIT = msgspec.structs.replace(GLASS, E=1.0, G0=1.0)
NU = 1 / 3  # of plane stress
HALF = 3.0  # m, half of a side of the square around a tip
Faces = Literal["corrected", "bare", "far from the tip"]


def filled(model: Model, faces: Faces, tip: tuple[float, float] = (0.0, 0.0)) -> BondSource:
    """Bonds with the faces of pre-cracks corrected, left bare, or corrected only beyond a horizon from the tip."""
    corrected = average_horizon.fill(model)
    if faces == "corrected":
        return corrected
    whole = dataclasses.replace(model.grid, cracks=np.empty((0, 4)))
    uncut = average_horizon.fill(dataclasses.replace(model, grid=whole)).whole().bonds
    near = np.hypot(*(model.grid.position - tip).T) < model.horizons

    def part(rows: NDArray[np.int64]) -> Part:
        made = corrected.part(rows)
        n, i = len(near), sources(made.bonds) + rows[0]
        keys = sources(uncut) * n + uncut.neighbour
        before = uncut.stiffness[np.searchsorted(keys, i * n + made.bonds.neighbour)]
        bare = near[i] | near[made.bonds.neighbour] | (faces == "bare")
        return made._replace(bonds=made.bonds._replace(stiffness=np.where(bare, before, made.bonds.stiffness)))

    return corrected._replace(part=part)


def with_faces(model: Model, faces: Faces) -> PreparedRun:
    """The model with such bonds."""
    return prepare_explicit_motion(
        model, ONE, SCHEMES["conservative"]._replace(fill=lambda model: filled(model, faces))
    )


def energies(problem: PreparedRun, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Densities (n,) of energy of small displacements (n, 2)."""
    bonds, i = bonds_of(problem), sources(bonds_of(problem))
    stretch = ((u[bonds.neighbour] - u[i]) * bonds.xi).sum(axis=1) / (bonds.xi**2).sum(axis=1)
    return np.bincount(i, bonds.stiffness * np.hypot(*bonds.xi.T) * stretch**2 / 4, minlength=len(u))


class Beside(NamedTuple):
    """Energy of the nodes of each row beside a crack pulled along itself, over that of the bulk, (m + 1,) each."""

    stretched: NDArray[np.float64]  # uniformly, the width held
    pulled: NDArray[np.float64]  # at its ends, free to narrow, at rest


def beside(m: int, profile: str, faces: Faces) -> Beside:
    """A plate with a crack right through it, the rows from the crack on."""
    columns, rows = 81, 40
    grid = square_grid(columns, rows, x0=-40e-3, y0=-19.5e-3)
    grid = dataclasses.replace(grid, cracks=np.array([[-1.0, 0.0, 1.0, 0.0]]))
    model = plate(grid, m, material=msgspec.structs.replace(UNIT, micromodulus=profile))
    problem = with_faces(model, faces)
    x, y = grid.position.T
    ends = np.abs(x) > 36.5e-3
    narrowed = np.column_stack([x, -NU * (y - 10e-3 * np.sign(y))])
    found = []
    for u in (np.column_stack([x, 0 * y]), equilibrium(problem, np.column_stack([ends, ends]), narrowed)):
        middle = energies(problem, u).reshape(rows, columns)[:, columns // 2]
        found.append(middle[rows // 2 : rows // 2 + m + 1] / middle[rows * 3 // 4])
    return Beside(*found)


# rows from the crack on, stretched and pulled
BESIDE = {
    (3, "conical"): ((0.993, 1.065, 1.021, 1.003), (1.035, 1.063, 1.026, 1.002)),
    (3, "constant"): ((0.974, 1.077, 1.046, 1.013), (1.003, 1.072, 1.040, 1.022)),
    (4, "conical"): ((0.974, 1.067, 1.051, 1.018, 1.005), (1.010, 1.073, 1.047, 1.023, 1.004)),
    (4, "constant"): ((0.955, 1.062, 1.072, 1.041, 1.016), (0.978, 1.069, 1.060, 1.042, 1.025)),
}


@pytest.mark.slow
@pytest.mark.parametrize(("m", "profile"), BESIDE)
def test_in_tension_along_a_crack_the_energy_beside_it_is_the_bulks(m: int, profile: str) -> None:
    """Within 3 per cent over the horizon beside it, stretched as the correction has it; pulled, and left to narrow by
    itself, within 3.5. Left bare, 7 to 10 per cent are missing, a quarter to a third of the first row's."""
    found, bare = beside(m, profile, "corrected"), beside(m, profile, "bare")
    for measured, rows in zip(found, BESIDE[m, profile], strict=True):
        assert measured == pytest.approx(rows, abs=1e-3)
    assert abs(found.stretched.mean() - 1) < 0.03  # measured 0.021, 0.028, 0.023, 0.029
    assert abs(found.pulled.mean() - 1) < 0.036  # measured 0.032, 0.034, 0.031, 0.035
    for measured in bare:
        assert measured.mean() < 0.945  # measured 0.903 to 0.941
        assert measured[0] < 0.8  # measured 0.657 to 0.787


def test_beside_a_crack_it_is_as_at_an_edge() -> None:
    """A plate that ends where the crack is has the same energies, to round-off."""
    model = plate(square_grid(20, 24, y0=-11.5e-3), 3)
    cracked = dataclasses.replace(model.grid, cracks=np.array([[-1.0, 0.0, 1.0, 0.0]]))
    one = prepare(dataclasses.replace(model, grid=cracked), ONE)
    other = prepare(plate(square_grid(20, 12, y0=0.5e-3), 3), ONE)
    both = [energies(problem, problem.system.model.grid.position**2) for problem in (one, other)]
    assert both[0][12 * 20 :] == pytest.approx(both[1], rel=1e-12)  # measured 1e-15


def field(position: NDArray[np.float64], mode: Literal[1, 2]) -> NDArray[np.float64]:
    """Displacements (n, 2) around the tip at the origin of a crack along -x: the first term of M. L. Williams,
    J. Appl. Mech. 24 (1957) 109-114, for K = 1 and E = 1, in opening (1) or sliding (2)."""
    G, kappa = 1 / (2 * (1 + NU)), (3 - NU) / (1 + NU)
    r, half = np.hypot(*position.T), np.arctan2(position[:, 1], position[:, 0]) / 2
    sin, cos = np.sin(half), np.cos(half)
    if mode == 1:
        u = np.column_stack([cos * (kappa - 1 + 2 * sin**2), sin * (kappa + 1 - 2 * cos**2)])
    else:
        u = np.column_stack([sin * (kappa + 1 + 2 * cos**2), -cos * (kappa - 1 - 2 * sin**2)])
    return np.asarray(np.sqrt(r / (2 * np.pi))[:, None] / (2 * G) * u)


def around_a_tip(
    fineness: int, m: int, faces: Faces, mode: Literal[1, 2], ahead: int = 0
) -> tuple[PreparedRun, NDArray[np.float64]]:
    """A square with a crack to its middle, or `ahead` spacings further, the classical displacements held in an outer
    layer: the problem, and what is at rest."""
    delta, side = 1 / fineness, int(2 * HALF * fineness)
    grid = square_grid(side, side, delta, x0=-HALF + delta / 2, y0=-HALF + delta / 2)
    ring = HALF * np.array([[-1.0, -1], [1, -1], [1, 1], [-1, 1]])
    grid: Grid = dataclasses.replace(grid, cracks=np.array([[-2 * HALF, 0, ahead * delta, 0]]), outline=(ring,))
    problem = with_faces(plate(grid, m, material=UNIT), faces)
    outer = np.abs(grid.position).max(axis=1) > HALF - (m + 1) * delta
    return problem, equilibrium(problem, np.column_stack([outer, outer]), field(grid.position, mode))


def off(fineness: int, m: int, faces: Faces, mode: Literal[1, 2]) -> float:
    """Relative L2 error of the displacements around a tip, where they are not held."""
    problem, u = around_a_tip(fineness, m, faces, mode)
    position = problem.system.model.grid.position
    free, exact = np.abs(position).max(axis=1) < HALF - (m + 1) / fineness, field(position, mode)
    return float(np.linalg.norm((u - exact)[free]) / np.linalg.norm(exact[free]))


def released(fineness: int, m: int, faces: Faces, mode: Literal[1, 2]) -> float:
    """Energy that two spacings of crack release, the edges being held, over their length: K^2 / E = 1 it should be."""
    stored = []
    for ahead in (-1, 1):
        problem, u = around_a_tip(fineness, m, faces, mode, ahead)
        stored.append(float((energies(problem, u) * problem.system.area).sum()))
    return (stored[0] - stored[1]) * fineness / 2


# m, opening (1) or sliding (2): error of displacement and energy released with faces corrected, bare, and corrected
# away from the tip; 8 nodes a metre, the square is 6 m wide
TIP = {
    (3, 1): ((0.0072, 0.0083, 0.0083), (0.999, 0.994, 0.994)),
    (3, 2): ((0.0138, 0.0148, 0.0178), (0.966, 0.942, 0.994)),
    (4, 1): ((0.0083, 0.0099, 0.0100), (0.983, 0.975, 0.976)),
    (4, 2): ((0.0158, 0.0169, 0.0215), (0.958, 0.927, 0.979)),
}
FACES: tuple[Faces, ...] = ("corrected", "bare", "far from the tip")


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(("m", "mode"), TIP)
def test_the_field_of_a_tip_is_best_with_all_of_the_faces_corrected(m: int, mode: Literal[1, 2]) -> None:
    """Sparing the tip leaves it too soft: worse in sliding than to correct nothing."""
    errors = [off(8, m, faces, mode) for faces in FACES]
    assert errors == pytest.approx(TIP[m, mode][0], abs=1e-4)
    assert errors[0] < 0.95 * min(errors[1:])


@pytest.mark.slow
@pytest.mark.parametrize(("m", "mode"), TIP)
def test_the_energy_released_is_nearer_with_faces_corrected(m: int, mode: Literal[1, 2]) -> None:
    """And nearest so in opening, which is how cracks run; in sliding a tip that is too soft makes up for more."""
    found = [released(8, m, faces, mode) for faces in FACES]
    assert found == pytest.approx(TIP[m, mode][1], abs=1e-3)
    corrected, bare, far = np.abs(np.array(found) - 1)
    assert corrected < 0.75 * bare
    assert mode == 2 or corrected < 0.75 * far


@pytest.mark.slow
def test_the_errors_around_a_tip_fall_with_the_spacing() -> None:
    """Twice as fine: half of the error of opening, and half of sliding."""
    for mode in (1, 2):
        coarse, fine = (off(fineness, 3, "corrected", mode) for fineness in (6, 12))
        assert coarse / fine > 1.9  # measured 2.24 and 2.22


@pytest.mark.slow
@pytest.mark.parametrize(("faces", "first"), [("corrected", 19.8e-6), ("bare", 4.4e-6)])
def test_the_notches_of_kalthoff_and_winkler_hold(faces: Faces, first: float) -> None:
    """Bonds along the notches broke before any at their tips did, at 11 us (an independent computation: 10.9 us)."""
    pytest.importorskip("gmsh", exc_type=OSError)
    from pdmesh.drawing.geo import read_geo
    from pdmesh.grid.lattice import build_grid

    grid, settings, _ = build_grid(read_geo(GEOMETRIES / "kalthoff_winkler.geo"))
    problem = with_faces(Model(grid, settings), faces)
    problem.advance(1, round(22e-6 / problem.system.time_step))
    broke = list_breaks_since(problem.system, 0)
    x, y = (1e3 * grid.position[np.searchsorted(grid.ids, broke.node)]).T
    time = broke.step * problem.system.time_step
    near = np.minimum(np.abs(y - 75.5), np.abs(y - 124.5)) < 3
    assert time[near & (x < 47)].min() == pytest.approx(first, abs=0.2e-6)
    assert time[near & (np.abs(x - 50) < 3)].min() == pytest.approx(11e-6, abs=0.2e-6)  # measured 10.9 and 11.1
