"""Load steps: a plate at rest under increasing load, its bonds breaking one after the other, the worst first.

A load step first goes half of the way and then the rest, so that the work of loads and holds follows from Simpson's
rule on three equilibria. Then the bonds furthest above their limit break, and the plate comes to rest again under the
same loads, until no bond is above its limit. Two energies are booked: what a bond holds when it breaks, and what the
plate releases on the way to its next equilibrium. The latter is the work of the residual forces on the straight path
between the two, again by Simpson's rule. Each is computed independently of the balance, so that work = strain + spent
checks the bookkeeping.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.amounts import pair_count
from pdsolve.bonds.static_breakage import Breaking
from pdsolve.checkpoint_validation import entry
from pdsolve.conditions import DISPLACEMENT, Drive, factors_at, put_loads
from pdsolve.errors import CheckpointError
from pdsolve.model import Model, ModelError, ModelWarning
from pdsolve.operators.contact.at_rest import RestingContact
from pdsolve.operators.ground_supports import grounded
from pdsolve.operators.protocol import Operator
from pdsolve.rest.contact_method import append_contact_pairs
from pdsolve.rest.equilibrium import (
    Equilibrium,
    EquilibriumConditions,
    EquilibriumMethod,
    NotConvergedError,
    force_densities,
    norm,
)
from pdsolve.rest.modes import LooseBodies, SupportChecker, describe_unbalanced_body, find_loose_bodies
from pdsolve.state import Broken, State
from pdsolve.stepper import LoadStepProgress, Stepper

Array = NDArray[np.float64]

FEW = 7  # iterations of an equilibrium: with fewer, the next part of a load step is larger by
GROWTH = 1.5
BETWEEN = 1e-5  # tolerance of equilibria between rounds of breaking: bonds are as bad within a thousandth
JUMP = 4  # horizons: cracks that grow by more in a load step, by themselves, jump; by less they go from node to node

SUMMARY_KEYS = "step", "iterations", "residual", "breaks", "least"  # of `LoadStepStatistics`, in the results


class LoadStepStatistics(NamedTuple):
    """How one load step came to rest."""

    step: int
    iterations: int  # in all
    residual: float  # what is left of the forces over those from outside
    break_rounds: int  # times that bonds broke
    least_breaking_load_share: float  # of this step's loads, to break the next bond; 1 if none broke


class LoadSteps(Stepper):
    """Takes load steps with a method and any operator whose own bonds do not break."""

    goes_from_rest_to_rest = True

    def __init__(
        self,
        model: Model,
        operator: Operator,
        drive: Drive,
        area: Array,
        method: EquilibriumMethod,
        bond_breaking: Breaking | None,
        grow_cracks: Callable[[State, int], bool] | None = None,
        on_equilibrium: Callable[[State], None] = lambda state: None,
        contact: RestingContact | None = None,
    ) -> None:
        """`bond_breaking` lets bonds break here; None: none does.

        `grow_cracks` lets cracks grow from an equilibrium in a step, and returns whether any did. `on_equilibrium` is
        called with each equilibrium under load; `contact` is the part of the operator that `method` looks at. Raises
        ModelError for a body without supports.
        """
        self._model, self._operator, self._drive, self._area = model, operator, drive, area
        self.method, self._breaking, self._dt = method, bond_breaking, model.settings.run.time_step or 0.0
        self.held = np.zeros(drive.force.shape, dtype=bool)
        self.held[drive.holds.node, drive.holds.axis] = True
        self._supported = self.held | grounded(model, drive.force.shape[1])
        self.step_results: list[LoadStepStatistics] = []
        self._remember, self._grow = on_equilibrium, grow_cracks
        self._contact = contact
        self._inner = 0.0  # N/m^3, of `EquilibriumConditions`
        self._on_next_equilibrium: Callable[[State], object] = lambda state: None
        self._warned, self._told_loose, self._loose = False, False, cast("LooseBodies | None", None)
        self._support_checker: SupportChecker | None = None  # of bodies that are supported
        source, target = operator.bonds(at_start=True)
        self._bonds = source * len(area) + target
        self._restrain_loose_bodies(operator.broken(), "")
        for step in range(1, model.settings.run.steps + 1) if self._loose is not None else ():
            put_loads(drive, step * self._dt)
            try:
                self._check_balance_of_loose_bodies("")
            except NotConvergedError as error:
                raise ModelError(f"{model.name}: $.conditions: {error}") from None
        drive.force[:] = 0

    def advance(self, state: State, first_step: int, end_step: int) -> int:
        """Take the load steps `first_step` to `end_step` - 1, in place; returns the last one.

        Raises NotConvergedError.
        """
        for step in range(first_step, end_step):
            before = self._drive.force.astype(float) if self.step_results else np.zeros(self._drive.force.shape)
            put_loads(self._drive, step * self._dt)
            self.method.discard_reused_tangent()
            start = self._loading_norm(state, before)
            dissipated_energy = self._dissipated_and_released_energy(state)
            try:
                self._check_balance_of_loose_bodies("")
                equilibrium = self._solve_in_parts_and_add_work(state, before, step, step * self._dt)
                self._on_next_equilibrium(state)
                equilibrium, breaks, least = self.break_overstretched_bonds_and_solve_equilibrium(
                    state, step, equilibrium
                )
                equilibrium, growth_count = self._grow_cracks_and_solve_equilibrium(state, step, equilibrium)
                if self._drive.force[~self.held].any():  # dead loads, under which the body might not stay
                    ways = self.method.count_unstable_modes(state, self.held)
                    if ways:
                        raise NotConvergedError(
                            f"the equilibrium is not stable, as energy falls in {ways} independent ways: a body under"
                            " dead loads leaves it; use smaller loads, prescribed displacements, or motion"
                            " (run.solver)"
                        )
            except NotConvergedError as error:
                raise NotConvergedError(
                    f"{self._model.name}: load step {step}, {step * self._dt:.4g} s: {error}"
                ) from None
            self.step_results.append(
                LoadStepStatistics(step, equilibrium.iterations, equilibrium.residual, breaks + growth_count, least)
            )
            # a crack that grew a long way at a smaller load than that of the step before is reported, once
            cost = self._dissipated_and_released_energy(state) - dissipated_energy
            crack_area = float(self._model.horizons.max()) ** (self._model.grid.dimension - 1)
            least_cost = crack_area * float(self._model.node_values("G0").min())
            is_smaller = least * self._loading_norm(state, self._drive.force.astype(float)) < start
            if step > 1 and is_smaller and cost > JUMP * least_cost and not self._warned:
                self._warned = True
                warnings.warn(
                    f"{self._model.name}: load step {step} ({step * self._dt:.4g} s): snap-back: the crack jumped at"
                    f" this load ({cost:.3g} J/m released), though {least:.3g} of it was enough; the result is"
                    " that of a jump at this load",
                    ModelWarning,
                    stacklevel=2,
                )
        return end_step - 1

    def set_swelling_strain(self, strain: Array, state: State, on_next_equilibrium: Callable[[State], object]) -> None:
        """Break bonds by their stretch from these strains (n,), with which the operator has been strained.

        `on_next_equilibrium` is called with the next equilibrium before bonds break.
        """
        self._on_next_equilibrium = on_next_equilibrium
        self.method.discard_reference()
        if self._breaking is not None:
            self._breaking.swell(strain)
        self._inner = norm(force_densities(self._operator, state._replace(value=np.zeros(state.value.shape))))

    def solve_equilibrium_at_time_zero(self, state: State) -> Equilibrium:
        """Bring the plate to rest under the conditions of time 0, without breaking bonds. Raises NotConvergedError."""
        put_loads(self._drive, 0.0)
        return self._solve_in_parts_and_add_work(state, np.zeros(self._drive.force.shape), 0, 0.0)

    def solve_equilibrium_at_time_and_add_work(
        self, state: State, previous_load: Array, step: int, time: float
    ) -> Equilibrium:
        """Bring the plate from rest under the loads `previous_load` (n, w) to rest under the conditions of `time`, s.

        Books the work. Raises NotConvergedError.
        """
        put_loads(self._drive, time)
        self._check_balance_of_loose_bodies("")
        return self._solve_in_parts_and_add_work(state, previous_load, step, time)

    def solve_equilibrium_at_time(self, state: State, step: int, time: float) -> Equilibrium:
        """Bring the plate to rest under the conditions of `time`, s; books nothing. Raises NotConvergedError."""
        put_loads(self._drive, time)
        self._check_balance_of_loose_bodies("")
        at = np.where(self.held, prescribed_displacements(self._drive, time), 0.0)
        conditions = EquilibriumConditions(self._drive.force.astype(float), self.held, at, self._inner)
        equilibrium = self.method.solve_equilibrium(state, conditions, self._make_progress_callback(step, 0))
        self._store_reactions_and_stop_motion(state, force_densities(self._operator, state))
        return equilibrium

    def raise_if_a_body_lacks_supports(self) -> None:
        """Raise NotConvergedError where broken bonds leave a body without supports."""
        broken = self._operator.broken()
        self._restrain_loose_bodies(broken, f"after {pair_count(len(broken.step))} bonds broke: ")

    def checkpoint_arrays(self) -> dict[str, NDArray[Any]]:
        """Convergence data (k, 5) of the load steps so far, and whether factors stay, for a checkpoint."""
        rows = np.array(self.step_results, dtype=float).reshape(-1, len(LoadStepStatistics._fields))
        return {"rested": rows, "reference_is_near": np.array([float(self.method.reference_is_near)])}

    def restore(self, checkpoint: Mapping[str, NDArray[Any]], state: State, step: int, broken: Broken) -> None:
        """Restore a checkpoint after `step` with these broken bonds. Raises CheckpointError."""
        if not entry(checkpoint, "reference_is_near", (1,), float)[0]:
            self.method.discard_reference()
        rows = entry(checkpoint, "rested", (step, len(LoadStepStatistics._fields)), float)
        if not np.array_equal(rows[:, 0], np.arange(1, step + 1)):
            raise CheckpointError(f"load steps are not 1 to {step}, those until the checkpoint")
        self.step_results = [
            LoadStepStatistics(int(s), int(i), r, int(b), least) for s, i, r, b, least in rows.tolist()
        ]
        if self._breaking is not None:
            self._breaking.restore(broken)
        count = len(broken.step)
        self._restrain_loose_bodies(broken, f"after {count} directed bonds broke: " if count else "")

    def summary(self) -> dict[str, Any]:
        """Iterations and residuals of each load step."""
        steps = [dict(zip(SUMMARY_KEYS, row, strict=True)) for row in self.step_results]
        return {"method": self.method.description, "load_steps": steps}

    def _dissipated_and_released_energy(self, state: State) -> float:
        """Energy, J/m, dissipated by broken bonds and released by the plate on its way to rest."""
        return float(np.sum(self._area * (state.dissipated + state.damped)))

    def _loading_norm(self, state: State, load: Array) -> float:
        """Size of the loading: the norm of loads, or of held displacements without loads."""
        size = norm(load)
        return size if size > 0 else norm(state.value[self.held])

    def _solve_in_parts_and_add_work(self, state: State, previous_load: Array, step: int, time: float) -> Equilibrium:
        """Find equilibrium under the loads and holds of `time`, s, starting from those before; books the work.

        A part of the way that does not come to rest is halved, and the next part grows if few iterations were enough.
        """
        at = prescribed_displacements(self._drive, time)
        now = self._drive.force.astype(float)
        start = state.value.copy()
        done, part, iterations, equilibrium = 0.0, 1.0, 0, Equilibrium(0, 0.0)
        while done < 1:
            end = 1.0 if done + part > 1 - self.method.least_load_step_share else done + part
            loads = [previous_load + share * (now - previous_load) for share in (done, (done + end) / 2, end)]
            places = [np.where(self.held, start + share * (at - start), 0.0) for share in ((done + end) / 2, end)]
            value, operator_arrays = state.value.copy(), self._operator.checkpoint_arrays()
            try:
                report_progress = self._make_progress_callback(step, iterations)
                u = [state.value.copy()]
                pushed = [self.loads_and_reactions(state, loads[0])]
                part_iterations = 0
                for load, place in zip(loads[1:], places, strict=True):
                    equilibrium = self.method.solve_equilibrium(
                        state, EquilibriumConditions(load, self.held, place, self._inner), report_progress
                    )
                    part_iterations += equilibrium.iterations
                    u.append(state.value.copy())
                    pushed.append(self.loads_and_reactions(state, load))
                    self._remember(state)
                # work, J/m^3, of forces along the path through three states, quadratic in between
                (u0, um, u1), (f0, fm, f1) = u, pushed
                work = (f0 * (4 * um - 3 * u0 - u1) + 4 * fm * (u1 - u0) + f1 * (u0 - 4 * um + 3 * u1)) / 6
                state.work[:] += work.sum(axis=1)
                equilibrium = Equilibrium(part_iterations, equilibrium.residual)
            except NotConvergedError as error:
                state.value[:], part = value, part / 2
                self._operator.restore(operator_arrays, self._operator.broken())
                if part < self.method.least_load_step_share:
                    raise self._limit_load_error(error, state, done) from None
                continue
            done, iterations = end, iterations + equilibrium.iterations
            part *= GROWTH if equilibrium.iterations < 2 * FEW else 1.0
        self._store_reactions_and_stop_motion(state, force_densities(self._operator, state))
        return Equilibrium(iterations, equilibrium.residual)

    def _limit_load_error(self, error: NotConvergedError, state: State, converged_share: float) -> NotConvergedError:
        """The error of a load step that converges up to `converged_share` only: a limit load, where nodes flow."""
        plastic = self._operator.fields(state).get("plastic")
        flowing = 0 if plastic is None else int((plastic > 0).sum())
        if not flowing or not self._drive.force[~self.held].any():
            return error
        return NotConvergedError(
            f"limit load: no equilibrium above {converged_share:.3g} of this load step, as {flowing} of"
            f" {len(self._area)} nodes flow; use smaller loads, prescribed displacements, or material.hardening"
        )

    def break_overstretched_bonds_and_solve_equilibrium(
        self, state: State, step: int, equilibrium: Equilibrium
    ) -> tuple[Equilibrium, int, float]:
        """Break bonds and settle until no bond is above its limit.

        Returns how it settled, how often, and the smallest share of the load.
        """
        breaks, least, iterations, roughly = 0, 1.0, equilibrium.iterations, False
        while self._breaking is not None:
            most = self._breaking.break_worst(self._operator, state, step)
            if most == 0 and not roughly:
                break
            if most and breaks:
                least = min(least, 1 / most)
            roughly = most > 0
            equilibrium = self.solve_equilibrium_after_breakage(state, step, iterations, BETWEEN if roughly else 0.0)
            iterations += equilibrium.iterations
            breaks += roughly
        return Equilibrium(iterations, equilibrium.residual), breaks, least

    def solve_equilibrium_after_breakage(
        self, state: State, step: int, iterations_before: int = 0, sufficient_residual: float = 0.0
    ) -> Equilibrium:
        """Settle again after bonds broke, at least to a residual of `sufficient_residual`. Raises NotConvergedError."""
        self.raise_if_a_body_lacks_supports()
        try:
            return self._solve_equilibrium_at_constant_load(state, step, iterations_before, sufficient_residual)
        except NotConvergedError as error:
            raise NotConvergedError(
                f"after {pair_count(len(self._operator.broken().step))} bonds broke: {error}"
            ) from None

    def _grow_cracks_and_solve_equilibrium(
        self, state: State, step: int, equilibrium: Equilibrium
    ) -> tuple[Equilibrium, int]:
        """Let cracks grow and settle until none grows; returns how it settled, and how often."""
        times, iterations = 0, equilibrium.iterations
        while self._grow is not None and self._grow(state, step):
            broken = self._operator.broken()
            self._restrain_loose_bodies(broken, f"after {pair_count(len(broken.step))} bonds were cut: ")
            equilibrium = self._solve_equilibrium_at_constant_load(state, step, iterations)
            iterations += equilibrium.iterations
            times += 1
        return Equilibrium(iterations, equilibrium.residual), times

    def _solve_equilibrium_at_constant_load(
        self, state: State, step: int, iterations_before: int, sufficient_residual: float = 0.0
    ) -> Equilibrium:
        """Find equilibrium under the same loads; books their work, and the energy that the plate releases."""
        load, u = self._drive.force.astype(float), state.value.copy()
        conditions = EquilibriumConditions(
            load, self.held, np.where(self.held, u, 0.0), self._inner, sufficient_residual
        )
        residual_forces = [self._residual_forces(state, load)]
        equilibrium = self.method.solve_equilibrium(
            state, conditions, self._make_progress_callback(step, iterations_before)
        )
        end, way, forces = state.value.copy(), state.value - u, equilibrium.neighbour_forces
        state.value[:] = (u + end) / 2
        residual_forces.append(self._residual_forces(state, load))
        state.value[:] = end
        forces = force_densities(self._operator, state) if forces is None else forces
        residual_forces.append(np.where(self.held, 0.0, forces + load))
        state.damped[:] += ((residual_forces[0] + 4 * residual_forces[1] + residual_forces[2]) / 6 * way).sum(axis=1)
        state.work[:] += (load * way).sum(axis=1)
        self._store_reactions_and_stop_motion(state, forces)
        return equilibrium._replace(neighbour_forces=None)

    def _residual_forces(self, state: State, load: Array) -> Array:
        return np.where(self.held, 0.0, force_densities(self._operator, state) + load)

    def loads_and_reactions(self, state: State, load: Array) -> Array:
        """External force densities (n, w): loads, and reactions of held components."""
        return np.where(self.held, -force_densities(self._operator, state), load)

    def _store_reactions_and_stop_motion(self, state: State, neighbour_forces: Array) -> None:
        """Store reactions, and set the motion to zero."""
        node, axis = self._drive.holds.node, self._drive.holds.axis
        self._drive.held_force[:] = (neighbour_forces + self._drive.force)[node, axis]
        self._drive.before[:] = self._drive.force
        state.rate[:] = state.second[:] = 0

    def _make_progress_callback(self, step: int, iterations_before: int) -> Callable[[int, float], None]:
        def report_iteration(iterations: int, residual: float) -> None:
            if self.on_progress is not None:
                self.on_progress(
                    LoadStepProgress(step, iterations_before + iterations, residual, len(self._operator.broken().step))
                )

        return report_iteration

    def _restrain_loose_bodies(self, broken: Broken, message_prefix: str) -> None:
        """Check for unsupported bodies, and hold softly what breaking bonds cut free.

        Raises ModelError at the start, NotConvergedError for loads on what is cut free.
        """
        model, nodes = self._model, len(self._area)
        intact = np.ones(len(self._bonds), dtype=bool)
        intact[np.searchsorted(self._bonds, broken.source * nodes + broken.target)] = False
        if self._support_checker is not None and self._support_checker.update_bonds_if_bodies_stay_supported(intact):
            return
        intact_bonds = self._bonds[intact]
        loose_bodies = find_loose_bodies(
            model.grid.position, model.grid.ids, np.divmod(intact_bonds, nodes), self._supported
        )
        self._support_checker = None
        if not loose_bodies.description:
            self._support_checker = SupportChecker(
                model.grid.position, np.divmod(self._bonds, nodes), self._supported, intact
            )
            return
        if self._contact is not None:
            alone = loose_bodies.is_loose_node
            joined = append_contact_pairs(np.divmod(intact_bonds, nodes), self._contact)
            loose_bodies = find_loose_bodies(model.grid.position, model.grid.ids, joined, self._supported)
            # Contact holds these nodes once it presses, in all directions but along a face
            self.method.restrain_by_weak_springs(alone)
            if not loose_bodies.description:
                return
        if not model.settings.run.static.floating and not message_prefix:
            said = (
                f"{loose_bodies.description}; add supports, or use --float (run.static.floating) if the loads balance"
            )
            raise ModelError(f"{model.name}: $.conditions: {said}")
        self._loose = loose_bodies
        self._check_balance_of_loose_bodies(message_prefix)
        if not model.settings.run.static.floating and not self._told_loose:
            self._told_loose = True
            said = f"{message_prefix}{loose_bodies.description}, without loads: it stays where it comes to rest"
            warnings.warn(f"{model.name}: {said}", ModelWarning, stacklevel=2)
        self.method.restrain_by_weak_springs(loose_bodies.is_loose_node)

    def _check_balance_of_loose_bodies(self, message_prefix: str) -> None:
        """Check that loads on unsupported bodies balance. Raises NotConvergedError."""
        if self._loose is not None:
            said = describe_unbalanced_body(
                self._model.grid.position, self._drive.force * self._area[:, None], self._loose
            )
            if said:
                raise NotConvergedError(f"{message_prefix}loads of {said} do not balance; add supports")


def prescribed_displacements(drive: Drive, time: float) -> Array:
    """Positions (n, d) of held components at `time`, s; 0 for others, and for those with a prescribed velocity."""
    at = np.zeros(drive.force.shape)
    holds = drive.holds
    still = holds.kind == DISPLACEMENT
    at[holds.node[still], holds.axis[still]] = (holds.value * factors_at(drive.profiles, time)[holds.profile])[still]
    return at
