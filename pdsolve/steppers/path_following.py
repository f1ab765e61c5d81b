"""Path following: a body of softening bonds at rest, along its equilibrium path, by the energy that its bonds spend.

All loads and prescribed displacements grow with one factor, lambda. Up to the first bond that softens, lambda is scaled
until that bond is at its peak. From there each step prescribes the energy that bonds spend, which never decreases, and
finds lambda as another unknown, so that snap-backs and snap-throughs are followed (C. V. Verhoosel, J. J. C. Remmers,
M. A. Gutierrez, Int. J. Numer. Meth. Engng 77 (2009) 1290-1321). A monitored opening may take the energy's place.

    u  displacements of free components       D  energy spent, or opening    R  residual forces, N/m
    K  consistent tangent, N/m^2              q  dD / du                     p  d(forces) / d(lambda) at fixed u
    K a = R,  K b = p,  d lambda = (dD - (D - D_n) - q a) / (q b),  du = a + d lambda b

Units are a plate's, by metre of thickness; in space forces are in N, energies in J, stiffnesses in N/m.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.operators.softening_bonds import Response, SofteningBonds
from pdsolve.steppers.equilibrium import Tell, UnsettledError, norm
from pdsolve.steppers.old_factors import Solver
from pdsolve.steppers.path_control import Control

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.float64]

MOST = 12  # iterations; a step that needs more is halved
FEW = 5  # iterations: a step that needs no more grows by
GROWTH = 1.4
FIRST = 0.05  # of the largest step of dissipation: the first one
LEAST = 1e-4  # of it: smaller ones are not tried
NEAR = 0.01  # of a step of the control, by which it may be missed
CONVERGING = 20  # iterations of one whose residual has been halved in each beyond MOST
UNDECIDED = 2  # times that a bond has begun or ceased to load within a step: it gets a mean slope, lest it goes on so
DECIDED = 3  # iterations without another turn, after which it gets its own slope again
STEADY = 3  # bonds that turned in an iteration of secants, at most: tangents converge from there
FAR = 0.5  # of the largest displacement: an iteration goes no further


class Path(NamedTuple):
    """A place on the path."""

    value: Array  # (n, d) m
    factor: float  # lambda
    spent: float  # J/m


class Proportional(NamedTuple):
    """Loads and holds (n, d) that grow with one factor."""

    held: NDArray[np.bool_]
    start: Array  # N/m, and m where held, at lambda = 0
    growth: Array  # of it, from lambda = 0 to 1

    def at(self, factor: float) -> Array:
        """Forces, N/m, and places, m."""
        return self.start + factor * self.growth


class Turns:
    """How often bonds (b,) have begun or ceased to load within a step."""

    def __init__(self, loads: NDArray[np.bool_]) -> None:
        self._loads, self._times, self._since = loads, np.zeros(len(loads), dtype=int), np.zeros(len(loads), dtype=int)

    def note(self, loads: NDArray[np.bool_], counts: bool) -> int:
        """Take those that load in the next iteration, whose turns count or not; returns how many have turned."""
        turned = loads != self._loads
        self._times += turned & counts
        self._since = np.where(turned, 0, self._since + 1)
        self._loads = loads
        return int(turned.sum())

    def torn(self) -> NDArray[np.bool_]:
        """Bonds that load, and turned often and lately."""
        return np.asarray((self._times >= UNDECIDED) & (self._since < DECIDED) & self._loads)


class Follower:
    """Finds equilibria of softening bonds."""

    def __init__(self, bonds: SofteningBonds, drive: Proportional, tolerance: float, control: Control) -> None:
        self.bonds, self.drive, self._tolerance, self.control = bonds, drive, tolerance, control
        self._free = np.flatnonzero(~drive.held.ravel())
        self.solver = Solver(bonds.symmetric)
        self.largest = 0.0  # N/m, norm of the forces from outside so far: the measure of residuals

    def settle(self, start: Array, factor: float, tell: Tell) -> tuple[Path, int, float]:
        """Equilibrium at this lambda by Newton's method with a line search, its iterations and residual.

        Raises UnsettledError.
        """
        drive, free = self.drive, self._free
        at = drive.at(factor)
        value, response = start.copy(), self.bonds.respond(start)
        way = np.where(drive.held, at - start, 0.0)
        rest, matrix = self._rest(response, at), self.bonds.tangent(response)
        step = self.solver.solve(matrix[free][:, free], rest - (matrix @ way.ravel())[free], True)
        value[drive.held] = at[drive.held]
        value.ravel()[free] += step
        for iteration in range(1, 2 * MOST):
            response = self.bonds.respond(value)
            rest = self._rest(response, at)
            residual = self._left(response, at, rest)
            tell(iteration, residual)
            if residual < self._tolerance:
                self.largest = max(self.largest, self._outside(response, at))
                return Path(value, factor, response.spent), iteration, residual
            step = self.solver.solve(self.bonds.tangent(response)[free][:, free], rest, False)
            size, before = 1.0, norm(rest)
            while size > 1e-3:
                tried = value.copy()
                tried.ravel()[free] += size * step
                if norm(self._rest(self.bonds.respond(tried), at)) < before:
                    break
                size /= 2
            value = tried
        raise UnsettledError(f"no equilibrium at {factor:.4g} of the loads after {2 * MOST} iterations")

    def follow(
        self, last: Path, guess: Path | None, more: float, tell: Tell, secants: int = 0, steady: int = STEADY
    ) -> tuple[Path, int, float]:
        """The equilibrium where the control is by `more` larger than at the last one, its iterations and its residual.

        `guess` is a place to begin with; None: along the last direction of the secants. So many first iterations take
        `secants` for tangents, which leads from further away; fewer if no more than `steady` bonds turn in one. Raises
        UnsettledError.
        """
        free = self._free
        if guess is None:
            guess = self._along(last, more)
        value, factor, begin = guess.value.copy(), guess.factor, self.control.measure(last.value, last.spent)
        reach = FAR * max(float(np.abs(last.value).max()), float(np.abs(value).max()))
        response, residual = self.bonds.respond(value), np.inf
        turns = Turns(response.releases > 0)
        for iteration in range(secants + CONVERGING + 1):
            at = self.drive.at(factor)
            rest = self._rest(response, at)
            before, residual = residual, self._left(response, at, rest)
            missed = more - (self.control.measure(value, response.spent) - begin)
            tell(iteration, residual)
            if residual < self._tolerance and abs(missed) < NEAR * more:
                self.largest = max(self.largest, self._outside(response, at))
                return Path(value, factor, response.spent), iteration, residual
            last_one = secants + (MOST if residual > before / 2 else CONVERGING)
            if not np.isfinite(residual) or iteration >= last_one:
                break
            if turns.note(response.releases > 0, iteration >= secants) <= steady and iteration:
                secants = min(secants, iteration)
            mean = response._replace(
                slope=np.where(turns.torn(), (response.slope + response.secant) / 2, response.slope)
            )
            matrix = self.bonds.tangent(mean, iteration < secants)
            inner, pushed = matrix[free][:, free], self._pushed(matrix)
            a, b = self.solver.solve(inner, np.column_stack([rest, pushed]), iteration == 0).T
            q = self.control.gradient(value, response)
            free_q, held_q = q.ravel()[free], float((q * np.where(self.drive.held, self.drive.growth, 0.0)).sum())
            along = float(free_q @ b) + held_q
            if along == 0 or not np.isfinite(along):
                break
            turn = (missed - float(free_q @ a)) / along
            move = np.where(self.drive.held, turn * self.drive.growth, 0.0)
            move.ravel()[free] = a + turn * b
            size = min(1.0, reach / max(float(np.abs(move).max()), 1e-300))
            value, factor = value + size * move, factor + size * turn
            response = self.bonds.respond(value)
        raise UnsettledError(
            f"no equilibrium where {self.control.said} {more:.3g} {self.control.unit} more after {iteration}"
            f" iterations (residual {residual:.2g}; tolerance {self._tolerance:g} of the external forces)"
        )

    def left(self, at: Path) -> float:
        """What is left of the forces at a place, over the largest from outside so far."""
        response, outside = self.bonds.respond(at.value), self.drive.at(at.factor)
        return self._left(response, outside, self._rest(response, outside))

    def direction(self, response: Response) -> Array:
        """Derivative (n, d) of displacements by lambda, of bonds that are straight."""
        matrix = self.bonds.tangent(response, secant=True)
        free = self._free
        way = np.where(self.drive.held, self.drive.growth, 0.0)
        way.ravel()[free] = self.solver.solve(matrix[free][:, free], self._pushed(matrix), True)
        return way

    def _along(self, last: Path, more: float) -> Path:
        """Where the control is by `more` larger, along the straight direction of growing loads."""
        way = self.direction(self.bonds.respond(last.value))
        begin, turn = self.control.measure(last.value, last.spent), max(last.factor, 1e-6) * 1e-3

        def growth_along(at: float) -> float:
            value = last.value + at * way
            return self.control.measure(value, self.bonds.respond(value).spent) - begin

        while growth_along(turn) < more and turn < 1e3:
            turn *= 2
        low, high = 0.0, turn
        for _ in range(40):
            middle = (low + high) / 2
            low, high = (middle, high) if growth_along(middle) < more else (low, middle)
        return Path(last.value + high * way, last.factor + high, last.spent)

    def _pushed(self, matrix: csr_array) -> Array:
        """Forces (f,) that lambda adds on free components at fixed displacements of these, N/m."""
        way = np.where(self.drive.held, self.drive.growth, 0.0).ravel()
        return np.asarray((self.drive.growth.ravel() - matrix @ way)[self._free])

    def _rest(self, response: Response, at: Array) -> Array:
        return np.asarray((self.bonds.forces(response) + at).ravel()[self._free])

    def _outside(self, response: Response, at: Array) -> float:
        constrained = self.drive.held
        return max(norm(at[~constrained]), norm(self.bonds.forces(response)[constrained]))

    def _left(self, response: Response, at: Array, rest: Array) -> float:
        scale = max(self.largest, self._outside(response, at))
        return norm(rest) / scale if scale > 0 else float(norm(rest) > 0)
