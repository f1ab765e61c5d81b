"""Speed of a crack tip with its uncertainty: the slope of time over length along its path.

Wave speeds of a plate are limits of crack speeds.
"""

from __future__ import annotations

from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from pdmesh.model.material import Material
from pdmesh.model.material_constants import poisson, rayleigh_speed
from pdmesh.model.orthotropic import ORTHOTROPIC, engineering_constants
from pdsolve.measures.embedded_model import read
from pdsolve.results import Results

WINDOW = 10.0  # local spacings of path, at least, that a speed is measured over
SURE = 0.95  # of Student's distribution; cracks drawn with noise are within their bands nine times in ten
BLUR = 0.1  # spacings: how well the place of a tip is known at best
RAYLEIGH, LEAST_SHEAR = "Rayleigh speed", "least shear speed"
VAGUE = 0.5  # of the slope: where it is less sure than this, no speed is told


class TipSpeeds(NamedTuple):
    """Speeds of a tip at k places, m/s; NaN where they are unknown."""

    value: NDArray[np.float64]  # (k,)
    low: NDArray[np.float64]  # (k,)
    high: NDArray[np.float64]  # (k,)


def estimate_tip_speeds(
    length_along_crack: NDArray[np.float64],
    time: NDArray[np.float64],
    spacing: NDArray[np.float64],
    known_time: NDArray[np.bool_],
    time_step: float,
) -> TipSpeeds:
    """Speeds at k points of a path, from the length there, m, and the time the tip passed, s.

    A speed is one over the slope of a least-squares line of time over length, through the surrounding points, at least
    ten spacings from first to last, with Student's band of the slope. The window is one of length, not of time, as
    cracks wait and jump. A speed is NaN if the stretch is shorter, if one of its points is not `known_time`, or if the
    uncertainty of the slope exceeds one half.
    """
    speed_columns = np.full((3, len(length_along_crack)), np.nan)
    for at in range(len(length_along_crack)):
        near = window_for_mean_speed(length_along_crack, at, WINDOW * spacing[at])
        if near is not None:  # of the coarsest nodes there
            near = window_for_mean_speed(length_along_crack, at, WINDOW * float(spacing[near].max()))
        if near is None or not known_time[near].all():
            continue
        away, late = length_along_crack[near] - length_along_crack[near].mean(), time[near] - time[near].mean()
        free = len(away) - 2
        slowness = float(away @ late) / float(away @ away)
        least_variance = time_step**2 / 12 + (BLUR * spacing[at] * slowness) ** 2
        scatter = max(float(((late - slowness * away) ** 2).sum()) / free, least_variance)
        off = float(stdtrit(free, (1 + SURE) / 2)) * np.sqrt(scatter / float(away @ away))
        if slowness > 0 and off <= VAGUE * slowness:
            speed_columns[:, at] = 1 / slowness, 1 / (slowness + off), 1 / (slowness - off)
    return TipSpeeds(*speed_columns)


def window_for_mean_speed(length_along_crack: NDArray[np.float64], point: int, length: float) -> slice | None:
    """The points around one, first to last at least `length` apart, extending equally to both sides if the path allows.

    None if the whole path is shorter.
    """
    slack = 1e-9 * length
    if length_along_crack[-1] - length_along_crack[0] < length - slack:
        return None
    low = min(max(length_along_crack[point] - length / 2, length_along_crack[0]), length_along_crack[-1] - length)
    first = int(np.searchsorted(length_along_crack, low + slack, side="right")) - 1
    last = int(np.searchsorted(length_along_crack, low + length - slack))
    return slice(max(first, 0), last + 1)


class _WaveSpeedGridFileKeys(msgspec.Struct):
    """The keys of the grid file that wave speeds need."""

    material: Material


class LimitingSpeed(NamedTuple):
    """A wave speed that cracks stay below."""

    value: float  # m/s
    name: str


def limiting_speed(results: Results) -> LimitingSpeed:
    """The Rayleigh speed of the main material, of plies the least shear speed; material regions are ignored."""
    material = read(results, _WaveSpeedGridFileKeys).material
    if material.model == "correspondence" and material.solid == ORTHOTROPIC:
        constants = engineering_constants(material)
        moduli = constants.G12 if results.dimension == 2 else (constants.G12, constants.G13, constants.G23)
        return LimitingSpeed(float(np.sqrt(np.min(moduli) / material.rho)), LEAST_SHEAR)
    return LimitingSpeed(rayleigh_speed(material.E, material.rho, material.plane, poisson(material)), RAYLEIGH)
