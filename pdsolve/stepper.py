"""The interface of a stepper: what the run asks of a time integration, of load steps and of an equilibrium path."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.state import Broken, State

if TYPE_CHECKING:
    from pdsolve.operators.protocol import Operator


class LoadStepProgress(NamedTuple):
    """Progress of a load step."""

    step: int
    iterations: int
    residual: float
    broken_directed_bond_count: int  # directed bonds so far


class Stepper(ABC):
    """What takes the steps of a system. All but `advance` has the answer of a time integration without a memory."""

    device_name: str = "cpu"  # what sums the forces
    integrator: str = ""  # of a motion, for the summary: Verlet, or a march that sums forces and moves nodes at once
    operator_has_state: bool = False  # `advance` may be given a state of no nodes, as the operator has it
    load_factor: float | None = None  # of a path or a cycle, the time of profiles, s; None: profiles follow the time
    finished: bool = False  # a path or a life has ended
    goes_from_rest_to_rest: bool = False  # in load steps, which begin without strains and with nothing held
    inner: Stepper | None = None  # the stepper that finds the equilibria, or takes the motion's steps, of this one
    on_progress: Callable[[LoadStepProgress], None] | None = None  # see `report_to`

    @abstractmethod
    def advance(self, state: State, first_step: int, end_step: int) -> int:
        """Take the steps `first_step` to `end_step` - 1, in place; returns the last step taken.

        A path or a fatigue life that has ended returns an earlier one, that after which it ended.
        """

    def report_to(self, on_progress: Callable[[LoadStepProgress], None] | None) -> None:
        """Call `on_progress` at each iteration of an equilibrium from now on; None: call nothing."""
        self.on_progress = on_progress
        if self.inner is not None:
            self.inner.report_to(on_progress)

    def synchronize(self) -> None:  # noqa: B027 - only of a device is the state elsewhere
        """Bring the state up to the steps taken."""

    def on_operator(self, operator: Operator) -> Stepper:
        """The stepper of the same model on other nodes, which the operator of its moving fine zone has made."""
        raise NotImplementedError("the nodes of this stepper stay")

    @property
    def content_rows(self) -> NDArray[np.int64] | slice:
        """Rows, among the nodes of what diffuses, of the current nodes."""
        return slice(None)

    def energy_density_at_zero_displacement(self, state: State) -> NDArray[np.float64] | float:
        """The energy densities (n,), J/m^3, that swollen bonds would have without displacements; 0 without swelling."""
        return 0.0

    def set_swelling_strain(  # noqa: B027 - a motion goes on from where it is
        self, strain: NDArray[np.float64], state: State, on_next_equilibrium: Callable[[State], object]
    ) -> None:
        """Take these strains (n,), with which the operator has been strained, for the next load step.

        `on_next_equilibrium` is called with its equilibrium before bonds break.
        """

    def discard_factors(self) -> None:  # noqa: B027 - steps without equations have none
        """Discard factors of a matrix that has changed."""

    def checkpoint_arrays(self) -> Mapping[str, NDArray[Any]]:
        """Arrays for a checkpoint, by name."""
        return {}

    def restore(  # noqa: B027 - a time integration has no memory
        self, checkpoint: Mapping[str, NDArray[Any]], state: State, step: int, broken: Broken
    ) -> None:
        """Restore a checkpoint after `step`, when state, operator and coupled unknowns have been restored.

        Growing cracks and loads are restored afterwards.
        `broken` are the bonds broken until then. Raises CheckpointError.
        """

    def progress_text(self) -> str:
        """Where a path or a life is, for a progress display; empty without one."""
        return ""

    def summary(self) -> dict[str, Any]:
        """Entries for the summary of the results."""
        return {}
