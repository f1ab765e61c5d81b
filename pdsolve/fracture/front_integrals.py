"""J and stress intensities at a point of a crack front in space, from the fields in a piece of a tube around it.

The front is taken as an arc of a circle in the plane of the crack. The weight q = f(r) g(s) falls smoothly from 1 to 0
between two radii and towards both ends of the tube. It multiplies e, the direction of growth at each place of the arc.
The domain form of J (C. F. Shih, B. Moran, T. Nakamura, Int. J. Fract. 30 (1986) 79-102) with the inertia terms is

    J S = sum [(s_ij u_i,k - (W + L) d_jk) q_k,j + rho (a_i u_i,k - v_i v_i,k) q_k] V,    q_k = q e_k,    S = int g ds

The interaction integral with a known field (marked a) is bilinear in both. Its field is that of plane strain, laid
along the arc: it neither balances nor is its strain that of its displacement, which two more terms account for (M.
Gosz, B. Moran, Eng. Fract. Mech. 69 (2002) 299-319):

    M S = sum [(s_ij ua_i,k + sa_ij u_i,k - sa_mn e_mn d_jk) q_k,j
               + (s_ij (ua_i,jk - ea_ij,k) + sa_ij,j u_i,k + rho a_i ua_i,k) q_k] V

All of this is in the frame of each place: growth, normal of the crack, tangent of the arc (1, 2, 3). Faces under
pressure add what `loaded_faces` says.

Symbols: s stress, Pa; u displacement, m; H its gradient; v, a its rates; e strain; W strain energy and L kinetic
energy, J/m^3; rho density; V a node's volume, m^3; r distance from the arc, s length along it, m; c its curvature, 1/m,
positive if the crack is convex; d the unit tensor.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.fracture.domain_integrals import SampledMotion, kink
from pdsolve.fracture.fields import Elastic, FrontField, front_field
from pdsolve.fracture.loaded_faces import LoadedFaces, at_front, changes_along, closed

AT_FRONT = 1e-9  # of a tube: a node this near to the front does not count, where the other fields are infinite
STRAIGHT = 1e-9  # of a tube's radius over that of the arc: no arc
UNITS = np.eye(3)


class FrontPlace(NamedTuple):
    """A point of a crack front and the arc that the front follows there."""

    place: NDArray[np.float64]  # (3,) m
    frame: NDArray[np.float64]  # (3, 3) rows: direction of growth, normal of the crack, tangent of the front
    curvature: float  # 1/m, positive if the crack is convex


class Tube(NamedTuple):
    """The tube over which q falls from 1 to 0."""

    inner: float  # m, radii from the front
    outer: float
    half: float  # m, half of its length


class FrontFieldSamples(NamedTuple):
    """The fields at n nodes; a node without a gradient (NaN) is left out."""

    position: NDArray[np.float64]  # (n, 3) m
    volume: NDArray[np.float64]  # (n,) m^3
    gradient: NDArray[np.float64]  # (n, 3, 3) du_a / dx_b
    strain: NDArray[np.float64]  # (n, 3, 3)
    stress: NDArray[np.float64]  # (n, 3, 3) Pa
    motion: SampledMotion | None = None  # None: at rest
    work: NDArray[np.float64] | None = None  # (n,) of the stress, J/m^3; None: that of an elastic solid


class FrontParameters(NamedTuple):
    """J and the stress intensities at a point of a front."""

    J: float  # J/m^2
    K1: float  # Pa m^0.5
    K2: float
    K3: float

    @property
    def angle(self) -> float:
        """Predicted angle of growth across the front, degrees, positive towards the normal; NaN without intensities."""
        return kink(self.K1, self.K2)


class _Around(NamedTuple):
    """Nodes in a tube, in the frames of their places."""

    z: NDArray[np.complex128]  # (n,) m, across the front
    bend: NDArray[np.float64]  # (n,) 1/m, one over the distance from the centre of the arc
    q: NDArray[np.float64]  # (n,)
    slope: NDArray[np.float64]  # (n, 3) gradient of q, 1/m
    at: FrontFieldSamples


def front_integrals(
    at: FrontFieldSamples, front_place: FrontPlace, tube: Tube, solid: Elastic, faces: LoadedFaces | None = None
) -> FrontParameters:
    """J and stress intensities at a point of a front; `solid` is in plane strain, `faces` are under pressure."""
    around = _around(at, front_place, tube)
    # J times the length of the front that q counts, J/m
    _, bend, q, slope, sampled = around
    H, s = sampled.gradient, sampled.stress
    energy = np.einsum("nij,nij->n", s, sampled.strain) / 2 if sampled.work is None else sampled.work
    total = np.einsum("nij,ni,nj->n", s, H[:, :, 0], slope)
    if sampled.motion is not None:
        density, v, a, rates = sampled.motion
        energy = energy + density * (v * v).sum(axis=1) / 2
        total += density * q * (a * H[:, :, 0] - v * rates[:, :, 0]).sum(axis=1)
    total += ((s[:, :, 2] * H[:, :, 2]).sum(axis=1) - energy) * q * bend - energy * slope[:, 0]
    J = float(sampled.volume @ total) / tube.half
    factors = (solid.effective_modulus / 2, solid.effective_modulus / 2, solid.shear)
    K1, K2, K3 = (
        factor * _between(around, front_field(around.z, solid, *mode)) / tube.half
        for mode, factor in zip(UNITS.tolist(), factors, strict=True)
    )
    if faces is None:
        return FrontParameters(J, K1, K2, K3)
    of_J, *of_K = (value / tube.half for value in _pushed(faces, front_place, tube, solid))
    K1, K2, K3 = (K + factor * more for K, factor, more in zip((K1, K2, K3), factors, of_K, strict=True))
    return FrontParameters(J + of_J, K1, K2, K3)


def _pushed(faces: LoadedFaces, front_place: FrontPlace, tube: Tube, solid: Elastic) -> tuple[float, ...]:
    """What pressure on faces adds to J and to the interaction integrals with modes 1, 2 and 3, times the length that q
    counts."""
    x, y, s, _ = across(faces.middle, front_place)
    rows = np.flatnonzero((np.hypot(x, y) < tube.outer) & (np.abs(s) < tube.half))
    if not len(rows):
        return 0.0, 0.0, 0.0, 0.0
    faces, x, y, s = faces.part(rows), x[rows], y[rows], s[rows]
    q = _step((np.hypot(x, y) - tube.inner) / (tube.outer - tube.inner))[0] * _step(np.abs(s) / tube.half)[0]
    turn = np.einsum("nab,bc->nac", _turned(faces.middle, front_place), front_place.frame)
    force = np.einsum("fab,fb->fa", turn, faces.force)
    out, up, _, _ = (values.reshape(-1, 3) for values in across(faces.corners.reshape(-1, 3), front_place))
    together = at_front(faces, np.hypot(out, up))
    displacement = closed(np.einsum("fab,fcb->fca", turn, faces.displacement), together)
    below = np.einsum("fa,fa->f", turn[:, 1], faces.outward) > 0  # the material is, of an upper normal
    behind = np.minimum(np.where(together, 0.0, out), 0.0) - AT_FRONT * tube.outer
    z = (behind * (1 + 1j * AT_FRONT * np.where(below, 1.0, -1.0)[:, None])).reshape(-1)
    fields = [front_field(z, solid, *mode).u.reshape(-1, 3, 3) for mode in UNITS.tolist()]
    return tuple(
        -float(((force * changes_along(faces.corners, turn[:, 0], values)).sum(axis=1) * q).sum())
        for values in (displacement, *fields)
    )


def across(
    position: NDArray[np.float64], front_place: FrontPlace
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Along growth, along the normal and along the arc (n,), m, of places (n, 3), and distances from the arc's centre
    over its radius (n,); these are not positive where the arc is no front any more."""
    x, y, w = ((position - front_place.place) @ front_place.frame.T).T
    c = front_place.curvature
    if abs(c) * max(float(np.abs(x).max(initial=0.0)), 1e-300) < STRAIGHT:
        return x, y, w, np.ones(len(x))
    far = np.hypot(1 + c * x, c * w)
    out = (2 * x + c * (x * x + w * w)) / (far + 1)
    return out, y, np.arctan2(c * w, 1 + c * x) / c, far


def _around(at: FrontFieldSamples, front_place: FrontPlace, tube: Tube) -> _Around:
    reach = np.hypot(tube.outer, tube.half + tube.outer)
    near = np.flatnonzero(((at.position - front_place.place) ** 2).sum(axis=1) < reach**2)
    x, y, s, far = across(at.position[near], front_place)
    r = np.hypot(x, y)
    inside = (r < tube.outer) & (r > AT_FRONT * tube.outer) & (np.abs(s) < tube.half)
    inside &= np.isfinite(at.gradient[near]).all(axis=(1, 2))
    rows, x, y, s, far, r = near[inside], x[inside], y[inside], s[inside], far[inside], r[inside]
    f, falls = _step((r - tube.inner) / (tube.outer - tube.inner))
    g, ends = _step(np.abs(s) / tube.half)
    falls, ends = falls / (tube.outer - tube.inner), ends * np.sign(s) / tube.half
    slope = np.column_stack([falls * x / r * g, falls * y / r * g, f * ends / far])
    turn = np.einsum("nab,bc->nac", _turned(at.position[rows], front_place), front_place.frame)

    def tensor(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(turn @ values[rows] @ turn.transpose(0, 2, 1))

    def way(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.einsum("nab,nb->na", turn, values[rows]))

    motion = at.motion
    if motion is not None:
        motion = SampledMotion(motion.density, way(motion.velocity), way(motion.acceleration), tensor(motion.rates))
    gradient, strain, stress = (tensor(values) for values in (at.gradient, at.strain, at.stress))
    sampled = FrontFieldSamples(at.position[rows], at.volume[rows], gradient, strain, stress, motion)
    return _Around(x + 1j * y, front_place.curvature / far, f * g, slope, sampled)


def _turned(position: NDArray[np.float64], front_place: FrontPlace) -> NDArray[np.float64]:
    """Turns (n, 3, 3) about the normal from the frame of a point of the front to those of places (n, 3)."""
    x, _, w = ((position - front_place.place) @ front_place.frame.T).T
    along, aside = 1 + front_place.curvature * x, front_place.curvature * w
    far = np.hypot(along, aside)
    turn = np.zeros((len(x), 3, 3))
    turn[:, 0, 0] = turn[:, 2, 2] = along / far
    turn[:, 0, 2], turn[:, 2, 0] = aside / far, -aside / far
    turn[:, 1, 1] = 1.0
    return turn


def _step(share: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A cubic (n,) that falls from 1 to 0 between the shares 0 and 1, without slope at both, and its derivative."""
    t = share.clip(0, 1)
    return 1 - t * t * (3 - 2 * t), -6 * t * (1 - t)


def _between(around: _Around, auxiliary: FrontField) -> float:
    """The interaction integral with a field of known intensities, times the length that q counts."""
    _, bend, q, slope, at = around
    H, s, sa = at.gradient, at.stress, auxiliary.stress
    turning = bend[:, None] * np.column_stack([-auxiliary.u[:, 2], 0 * bend, auxiliary.u[:, 0]])  # ua_i,3
    mutual = np.einsum("nij,nij->n", sa, at.strain)
    total = np.einsum("nij,ni,nj->n", s, auxiliary.slope, slope) + np.einsum("nij,ni,nj->n", sa, H[:, :, 0], slope)
    total += ((s[:, :, 2] * turning).sum(axis=1) + (sa[:, :, 2] * H[:, :, 2]).sum(axis=1) - mutual) * q * bend
    total -= mutual * slope[:, 0]
    strain = bend[:, None] * (auxiliary.slope - bend[:, None] * auxiliary.u)  # of the rest ua_i,j - ea_ij, along growth
    total += q * (s[:, 2, 2] * strain[:, 0] - s[:, 0, 2] * strain[:, 2])
    unbalanced = bend[:, None] * np.column_stack([sa[:, 0, 0] - sa[:, 2, 2], sa[:, 0, 1], 2 * sa[:, 0, 2]])
    total += q * (unbalanced * H[:, :, 0]).sum(axis=1)
    if at.motion is not None:
        total += at.motion.density * q * (at.motion.acceleration * auxiliary.slope).sum(axis=1)
    return float(at.volume @ total)
