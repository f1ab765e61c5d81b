"""Steps of cycles at rest: what fatigue by bonds and fatigue by stress intensities share."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.fatigue import Cycled, Fatigue
from pdsolve.checkpoint_validation import entry
from pdsolve.errors import CheckpointError
from pdsolve.operators.protocol import Operator
from pdsolve.state import State
from pdsolve.steppers.equilibrium import Settled
from pdsolve.steppers.load_steps import Going, LoadSteps, Rested


class CycleSteps:
    """Takes steps of some cycles each, until life has ended, between which the body rests under the largest loads."""

    factor = 1.0  # of the loads: the largest of a cycle

    def __init__(self, law: Fatigue, operator: Operator, motion: LoadSteps, said: str) -> None:
        """`said` is what a step is."""
        self._law, self._operator, self._motion = law, operator, motion
        self._cycles = 0.0
        self.said = f"{said}, {motion.method.said}"
        self.rested: list[Cycled] = []
        self.ended, self.why = False, ""

    @property
    def watch(self) -> Callable[[Going], None] | None:
        """Called with the progress of an equilibrium."""
        return self._motion.watch

    @watch.setter
    def watch(self, watch: Callable[[Going], None] | None) -> None:
        self._motion.watch = watch

    def march(self, state: State, first: int, last: int) -> None:
        """Take the steps `first` to `last` - 1, in place, unless life has ended. Raises UnsettledError."""
        for step in range(first, last):
            if self.ended:
                return
            if step == 1:
                self._motion.march(state, 1, 2)
            self._motion.method.forget()
            equilibrium = self._step(state, step, Settled(0, self._motion.rested[-1].residual))
            broken = len(self._operator.broken().step)
            self.rested.append(Cycled(step, equilibrium.iterations, equilibrium.residual, self._cycles, broken))

    def _step(self, state: State, step: int, before: Settled) -> Settled:
        """Take a step; returns how what is left settled, `before` if nothing changed."""
        raise NotImplementedError

    def _end(self, why: str) -> None:
        self.ended, self.why = True, why

    def keep(self) -> dict[str, NDArray[Any]]:
        """Steps so far, for a checkpoint."""
        steps = np.array(self.rested, dtype=float).reshape(-1, len(Cycled._fields))
        return {"cycled": steps, "rested": self._motion.keep()}

    def back(self, checkpoint: Mapping[str, NDArray[Any]], step: int) -> None:
        """Restore a checkpoint after `step`. Raises CheckpointError."""
        rows = entry(checkpoint, "cycled", (step, len(Cycled._fields)), float)
        if not np.array_equal(rows[:, 0], np.arange(1, step + 1)):
            raise CheckpointError(f"steps of cycles are not 1 to {step}, those until there")
        self.rested = [Cycled(int(s), int(i), r, c, int(b)) for s, i, r, c, b in rows.tolist()]
        if step:
            self._motion.back(entry(checkpoint, "rested", (1, len(Rested._fields)), float), self._operator.broken())

    def words(self) -> str:
        """The cycles so far, for a progress display."""
        return f"{self._cycles:.4g} cycles"
