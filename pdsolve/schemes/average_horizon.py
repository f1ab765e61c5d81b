"""Symmetric bonds: two nodes see each other within the mean of their horizons, with the constants of that mean.

One modulus a pair, c_ij = c_ji, so linear and angular momentum are conserved. Against the dual horizon of H. Ren,
X. Zhuang, Y. Cai, T. Rabczuk, Int. J. Numer. Methods Eng. 108 (2016) 1451-1476, which is as symmetric, a wave
is reflected less where spacings differ.

- Areas are exact cells, unless the model says otherwise.
- A neighbour's cell counts by its share within the horizon (Hu's beta, the mean of both ends' to stay symmetric),
  in a family that reaches half a spacing beyond the horizon; bonds without stiffness are left out.
- The lattice is calibrated: its mean stiffness and fracture energy are those of the material (`pdsolve.lattice`).
- Surfaces and interfaces are corrected by the energy method: a bond is multiplied so that, in uniform stretching
  along x and along y, its two nodes hold on average the energy of a node in a full lattice (Q. V. Le,
  F. Bobaru, Comput. Mech. 61 (2018) 499-518, section "energy method"). Pre-cracks are not corrected for, as the
  cracks a run makes are not.
- Where two materials meet, each end brings half the stiffness and half the energy a bond spends on breaking.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds import Assembly, Pairs, areas, assembled, both_ways, chosen, inside_plate, pairs_within
from pdsolve.lattice import ROUND_OFF, calibration, hu_beta, lattice_ratios
from pdsolve.laws.bilinear import critical_stretch, limits
from pdsolve.laws.micromodulus import micromodulus
from pdsolve.model import Model

SAME = 1e-12  # relative: a limit this near to its peak is that of a brittle bond, but for round-off


def fill(model: Model) -> Assembly:
    """Average-horizon bonds of the model."""
    grid, horizon = model.grid, model.horizons
    area = areas(model, "cells")
    pairs = both_ways(pairs_within(grid.position, horizon + grid.delta / 2), len(grid))
    i, j, length = pairs
    reach = (horizon[i] + horizon[j]) / 2
    beta = (hu_beta(length, reach, grid.delta[i]) + hu_beta(length, reach, grid.delta[j])) / 2
    modulus, peak, limit = _mean_of_ends(model, pairs, reach)
    modulus *= beta
    scaled = modulus * reach**3
    stiff = scaled > ROUND_OFF * scaled.max(initial=0.0)
    pairs, modulus, peak, limit = chosen(pairs, stiff), modulus[stiff], peak[stiff], limit[stiff]
    inside = inside_plate(grid, pairs)
    pairs, modulus, peak, limit = chosen(pairs, inside), modulus[inside], peak[inside], limit[inside]
    modulus *= _energy_factor(model, pairs, modulus, area)
    return assembled(model, pairs, modulus * area[pairs.target], peak, limit, area)


def _mean_of_ends(
    model: Model, pairs: Pairs, reach: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Modulus, peak and limit of each pair (b,): half from the material of each end.

    The peak keeps the mean energy up to it, the limit the mean of the whole; equal ends keep their own.
    """
    modulus, up_to_peak, whole = (np.zeros(len(pairs.length)) for _ in range(3))
    widest_peak, widest = np.zeros(len(pairs.length)), np.zeros(len(pairs.length))
    for number, material in enumerate(model.materials):
        calibrated = calibration(model.settings.horizon.ratio, material)
        c = calibrated.stiffness * micromodulus(material, pairs.length, reach)
        own = limits(material, calibrated.stretch * critical_stretch(material, reach))
        for end in (pairs.source, pairs.target):
            half = np.where(model.material_of[end] == number, 0.5, 0.0)
            modulus += half * c
            up_to_peak += half * c * own.peak**2
            whole += half * c * own.peak * own.limit
            widest_peak += half * own.peak
            widest += half * own.limit
    if len(model.materials) == 1:
        return modulus, widest_peak, widest
    with np.errstate(invalid="ignore", divide="ignore"):
        peak = np.where(modulus > 0, np.sqrt(up_to_peak / modulus), widest_peak)
        limit = np.where(modulus > 0, whole / (modulus * peak), widest)
    return modulus, peak, np.where(limit <= peak * (1 + SAME), peak, limit)


def _energy_factor(
    model: Model, pairs: Pairs, modulus: NDArray[np.float64], area: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Correction (b,) of each pair's modulus, 1 in the interior of a uniform grid; the same both ways."""
    grid, full = model.grid, _full_energy(model)
    n = (grid.position[pairs.target] - grid.position[pairs.source]) / pairs.length[:, None]
    lack = []
    for axis in (0, 1):
        energy = modulus * pairs.length * n[:, axis] ** 4 * area[pairs.target] / 2
        held = np.bincount(pairs.source, energy, minlength=len(grid))
        with np.errstate(divide="ignore"):
            lack.append(np.where(held > 0, full / held, 1.0))
    mean = [(g[pairs.source] + g[pairs.target]) / 2 for g in lack]
    return np.asarray(((n[:, 0] / mean[0]) ** 2 + (n[:, 1] / mean[1]) ** 2) ** -0.5)


def _full_energy(model: Model) -> NDArray[np.float64]:
    """Twice the energy density (n,) of a node of a full lattice of its material at unit stretch, Pa."""
    ratio = model.settings.horizon.ratio
    full = []
    for material in model.materials:
        found = lattice_ratios(ratio, material.micromodulus, material.plane, True)
        c11 = (1.125 if material.plane == "stress" else 1.2) * material.E
        full.append(c11 * found.c11 * calibration(ratio, material).stiffness)
    return np.array(full)[model.material_of]
