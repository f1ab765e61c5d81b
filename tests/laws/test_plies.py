"""Orthotropic solids: closed forms of plies, what a node answers, and constants that cannot be."""

from __future__ import annotations

import dataclasses
from typing import Any

import msgspec
import numpy as np
import pytest
from messages import naming
from numba import njit
from numpy.typing import NDArray
from plates import plate, square_grid

from pdmesh import Material, laminate
from pdmesh.model.document import Region
from pdmesh.model.node_fields import FieldColumn, wrong_values
from pdmesh.model.orthotropic import eigenvalues, engineering_constants, stiffness
from pdsolve.laws.materials import solid as solids
from pdsolve.laws.materials.orthotropic import crossing, equivalent
from pdsolve.model import Model, ModelError
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

PLY = Material(
    E=171.4e9, E2=9.08e9, nu=0.32, G12=5.29e9, rho=1580, G0=1e3, model="correspondence", solid="orthotropic",
    failure="none",
)  # fmt: skip
THICK = {"E3": 9.08e9, "nu13": 0.32, "nu23": 0.5, "G13": 5.29e9, "G23": 3e9}
ORDER = ((0, 1, 2, 3), (1, 4, 5, 6), (2, 5, 7, 8), (3, 6, 8, 12))  # xx, yy, zz, xy of the 13 components


@njit
def _respond(solid: Any, h: Any) -> Any:
    return solids.respond(solid, 0.0, 0, h, 0.0)


@njit
def _energies(solid: Any, h: Any) -> Any:
    return solids.energies(solid, 0.0, 0, h, 0.0)


def of(**changes: Any) -> Material:
    return msgspec.structs.replace(PLY, **changes)


def model_of(material: Material, **changes: Any) -> Model:
    return plate(square_grid(5, 5), material=material, **changes)


def response(material: Material, h: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """P and sigma of the first node of a plate with a gradient (3, 3), and its energy density."""
    solid = solids.solid_of(model_of(material), float, 2)
    numbers = tuple(np.asarray(h, dtype=float).ravel().tolist())
    answer = _respond(solid, numbers)
    return np.array(answer[0]).reshape(3, 3), np.array(answer[1]), float(_energies(solid, numbers)[0])


@pytest.mark.parametrize(
    ("angle", "E", "nu", "eta", "G"),
    [
        (0, 171.4000, 0.32000, 0.0, 5.2900),
        (15, 58.2941, 0.36145, -2.39507, 5.8240),
        (30, 22.2672, 0.33105, -1.33990, 7.2974),
        (45, 13.2772, 0.25493, -0.69239, 8.3542),
        (60, 10.3031, 0.15318, -0.31065, 7.2974),
        (90, 9.0800, 0.01695, 0.0, 5.2900),
    ],
)
def test_constants_of_turned_plies(angle: float, E: float, nu: float, eta: float, G: float) -> None:
    """E, nu, the shear of tension and G along x, of closed forms computed elsewhere, GPa: to their last digit."""
    C = stiffness(engineering_constants(PLY), angle)[0]
    S = np.linalg.inv(C[[[0, 1, 3], [1, 4, 6], [3, 6, 12]]])
    assert (1e-9 / S[0, 0], -S[0, 1] / S[0, 0], S[0, 2] / S[0, 0]) == pytest.approx((E, nu, eta), abs=6e-5)
    assert 1e-9 / S[2, 2] == pytest.approx(G, abs=6e-5)


def test_a_turned_stiffness_has_the_energy_of_the_turned_strain() -> None:
    """In space, with nine constants: 37 degrees; the eigenvalues do not turn."""
    constants = engineering_constants(of(**THICK))
    straight, turned = stiffness(constants, 0.0), stiffness(constants, 37.0)
    c, s = np.cos(np.radians(37)), np.sin(np.radians(37))
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    e = np.random.default_rng(1).uniform(-1, 1, (3, 3))
    e = e + e.T

    def energy(C: NDArray[np.float64], e: NDArray[np.float64]) -> float:
        plane = np.array([e[0, 0], e[1, 1], e[2, 2], 2 * e[0, 1]])
        out = 2 * e[0, 2], 2 * e[1, 2]
        return float(
            plane @ C[list(ORDER),] @ plane + C[11] * out[0] ** 2 + C[9] * out[1] ** 2 + 2 * C[10] * np.prod(out)
        )

    assert energy(turned[0], R @ e @ R.T) == pytest.approx(energy(straight[0], e), rel=1e-14)
    for plane in ("stress", "strain", "space"):
        assert eigenvalues(turned, plane) == pytest.approx(eigenvalues(straight, plane), rel=1e-14)


@pytest.mark.parametrize("plane", ["stress", "strain"])
def test_a_node_answers_by_its_ply(plane: str) -> None:
    """Swapped constants are a turn by 90 degrees, and isotropic constants are `svk`, to round-off; energy is work."""
    h = np.array([[2e-3, 5e-3, 0], [-3e-3, -1e-3, 0], [0, 0, 0]])
    given = {"plane": plane} | THICK
    swapped = {"E": PLY.E2, "E2": PLY.E, "nu": 0.32 * 9.08 / 171.4, "nu13": 0.5, "nu23": 0.32}
    for one, other in (
        (of(angle=90.0, **given), of(**given | swapped)),
        (
            of(**given | {"E": 70e9, "E2": 70e9, "E3": 70e9, "nu": 0.3, "nu13": 0.3, "nu23": 0.3, "G12": 70e9 / 2.6}),
            of(plane=plane, E=70e9, nu=0.3, solid="svk"),
        ),
    ):
        for mine, theirs in zip(response(one, h), response(other, h), strict=True):
            assert mine == pytest.approx(theirs, rel=1e-12, abs=1e-12 * np.abs(theirs).max())
    size, material = 1e-6, of(angle=30.0, **given)
    for a, b in ((0, 0), (0, 1), (1, 0), (1, 1)):
        step = np.zeros((3, 3))
        step[a, b] = size
        slope = (response(material, h + step)[2] - response(material, h - step)[2]) / (2 * size)
        assert response(material, h)[0][a, b] == pytest.approx(slope, rel=1e-6)


def test_a_ply_turns_with_its_body() -> None:
    """A rigid turn by 40 degrees stores nothing; a stretch, then a turn, has the turned stress."""
    c, s = np.cos(np.radians(40)), np.sin(np.radians(40))
    R, U = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]), np.diag([1.01, 0.995, 1.0])
    assert np.abs(response(of(angle=20.0), R - np.eye(3))[0]).max() < 1e-14 * PLY.E
    straight, turned = (response(of(angle=20.0), F - np.eye(3))[0] for F in (U, R @ U))
    assert turned == pytest.approx(R @ straight, rel=1e-12, abs=1e-12 * np.abs(straight).max())


def test_angles_by_region_and_by_node() -> None:
    """A region's angle, and a field of angles, are those of its nodes."""
    half = (2.5e-3, -1.0, 1.0, 1.0)
    model = model_of(PLY, regions=(Region(box=half, material=of(angle=30.0)),))
    by_region = solids.solid_of(model, float, 2).ply
    angles = np.where(model.grid.position[:, 0] >= 2.5e-3, 30.0, 0.0)
    grid = dataclasses.replace(model.grid, fields=(FieldColumn("angle", angles),))
    by_node = solids.solid_of(plate(grid, material=PLY), float, 2).ply
    assert (by_region == by_node).all()
    assert len(np.unique(by_region[:, 0])) == 2


def test_poissons_ratio_by_node_may_exceed_a_half() -> None:
    """Of plies, to E1 nu21 = E2 nu12; 0.5 raises no division by zero. Other solids refuse it."""
    nodes = np.full(25, 0.5)
    nodes[7] = 0.7
    grid = dataclasses.replace(square_grid(5, 5), fields=(FieldColumn("nu", nodes),))
    with np.errstate(all="raise"):
        solid = solids.solid_of(plate(grid, material=PLY), float, 2)
    own = stiffness(engineering_constants(of(nu=0.7)), 0.0)[0]
    assert solid.ply[7, : len(own)] == pytest.approx(own, rel=1e-14)
    assert wrong_values("nu", nodes, (PLY,)) is None
    assert wrong_values("nu", nodes, (PLY, of(solid="linear"))) is not None
    assert (wrong_values("nu", nodes + 0.3, (PLY,)) or [None])[0] == 7


WEAK = {"failure": "stress", "strength": 2e9, "strength_across": 5e7, "shear_strength": 8e7}


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"E2": None}, naming("$.material.E2", found="missing", expected="plane stress")),
        ({"nu": None}, naming("$.material.nu", found="missing", expected="plane stress")),
        ({"plane": "strain"}, naming("$.material.E3", found="missing", expected="plane strain")),
        ({"E2": 300e9, "nu": 0.8}, naming("$.material.nu", found="0.8", expected=("0.7559", "E / E2"))),
        ({"plane": "strain"} | THICK | {"nu23": 0.999}, naming("$.material.nu23", found="0.999")),
        ({"failure": "stretch"}, naming("$.material.failure", found="'stretch'", expected="stress or none")),
        (WEAK | {"shear_strength": None}, naming("$.material.shear_strength", found="missing")),
        ({"control": "wan"}, naming("$.material.control", found="'wan'", expected="silling")),
        ({"order": 2}, naming("$.material.order", found="'2'")),
        ({"form": "rate"}, naming("$.material.form", found="'rate'", expected="'total'")),
        ({"model": "bond"}, naming("$.material.G12", found="5.29e+09", expected=("2.921e+09 Pa", "0.5725"))),
        ({"model": "bond", "G12": 2.92e9}, naming("$.material.model", found="'bond'", expected="'correspondence'")),
        ({"model": "bond", "G12": None}, naming("$.material.solid", found="'orthotropic'", expected="'bond'")),
    ],
)
def test_constants_that_cannot_be(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(ModelError, match=says):
        prepare(model_of(of(**changes)), Options())


def test_fields_that_store_negative_energy_are_refused() -> None:
    nodes = np.full(25, 0.32)
    nodes[7] = 0.49
    grid = dataclasses.replace(square_grid(5, 5), fields=(FieldColumn("nu", nodes),))
    with pytest.raises(ModelError, match=naming(expected="node 8")):
        solids.solid_of(plate(grid, material=of(E2=171.4e9 / 0.22)), float, 2)


@njit
def _equivalent(ply: Any, m: Any, d: int) -> Any:
    return equivalent(ply, d, m, 0)


@pytest.mark.parametrize("dimension", [2, 3])
def test_the_strengths_of_a_turned_ply(dimension: int) -> None:
    """Stress along the fibres, across them and in shear, turned by 30 degrees: over the strength along them 1 each."""
    material = of(angle=30.0, plane="strain", **WEAK, **THICK)
    ply = solids.solid_of(model_of(material), float, 2).ply[0]
    c, s = np.cos(np.radians(30)), np.sin(np.radians(30))
    R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    cases = [((0, 0), 2e9, (1, 0)), ((1, 1), 5e7, (0, 1)), ((1, 1), -5e9, (0, 0)), ((0, 1), 8e7, (0, 1))]
    if dimension == 3:
        cases += [((2, 2), 5e7, (0, 1)), ((1, 2), 5e7, (0, 1)), ((0, 2), 8e7, (0, 1))]
    for (a, b), size, expected in cases:
        own = np.zeros((3, 3))
        own[a, b] = own[b, a] = size
        turned = R @ own @ R.T
        m = np.array([turned[a, b] for a, b in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))])
        found = np.array(_equivalent(ply, m[: 4 if dimension == 2 else 6], dimension)) / 2e9
        assert found == pytest.approx(expected, abs=1e-6)


@njit
def _crossing(ply: Any, xi: Any) -> Any:
    return crossing(ply, xi)


def test_bonds_along_fibres_cross_none() -> None:
    """The sine of 30 degrees for a bond along x, and 0 and 1 along and across the fibres."""
    ply = solids.solid_of(model_of(of(angle=30.0, **WEAK)), float, 2).ply[0]
    c, s = np.cos(np.radians(30)), np.sin(np.radians(30))
    assert _crossing(ply, (2e-3, 0.0)) == pytest.approx(0.5)
    assert _crossing(ply, (c, s)) == pytest.approx(0, abs=1e-7)
    assert _crossing(ply, (-3 * s, 3 * c)) == pytest.approx(1)
    assert _crossing(ply, (0.0, 0.0, 1e-3)) == 1


@pytest.mark.parametrize(
    ("angles", "E", "nu", "G"),
    [
        ([0, 90, 90, 0], 90.638, 0.03220, 5.290),
        ([45, -45], 19.012, 0.79699, 43.905),
        ([0, 45, -45, 90], 64.506, 0.31123, 24.598),
    ],
)
def test_constants_of_laminates(angles: list[float], E: float, nu: float, G: float) -> None:
    """Of closed forms computed elsewhere, GPa: to their last digit."""
    one = laminate(PLY, angles)
    assert one.G12 is not None
    assert (1e-9 * one.E, 1e-9 * (one.E2 or 0), one.nu, 1e-9 * one.G12) == pytest.approx((E, E, nu, G), abs=6e-4)
    doubled = laminate(PLY, [*angles, 0], [2.0] * len(angles) + [1e-9])
    assert pytest.approx(one.E, rel=1e-8) == doubled.E


@pytest.mark.parametrize(
    ("ply", "plies", "says"),
    [
        (PLY, ([0, 45],), "45 degrees"),
        (PLY, ([],), "0 angles"),
        (PLY, ([0, 90], [1.0]), "1 thicknesses"),
        (PLY, ([0, 90], [1.0, 0.0]), "above 0"),
        (of(solid="linear"), ([0],), "'linear'"),
    ],
)
def test_laminates_that_cannot_be(ply: Material, plies: tuple[Any, ...], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        laminate(ply, *plies)
