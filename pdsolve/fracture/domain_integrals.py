"""Fracture parameters of a crack tip from the fields on a ring around it: J, stress intensities and T-stress.

The area form of J has a weight q that falls smoothly from 1 inside the ring to 0 outside it, x along the crack (F. Z.
Li, C. F. Shih, A. Needleman, Eng. Fract. Mech. 21 (1985) 405-421), with the inertia terms (T. Nakamura, C. F. Shih, L.
B. Freund, Int. J. Fract. 27 (1985) 229-243):

    J = sum [(s_ij u_i,x - (W + L) d_xj) q,j + rho (a_i u_i,x - v_i v_i,x) q] A

The interaction integral is the part of it that is bilinear in the fields here and in a field of known K1, K2 or T (J.
F. Yau, S. S. Wang, H. T. Corten, J. Appl. Mech. 47 (1980) 335-341). The crack faces are straight, and free or under
pressure (`loaded_faces`).

Symbols: s stress, Pa; u displacement, m; v, a its rates; W strain energy and L kinetic energy, J/m^3; rho density; A a
node's area, m^2; d the unit tensor.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.fracture.fields import Elastic, TipField, intensities, pushed
from pdsolve.fracture.loaded_faces import LoadedFaces, at_front, changes_along, closed

AT_TIP = 1e-9  # of a ring: a node this near to the tip does not count, where the other fields are infinite


class Sampled(NamedTuple):
    """The fields at n nodes; a node without a gradient (NaN) is left out."""

    position: NDArray[np.float64]  # (n, 2) m
    area: NDArray[np.float64]  # (n,) m^2
    gradient: NDArray[np.float64]  # (n, 2, 2) du_a / dx_b
    strain: NDArray[np.float64]  # (n, 3) xx, yy, xy
    stress: NDArray[np.float64]  # (n, 3) Pa, likewise
    motion: SampledMotion | None = None  # None: at rest
    work: NDArray[np.float64] | None = None  # (n,) of the stress, J/m^3; None: that of an elastic solid


class SampledMotion(NamedTuple):
    """The inertia of n nodes: density, velocity, acceleration and velocity gradient."""

    density: float  # kg/m^3
    velocity: NDArray[np.float64]  # (n, d) m/s
    acceleration: NDArray[np.float64]  # (n, d) m/s^2
    rates: NDArray[np.float64]  # (n, d, d) 1/s, dv_a / dx_b


class Ring(NamedTuple):
    """The ring over which q falls from 1 to 0, m from the tip."""

    inner: float
    outer: float


class FractureParameters(NamedTuple):
    """J, K1, K2 and the T-stress of a tip."""

    J: float  # J/m^2
    K1: float  # Pa m^0.5
    K2: float
    T: float  # Pa

    @property
    def angle(self) -> float:
        """Predicted angle of growth, degrees, positive to the left; NaN without stress intensities."""
        return kink(self.K1, self.K2)


def kink(K1: float, K2: float) -> float:
    """The angle, degrees, of the largest hoop stress ahead of a tip, positive to the left of its direction.

    F. Erdogan, G. C. Sih, J. Basic Eng. 85 (1963) 519-525. NaN where both are 0.
    """
    if K1 == 0 == K2:
        return float("nan")
    return float(np.degrees(2 * np.arctan2(-2 * K2, K1 + np.hypot(K1, np.sqrt(8) * K2))))


def integrals(
    at: Sampled,
    tip: NDArray[np.float64],
    way: NDArray[np.float64],
    ring: Ring,
    plate: Elastic,
    faces: LoadedFaces | None = None,
) -> FractureParameters:
    """Fracture parameters of the tip at a place (2,), m, with the crack arriving along the unit vector `way` (2,).

    `faces` are those of the crack that are under pressure.
    """
    far = np.hypot(*(at.position - tip).T)
    in_ring = (far < ring.outer) & (far > AT_TIP * ring.outer)
    rows = np.flatnonzero(in_ring & np.isfinite(at.gradient).all(axis=(1, 2)))
    turn = np.array([way, [-way[1], way[0]]])
    fields = _turned(at, rows, tip, turn)
    q, slope = weight(fields.position, ring)
    z = fields.position[:, 0] + 1j * fields.position[:, 1]
    # J in its area form
    along = fields.gradient[:, :, 0]
    energy = _product(fields.stress, fields.strain) / 2 if fields.work is None else fields.work
    total = _pulled(fields.stress, along, slope)
    if fields.motion is not None:
        density, velocity, acceleration, rates = fields.motion
        energy = energy + density * (velocity**2).sum(axis=1) / 2
        total = total + density * q * (acceleration * along - velocity * rates[:, :, 0]).sum(axis=1)
    J = float(fields.area @ (total - energy * slope[:, 0]))
    turned_faces = None if faces is None else _faces_behind_tip(faces, tip, turn, ring)
    if turned_faces is not None:
        J += _pushed_along(turned_faces, ring, turned_faces.displacement)

    def interaction(field: Callable[[NDArray[np.complex128]], TipField], reach: float) -> float:
        auxiliary = field(z)
        total = _pulled(fields.stress, auxiliary.slope, slope) + _pulled(
            auxiliary.stress, fields.gradient[:, :, 0], slope
        )
        total = total - _product(auxiliary.stress, fields.strain) * slope[:, 0]
        if fields.motion is not None:
            total = total + fields.motion.density * q * (fields.motion.acceleration * auxiliary.slope).sum(axis=1)
        between = float(fields.area @ total)
        if turned_faces is not None:  # the displacement is `reach` times that of a constant slope from the tip
            x, y = turned_faces.corners.reshape(-1, 2).T
            slopes = field(x + 1j * y).slope
            between += _pushed_along(turned_faces, ring, (reach * x[:, None] * slopes).reshape(-1, 2, 2))
        return between

    K1 = plate.effective_modulus / 2 * interaction(lambda at: intensities(at, plate, 1.0, 0.0), 2.0)
    K2 = plate.effective_modulus / 2 * interaction(lambda at: intensities(at, plate, 0.0, 1.0), 2.0)
    T = plate.effective_modulus * interaction(lambda at: pushed(at, plate, 1.0), 0.0)
    return FractureParameters(J, K1, K2, T)


def _faces_behind_tip(
    faces: LoadedFaces, tip: NDArray[np.float64], turn: NDArray[np.float64], ring: Ring
) -> LoadedFaces | None:
    """Pieces of faces in the crack's frame, with corners on its line, on the side of the material, in the ring."""
    rows = np.flatnonzero(np.hypot(*(faces.middle - tip).T) < ring.outer)
    if not len(rows):
        return None
    part = faces.part(rows)
    corners, outward = (part.corners - tip) @ turn.T, part.outward @ turn.T
    at_tip = at_front(part, np.hypot(corners[:, :, 0], corners[:, :, 1]))
    x = np.where(at_tip, 0.0, np.minimum(corners[:, :, 0], 0.0)) - AT_TIP * ring.outer
    y = np.where(outward[:, 1:] < 0, 1.0, -1.0) * AT_TIP * AT_TIP * ring.outer
    places = np.stack([x, np.broadcast_to(y, x.shape)], axis=2)
    return LoadedFaces(places, closed(part.displacement @ turn.T, at_tip), part.force @ turn.T, outward, at_tip)


def _pushed_along(faces: LoadedFaces, ring: Ring, displacement: NDArray[np.float64]) -> float:
    """What forces on pieces of faces add to an integral by a displacement (f, 2, 2) of their corners."""
    along = np.tile([1.0, 0.0], (len(faces.force), 1))
    change = changes_along(faces.corners, along, displacement)
    return -float(((faces.force * change).sum(axis=1) * weight(faces.middle, ring)[0]).sum())


def weight(places: NDArray[np.float64], ring: Ring) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """q (n,) and its gradient (n, 2) at places (n, 2) relative to the tip, m: a cubic with zero slope at both ends."""
    far = np.hypot(*places.T)
    share = ((far - ring.inner) / (ring.outer - ring.inner)).clip(0, 1)
    steep = -6 * share * (1 - share) / (ring.outer - ring.inner)
    return 1 - share**2 * (3 - 2 * share), (steep / np.maximum(far, 1e-300))[:, None] * places


def _turned(at: Sampled, rows: NDArray[np.int64], tip: NDArray[np.float64], turn: NDArray[np.float64]) -> Sampled:
    """The fields of some nodes in the crack's frame: places and components from its tip, along and across it."""

    def tensor(packed: NDArray[np.float64]) -> NDArray[np.float64]:
        xx, yy, xy = packed[rows].T
        rotated = turn @ np.stack([xx, xy, xy, yy], axis=-1).reshape(-1, 2, 2) @ turn.T
        return np.column_stack([rotated[:, 0, 0], rotated[:, 1, 1], rotated[:, 0, 1]])

    motion = at.motion
    if motion is not None:
        motion = SampledMotion(
            motion.density,
            motion.velocity[rows] @ turn.T,
            motion.acceleration[rows] @ turn.T,
            turn @ motion.rates[rows] @ turn.T,
        )
    place, work = (at.position[rows] - tip) @ turn.T, None if at.work is None else at.work[rows]
    gradient = turn @ at.gradient[rows] @ turn.T
    return Sampled(place, at.area[rows], gradient, tensor(at.strain), tensor(at.stress), motion, work)


def _product(stress: NDArray[np.float64], strain: NDArray[np.float64]) -> NDArray[np.float64]:
    """The product s_ij e_ij (n,) of stress and strain."""
    product: NDArray[np.float64] = (stress[:, :2] * strain[:, :2]).sum(axis=1) + 2 * stress[:, 2] * strain[:, 2]
    return product


def _pulled(stress: NDArray[np.float64], along: NDArray[np.float64], slope: NDArray[np.float64]) -> NDArray[np.float64]:
    """The product s_ij u_i,x q,j (n,) of stress, displacement gradient and slope of the weight."""
    xx, yy, xy = stress.T
    product: NDArray[np.float64] = along[:, 0] * (xx * slope[:, 0] + xy * slope[:, 1])
    product += along[:, 1] * (xy * slope[:, 0] + yy * slope[:, 1])
    return product
