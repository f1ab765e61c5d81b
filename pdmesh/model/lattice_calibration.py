"""A full square or cubic lattice of bonds compared with the continuum it represents.

Sums over one family of a uniform grid give the stiffness and the energy of a straight crack. They depend only on the
ratio m = horizon / spacing and on the micromodulus profile.

A small family is not isotropic. Its anisotropy is the mean of the lattice's fourth harmonic H over the stiffness of
bonds, where H is cos 4 phi of a bond's angle phi, and in space 5/2 sum n_a^4 - 3/2; H is 1 along an axis. Above
`ANISOTROPY`, or at any with the calibration "isotropic", bonds of a lattice have a factor 1 - b H(|xi|), H(|xi|) being
the mean over all bonds of one length. It makes the stiffness isotropic for any ratio that has diagonal bonds, in all
directions, as it depends on lengths alone. Below, only the mean stiffness is right, and Young's modulus along the axes
is up to 5.3 % too large (`along_axes`). The usual ratio of 3 is below: 3.9 % in plane stress with a conical
micromodulus, 4.6 % with a constant one, 4.9 and 2.0 % in space.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.material import Material
from pdmesh.model.material_constants import C11, C66, critical_stretch, dimension_of, micromodulus, poisson
from pdmesh.model.neighbours import ROUND_OFF, lengths


class LatticeRatios(NamedTuple):
    """Ratios of lattice to continuum; all 1 in the limit of many neighbours."""

    c11: float
    c12: float
    c66: float
    row: float  # energy of a crack between two rows, over G0
    diagonal: float  # energy of a crack at 45 degrees, over G0


ANISOTROPY = {2: 0.04, 3: 0.03}  # mean of H, by dimension, from which bonds are made isotropic; less with m = 3
NEGLIGIBLE = 1e-9  # of the stiffness: what other bonds have in a family of nearest neighbours


class Shells(NamedTuple):
    """Factors of bonds by length that make a lattice isotropic."""

    length: NDArray[np.float64]  # (k,) spacings, increasing
    factor: NDArray[np.float64]  # (k,)

    def at(self, length: NDArray[np.float64]) -> NDArray[np.float64]:
        """Factors (b,) of bonds `length` spacings long; linear between the lengths of the lattice."""
        return np.interp(length, self.length, self.factor) if len(self.length) else np.ones_like(length)


NO_SHELLS = Shells(np.zeros(0), np.zeros(0))


class Calibration(NamedTuple):
    """Factors that give the lattice the mean stiffness and fracture energy of the material."""

    stiffness: float  # times the micromodulus
    stretch: float  # times the critical stretch
    shells: Shells  # times the micromodulus, by length; none where the lattice is nearly isotropic
    ratios: LatticeRatios  # with the shells, without the two factors


class Elasticity(NamedTuple):
    """Elastic constants of a calibrated lattice pulled along an axis, in a long bar."""

    young: float  # over E
    poisson: float


def has_partial_cells(material: Material) -> bool:
    """Whether cells count by their share within the horizon, with families half a spacing beyond it.

    A conical micromodulus is 0 at the horizon, where shares hardly matter, so cells count in full.
    """
    return material.micromodulus == "constant"


def hu_beta(
    length: NDArray[np.float64], horizon: NDArray[np.float64], delta: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Share of a neighbour's cell, of size `delta`, within the horizon: 1 up to horizon - delta/2, then linear.

    W. Hu, Y. D. Ha, F. Bobaru, Comput. Methods Appl. Mech. Eng. 217-220 (2012) 247-261.
    """
    return np.clip((horizon + delta / 2 - length) / delta, 0.0, 1.0)


def offsets(reach: float, dimension: int = 2) -> NDArray[np.float64]:
    """Neighbours (k, d) of the origin in the lattice of spacing 1, up to |xi| = `reach`."""
    steps = np.arange(-int(reach) - 1, int(reach) + 2)
    every = np.column_stack([grid.ravel() for grid in np.meshgrid(*(steps,) * dimension)]).astype(float)
    length = lengths(every)
    return every[(length > 0) & (length <= reach * (1 + ROUND_OFF))]


def full_family(ratio: float, dimension: int = 2) -> int:
    """Number of neighbours in a full lattice within horizon / spacing = `ratio`: 28 for 3 in the plane, 122 in
    space."""
    return len(offsets(ratio, dimension))


@lru_cache
def lattice_ratios(ratio: float, micromodulus_profile: str, plane: str, partial_cells: bool) -> LatticeRatios:
    """Stiffness and fracture energy of the lattice over those of the continuum, without any calibration.

    With `partial_cells`, the family extends half a spacing beyond the horizon, weighted by Hu's beta; otherwise it is
    |xi| <= horizon and each cell counts in full.
    """
    material = _unit(micromodulus_profile, plane)
    xi, length, c, share = _family(material, ratio, partial_cells)
    return _ratios(material, ratio, xi, length, c * share)


def _unit(micromodulus_profile: str, plane: str) -> Material:
    unit = Material(E=1.0, rho=1.0, G0=1.0)
    return msgspec.structs.replace(unit, micromodulus=micromodulus_profile, plane=plane)


def _family(material: Material, ratio: float, partial_cells: bool) -> tuple[NDArray[np.float64], ...]:
    """Bonds (k, d) of a node in a lattice of spacing 1, their lengths (k,), moduli (k,) and shares of cells (k,)."""
    xi = offsets(ratio + 0.5 if partial_cells else ratio, dimension_of(material.plane))
    length, horizon = lengths(xi), np.full(len(xi), float(ratio))
    share = hu_beta(length, horizon, np.ones(len(xi))) if partial_cells else np.ones(len(xi))
    return xi, length, micromodulus(material, length, horizon), share


def _ratios(
    material: Material, ratio: float, xi: NDArray[np.float64], length: NDArray[np.float64], c: NDArray[np.float64]
) -> LatticeRatios:
    plane = material.plane
    n_x, n_y, *_ = (xi / length[:, None]).T
    c11, c66 = (0.5 * np.sum(c * length * term) for term in (n_x**4, (n_x * n_y) ** 2))
    s0 = float(critical_stretch(material, np.array([ratio]))[0])
    spent = c * s0**2 * length / 2
    row = np.sum(spent * np.maximum(xi[:, 1], 0))
    diagonal = np.sum(spent * np.maximum(xi[:, :2].sum(axis=1), 0)) / np.sqrt(2)
    ratio_values = c11 / C11[plane], c66 / C66[plane], c66 / C66[plane], row, diagonal
    return LatticeRatios(*(float(value) for value in ratio_values))


def shells(xi: NDArray[np.float64], weight: NDArray[np.float64], calibration: str) -> Shells:
    """Factors that make a lattice isotropic whose bonds xi (k, d), in spacings, weigh so much (k,) in its stiffness.

    None where only nearest neighbours pull, so that no factor helps, and with the calibration "mean" where the
    anisotropy is small.
    """
    squares, dimension = np.rint((xi**2).sum(axis=1)).astype(np.int64), xi.shape[1]
    fourth = (xi**4).sum(axis=1) / squares**2
    harmonic = 4 * fourth - 3 if dimension == 2 else (5 * fourth - 3) / 2
    number, shell = np.unique(squares, return_inverse=True)
    mean = np.bincount(shell, harmonic) / np.bincount(shell)
    bond_harmonic, total = mean[shell], float(weight.sum())
    anisotropy = float((weight * bond_harmonic).sum())
    only_nearest = (weight * (1 - bond_harmonic)).sum() <= NEGLIGIBLE * total
    if only_nearest or abs(anisotropy) <= (ANISOTROPY[dimension] * total if calibration == "mean" else 0.0):
        return NO_SHELLS
    return Shells(np.sqrt(number), 1 - anisotropy / float((weight * bond_harmonic**2).sum()) * mean)


@lru_cache
def _calibration(
    ratio: float, micromodulus_profile: str, plane: str, partial_cells: bool, calibration: str
) -> Calibration:
    material = _unit(micromodulus_profile, plane)
    xi, length, c, share = _family(material, ratio, partial_cells)
    factors = shells(xi, c * share * length, calibration)
    ratios = _ratios(material, ratio, xi, length, c * share * factors.at(length))
    stiffness = 3 / (ratios.c11 + ratios.c12 + ratios.c66)
    return Calibration(stiffness, float(np.sqrt(2 / (stiffness * (ratios.row + ratios.diagonal)))), factors, ratios)


def calibration(ratio: float, material: Material, partial_cells: bool = True) -> Calibration:
    """Calibration factors of the lattice, with or without partial cells.

    They give the material's values to the mean of the lattice's stiffnesses, and to the mean energy of cracks along a
    row and at 45 degrees.
    """
    return _calibration(ratio, material.micromodulus, material.plane, partial_cells, material.calibration)


def calibrated_family(material: Material, ratio: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Bonds (k, d) of a node in a lattice of spacing 1, and their calibrated moduli (k,)."""
    partial = has_partial_cells(material)
    factors, (xi, length, c, share) = calibration(ratio, material, partial), _family(material, ratio, partial)
    return xi, factors.stiffness * c * share * factors.shells.at(length)


def along_axes(material: Material, ratio: float, one_sided: bool = False) -> Elasticity:
    """Young's modulus over E, and Poisson's ratio, of a long bar along an axis of the lattice of springs.

    The lattice is calibrated, or that of the thesis: `one_sided`, with Hu's beta up to the horizon.
    """
    factors = calibration(ratio, material, has_partial_cells(material))
    stiffness, ratios = factors.stiffness, factors.ratios
    if one_sided:
        unit = _unit(material.micromodulus, material.plane)
        xi, length, c, share = _family(unit, ratio, False)
        stiffness, ratios = 1.0, _ratios(unit, ratio, xi, length, c * hu_beta(length, ratio * share, share))
    c11, c12 = (stiffness * part * of[material.plane] for part, of in ((ratios.c11, C11), (ratios.c12, C66)))
    return elasticity(c11, c12, material.plane)


def elasticity(c11: float, c12: float, plane: str) -> Elasticity:
    """Constants of a long bar along an axis, from those of stretching along it, over E."""
    if plane == "stress":
        return Elasticity((c11**2 - c12**2) / c11, c12 / c11)
    return Elasticity((c11 - c12) * (c11 + 2 * c12) / (c11 + c12), c12 / (c11 + c12))


class Sheared(NamedTuple):
    """Stiffnesses of bonds with shear and a free rotation, whose energy is c |xi| (s^2 + r gamma^2) / 2."""

    stiffness: float  # c over that of calibrated springs
    ratio: float  # r


def sheared(material: Material, ratio: float) -> Sheared:
    """Bonds whose lattice has the material's Young's modulus and Poisson's ratio in the mean of all directions.

    C11 + C12 follows from the sum of c |xi| alone, C11 - C12 and 2 C66 in the mean from r, on any square lattice.
    """
    nu, partial = poisson(material), has_partial_cells(material)
    factors = calibration(ratio, material, partial)
    uniform = factors.stiffness * (3 * factors.ratios.c11 + factors.ratios.c12) / 4
    if material.plane == "stress":
        return Sheared(2 / (3 * (1 - nu)) / uniform, (1 - 3 * nu) / (1 + nu))
    return Sheared(1 / (1.6 * (1 + nu) * (1 - 2 * nu)) / uniform, 1 - 4 * nu)
