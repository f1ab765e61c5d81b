"""Breaking of bonds at rest, the most overstretched first; forces are those of lasting bonds until they are removed."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import BondSource, Part
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.model import ModelError
from pdsolve.state import Broken, State

if TYPE_CHECKING:
    from pdsolve.laws.law import Pair
    from pdsolve.operators.bond_list import BondList
    from pdsolve.operators.protocol import Operator

TIE = 1e-3  # relative: bonds this near to the worst are as bad; they break together, in whatever order nodes are


class Breaking(Protocol):
    """Bonds that break at rest, the worst first."""

    def break_worst(self, operator: Operator, state: State, step: int) -> float:
        """Break the worst bonds over their limit, and book what they held.

        Returns how far over it they are: the largest ratio of the load to that at which the first breaks; 0 if none is.
        """

    def worst(self, value: NDArray[np.float64]) -> float:
        """The largest ratio of the load to that at which a bond breaks, at displacements (n, d); 0 where none is over
        its limit."""

    def restore(self, broken: Broken) -> None:
        """Take these bonds for broken, and no others."""

    def swell(self, strain: NDArray[np.float64]) -> None:
        """Let bonds stretch from these strains (n,) of free nodes."""


class Breakable(NamedTuple):
    """Springs that may break, b of them, in the order of their nodes; see `Breaking`."""

    source: NDArray[np.int64]  # (b,) row of the node whose bond it is
    target: NDArray[np.int64]  # (b,)
    xi: NDArray[np.float64]  # (b, d) m
    stiffness: NDArray[np.float64]  # (b,) force density for a unit stretch, N/m^3
    limit: NDArray[np.float64]  # (b,) stretch at which it breaks
    peak: NDArray[np.float64]  # (b,) the law's other stretch
    intact: NDArray[np.bool_]  # (b,) changes
    strain: NDArray[np.float64]  # (n,) of free nodes, from which bonds stretch; changes
    bond_strain_energy: Callable[..., NDArray[np.float64]] | None = None  # of `Pair`; None: bonds are linear

    def stretches(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """Stretches (b,) at these displacements (n, d), without cancellation."""
        stretches = np.empty(len(self.source))
        _stretch(self.source, self.target, self.xi, self.strain, np.ascontiguousarray(value, dtype=float), stretches)
        return stretches

    def break_worst(self, operator: Operator, state: State, step: int) -> float:
        """Break the most overstretched."""
        stretches = self.stretches(state.value)
        over = np.empty(len(stretches))
        most = float(_set_overloads(stretches, self.limit, self.intact, over))
        which = np.flatnonzero(over > max(1.0, (1 - TIE) * most))
        if not len(which):
            return 0.0
        self.part(operator, state, step, which, stretches)
        return most

    def worst(self, value: NDArray[np.float64]) -> float:
        """By stretches over their limits, of intact bonds."""
        most = float((self.stretches(value) / self.limit)[self.intact].max(initial=0.0))
        return most if most > 1 else 0.0

    def part(
        self, operator: Operator, state: State, step: int, which: NDArray[np.int64], stretches: NDArray[np.float64]
    ) -> None:
        """Break these bonds (k,), of all with stretches (b,), and book half of what each holds at its own node."""
        length = np.sqrt((self.xi[which] ** 2).sum(axis=1))
        c, s = self.stiffness[which] * length / 4, stretches[which]
        bond_energy = c * s**2
        if self.bond_strain_energy is not None:
            bond_energy = self.bond_strain_energy(None, c, s, np.zeros_like(s), self.peak[which], self.limit[which])
        state.dissipated[:] += np.bincount(self.source[which], bond_energy, minlength=len(self.strain))
        self.intact[which] = False
        new = Broken(np.full(len(which), step), self.source[which], self.target[which])
        broken = Broken(*(np.concatenate(both) for both in zip(operator.broken(), new, strict=True)))
        operator.restore(operator.checkpoint_arrays(), broken)

    def restore(self, broken: Broken) -> None:
        """Mark the others intact."""
        nodes = len(self.strain)
        self.intact[:] = ~np.isin(self.source * nodes + self.target, broken.source * nodes + broken.target)

    def swell(self, strain: NDArray[np.float64]) -> None:
        """Keep the strains (n,)."""
        self.strain[:] = strain


@cached_njit(error_model="numpy")
def _stretch(source, target, xi, strain, value, out):  # type: ignore[no-untyped-def]
    """Set `out` (b,) to the stretches of bonds; see `Breakable`."""
    for k in range(len(source)):
        i, j = source[k], target[k]
        free = (strain[i] + strain[j]) / 2
        more, square = 0.0, 0.0
        for axis in range(xi.shape[1]):
            x = xi[k, axis]
            eta = value[j, axis] - value[i, axis] - free * x
            more += (2 * x + eta) * eta
            square += x * x
        e = more / square
        out[k] = e / (np.sqrt(1 + e) + 1)


@cached_njit(error_model="numpy")
def _set_overloads(stretches, limit, intact, out):  # type: ignore[no-untyped-def]
    """Set `out` (b,) to stretches over their limits, 0 of broken bonds; returns the largest, 0 at least."""
    most = 0.0
    for k in range(len(stretches)):
        out[k] = stretches[k] / limit[k] if intact[k] else 0.0
        most = max(most, out[k])
    return most


class FamilyBonds:
    """Bonds of nodes that know their families: a law says which fail; see `Breaking`.

    The worst fail first if all displacements grow in proportion, which is found by bisection.
    """

    def __init__(self, operator: BondList) -> None:
        self._operator = operator

    def break_worst(self, operator: Operator, state: State, step: int) -> float:
        """Break what fails at the least share of the displacements; the family loses what it held less."""
        which, most = self._first(state.value)
        if most:
            self._operator.sever(state, which, step)
        return most

    def worst(self, value: NDArray[np.float64]) -> float:
        """By the share of the displacements at which the first fails."""
        return self._first(value)[1]

    def _first(self, value: NDArray[np.float64]) -> tuple[NDArray[np.int64], float]:
        """The bonds (k,) that fail at the least share of the displacements, and its inverse; 0 where none fails."""
        which, low, high = self._operator.failing(value), 0.0, 1.0
        if not len(which):
            return which, 0.0
        while high - low > TIE * high:
            middle = (low + high) / 2
            failing_bonds = self._operator.failing(middle * value)
            low, high, which = (low, middle, failing_bonds) if len(failing_bonds) else (middle, high, which)
        return which, 1 / high

    def restore(self, broken: Broken) -> None:
        """Does nothing: the operator knows."""

    def swell(self, strain: NDArray[np.float64]) -> None:
        """Does nothing: the operator knows."""


class StaticBreakage:
    """Makes the bonds of a filling unbreakable, and records those that would break."""

    def __init__(self, filling: BondSource, pair: Pair | None = None) -> None:
        """`pair` is the bonds' law, if they are independent: those of a curve keep it up to its limit."""
        elastic_curve = pair is not None and pair.is_curved and pair.softening is None
        self._filling, self._pair = filling, pair if elastic_curve else None
        self._columns: dict[int, tuple[NDArray[Any], ...]] = {}  # by first row, as parts may be filled again

    def filling(self) -> BondSource:
        """The filling with unbreakable bonds."""
        return self._filling._replace(part=self._part)

    def breakable(self) -> Breakable | None:
        """Bonds with a limit; None without any."""
        if not self._columns:
            for _ in self.filling().parts():
                pass
        columns = [np.concatenate(column) for column in zip(*self._columns.values(), strict=True)]
        columns += [np.ones(len(columns[0]), dtype=bool), np.zeros(len(self._filling.area))]
        if not len(columns[0]):
            return None
        breakable = Breakable(*columns)  # type: ignore[arg-type]
        return breakable if self._pair is None else breakable._replace(bond_strain_energy=self._pair.bond_strain_energy)

    def _part(self, rows: NDArray[np.int64]) -> Part:
        part = self._filling.part(rows)
        bonds = part.bonds
        which = np.flatnonzero(np.isfinite(bonds.limit))
        source = bonds.source[which] + part.first
        target = bonds.neighbour[which].astype(np.int64)
        peak, limit = bonds.peak[which].astype(float), bonds.limit[which].astype(float)
        self._columns[part.first] = (source, target, bonds.xi[which], bonds.stiffness[which], limit, peak)
        for_ever = np.full(len(bonds.limit), np.inf)
        if self._pair is None:
            return part._replace(bonds=bonds._replace(peak=for_ever, limit=for_ever))
        assert self._pair.secant is not None
        for stretch in (limit / 2, limit):
            with np.errstate(all="ignore"):  # of a limit that is infinite
                at_limit, for_ever_there = (
                    self._pair.secant(None, stretch, 0 * stretch, peak, end) for end in (limit, for_ever[which])
                )
            if not np.allclose(at_limit, for_ever_there, rtol=1e-9, atol=0):
                raise ModelError(
                    "$.material.law: its secant depends on the limit at which bonds break; at rest use the peak in"
                    " its place, or declare the softening"
                )
        return part._replace(bonds=bonds._replace(limit=for_ever))
