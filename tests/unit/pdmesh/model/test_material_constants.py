"""Micromodulus and critical stretch against tables and against the integrals that define them."""

from __future__ import annotations

import math

import msgspec
import numpy as np
import pytest
from plates import GLASS

from pdmesh.model.document import Material
from pdmesh.model.material_constants import BONDS_NU, C11, C66, critical_stretch, micromodulus

CASES = [(plane, profile) for plane in ("stress", "strain") for profile in ("constant", "conical")]
SODA_LIME = Material(E=72e9, rho=2440.0, G0=135.0)


@pytest.mark.parametrize(
    ("material", "delta", "printed"),
    [(GLASS, 1e-3, 0.001170), (SODA_LIME, 1e-3, 0.000905), (GLASS, 2e-3, 0.000827), (SODA_LIME, 2e-3, 0.000640)],
)
def test_critical_stretches_of_the_thesis_table_4(material: Material, delta: float, printed: float) -> None:
    s0 = float(critical_stretch(material, np.array([4 * delta]))[0])
    assert f"{s0:.6f}" == f"{printed:.6f}"


@pytest.mark.parametrize(("plane", "profile"), CASES)
def test_a_crack_costs_the_fracture_energy(plane: str, profile: str) -> None:
    """G0 = 2 int_0^h w xi^2 dxi with w = c s0^2 xi / 2, the energy of one bond."""
    material = msgspec.structs.replace(GLASS, plane=plane, micromodulus=profile)
    horizon = 4e-3
    x, weights = np.polynomial.legendre.leggauss(8)
    xi = horizon * (x + 1) / 2
    c = micromodulus(material, xi, np.full_like(xi, horizon))
    s0 = float(critical_stretch(material, np.array([horizon]))[0])
    energy = 2 * np.sum(weights * horizon / 2 * (c * s0**2 * xi / 2) * xi**2)
    assert energy == pytest.approx(material.G0, rel=1e-12)  # measured 2e-16


@pytest.mark.parametrize(("plane", "nu"), [("stress", 1 / 3), ("strain", 1 / 4)])
@pytest.mark.parametrize("profile", ["constant", "conical"])
def test_strain_energies_are_the_classical_ones(plane: str, profile: str, nu: float) -> None:
    """C11 and C66 of the continuum of bonds: int c n_x^4 xi / 2 and int c n_x^2 n_y^2 xi / 2 over the family."""
    material = msgspec.structs.replace(GLASS, plane=plane, micromodulus=profile)
    horizon = 3e-3
    x, weights = np.polynomial.legendre.leggauss(8)
    xi = horizon * (x + 1) / 2
    radial = np.sum(weights * horizon / 2 * micromodulus(material, xi, np.full_like(xi, horizon)) * xi**2)
    c11, c66 = radial / 2 * 3 * math.pi / 4, radial / 2 * math.pi / 4
    E = material.E
    stress = (E / (1 - nu**2), E / (2 * (1 + nu)))
    strain = (E * (1 - nu) / ((1 + nu) * (1 - 2 * nu)), E / (2 * (1 + nu)))
    assert (c11, c66) == pytest.approx(stress if plane == "stress" else strain, rel=1e-12)  # measured 3e-16


@pytest.mark.parametrize(("plane", "nu"), [("stress", 1 / 3), ("strain", 1 / 4)])
def test_stiffnesses_are_those_of_the_poisson_ratio_of_bonds(plane: str, nu: float) -> None:
    """Hooke's law; of bonds C12 is C66, which is so at this ratio alone."""
    assert BONDS_NU[plane] == nu
    c66 = 1 / (2 * (1 + nu))
    c11 = 1 / (1 - nu**2) if plane == "stress" else (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    c12 = nu * c11 if plane == "stress" else nu / ((1 + nu) * (1 - 2 * nu))
    assert (C11[plane], C66[plane], C66[plane]) == pytest.approx((c11, c66, c12), rel=1e-15)


def test_a_bond_at_the_horizon_of_the_conical_profile_has_no_stiffness() -> None:
    horizon = np.array([3e-3])
    assert micromodulus(GLASS, horizon, horizon)[0] == 0.0
