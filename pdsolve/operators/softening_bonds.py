r"""Softening bonds at rest: their forces, consistent tangent and dissipation, as functions of the displacements alone.

A pair of nodes has one bond here. Symbols, of a bond of length xi:

    s       stretch                        kappa   largest stretch above the peak so far, 0 if never there
    sigma   force over C                   omega   secant, sigma / kappa
    C       force at unit stretch, N/m     D       energy spent, J/m

While kappa grows sigma follows the law's curve, whose slope is sigma'; below it sigma = omega s. The spent energy has
the derivative dD / dkappa = C xi (sigma - sigma' kappa) / 2. Units are a plate's, by metre of thickness; in space
forces are in N, energies in J and stiffnesses of nodes in N/m.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import Assembly
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.laws.law import Law
from pdsolve.state import Broken

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.float64]
Index = NDArray[np.int64]
NONE = np.zeros((0, 2))


class Response(NamedTuple):
    """What bonds (b,) do at some displacements, after a history kappa."""

    along: Array  # (b, d) unit vectors from source to target
    length: Array  # (b,) m, now
    kappa: Array  # (b,) with the stretches of now
    force: Array  # (b,) N/m; with shear (b, 2), along and across
    slope: Array  # (b,) of the force by the stretch, N/m
    secant: Array  # (b,) of bonds that unload, N/m
    releases: Array  # (b,) derivative of the spent energy by the stretch, J/m
    dissipated_energy: float  # J/m, by all bonds since they were made
    toward: Array = NONE  # (b, 2) with shear: derivative of the drive by both strains
    value: Array = NONE  # (n, d) m, displacements of nodes, where they have forces beside those of bonds


class Softened(NamedTuple):
    """State of bonds (b,) at some drives."""

    kappa: Array  # with these
    omega: Array  # secant over the first stiffness
    slope: Array  # of the force over that by the drive, omega where kappa does not grow
    releases: Array  # sigma - sigma' kappa where it does, else 0


class SofteningBonds:
    """The bonds of n nodes, each pair once, in the order of their nodes."""

    symmetric = True  # the tangent

    def __init__(self, law: Law, assembly: Assembly) -> None:
        """Bonds of a pair law that conserve momentum: area times stiffness is the same from both ends."""
        curve = law.pair or law.curve
        assert curve is not None
        assert curve.softening is not None
        bonds, nodes = assembly.bonds, len(assembly.area)
        source, target = bonds.source, bonds.neighbour.astype(np.int64)
        once = np.flatnonzero(source < target)
        self.source, self.target, self.xi = source[once], target[once], bonds.xi[once].astype(float)
        self.length = np.sqrt((self.xi**2).sum(axis=1))
        self.stiffness = bonds.stiffness[once] * assembly.area[self.source]
        self.peak, self.limit = bonds.peak[once].astype(float), bonds.limit[once].astype(float)
        self.breaks = np.flatnonzero(np.isfinite(self.limit))
        self.kappa = np.zeros(len(once))
        self._pair, self._softening, self._nodes = curve, curve.softening, nodes
        self._pattern: tuple[Index, Index, Index] | None = None  # of the tangent: row starts, columns, places of blocks
        self._ground: csr_array | None = None

    def stand_on(self, stiffness: csr_array) -> None:
        """Add spring supports and pins of this stiffness (n w, n w), N/m^2: symmetric, on n nodes."""
        self._ground = stiffness

    def restore(self, checkpoint: Mapping[str, NDArray[Any]], broken: Broken) -> None:
        """Take the history of these bonds over from an operator."""
        key, self.kappa[:] = self.source * self._nodes + self.target, 0.0
        order = np.argsort(key)
        soft = checkpoint["worst_source"] < checkpoint["worst_target"]
        once = checkpoint["worst_source"][soft] * self._nodes + checkpoint["worst_target"][soft]
        self.kappa[order[np.searchsorted(key, once, sorter=order)]] = checkpoint["worst"][soft]
        is_forward = broken.source < broken.target
        once = broken.source[is_forward] * self._nodes + broken.target[is_forward]
        k = order[np.searchsorted(key, once, sorter=order)]
        self.kappa[k] = self.limit[k]

    def stretches(self, value: Array) -> Array:
        """Stretches (b,) at these displacements (n, d), without cancellation."""
        return self._kinematics(value)[0]

    def _kinematics(self, value: Array) -> tuple[Array, Array, Array]:
        """Stretches (b,), unit vectors (b, d) from source to target, and lengths (b,), m, at displacements (n, d)."""
        stretch, along, now = np.empty(len(self.xi)), np.empty(self.xi.shape), np.empty(len(self.xi))
        _stretch_and_direct(self.source, self.target, self.xi, self.length, value, stretch, along, now)
        return stretch, along, now

    def respond(self, value: Array) -> Response:
        """The response at displacements (n, d) after the history `kappa`."""
        c = self.stiffness
        s, along, now = self._kinematics(value)
        softened = self._soften(s)
        if self._pair.elastic_in_compression:
            pressed = self.breaks[(s < 0)[self.breaks] & (softened.kappa < self.limit)[self.breaks]]
            softened.omega[pressed] = softened.slope[pressed] = 1.0
        releases = c * self.length * softened.releases / 2
        dissipated_energy = float(self.dissipated_energy(softened.kappa).sum())
        return Response(
            along,
            now,
            softened.kappa,
            c * (softened.omega * s),
            c * softened.slope,
            c * softened.omega,
            releases,
            dissipated_energy,
            value=value.copy(),
        )

    def _soften(self, drive: Array) -> Softened:
        """The state of bonds (b,) at these drives, of springs their stretches, after the history `kappa`."""
        slope, omega, releases = np.ones(len(drive)), np.ones(len(drive)), np.zeros(len(drive))
        kappa = self.kappa.copy()
        peak, limit = self.peak[self.breaks], self.limit[self.breaks]
        soft = (drive[self.breaks] > peak) | (kappa[self.breaks] > 0)
        k, peak, limit = self.breaks[soft], peak[soft], limit[soft]
        grows = drive[k] > np.maximum(kappa[k], peak)
        worst = np.minimum(np.where(grows, drive[k], kappa[k]), limit)
        secant = np.ones(len(k)) if self._pair.secant is None else self._pair.secant(None, drive[k], worst, peak, limit)
        curve = self._softening.softening_slope(None, worst, peak, limit)
        secant[worst >= limit] = curve[worst >= limit] = 0.0
        on = grows & (worst < limit)
        kappa[k], omega[k], slope[k] = worst, secant, np.where(on, curve, secant)
        releases[k] = np.where(on, secant * worst - curve * worst, 0.0)
        return Softened(kappa, omega, slope, releases)

    def dissipated_energy(self, kappa: Array) -> Array:
        """Energy (b,), J/m, that bonds have spent at this history."""
        energy, k = np.zeros(len(kappa)), self.breaks[kappa[self.breaks] > 0]
        c, worst, peak, limit = self.stiffness[k] * self.length[k] / 2, kappa[k], self.peak[k], self.limit[k]
        is_broken = worst >= limit
        energy[k] = np.where(is_broken, self._softening.total_dissipated_energy(None, c, peak, limit), 0.0)
        unbroken = ~is_broken
        at = c[unbroken], worst[unbroken], peak[unbroken], limit[unbroken]
        energy[k[unbroken]] = self._softening.dissipated_energy(None, *at)
        return energy

    def forces(self, response: Response) -> Array:
        """Forces (n, d) of bonds and of supports on nodes, N/m."""
        return self._with_ground(response.value, self._summed(response.force[:, None] * response.along))

    def _with_ground(self, value: Array, force: Array) -> Array:
        """These forces (n, w) and those of supports at displacements (n, w), N/m."""
        return force if self._ground is None else force - (self._ground @ value.ravel()).reshape(value.shape)

    def gradient(self, response: Response) -> Array:
        """Derivative (n, d) of the spent energy by the displacements, N/m."""
        return -self._summed((response.releases / self.length)[:, None] * response.along)

    def _summed(self, pull: Array) -> Array:
        """Sums (n, d) at nodes of what acts on the source, and reversed on the target."""
        out, at_target = np.zeros((2, self._nodes, pull.shape[1]))
        _add_at_both_ends(self.source, self.target, pull, out, at_target)
        return np.asarray(out - at_target)

    def tangent(self, response: Response, secant: bool = False) -> csr_array:
        """Minus the derivative (n d, n d) of the forces by the displacements, N/m^2; `secant`: of straight bonds."""
        slope = response.secant if secant else response.slope
        block = np.empty((*self.xi.shape, self.xi.shape[1]))
        _set_spring_blocks(response.along, slope / self.length, response.force / response.length, block)
        return self._assembled((block, block, block, block), (1.0, 1.0, -1.0, -1.0))

    def _assembled(self, blocks: tuple[Array, ...], signs: tuple[float, ...] = (1.0, 1.0, 1.0, 1.0)) -> csr_array:
        """The matrix (n w, n w) of supports and of blocks (b, w, w), times their signs: source-source, target-target,
        source-target, target-source. All matrices have the same pattern."""
        from scipy.sparse import csr_array  # SciPy takes long to import, and few runs ask

        w, size = blocks[0].shape[1], blocks[0].shape[1] * self._nodes
        ground = csr_array((size, size)) if self._ground is None else self._ground
        if self._pattern is None:
            i, j = self.source, self.target
            rows, columns = np.concatenate([i, j, i, j]), np.concatenate([i, j, j, i])
            a, b = (index.ravel() for index in np.indices((w, w)))
            key = ((w * rows[:, None] + a) * size + w * columns[:, None] + b).ravel()
            supports = ground.tocoo()
            key = np.concatenate([key, supports.row.astype(np.int64) * size + supports.col])
            unique, place = np.unique(key, return_inverse=True)
            row, column = np.divmod(unique, size)
            indptr = np.searchsorted(row, np.arange(size + 1))
            self._pattern = indptr.astype(np.int32), column.astype(np.int32), place.astype(np.int32)
        indptr, indices, place = self._pattern
        data = np.zeros(len(indices))
        at_blocks = place[: 4 * blocks[0].size].reshape(4, *blocks[0].shape)
        for at, block, sign in zip(at_blocks, blocks, signs, strict=True):
            _add_blocks(at, block, sign, data)
        data[place[4 * blocks[0].size :]] += ground.tocoo().data
        return csr_array((data, indices, indptr), (size, size))


@cached_njit(error_model="numpy")
def _stretch_and_direct(source, target, xi, length, value, stretch, along, now):  # type: ignore[no-untyped-def]
    """Set stretches (b,), unit vectors (b, d) and lengths (b,) of bonds at displacements (n, d)."""
    for k in range(len(source)):
        i, j = source[k], target[k]
        more, square = 0.0, 0.0
        for axis in range(xi.shape[1]):
            x = xi[k, axis]
            eta, y = value[j, axis] - value[i, axis], x + value[j, axis] - value[i, axis]
            more += (2 * x + eta) * eta
            square += y * y
            along[k, axis] = y
        e = more / (length[k] * length[k])
        stretch[k], now[k] = e / (np.sqrt(1 + e) + 1), np.sqrt(square)
        for axis in range(xi.shape[1]):
            along[k, axis] /= now[k]


@cached_njit(error_model="numpy")
def _add_at_both_ends(source, target, pull, at_source, at_target):  # type: ignore[no-untyped-def]
    """Add what bonds (b, d) do to sums (n, d) at their sources and at their targets."""
    for k in range(len(source)):
        for axis in range(pull.shape[1]):
            at_source[source[k], axis] += pull[k, axis]
            at_target[target[k], axis] += pull[k, axis]


@cached_njit(error_model="numpy")
def _set_spring_blocks(along, axial, transverse, block):  # type: ignore[no-untyped-def]
    """Set the stiffness (b, d, d) of springs, of what they have along and across their direction (b,)."""
    for k in range(len(along)):
        for a in range(along.shape[1]):
            for b in range(along.shape[1]):
                outer = along[k, a] * along[k, b]
                block[k, a, b] = axial[k] * outer + transverse[k] * ((1.0 if a == b else 0.0) - outer)


@cached_njit(error_model="numpy")
def _add_blocks(place, block, sign, data):  # type: ignore[no-untyped-def]
    """Add blocks (b, w, w), times a sign, to the entries of a matrix at these places (b, w, w)."""
    for k in range(len(block)):
        for a in range(block.shape[1]):
            for b in range(block.shape[2]):
                data[place[k, a, b]] += sign * block[k, a, b]
