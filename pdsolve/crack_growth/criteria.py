"""Criteria for the growth of a crack tip, and its direction.

    intensity  the largest hoop stress ahead from the stress intensities around the tip, cos^2(a / 2) (K1 cos(a / 2)
               - 3 K2 sin(a / 2)) at its angle a (F. Erdogan, G. C. Sih, J. Basic Eng. 85 (1963) 519-525), against the
               toughness, by default sqrt(E' G0). K1 and K2 are those of interaction integrals on a ring. If an edge or
               another crack leaves no room for it: sqrt(E' J) of a smaller ring, which says the angle too.
    stress     the largest principal value of the mean stress ahead, within 1.5 horizons, against the strength.

The direction is that of the largest hoop stress, from the intensities or, for the stress criterion, from the nodes
ahead; or the normal to the axis of the mean stress. With the stress criterion, a crack forks if the hoop stress has a
second maximum nearly as large as the first. Two maxima closer to each other than cracks can be are merged.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import ParticleRules
from pdsolve.fracture.domain_integrals import Ring, Sampled, integrals, kink
from pdsolve.fracture.fields import Elastic

AHEAD = 1.5  # horizons that stress is looked at in
BEGINS = 0.5  # horizons: nearer nodes have bonds that are cut
SPREAD = 12.0  # degrees: what nodes are smoothed by around the tip
WIDEST = 75.0  # degrees that a crack turns by at most, at once; pure shear makes it 70.5
SAME = 1e-3  # relative: maxima this near to each other are as large
APART = 45.0  # degrees between the branches of a fork, at least


class Verdict(NamedTuple):
    """The decision about a tip."""

    share: float  # of what lets it grow; it does from 1 on
    angles: tuple[float, ...]  # rad from its way, to the left positive: one, or two where it forks
    K1: float = float("nan")  # Pa m^0.5
    K2: float = float("nan")
    released: float = float("nan")  # Pa m^0.5, intensity of the largest hoop stress if K1^2 + K2^2 were J E'
    straight: bool = False  # on to what is ahead, without looking at intensities


def by_intensity(
    at: Sampled, tip: NDArray[np.float64], way: NDArray[np.float64], ring: Ring, plate: Elastic, toughness: float
) -> Verdict:
    """Decide by stress intensities, against a toughness, Pa m^0.5."""
    parameters = integrals(at, tip, way, ring, plate)
    turn = np.radians(kink(parameters.K1, parameters.K2))
    half = turn / 2
    hoop = np.cos(half) ** 2 * (parameters.K1 * np.cos(half) - 3 * parameters.K2 * np.sin(half))
    share = hoop / toughness if np.isfinite(hoop) else 0.0
    total_intensity = np.hypot(parameters.K1, parameters.K2)
    released = (
        hoop / total_intensity * np.sqrt(max(parameters.J, 0.0) * plate.effective_modulus)
        if total_intensity > 0
        else 0.0
    )
    angles = (float(turn),) if np.isfinite(turn) else ()
    return Verdict(float(share), angles, parameters.K1, parameters.K2, float(released))


def by_release(
    at: Sampled, tip: NDArray[np.float64], way: NDArray[np.float64], ring: Ring, plate: Elastic, toughness: float
) -> Verdict:
    """Decide by J, which a ring too narrow for the size of intensities also gives, against a toughness, Pa m^0.5; the
    angle is that of their ratio."""
    parameters = integrals(at, tip, way, ring, plate)
    released = float(np.sqrt(max(parameters.J, 0.0) * plate.effective_modulus))
    turn = float(np.radians(kink(parameters.K1, parameters.K2)))
    return Verdict(released / toughness, (turn if np.isfinite(turn) else 0.0,), released=released)


def by_stress(
    at: Sampled, tip: NDArray[np.float64], way: NDArray[np.float64], horizon: float, rules: ParticleRules, forks: bool
) -> Verdict:
    """Decide by the stress of the nodes ahead, against the strength of the rules; `forks`: whether the crack may
    fork."""
    assert rules.strength is not None
    turned = (at.position - tip) @ np.array([way, [-way[1], way[0]]]).T
    far, angle = np.hypot(*turned.T), np.arctan2(turned[:, 1], turned[:, 0])
    near = (far < AHEAD * horizon) & (far > BEGINS * horizon) & np.isfinite(at.stress).all(axis=1)
    ahead = near & (turned[:, 0] > 0)
    if not ahead.any():
        return Verdict(0.0, ())
    mean = at.area[ahead] @ at.stress[ahead] / at.area[ahead].sum()
    values, vectors = np.linalg.eigh([[mean[0], mean[2]], [mean[2], mean[1]]])
    share = float(values[1] / rules.strength)
    if rules.direction == "principal":
        across = np.array([-vectors[1, 1], vectors[0, 1]])
        across = across if across @ way > 0 else -across
        return Verdict(share, (float(np.arctan2(way[0] * across[1] - way[1] * across[0], across @ way)),))
    # the hoop stress around the tip at ANGLES, extrapolated to a distance of one horizon
    out = (at.position[near] - tip) / far[near, None]
    xx, yy, xy = at.stress[near].T
    hoop = xx * out[:, 1] ** 2 + yy * out[:, 0] ** 2 - 2 * xy * out[:, 0] * out[:, 1]
    hoop = hoop * np.sqrt(far[near] / horizon)
    weight = at.area[near] * np.exp(-(((ANGLES[:, None] - angle[near]) / np.radians(SPREAD)) ** 2) / 2)
    profile = (weight @ hoop) / weight.sum(axis=1)
    return Verdict(share, _maxima(profile, rules.branch if forks else np.inf))


ANGLES = np.radians(np.arange(-WIDEST, WIDEST + 1, 1.0))


def _maxima(profile: NDArray[np.float64], branch: float) -> tuple[float, ...]:
    """Angles of the largest value and of a second maximum of at least `branch` times it."""
    padded = np.concatenate([[-np.inf], profile, [-np.inf]])
    tops = np.flatnonzero((padded[1:-1] >= padded[:-2]) & (padded[1:-1] > padded[2:]))
    tops = tops[np.argsort(-profile[tops], kind="stable")]
    first = float(ANGLES[tops[0]])
    for top in tops[1:]:
        if profile[tops[0]] <= 0 or profile[top] < min(branch, 1 - SAME) * profile[tops[0]]:
            break
        second = float(ANGLES[top])
        if abs(second - first) < np.radians(APART) or profile[top] < branch * profile[tops[0]]:
            return ((first + second) / 2,)
        return min(first, second), max(first, second)
    return (first,)
