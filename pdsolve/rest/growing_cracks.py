"""Cracks of particles as steppers see them: how hard their tips are pulled, and a step of growth that is taken back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from pdsolve.fracture.crack_particles import Particles
from pdsolve.operators.protocol import Operator
from pdsolve.state import Broken, State

EvaluatedTip = tuple[Any, Any]  # a tip, and what is decided about it


class CrackGrowth(Protocol):
    """Cracks of particles; see `pdsolve.crack_growth.growth.Growth`."""

    particles: Particles

    def evaluate_tips(self, state: State) -> list[EvaluatedTip]:
        """All tips, and what is decided about them in a state."""

    def grow_tips_and_cut_bonds(
        self, tips: list[EvaluatedTip], state: State, step: int, length_share: float = 1.0
    ) -> int:
        """Let these tips grow by a particle each, of that share of its length, and cut the bonds; returns the number of
        new particles."""

    def growth_length(self, tip: Any, length_share: float = 1.0) -> float:
        """The length, m, by which a tip grows at once, or a share of it; a spacing at least."""

    def toughness(self, tip: Any) -> float:
        """What the stress intensity of a tip must reach, Pa m^0.5."""

    def checkpoint_arrays(self) -> dict[str, NDArray[Any]]:
        """Particles for a checkpoint."""

    def restore(self, checkpoint: Mapping[str, NDArray[Any]], broken: Broken) -> None:
        """Restore a checkpoint with these broken bonds."""

    def add_warning_once(self, key: str, text: str) -> None:
        """Add a remark to be read together with the crack paths, once for a key."""


class CrackedBodySnapshot(NamedTuple):
    """A body and its cracks before they grow."""

    state_arrays: list[NDArray[Any]]
    broken_bonds: Broken
    crack_arrays: dict[str, NDArray[Any]]

    @classmethod
    def capture(cls, state: State, operator: Operator, growth: CrackGrowth) -> CrackedBodySnapshot:
        """What is there in a state."""
        return cls([part.copy() for part in state], operator.broken(), growth.checkpoint_arrays())

    def restore(self, state: State, operator: Operator, growth: CrackGrowth) -> None:
        """Set all back, in place."""
        for part, value in zip(state, self.state_arrays, strict=True):
            part[:] = value
        operator.restore(operator.checkpoint_arrays(), self.broken_bonds)
        growth.restore(self.crack_arrays, self.broken_bonds)


def largest_relative_difference_of_K_and_J(growth: CrackGrowth, evaluated_tips: list[EvaluatedTip]) -> float:
    """How far K by interaction integrals and by J are apart, the most of all tips, over K; 0 where only J is known."""
    both = [
        (v.share * growth.toughness(tip), v.released)
        for tip, v in evaluated_tips
        if np.isfinite(v.K1) and v.released > 0
    ]
    return max((abs(stress_intensity / released - 1) for stress_intensity, released in both), default=0.0)


def stress_intensities_of_tips(growth: CrackGrowth, evaluated_tips: list[EvaluatedTip]) -> NDArray[np.float64]:
    """K (k,) of tips, Pa m^0.5, with the size of sqrt(J E') where they have J."""
    stress_intensities = [verdict.share * growth.toughness(tip) for tip, verdict in evaluated_tips]
    return np.array(
        [
            v.released if np.isfinite(v.released) else k
            for (_, v), k in zip(evaluated_tips, stress_intensities, strict=True)
        ]
    )
