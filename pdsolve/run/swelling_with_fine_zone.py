"""Plates and bodies with a fine zone that moves, which heat, or a solvent, swells.

The content is that of all nodes of the fine lattice, conducted as without a zone, so that cells that become fine have
theirs. Coarse nodes have that of the fine nodes they lie on.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.hybrid.operator import HybridOperator
from pdsolve.adaptivity.hybrid.space.operator import HybridBodyOperator
from pdsolve.adaptivity.two_lattice_operator import TwoLatticeStepper
from pdsolve.diffusion.swelling import BrokenBonds, Swelling
from pdsolve.model import Model
from pdsolve.state import Broken, State
from pdsolve.stepper import Stepper

if TYPE_CHECKING:
    from pdsolve.operators.protocol import Operator


class SwellingStepperWithFineZone(Swelling):
    """Steps of a content, of n nodes of the grid, and of what it swells, whose state has the current nodes."""

    def __init__(
        self,
        content: Stepper,
        content_state: State,
        operator: HybridOperator | HybridBodyOperator,
        model: Model,
        steps_per_content_step: int,
        broken: BrokenBonds | None,
    ) -> None:
        """See `Swelling`; `model` is that of all nodes."""
        self._operator = operator
        super().__init__(
            content, content_state, TwoLatticeStepper(operator), operator, model, steps_per_content_step, broken
        )
        operator.engine.compute_initial_forces()

    @property
    def content_rows(self) -> NDArray[np.int64]:
        """The rows (n,) in the grid of the current nodes."""
        return self._operator.grid_rows

    def on_operator(self, operator: Operator) -> SwellingStepperWithFineZone:
        """This stepper, with other current nodes of the same plate."""
        self._operator = self._bonds = cast("HybridOperator | HybridBodyOperator", operator)
        return self

    def restore(self, checkpoint: Mapping[str, NDArray[Any]], state: State, step: int, broken: Broken) -> None:
        """Strain the bonds by the contents, with which nodes at the border of the fine zone move."""
        super().restore(checkpoint, state, step, broken)
        self._operator.copy_to_state(state)

    def energy_density_at_zero_displacement(self, state: State) -> NDArray[np.float64]:
        """The energy densities (n,) of the current nodes at no displacement, J/m^3, inside of one material."""
        rows = self._operator.grid_rows
        return self._operator.engine.energy_density_at_unit_stretch(rows) * self._strain()[rows] ** 2

    def advance(self, state: State, first_step: int, end_step: int) -> int:
        """Take the steps `first_step` to `end_step` - 1 of both; returns the last one. Raises UnstableError.

        The state is updated as long as its nodes are current.
        """
        hybrid, step = self._operator.engine, first_step
        while step < end_step:
            until = min(end_step, step + (self.steps_per_content_step // 2 + 1 - step) % self.steps_per_content_step)
            hybrid.advance(step, until)
            if until < end_step:
                if self._broken is not None:
                    self._broken.update(self._content)
                before, energy_before = hybrid.copy_negative_half_swelling(), hybrid.strain_energy()
                content_step = (until - 1) // self.steps_per_content_step + 1
                self._content.advance(self._h, content_step, content_step + 1)
                hybrid.set_swelling_strain(self._strain())
                hybrid.add_work((hybrid.strain_energy() - energy_before) / 2)
                hybrid.advance(until, until + 1)
                hybrid.add_work((hybrid.strain_energy() - hybrid.strain_energy_at_swelling(before)) / 2)
            step = until + 1
        if self._operator.nodes_are_unchanged:
            self._operator.copy_to_state(state)
        return end_step - 1
