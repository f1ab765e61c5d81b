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
    spent: float  # J/m, by all bonds since they were made
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
        self._pattern: tuple[Index, Index, Index] | None = None
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
        eta = value[self.target] - value[self.source]
        e = ((2 * self.xi + eta) * eta).sum(axis=1) / self.length**2
        return np.asarray(e / (np.sqrt(1 + e) + 1))

    def respond(self, value: Array) -> Response:
        """The response at displacements (n, d) after the history `kappa`."""
        y = self.xi + value[self.target] - value[self.source]
        s, now, c = self.stretches(value), np.sqrt((y**2).sum(axis=1)), self.stiffness
        softened = self._soften(s)
        if self._pair.elastic_in_compression:
            pressed = self.breaks[(s < 0)[self.breaks] & (softened.kappa < self.limit)[self.breaks]]
            softened.omega[pressed] = softened.slope[pressed] = 1.0
        releases = c * self.length * softened.releases / 2
        spent, along = float(self.dissipated_energy(softened.kappa).sum()), y / now[:, None]
        return Response(
            along,
            now,
            softened.kappa,
            c * (softened.omega * s),
            c * softened.slope,
            c * softened.omega,
            releases,
            spent,
            value=value.copy(),
        )

    def _soften(self, drive: Array) -> Softened:
        """The state of bonds (b,) at these drives, of springs their stretches, after the history `kappa`."""
        slope = np.ones(len(drive))
        releases = np.zeros(len(drive))
        kappa = self.kappa.copy()
        omega = np.ones(len(drive))
        k = self.breaks
        bond_drive, before, peak, limit = drive[k], self.kappa[k], self.peak[k], self.limit[k]
        grows = bond_drive > np.maximum(before, peak)
        worst = np.minimum(np.where(grows, bond_drive, before), limit)
        has_history = worst > 0
        secant, curve = np.ones(len(k)), np.zeros(len(k))
        at = worst[has_history], peak[has_history], limit[has_history]
        secant[has_history] = (
            self._pair.secant(None, bond_drive[has_history], *at) if self._pair.secant is not None else 1.0
        )
        curve[has_history] = self._softening.softening_slope(None, *at)
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
        out = np.empty((self._nodes, pull.shape[1]))
        for a in range(pull.shape[1]):
            at_target = np.bincount(self.target, pull[:, a], self._nodes)
            out[:, a] = np.bincount(self.source, pull[:, a], self._nodes) - at_target
        return out

    def tangent(self, response: Response, secant: bool = False) -> csr_array:
        """Minus the derivative (n d, n d) of the forces by the displacements, N/m^2; `secant`: of straight bonds."""
        d, n, slope = self.xi.shape[1], response.along, response.secant if secant else response.slope
        outer = n[:, :, None] * n[:, None, :]
        block = (slope / self.length)[:, None, None] * outer
        block += (response.force / response.length)[:, None, None] * (np.eye(d) - outer)
        return self._assembled(np.concatenate([block, block, -block, -block]))

    def _assembled(self, blocks: Array) -> csr_array:
        """The matrix (n w, n w) of supports and of blocks (4 b, w, w): source-source, target-target, source-target,
        target-source."""
        from scipy.sparse import csr_array  # SciPy takes long to import, and few runs ask

        w = blocks.shape[1]
        if self._pattern is None:
            i, j = self.source, self.target
            rows, columns = np.concatenate([i, j, i, j]), np.concatenate([i, j, j, i])
            a, b = (index.ravel() for index in np.indices((w, w)))
            key = (w * rows[:, None] + a) * (w * self._nodes) + w * columns[:, None] + b
            unique, place = np.unique(key.ravel(), return_inverse=True)
            row, column = np.divmod(unique, w * self._nodes)
            indptr = np.searchsorted(row, np.arange(w * self._nodes + 1))
            self._pattern = indptr.astype(np.int64), column, place.ravel()
        indptr, indices, place = self._pattern
        data = np.bincount(place, blocks.ravel(), len(indices))
        matrix = csr_array((data, indices, indptr), (w * self._nodes, w * self._nodes))
        return matrix if self._ground is None else (matrix + self._ground).tocsr()
