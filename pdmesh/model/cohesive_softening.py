"""Cohesive cracks: how bonds soften so that a lattice has the strength and the fracture energy of a laboratory.

A crack transmits a stress that falls with its opening, A. Hillerborg, M. Modeer, P.-E. Petersson, Cem. Concr. Res. 6
(1976) 773-781. Here each bond softens by its own opening, from the stretch s0 to the opening w_c at which it is gone,
which is the same for bonds of all lengths:

    f_t     tensile strength, Pa                      s0      f_t / (k E), stretch at which a bond begins to soften
    G0      fracture energy, J/m^2                    w_c     opening at which a bond is gone, m
    l_ch    E G0 / f_t^2, characteristic length, m    A       area below a softening curve from (0, 1) to (1, 0)

A crack spends G0 = s0^2 cross(1) / 2 + A s0 w_c cross(0), where cross(p) is the sum over the bonds that cross an axis
line of a lattice, of c |xi|^p times both cells, for each area of the crack. The first term is what bonds hold when they
begin to soften. It grows with the horizon, so that w_c is positive up to a largest horizon only.

k: bonds along the pull soften first while others still load, so that a bar of bonds with s0 = f_t / E peaks at k f_t.
Bars of 10 and 20 rows with a constant micromodulus and the three curves have k from 1.23 to 1.37 in plane stress, and
with the linear curve 1.38 to 1.46 in plane strain, for horizons of 3 and 4 spacings. In space it is 1.45 to 1.58 with
a horizon of 3 spacings, 1.63 to 1.81 with 2. `K` has the middle of each.
Bonds with shear load more evenly: with nu = 0.18 bars in plane stress have k from 1.22 to 1.32, with nu = 0.05 from
1.17 to 1.22, whence `FALL`.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.lattice_calibration import calibrated_family, calibration, has_partial_cells, sheared
from pdmesh.model.material import Material
from pdmesh.model.material_constants import (
    BONDS_NU,
    critical_stretch,
    poisson,
)
from pdmesh.model.neighbours import lengths

K = {"stress": 1.3, "strain": 1.4, "space": 1.55}  # k, by plane
FALL = 0.2  # of k with Poisson's ratio below that of springs, of bonds with shear
DECAYS = 8.0  # of the exponential curve until it is cut off, where it is lowered to end at 0
AREA = {  # A, by `Material.shape`
    "linear": 1 / 2,
    "bilinear": 5 / 18,
    "exponential": (1 / DECAYS - np.exp(-DECAYS) * (1 + 1 / DECAYS)) / (1 - np.exp(-DECAYS)),
}
COARSE = 1 / 1.3  # of l_ch: the largest horizon at which peaks and energies were measured


class Crossing(NamedTuple):
    """Sums over the bonds that cross an axis line of a full lattice."""

    zeroth: float  # cross(0) / E
    first: float  # cross(1) / (E horizon)


def crossing(material: Material, ratio: float) -> Crossing:
    """The sums of a material's lattice whose horizon is `ratio` spacings."""
    sums = _crossing(material.micromodulus, material.plane, material.calibration, ratio)
    if material.model != "micropolar":
        return sums
    share = sheared(material, ratio).stiffness
    return Crossing(sums.zeroth * share, sums.first * share)


@lru_cache
def _crossing(profile: str, plane: str, calibration: Any, ratio: float) -> Crossing:
    unit = Material(E=1.0, rho=1.0, G0=1.0)
    unit = msgspec.structs.replace(unit, micromodulus=profile, plane=plane, calibration=calibration)
    xi, c = calibrated_family(unit, ratio)
    c = c * np.maximum(xi[:, 1], 0)  # as many bonds of one kind cross each spacing of the line
    return Crossing(float(c.sum()), float((c * lengths(xi)).sum() / ratio))


def peak_factor(material: Material) -> float:
    """k, the strength of a bar over that of its first bonds."""
    k = K[material.plane]
    return k - FALL * (BONDS_NU[material.plane] - poisson(material)) if material.model == "micropolar" else k


def first_stretch(material: Material) -> float:
    """s0, the stretch at which bonds begin to soften."""
    assert material.f_t is not None
    return material.f_t / (peak_factor(material) * material.E)


def critical_opening(material: Material, ratio: float, horizon: NDArray[np.float64]) -> NDArray[np.float64]:
    """w_c, m, for families of these horizons, m; 0 or less where the horizon is too large."""
    sums, s0 = crossing(material, ratio), first_stretch(material)
    elastic_energy = s0**2 * sums.first * material.E * horizon / 2
    return np.asarray((material.G0 - elastic_energy) / (AREA[material.shape] * s0 * sums.zeroth * material.E))


def strength_of_peak(material: Material, ratio: float, horizon: float) -> float:
    """f_t, Pa, of cohesive bonds that begin to soften where a material's bilinear ones do; `horizon` in m."""
    brittle = calibration(ratio, material, has_partial_cells(material)).stretch
    critical = brittle * float(critical_stretch(material, np.array([horizon]))[0])
    peak = critical / (np.sqrt(material.kr) if material.keep_G0 else material.kr)
    return peak_factor(material) * material.E * float(peak)


def characteristic_length(material: Material) -> float:
    """l_ch, m."""
    assert material.f_t is not None
    return material.E * material.G0 / material.f_t**2


def largest_horizon(material: Material, ratio: float) -> float:
    """The horizon, m, at which bonds hold the whole fracture energy when they begin to soften."""
    return 2 * peak_factor(material) ** 2 / crossing(material, ratio).first * characteristic_length(material)
