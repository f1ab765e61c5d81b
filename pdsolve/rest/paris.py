r"""Fatigue by stress intensities: cracks of particles grow by da/dN = C dK^m, a particle a step (P. Paris, F. Erdogan,
J. Basic Engng 85 (1963) 528-533), and turn by the largest hoop stress. K is its intensity, with the size of sqrt(J E'):
stress along the crack (T) changes intensities of interaction integrals by some percent on a lattice, and J by none.

The body rests under the largest loads of the cycle. Every tip has grown a part of its next particle; a step goes to the
cycle in which the first tip has grown all of it. A step after which a tip grows more than `STEEPEST` times as fast is
taken back and begins anew with particles of half the length, down to a spacing: up to that its cycles are right to some
3 %. Later particles are as short. Of the first step the mean of both its ends counts. The differences
between that mean and the middles are summed: an estimate of the error from the length of particles, which comes out
larger than it where intensities grow faster than geometrically. K of a lattice is off by about as much as its two
integrals are apart, and cycles by m times that: these are summed too. Symbols:

    dK    range of K: (1 - R) K with a load ratio R of 0 or more; below 0 the crack is closed, and dK = K
    r     growth of a tip, m a cycle; within a step that of its middle, r sqrt(r / r of the step before)^(l / l before)
    l     length of a particle, m
    gone  of the next particle, m
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Fatigue
from pdsolve.checkpoint_validation import entry
from pdsolve.operators.protocol import Operator
from pdsolve.rest.equilibrium import Equilibrium, NotConvergedError
from pdsolve.rest.fatigue import CycleSteps
from pdsolve.rest.growing_cracks import (
    CrackedBodySnapshot,
    CrackGrowth,
    EvaluatedTip,
    largest_relative_difference_of_K_and_J,
    stress_intensities_of_tips,
)
from pdsolve.rest.load_steps import LoadSteps
from pdsolve.state import Broken, State

ALIKE = 1e-6  # of a particle: tips this near to the end of theirs grow together
STEEPEST = 2.0  # of r to that of the step before


class _TipHistory(NamedTuple):
    """What a tip remembers."""

    grown_particle_length: float  # m
    previous_growth_rate: float  # r of the step before
    previous_particle_length: float  # m, of the particle before


class _StepSnapshot(NamedTuple):
    """What is there before a step."""

    cracked_body: CrackedBodySnapshot
    tip_histories: dict[int, _TipHistory]
    cycles: float


class ParisSteps(CycleSteps):
    """Takes steps of a particle of the tip that needs the fewest cycles."""

    def __init__(self, law: Fatigue, operator: Operator, load_steps: LoadSteps, growth: CrackGrowth) -> None:
        super().__init__(law, operator, load_steps, "a particle a step")
        self._growth = growth
        self.cycle_error_of_steps = (
            0.0  # cycles by the middles of steps and by the mean of both ends: sum of differences
        )
        self.cycle_error_of_K = 0.0  # cycles, of how far the two integrals for K are apart, summed
        self._apart = 0.0  # of K, the largest, where both were known last
        self._tips: dict[int, _TipHistory] = {}  # by their particle
        self._share = 1.0  # of the length of particles
        self._at_first = 0.0  # cycles of this step if its tips grew on as at its beginning

    def _take_cycle_step(self, state: State, step: int, previous_equilibrium: Equilibrium) -> Equilibrium:
        """Let tips grow until the first has grown a particle, and settle; returns how."""
        law, growth = self._law, self._growth
        evaluated_tips = growth.evaluate_tips(state)
        if any(verdict.share >= 1 and np.isfinite(verdict.K1) for _, verdict in evaluated_tips):
            self._record_end_of_life("K of the largest loads reached the toughness")
            return previous_equilibrium
        rate = crack_growth_per_cycle(law, stress_intensities_of_tips(growth, evaluated_tips))
        if not rate.any():
            self._record_end_of_life("no crack grows: the range of K is not above its threshold")
            return previous_equilibrium
        before = self._take_snapshot(state)
        while True:
            equilibrium = self._advance_cycles_to_next_particle(state, step, evaluated_tips, rate)
            if equilibrium is None:
                return previous_equilibrium
            steepest, ahead = self._largest_growth_rate_ratios(state)
            shorter = [
                growth.growth_length(tip, self._share / 2) < growth.growth_length(tip, self._share)
                for tip, _ in evaluated_tips
            ]
            if steepest <= STEEPEST or not any(shorter):
                break
            self._restore_snapshot(state, before)
            self._share /= 2
        ahead = max(ahead, 1 / STEEPEST)  # of a tip that is stopped, as middles have it
        cycles, mean = self._cycles - before.cycles, self._at_first * cycles_relative_to_initial_growth_rate(ahead)
        if not before.tip_histories:  # no step before the first says how growth changes: the mean of both ends does
            cycles, mean = mean, self._at_first / float(np.sqrt(ahead))
            self._cycles = before.cycles + cycles
        self.cycle_error_of_steps += abs(cycles - mean)
        self._apart = largest_relative_difference_of_K_and_J(growth, evaluated_tips) or self._apart
        assert law.m is not None
        self.cycle_error_of_K += abs(cycles) * law.m * self._apart
        if steepest > STEEPEST:
            message = f"growth is {steepest:.3g} times as fast as before this step, more than {STEEPEST:g} times"
            growth.add_warning_once("outruns", f"step {step}: {message}, of particles as short as the spacing")
        return equilibrium

    def _advance_cycles_to_next_particle(
        self, state: State, step: int, evaluated_tips: list[EvaluatedTip], growth_rate: NDArray[np.float64]
    ) -> Equilibrium | None:
        """Let tips of these rates (k,) grow until the first has grown a particle, and settle; None where life ends."""
        law, growth = self._law, self._growth
        length = np.array([growth.growth_length(tip, self._share) for tip, _ in evaluated_tips])
        first = zip(evaluated_tips, growth_rate.tolist(), length.tolist(), strict=True)
        tip_histories = [self._tips.get(tip.particle, _TipHistory(0.0, r, way)) for (tip, _), r, way in first]
        grown_length, before, last = np.array(tip_histories).T
        steep = np.clip(
            growth_rate / np.where(before > 0, before, growth_rate + (growth_rate == 0)), 1 / STEEPEST, STEEPEST
        )
        middle = growth_rate * np.sqrt(steep) ** (length / last)
        took = np.divide(length - grown_length, middle, out=np.full(len(growth_rate), np.inf), where=middle > 0)
        soonest = int(took.argmin())
        cycles_to_growth = max(float(took[soonest]), 0.0)
        self._at_first = cycles_to_growth * float(middle[soonest] / growth_rate[soonest])
        if self._cycles + cycles_to_growth >= law.cycles:
            self._cycles = law.cycles
            self._record_end_of_life("its cycles are over")
            return None
        self._cycles += cycles_to_growth
        grown_length = grown_length + cycles_to_growth * middle
        grows = grown_length > (1 - ALIKE) * length
        rows = zip(
            evaluated_tips, grown_length.tolist(), growth_rate.tolist(), length.tolist(), grows.tolist(), strict=True
        )
        self._tips = {tip.particle: _TipHistory(part, r, way) for (tip, _), part, r, way, due in rows if not due}
        chosen = [evaluated_tip for evaluated_tip, due in zip(evaluated_tips, grows, strict=True) if due]
        growth, before = self._growth, self._take_snapshot(state)
        if not growth.grow_tips_and_cut_bonds(chosen, state, step, self._share):
            self._record_end_of_life("no crack goes on")
            return None
        parent = growth.particles.parent.tolist()
        of = {
            tip.particle: _TipHistory(0.0, r, growth.growth_length(tip, self._share))
            for (tip, _), r in zip(chosen, growth_rate[grows].tolist(), strict=True)
        }
        self._tips |= {number: of[above] for number, above in enumerate(parent) if above in of}
        try:
            return self._motion.solve_equilibrium_after_breakage(state, step)
        except NotConvergedError:
            self._restore_snapshot(state, before)
            self._record_end_of_life("what was left could not bear the largest loads")
            return None

    def _largest_growth_rate_ratios(self, state: State) -> tuple[float, float]:
        """Growth of the tips over what it was in the step before, the largest: of all, and of those that have grown."""
        evaluated_tips = self._growth.evaluate_tips(state)
        rate = crack_growth_per_cycle(self._law, stress_intensities_of_tips(self._growth, evaluated_tips)).tolist()
        tip_histories = [self._tips.get(tip.particle) for tip, _ in evaluated_tips]
        more = [
            (now / was.previous_growth_rate, was.grown_particle_length)
            for now, was in zip(rate, tip_histories, strict=True)
            if was and was.previous_growth_rate > 0
        ]
        grown_ratios = (ratio for ratio, grown_length in more if grown_length == 0)
        return max((ratio for ratio, _ in more), default=1.0), max(grown_ratios, default=1.0)

    def _take_snapshot(self, state: State) -> _StepSnapshot:
        return _StepSnapshot(
            CrackedBodySnapshot.capture(state, self._operator, self._growth), dict(self._tips), self._cycles
        )

    def _restore_snapshot(self, state: State, snapshot: _StepSnapshot) -> None:
        snapshot.cracked_body.restore(state, self._operator, self._growth)
        self._motion.method.discard_reused_tangent()
        self._tips, self._cycles = dict(snapshot.tip_histories), snapshot.cycles

    @property
    def estimated_cycle_error(self) -> float:
        """The estimated error of the cycles, of particles and of K together."""
        return self.cycle_error_of_steps + self.cycle_error_of_K

    def checkpoint_arrays(self) -> dict[str, NDArray[Any]]:
        """Growth of tips and steps so far, for a checkpoint."""
        tips = np.array([(n, *history) for n, history in self._tips.items()], dtype=float).reshape(-1, 4)
        numbers = np.array([self._cycles, self._share, self.cycle_error_of_steps, self.cycle_error_of_K, self._apart])
        return super().checkpoint_arrays() | {"paris_tips": tips, "paris_cycles": numbers}

    def restore(self, checkpoint: Mapping[str, NDArray[Any]], state: State, step: int, broken: Broken) -> None:
        """Restore a checkpoint after `step`. Raises CheckpointError."""
        super().restore(checkpoint, state, step, broken)
        tips = entry(checkpoint, "paris_tips", (None, 4), float)
        self._tips = {int(number): _TipHistory(*history) for number, *history in tips.tolist()}
        numbers = entry(checkpoint, "paris_cycles", (5,), float).tolist()
        self._cycles, self._share, self.cycle_error_of_steps, self.cycle_error_of_K, self._apart = numbers

    def summary(self) -> dict[str, Any]:
        """Cycles of each step and their estimated errors: in all, and from the length of particles."""
        errors = {"cycles_error": self.estimated_cycle_error, "cycles_error_of_jumps": self.cycle_error_of_steps}
        return super().summary() | errors


def cycles_relative_to_initial_growth_rate(rate_ratio: float) -> float:
    """Cycles of a length over those at its first rate, where the rate grows to `rate_ratio` times that
    geometrically."""
    return 1.0 if abs(rate_ratio - 1) < ALIKE else float(np.log(rate_ratio) / (rate_ratio - 1))


def crack_growth_per_cycle(law: Fatigue, K_max: NDArray[np.float64]) -> NDArray[np.float64]:
    """Growth (k,) of tips with these intensities (k,), Pa m^0.5, of the largest loads, m a cycle."""
    assert law.C is not None
    assert law.m is not None
    dK = (1 - max(law.ratio, 0.0)) * np.maximum(K_max, 0.0)
    return np.asarray(np.where(dK > law.threshold_K, law.C * dK**law.m, 0.0))
