"""Fatigue at rest: a body under loads that repeat, its bonds tiring in jumps of cycles until the next ones break.

The body rests under the largest loads of the cycle. At the least ones, which are `ratio` of these, bonds that are
linear stretch `ratio` times as far, so that one equilibrium says what both ends of the cycle are. Below a ratio of 0
the faces of a crack are closed at the least loads: the range of bonds next to damage is that of a ratio of 0, as that
of K is. It stays the same from one break to the next: a jump goes there at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Cycled, Fatigue
from pdsolve.bonds.fatigue_life import LEFT, Place, jump, shares
from pdsolve.bonds.static_breakage import Breakable
from pdsolve.checkpoint_validation import entry
from pdsolve.errors import CheckpointError
from pdsolve.operators.protocol import Operator
from pdsolve.rest.equilibrium import Equilibrium, NotConvergedError
from pdsolve.rest.load_steps import LoadSteps
from pdsolve.state import Broken, State
from pdsolve.stepper import Stepper


class CycleSteps(Stepper):
    """Takes steps of some cycles each, until life has ended, between which the body rests under the largest loads."""

    load_factor = 1.0  # of the loads: the largest of a cycle

    def __init__(self, law: Fatigue, operator: Operator, load_steps: LoadSteps, step_description: str) -> None:
        """`step_description` is what a step is."""
        self._law, self._operator, self._motion = law, operator, load_steps
        self.inner = load_steps
        self._cycles = 0.0
        self.description = f"{step_description}, {load_steps.method.description}"
        self.step_results: list[Cycled] = []
        self.end_reason = ""

    def advance(self, state: State, first_step: int, end_step: int) -> int:
        """Take the steps `first_step` to `end_step` - 1, in place, unless life has ended; returns the last one
        taken.

        Raises NotConvergedError.
        """
        for step in range(first_step, end_step):
            if self.finished:
                break
            if step == 1:
                self._motion.advance(state, 1, 2)
            self._motion.method.discard_reused_tangent()
            equilibrium = self._take_cycle_step(state, step, Equilibrium(0, self._motion.step_results[-1].residual))
            broken = len(self._operator.broken().step)
            self.step_results.append(Cycled(step, equilibrium.iterations, equilibrium.residual, self._cycles, broken))
        return self.step_results[-1].step if self.step_results else first_step - 1

    def _take_cycle_step(self, state: State, step: int, previous_equilibrium: Equilibrium) -> Equilibrium:
        """Take a step; returns how what is left settled, `previous_equilibrium` if nothing changed."""
        raise NotImplementedError

    def _record_end_of_life(self, reason: str) -> None:
        self.finished, self.end_reason = True, reason

    def checkpoint_arrays(self) -> dict[str, NDArray[Any]]:
        """Steps so far, for a checkpoint."""
        steps = np.array(self.step_results, dtype=float).reshape(-1, len(Cycled._fields))
        return {"cycled": steps} | self._motion.checkpoint_arrays()

    def restore(self, checkpoint: Mapping[str, NDArray[Any]], state: State, step: int, broken: Broken) -> None:
        """Restore a checkpoint after `step`. Raises CheckpointError."""
        rows = entry(checkpoint, "cycled", (step, len(Cycled._fields)), float)
        if not np.array_equal(rows[:, 0], np.arange(1, step + 1)):
            raise CheckpointError(f"steps of cycles are not 1 to {step}, those until there")
        self.step_results = [Cycled(int(s), int(i), r, c, int(b)) for s, i, r, c, b in rows.tolist()]
        if step:
            self._motion.restore(checkpoint, state, 1, broken)

    def progress_text(self) -> str:
        """The cycles so far, for a progress display."""
        return f"{self._cycles:.4g} cycles"

    def summary(self) -> dict[str, Any]:
        """Cycles and residuals of each step, when bonds broke first, and the estimated errors of the cycles."""
        return {
            "method": self.description,
            "fatigue_steps": [cycled._asdict() for cycled in self.step_results],
            "first_break": None,
            "first_range": None,
            "cycles_error": None,
            "cycles_error_of_jumps": None,
            "ended": self.end_reason or None,
        }


JUMPS = 10  # to a step
NONE_BROKE = -1.0  # in a checkpoint: cycles until the first bonds broke, where none have


class BondFatigueSteps(CycleSteps):
    """Takes steps of jumps with load steps whose bonds may break."""

    def __init__(
        self,
        law: Fatigue,
        operator: Operator,
        load_steps: LoadSteps,
        breakable: Breakable,
        family_size: NDArray[np.int64],
        uncut_bond_count: NDArray[np.int64],
    ) -> None:
        """`family_size` and `uncut_bond_count` (n,) count bonds of nodes: all, and those not cut at first."""
        super().__init__(law, operator, load_steps, "jumps of cycles")
        self._breakable = breakable
        self._family, self._cut = family_size, family_size - uncut_bond_count
        self._life = np.ones(len(breakable.source))
        self._at = Place(0, 0.0)
        self.first, self.range = np.inf, 0.0  # cycles until the first bonds broke, and their range of stretch

    def _take_cycle_step(self, state: State, step: int, previous_equilibrium: Equilibrium) -> Equilibrium:
        equilibrium = previous_equilibrium
        for _ in range(JUMPS):
            if not self.finished:
                equilibrium = self._jump_cycles_to_next_bond_breaks(state, step, equilibrium)
        return equilibrium

    def checkpoint_arrays(self) -> dict[str, NDArray[Any]]:
        """Lives and steps so far, for a checkpoint."""
        first = self.first if np.isfinite(self.first) else NONE_BROKE
        numbers = np.array([self._cycles, first, self.range, *self._at])
        return super().checkpoint_arrays() | {"fatigue_life": self._life, "fatigue_numbers": numbers}

    def restore(self, checkpoint: Mapping[str, NDArray[Any]], state: State, step: int, broken: Broken) -> None:
        """Restore a checkpoint after `step`. Raises CheckpointError."""
        super().restore(checkpoint, state, step, broken)
        self._life[:] = entry(checkpoint, "fatigue_life", self._life.shape, float)
        self._cycles, self.first, self.range, block, done = entry(checkpoint, "fatigue_numbers", (5,), float).tolist()
        self.first = np.inf if self.first == NONE_BROKE else self.first
        if not 0 <= block < max(len(self._law.blocks), 1):
            raise CheckpointError(f"block {block:g} of the loading does not exist; there are {len(self._law.blocks)}")
        self._at = Place(int(block), done)

    def summary(self) -> dict[str, Any]:
        """Cycles of each step and until the first bonds broke, and their range of stretch."""
        first = {"first_break": self.first, "first_range": self.range} if self.step_results else {}
        return super().summary() | first

    def _jump_cycles_to_next_bond_breaks(
        self, state: State, step: int, previous_equilibrium: Equilibrium
    ) -> Equilibrium:
        """Let bonds tire until the next ones break, and settle without these. Returns iterations in all."""
        bonds, law, motion = self._breakable, self._law, self._motion
        stretches = bonds.stretches(state.value)
        broken_count = self._cut + np.bincount(bonds.source[~bonds.intact], minlength=len(self._family))
        damaged = broken_count > law.damaged * self._family
        near = damaged.copy()
        near[bonds.source[damaged[bonds.target]]] = True
        grows = near[bonds.source] | near[bonds.target]  # within a horizon of damage
        eps = np.where(bonds.intact, np.abs(stretches) * shares(law, grows), 0.0)
        cycles, self._at = jump(self._life, law, eps, grows, self._at, law.cycles - self._cycles)
        self._cycles = min(self._cycles + cycles, law.cycles)
        which = np.flatnonzero(bonds.intact & (self._life <= LEFT))
        if not len(which):
            self._record_end_of_life("its cycles are over" if eps.any() else "no bond tires")
            return previous_equilibrium
        if np.isinf(self.first):
            self.first, self.range = self._cycles, float(eps[which].max())
        values, broken, intact = [part.copy() for part in state], self._operator.broken(), bonds.intact.copy()
        try:
            bonds.part(self._operator, state, step, which, stretches)
            equilibrium = motion.solve_equilibrium_after_breakage(state, step, previous_equilibrium.iterations)
            total = Equilibrium(previous_equilibrium.iterations + equilibrium.iterations, equilibrium.residual)
            return motion.break_overstretched_bonds_and_solve_equilibrium(state, step, total)[0]
        except NotConvergedError:
            for part, value in zip(state, values, strict=True):
                part[:] = value
            bonds.intact[:] = intact
            self._operator.restore(self._operator.checkpoint_arrays(), broken)
            self._record_end_of_life("what was left could not bear the largest loads")
            return previous_equilibrium
