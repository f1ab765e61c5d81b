"""The motion of a crack tip's surroundings, which a boundary can follow: K field, T-stress, and a tip that moves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import atan2, cos, hypot, isfinite, pi, radians, sin, sqrt

import numpy as np

from pdmesh.model.material import Material
from pdmesh.model.material_constants import poisson
from pdmesh.scene.conditions import Profile, checked_profile
from pdmesh.scene.functions_of_place import ValueOfPlace, over_time
from pdmesh.scene.shapes import SceneError


def k_field(
    material: Material,
    K1: float,
    K2: float = 0.0,
    *,
    T: float = 0.0,
    tip: tuple[float, float] = (0.0, 0.0),
    angle: float = 0.0,
    speed: float = 0.0,
    times: Sequence[float] = (),
    profile: Profile = (),
) -> tuple[ValueOfPlace, ValueOfPlace]:
    """Displacements along x and y around the tip of a straight crack with free faces, for `.fix(where, *k_field(...))`.

    They are those of M. L. Williams, J. Appl. Mech. 24 (1957) 109-114, in an infinite isotropic plate, or in plane
    strain, with the Young's modulus and Poisson's ratio of the material. E' G = K1^2 + K2^2.

    Parameters
    ----------
    material
        Of the plate; its `plane` says whether in plane stress. A body in space is in plane strain.
    K1, K2
        Stress intensity factors of opening and sliding, Pa m^0.5.
    T
        Stress along the crack, Pa.
    tip
        Its place at time 0, m.
    angle
        Of the direction of growth, degrees, anticlockwise from x. The crack is behind the tip.
    speed
        Of the tip in this direction, m/s. It is static for the solid: use little of the Rayleigh wave speed.
    times
        Of a field that changes: when it is sampled, s, from 0 to the end of the run. Values are linear between them.
    profile
        Points (time, factor) of K1, K2 and T, with `times`.

    Raises
    ------
    SceneError
        For a material that is not isotropic, numbers that are not finite, and a speed or a profile without times.
    """
    if not all(map(isfinite, (K1, K2, T, *tip, angle, speed))):
        raise SceneError(
            f"k_field: K1 {K1}, K2 {K2}, T {T}, tip {tip}, angle {angle}, speed {speed}; use finite numbers"
        )
    if material.model == "correspondence" and material.solid == "orthotropic":
        raise SceneError("k_field: the material is orthotropic; use one that is isotropic")
    if (speed or profile) and not len(times):
        raise SceneError("k_field: a speed or a profile is given without times; give the times of samples, s")
    points = checked_profile(profile, "k_field: profile")
    motion = _TipMotion(material, K1, K2, T, tip, radians(angle), speed if len(times) else None, points)

    def along_x(*at: float) -> float:
        return motion.displacement(*at)[0]

    def along_y(*at: float) -> float:
        return motion.displacement(*at)[1]

    return (over_time(along_x, times), over_time(along_y, times)) if len(times) else (along_x, along_y)


@dataclass(frozen=True)
class _TipMotion:
    """What moves around a tip; `speed` is None of a field that does not change with time."""

    material: Material
    K1: float
    K2: float
    T: float
    tip: tuple[float, float]
    angle: float  # rad
    speed: float | None
    profile: Profile

    def displacement(self, x: float, y: float, *more: float) -> tuple[float, float]:
        """The displacement, m, at a place, m, and, last of `more`, a time, s."""
        time = 0.0 if self.speed is None else more[-1]
        c, s, ahead = cos(self.angle), sin(self.angle), (self.speed or 0.0) * time
        a, b = x - self.tip[0] - c * ahead, y - self.tip[1] - s * ahead
        along, up = c * a + s * b, c * b - s * a
        nu, strained = poisson(self.material), self.material.plane != "stress"
        kappa = 3 - 4 * nu if strained else (3 - nu) / (1 + nu)
        shear = self.material.E / (2 * (1 + nu))
        r, half = hypot(along, up), atan2(up, along) / 2
        scale, cosine = sqrt(r / (2 * pi)) / (2 * shear), cos(2 * half)
        u = scale * (self.K1 * (kappa - cosine) * cos(half) + self.K2 * (kappa + 2 + cosine) * sin(half))
        v = scale * (self.K1 * (kappa - cosine) * sin(half) - self.K2 * (kappa - 2 + cosine) * cos(half))
        u += self.T * along * (kappa + 1) / (8 * shear)
        v -= self.T * up * (3 - kappa) / (8 * shear)
        factor = float(np.interp(time, *np.array(self.profile).T)) if self.profile else 1.0
        return factor * (c * u - s * v), factor * (s * u + c * v)
