"""Steps along a path of equilibria on which one factor scales loads and prescribed displacements: what is kept of them.

Profiles of the drive go from 0 to 1 s, so that the factor is the time of these. The path goes on past the largest
loads, whether the factor rises or falls.
"""

from __future__ import annotations

import time as clock
import warnings
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.checkpoint_validation import entry
from pdsolve.conditions import Drive, put_loads
from pdsolve.errors import CheckpointError
from pdsolve.model import Model, ModelWarning
from pdsolve.operators.protocol import Operator
from pdsolve.rest.controls import PathPoint, ProportionalLoads
from pdsolve.rest.equilibrium import NotConvergedError, ProgressReport
from pdsolve.rest.load_steps import prescribed_displacements
from pdsolve.state import Broken, State
from pdsolve.stepper import LoadStepProgress, Stepper

Array = NDArray[np.float64]

PASSED = 0.98  # of the largest load so far: what has fallen below is past its peak
END = 0.01  # of the largest load: as good as gone
CRACK_STEPS = 80  # of dissipation in which a crack would go through the body's smallest extent
COARSEST = 1e-6  # tolerance of residuals: path steps are not solved better
ALIKE = 3.0  # times: steps of the control that one parabola may go through
REACHED = "the loads are reached"
SUMMARY_KEYS = "step", "iterations", "residual", "factor", "pull", "spent"  # of `PathStepResult`, in the results


class PathStepResult(NamedTuple):
    """One step along the path."""

    step: int
    iterations: int  # in all
    residual: float  # what is left of the forces over the largest from outside so far
    load_factor: float  # of loads and prescribed displacements
    work_conjugate_force: float  # to the load factor: N/m times m/s of what moves, or of loads
    dissipated_energy: float  # J/m, by bonds or cracks


class PathStepper(Stepper):
    """Takes the steps of a path, in a way that others say, and keeps their records."""

    description = ""  # how, for the record
    end_load_share = END  # of the largest load: the path ends there

    def __init__(self, model: Model, operator: Operator, drive: Drive, area: Array) -> None:
        self._model, self._operator, self._drive, self._area = model, operator, drive, area
        self._held: NDArray[np.bool_] = np.zeros(drive.force.shape, dtype=bool)
        self._held[drive.holds.node, drive.holds.axis] = True
        self._start, end = self._loads_and_prescribed_displacements(0.0), self._loads_and_prescribed_displacements(1.0)
        self._growth = end - self._start  # of loads (n, w), N/m, and places, m, from a factor of 0 to 1
        self._driven = self._held if self._growth[self._held].any() else ~self._held
        self._began: tuple[float, float] | None = None  # s, and the share of the path that was done then
        self.step_results: list[PathStepResult] = []
        self.load_factor = 0.0
        self.end_reason = ""
        self.peak_load_factor: float | None = None  # of dead loads, where no equilibrium further on bears as much
        drive.force[:] = 0

    def advance(self, state: State, first_step: int, end_step: int) -> int:
        """Take the steps `first_step` to `end_step` - 1, in place, unless the path has ended; returns the last one.

        Raises NotConvergedError.
        """
        self._began = self._began or (clock.monotonic(), self._finished_path_share())
        for step in range(first_step, end_step):
            if self.finished:
                continue
            try:
                self._take_path_step(state, step)
            except NotConvergedError as error:
                raise NotConvergedError(f"{self._model.name}: path step {step}: {error}") from None
        return self.step_results[-1].step if self.step_results else end_step - 1

    def checkpoint_arrays(self) -> dict[str, Array]:
        """The steps so far, for a checkpoint."""
        return {"stepped": np.array(self.step_results, dtype=float).reshape(-1, len(PathStepResult._fields))}

    def restore(self, checkpoint: Mapping[str, NDArray[Any]], state: State, step: int, broken: Broken) -> None:
        """Restore a checkpoint after `step`. Raises CheckpointError."""
        rows = entry(checkpoint, "stepped", (step, len(PathStepResult._fields)), float)
        if not np.array_equal(rows[:, 0], np.arange(1, step + 1)):
            raise CheckpointError(f"path steps are not 1 to {step}, those until the checkpoint")
        self.step_results = [PathStepResult(int(row[0]), int(row[1]), *row[2:]) for row in rows.tolist()]
        self.load_factor = self.step_results[-1].load_factor if step else 0.0

    def summary(self) -> dict[str, Any]:
        """Each step, the load factor of the peak that was passed, and why the path ended."""
        steps = [dict(zip(SUMMARY_KEYS, path_step, strict=True)) for path_step in self.step_results]
        lost, ended = self.peak_load_factor, self.end_reason or None
        return {"method": self.description, "path_steps": steps, "lost": lost, "ended": ended}

    def progress_text(self) -> str:
        """The load, the spent energy and the time that is left, for a progress display."""
        if not self.step_results:
            return "elastic"
        most, last = max(abs(row.work_conjugate_force) for row in self.step_results) or 1.0, self.step_results[-1]
        unit = "J/m" if self._model.grid.dimension == 2 else "J"
        said = (
            f"load {last.work_conjugate_force / most:.0%} of its peak, dissipated {last.dissipated_energy:.3g} {unit}"
        )
        began, before = self._began or (0.0, 1.0)
        share = self._finished_path_share()
        if share <= before:
            return said
        seconds_left = (clock.monotonic() - began) * (1 - share) / (share - before)
        return f"{said}, about {seconds_left:.0f} s left"

    def _finished_path_share(self) -> float:
        """How much of the path is done."""
        raise NotImplementedError

    def _take_path_step(self, state: State, step: int) -> None:
        """Take a step, in place. Raises NotConvergedError."""
        raise NotImplementedError

    def _make_progress_callback(self, step: int) -> ProgressReport:
        def report_iteration(iterations: int, residual: float) -> None:
            if self.on_progress is not None:
                self.on_progress(LoadStepProgress(step, iterations, residual, len(self._operator.broken().step)))

        return report_iteration

    def _record_step(
        self,
        step: int,
        iterations: int,
        residual: float,
        load_factor: float,
        external_forces: Array,
        dissipated_energy: float,
    ) -> None:
        """Record a step that ended under loads and reactions `external_forces` (n, w), N/m."""
        pull = float((external_forces * self._growth)[self._driven].sum())
        self.step_results.append(PathStepResult(step, iterations, residual, load_factor, pull, dissipated_energy))
        self.load_factor = load_factor
        pulls = [abs(path_step.work_conjugate_force) for path_step in self.step_results]
        most, now = max(pulls), pulls[-1]
        if now < self.end_load_share * most:
            self.finished, self.end_reason = True, f"the load has fallen to {self.end_load_share:.0%} of its peak"
        elif step == self._model.settings.run.steps and not self.finished:
            self.end_reason = "the steps are over"
        if self._driven[self._held].any() or now >= PASSED * most:
            return
        self.peak_load_factor = max(path_step.load_factor for path_step in self.step_results)
        after = self._model.settings.run.after
        if after != "path":
            self.finished, self.end_reason = True, "the load has passed its peak"
        if min(pulls[pulls.index(most) : -1]) < PASSED * most:
            return
        follows = {"path": "goes on at smaller loads", "stop": "ends here", "motion": "ends here, and a motion begins"}
        warnings.warn(
            f"{self._model.name}: path step {step}: the load has passed its peak, {self.peak_load_factor:.4g} of the"
            f" prescribed load, beyond which dead loads have no equilibrium; the path {follows[after]}",
            ModelWarning,
            stacklevel=2,
        )

    def _loads_and_prescribed_displacements(self, load_factor: float) -> Array:
        """Loads (n, w), N/m, and places of what is held, m."""
        put_loads(self._drive, load_factor)
        return np.where(
            self._held, prescribed_displacements(self._drive, load_factor), self._area[:, None] * self._drive.force
        )


class CorrectedPathSteps(PathStepper):
    """Path steps whose ends the corrector finds: the last two of them, and the work in between."""

    def __init__(self, model: Model, operator: Operator, drive: Drive, area: Array) -> None:
        super().__init__(model, operator, drive, area)
        shape = self._held.shape
        self._loads = ProportionalLoads(self._held, self._start, self._growth)
        self._tolerance = max(model.settings.run.static.tolerance, COARSEST)
        self._largest = 0.0  # N/m, norm of the forces from outside so far: the measure of residuals
        self._most = self._more = 0.0  # of the control: the measure of steps, and the next one
        self._last = self._before = PathPoint(np.zeros(shape), 0.0, 0.0)
        self._pushed = np.zeros(shape), np.zeros(shape)  # loads and reactions there, N/m

    def checkpoint_arrays(self) -> dict[str, Array]:
        """The path so far, for a checkpoint."""
        numbers = [*self._last[1:], *self._before[1:], self._more, self._most, self._largest]
        return super().checkpoint_arrays() | {
            "path_value": self._last.displacement,
            "path_before": self._before.displacement,
            "path_pushed": np.array(self._pushed),
            "path_numbers": np.array(numbers),
        }

    def restore(self, checkpoint: Mapping[str, NDArray[Any]], state: State, step: int, broken: Broken) -> None:
        """Restore a checkpoint after `step`. Raises CheckpointError."""
        super().restore(checkpoint, state, step, broken)
        self._pushed = tuple(entry(checkpoint, "path_pushed", (2, *self._held.shape), float).copy())
        value, before = (entry(checkpoint, f"path_{name}", self._held.shape, float) for name in ("value", "before"))
        factor, way, earlier, less, *rest = entry(checkpoint, "path_numbers", (7,), float).tolist()
        self._last, self._before = PathPoint(value.copy(), factor, way), PathPoint(before.copy(), earlier, less)
        self._more, self._most, self._largest = rest

    def _go_to(self, new: PathPoint, external_forces: Array, state: State) -> None:
        """Take over a point of the path with these loads and reactions (n, w), N/m, and book their work."""
        points, forces = (self._before, self._last, new), (*self._pushed, external_forces)
        state.work[:] += work_of_last_path_step(points, forces).sum(axis=1) / self._area
        self._pushed, self._before, self._last = (self._pushed[1], external_forces), self._last, new


def work_of_last_path_step(
    three_points: tuple[PathPoint, PathPoint, PathPoint], external_forces: tuple[Array, Array, Array]
) -> Array:
    """Work (n, d), J/m, of forces (n, d) from the second place to the third, all quadratic in the spent energy.

    By Simpson's rule, exact for these; by the trapezoidal rule next to a much longer or shorter step.
    """
    (first, last, new), (f0, f1, f2) = three_points, external_forces
    back = last.energy_or_arc_length - first.energy_or_arc_length
    ahead = new.energy_or_arc_length - last.energy_or_arc_length
    if not ALIKE * ahead > back > ahead / ALIKE:
        return np.asarray((f1 + f2) / 2 * (new.displacement - last.displacement))
    steep = ahead / back
    # The bend of a parabola through the three places
    bend = (new.displacement - last.displacement) - steep * (last.displacement - first.displacement)
    bow = (f2 - f1) - steep * (f1 - f0)
    # So that u = u1 + t (u2 - u1) - t (1 - t) bend, t from 0 to 1
    bend, bow = bend / (1 + 1 / steep), bow / (1 + 1 / steep)
    way = new.displacement - last.displacement
    middle = (f1 + f2) / 2 - bow / 4
    return np.asarray((f1 * (way - bend) + 4 * middle * way + f2 * (way + bend)) / 6)
