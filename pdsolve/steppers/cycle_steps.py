"""Steps of cycles at rest: what fatigue by bonds and fatigue by stress intensities share."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Cycled, Fatigue
from pdsolve.checkpoint_validation import entry
from pdsolve.errors import CheckpointError
from pdsolve.operators.protocol import Operator
from pdsolve.state import Broken, State
from pdsolve.stepper import Stepper
from pdsolve.steppers.equilibrium import Equilibrium
from pdsolve.steppers.load_steps import LoadSteps


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
