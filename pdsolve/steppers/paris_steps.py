r"""Fatigue by stress intensities: cracks of particles grow by da/dN = C dK^m, a particle a step (P. Paris, F. Erdogan,
J. Basic Engng 85 (1963) 528-533), and turn by the largest hoop stress. K is its intensity, with the size of sqrt(J E'):
stress along the crack (T) changes intensities of interaction integrals by some percent on a lattice, and J by none.

The body rests under the largest loads of the cycle. Every tip has grown a part of its next particle; a step goes to the
cycle in which the first tip has grown all of it. Symbols:

    dK    range of K: (1 - R) K with a load ratio R of 0 or more; below 0 the crack is closed, and dK = K
    r     growth of a tip, m a cycle; within a step that of its middle, r sqrt(r / r of the step before)
    gone  of the next particle, m
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.crack_particles import Particles
from pdmesh.model.fatigue import Cycled, Fatigue
from pdsolve.checkpoint_validation import entry
from pdsolve.errors import CheckpointError
from pdsolve.operators.protocol import Operator
from pdsolve.state import Broken, State
from pdsolve.steppers.equilibrium import Settled, UnsettledError
from pdsolve.steppers.load_steps import Going, LoadSteps, Rested

ALIKE = 1e-6  # of a particle: tips this near to the end of theirs grow together
STEEPEST = 2.0  # of r to that of the step before, in the middle of a step


class Growing(Protocol):
    """Cracks of particles; see `pdsolve.crack_growth.growth.Growth`."""

    particles: Particles

    def judged(self, state: State) -> list[tuple[Any, Any]]:
        """All tips, and what is decided about them in a state."""

    def lengthen(self, chosen: list[tuple[Any, Any]], state: State, step: int) -> int:
        """Let these tips grow by a particle each and cut the bonds; returns the number of new particles."""

    def length(self, tip: Any) -> float:
        """The length, m, by which a tip grows at once."""

    def toughness(self, tip: Any) -> float:
        """What the stress intensity of a tip must reach, Pa m^0.5."""

    def keep(self) -> dict[str, NDArray[Any]]:
        """Particles for a checkpoint."""

    def back(self, kept: Mapping[str, NDArray[Any]], broken: Broken) -> None:
        """Restore a checkpoint with these broken bonds."""

    def remark(self, key: str, words: str) -> None:
        """Add a remark to be read together with the crack paths, once for a key."""


class ParisSteps:
    """Takes steps of a particle of the tip that needs the fewest cycles."""

    factor = 1.0  # of the loads: the largest of a cycle

    def __init__(self, law: Fatigue, operator: Operator, motion: LoadSteps, growth: Growing) -> None:
        self._law, self._operator, self._motion, self._growth = law, operator, motion, growth
        self._cycles = 0.0
        self._tips: dict[int, tuple[float, float]] = {}  # by their particle: gone, m, and r of the step before
        self.said = f"a particle a step, {motion.method.said}"
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
            settled = self._step(state, step)
            broken = len(self._operator.broken().step)
            self.rested.append(Cycled(step, settled.iterations, settled.residual, self._cycles, broken))

    def _step(self, state: State, step: int) -> Settled:
        """Let tips grow until the first has grown a particle, and settle; returns how."""
        law, growth, rest = self._law, self._growth, Settled(0, self._motion.rested[-1].residual)
        judged = growth.judged(state)
        whole = [verdict.share * growth.toughness(tip) for tip, verdict in judged]  # of tips that go straight on
        K = np.array([v.released if np.isfinite(v.released) else k for (_, v), k in zip(judged, whole, strict=True)])
        if any(verdict.share >= 1 and np.isfinite(verdict.K1) for _, verdict in judged):
            return self._end("K of the largest loads reached the toughness", rest)
        rate = rates(law, K)
        if not rate.any():
            return self._end("no crack grows: the range of K is not above its threshold", rest)
        known = [self._tips.get(tip.particle, (0.0, r)) for (tip, _), r in zip(judged, rate.tolist(), strict=True)]
        gone, before = np.array(known).T
        length = np.array([growth.length(tip) for tip, _ in judged])
        middle = rate * np.sqrt(
            np.clip(rate / np.where(before > 0, before, rate + (rate == 0)), 1 / STEEPEST, STEEPEST)
        )
        self._look(step, rate, before)
        left = float(((length - gone)[rate > 0] / middle[rate > 0]).min())
        if self._cycles + left >= law.cycles:
            self._cycles = law.cycles
            return self._end("its cycles are over", rest)
        self._cycles += left
        gone = gone + left * middle
        grows = gone > (1 - ALIKE) * length
        self._tips = {
            tip.particle: (part, r)
            for (tip, _), part, r, due in zip(judged, gone.tolist(), rate.tolist(), grows.tolist(), strict=True)
            if not due
        }
        chosen = [one for one, due in zip(judged, grows, strict=True) if due]
        return self._lengthen(state, step, chosen, rate[grows].tolist(), rest)

    def _look(self, step: int, rate: NDArray[np.float64], before: NDArray[np.float64]) -> None:
        """Remark on growth that outruns its extrapolation: up to `STEEPEST`, cycles are right to some 3 %."""
        more = float(np.divide(rate, before, out=np.ones(len(rate)), where=before > 0).max())
        if more > STEEPEST:
            found = f"found growth {more:.3g} times as fast as in the step before, expected {STEEPEST:g} times at most"
            self._growth.remark("outruns", f"step {step}: {found}, by shorter particles (run.particles.spacing)")

    def _lengthen(self, state: State, step: int, chosen: list[Any], rate: list[float], rest: Settled) -> Settled:
        """Let these tips grow and settle; their children remember their `rate`. Without rest, life ends before that."""
        growth, operator = self._growth, self._operator
        values, broken, cracks = [part.copy() for part in state], operator.broken(), growth.keep()
        if not growth.lengthen(chosen, state, step):
            return self._end("no crack goes on", rest)
        parent = growth.particles.parent.tolist()
        of = {tip.particle: r for (tip, _), r in zip(chosen, rate, strict=True)}
        self._tips |= {number: (0.0, of[above]) for number, above in enumerate(parent) if above in of}
        try:
            return self._motion.settle_broken(state, step)
        except UnsettledError:
            for part, value in zip(state, values, strict=True):
                part[:] = value
            operator.back(operator.keep(), broken)
            growth.back(cracks, broken)
            return self._end("what was left could not bear the largest loads", rest)

    def _end(self, why: str, rest: Settled) -> Settled:
        self.ended, self.why = True, why
        return rest

    def keep(self) -> dict[str, NDArray[Any]]:
        """Growth of tips and steps so far, for a checkpoint."""
        return {
            "cycled": np.array(self.rested, dtype=float).reshape(-1, len(Cycled._fields)),
            "rested": self._motion.keep(),
            "paris_tips": np.array([(n, *known) for n, known in self._tips.items()], dtype=float).reshape(-1, 3),
            "paris_cycles": np.array([self._cycles]),
        }

    def back(self, kept: Mapping[str, NDArray[Any]], step: int) -> None:
        """Restore a checkpoint after `step`. Raises CheckpointError."""
        rows = entry(kept, "cycled", (step, len(Cycled._fields)), float)
        if not np.array_equal(rows[:, 0], np.arange(1, step + 1)):
            raise CheckpointError(f"found steps of cycles that are not 1 to {step}, expected those until there")
        self.rested = [Cycled(int(s), int(i), r, c, int(b)) for s, i, r, c, b in rows.tolist()]
        tips = entry(kept, "paris_tips", (None, 3), float)
        self._tips = {int(number): (gone, rate) for number, gone, rate in tips.tolist()}
        (self._cycles,) = entry(kept, "paris_cycles", (1,), float).tolist()
        if step:
            self._motion.back(entry(kept, "rested", (1, len(Rested._fields)), float), self._operator.broken())

    def words(self) -> str:
        """The cycles so far, for a progress display."""
        return f"{self._cycles:.4g} cycles"


def rates(law: Fatigue, K: NDArray[np.float64]) -> NDArray[np.float64]:
    """Growth (k,) of tips with these intensities (k,), Pa m^0.5, of the largest loads, m a cycle."""
    assert law.C is not None
    assert law.m is not None
    dK = (1 - max(law.ratio, 0.0)) * np.maximum(K, 0.0)
    return np.asarray(np.where(dK > law.threshold_K, law.C * dK**law.m, 0.0))
