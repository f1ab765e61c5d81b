"""A model prepared for time steps: everything that does not change during them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.factory import Moving, moving_of
from pdsolve.adaptivity.hybrid.engine import ZoneSummary
from pdsolve.adaptivity.hybrid.outlook import decided
from pdsolve.adaptivity.hybrid.space.operator import SpaceHybrid
from pdsolve.adaptivity.hybrid.space.prepare import body_of, drive_of_nodes
from pdsolve.adaptivity.quadtree.incremental_bonds import filled
from pdsolve.adaptivity.quadtree.operator import SURE, Leaves, tree_over
from pdsolve.adaptivity.two_lattice_operator import FusedMarch
from pdsolve.bonds.assembly import Counted, Filling
from pdsolve.bonds.static_breakage import FamilyBonds, StaticBreakage
from pdsolve.checks import refuse, refuse_fields, refuse_on_ranks
from pdsolve.conditions import (
    Drive,
    damping,
    drive,
    held,
    initial_acceleration,
    initial_velocity,
    refuse_layers,
    widened,
)
from pdsolve.diffusion import system as diffusion
from pdsolve.diffusion.broken_bonds import BrokenBonds
from pdsolve.diffusion.swelling import Swelling, cycle_of
from pdsolve.diffusion.system import Transport
from pdsolve.laws import law_of
from pdsolve.model import Model, ModelError, counted
from pdsolve.numerics.thread_team import cores, crew
from pdsolve.operators.bond_list import BondList
from pdsolve.operators.contact.operator import PenaltyContact
from pdsolve.operators.ground_supports import bonded, supported
from pdsolve.operators.protocol import Operator
from pdsolve.operators.simd_lattice.operator import SimdLattice
from pdsolve.operators.softening_shear import softening_of
from pdsolve.options import Options as Options
from pdsolve.options import threads_of as threads_of
from pdsolve.run.explicit_stepper import stepper_of, stepper_of_content
from pdsolve.run.on_device import OnDevice, fetch
from pdsolve.run.operator_factory import for_swelling, operator_of, touched, touched_at_rest
from pdsolve.run.operator_factory import stable as stable
from pdsolve.run.time_step import step_of as step_of
from pdsolve.schemes import SCHEMES
from pdsolve.schemes.scheme import Scheme
from pdsolve.state import State
from pdsolve.steppers.equilibrium import Method, forces
from pdsolve.steppers.euler import Euler
from pdsolve.steppers.load_steps import LoadSteps
from pdsolve.steppers.newton import FACTORED_IN, Newton
from pdsolve.steppers.path_steps import PathSteps
from pdsolve.steppers.protocol import Stepper
from pdsolve.steppers.relaxation import Relaxation
from pdsolve.steppers.static_loads import follows_path, in_load_steps, in_steps_of_content
from pdsolve.steppers.stepped_rest import SteppedRest, repeating
from pdsolve.steppers.touching import Touching

if TYPE_CHECKING:
    from pdsolve.crack_growth.growth import Growth


WORTH_HYBRID = 25_000  # nodes of a plate with a fine zone that moves, were they all there


@dataclass(frozen=True)
class System:
    """A prepared model; n nodes."""

    model: Model
    options: Options
    scheme: Scheme
    operator: Operator
    stepper: Stepper
    drive: Drive  # loads and holds; what they are now changes with time
    area: NDArray[np.float64]  # (n,) m^2
    family: NDArray[np.int64]  # (n,) bonds that count in damage, those cut by a pre-crack included
    count: NDArray[np.int64]  # (n,) bonds at the start, those cut by a pre-crack left out
    time_step: float  # s
    bound: float  # surely stable time step, s
    initial_energy: float  # J/m
    whole: Model | None = None  # all there is to solve, where `model` is of the nodes there are now
    growth: Growth | None = None  # cracks that are particles
    contact: PenaltyContact | None = None  # of bodies and crack faces; a part of the operator
    transport: Transport | None = None  # what carries a substance; None: the model moves
    beside: tuple[Prepared, ...] = ()  # other unknowns of the same nodes, which the stepper marches too
    broken_before: int = 0  # directed bonds that broke and are none of the operator's: of nodes that are gone

    @property
    def asked(self) -> Model:
        """The model as given, with all conditions."""
        return self.whole or self.model

    @property
    def kernel(self) -> str:
        """The kernel that sums the forces of bonds, by name."""
        return bonded(self.operator).name

    @property
    def device(self) -> str:
        """What sums bonds: cpu, or the name of a device."""
        return self.stepper.session.about.name.strip() if isinstance(self.stepper, OnDevice) else "cpu"

    @property
    def hybrid(self) -> Moving | None:
        """The operator if it has a moving fine zone and its own energy ledger; otherwise None."""
        return self.operator if isinstance(self.operator, Moving) else None

    @property
    def load_steps(self) -> LoadSteps | None:
        """What takes load steps, if the model is solved at rest."""
        taken = self.stepper.motion if isinstance(self.stepper, Swelling) else self.stepper
        return taken if isinstance(taken, LoadSteps) else None

    @property
    def zone_summary(self) -> ZoneSummary | None:
        """Summary of finer nodes that come and go; None without any."""
        return self.operator.zone_summary() if isinstance(self.operator, Moving | Leaves | SpaceHybrid) else None

    def load_time(self, step: int) -> float:
        """Time of the profiles of conditions after `step`, s."""
        return self.stepper.factor if isinstance(self.stepper, SteppedRest) else step * self.time_step

    @property
    def threads(self) -> int:
        """Number of threads that share the work."""
        return threads_of(self.options, len(self.model.grid), isinstance(self.operator, SimdLattice))

    @property
    def bonds(self) -> int:
        """Number of directed bonds at the start."""
        return int(self.count.sum())


class Prepared(NamedTuple):
    """A system and its state, ready to march."""

    system: System
    state: State

    def march(self, first: int, last: int) -> None:
        """Take the steps `first` to `last` - 1, in place."""
        self.system.stepper.march(self.state, first, last)
        fetch(self.system.stepper)


def scheme_of(model: Model, options: Options) -> Scheme:
    """The scheme that options name. Raises ModelError for an unsupported model or option."""
    if options.mode not in SCHEMES:
        raise ModelError(f"mode: found '{options.mode}', expected one of {', '.join(SCHEMES)}")
    if options.precision not in ("float64", "float32"):
        raise ModelError(f"precision: found '{options.precision}', expected float64 or float32")
    if options.kernel not in (None, "blocks", "listed", "hybrid", "collocation"):
        raise ModelError(f"kernel: found '{options.kernel}', expected blocks or listed")
    if options.threads is not None and not 1 <= options.threads <= cores():
        raise ModelError(f"threads: found {options.threads}, expected 1 to {cores()}")
    scheme = SCHEMES[options.mode]
    refuse(model, scheme.partial_cells)
    if model.settings.run.cracks != "bonds" and not scheme.symmetric:
        raise ModelError(f"{model.name}: mode: found {scheme.name}, expected conservative with cracks of particles")
    refuse_layers(model)
    return scheme


def prepare(model: Model, options: Options) -> Prepared:
    """A model's bonds and conditions, and its state at time 0. Raises ModelError for an unsupported model."""
    found = _prepared(decided(model, options), options)
    system = found.system
    whole = None if system.whole is None else counted(system.whole, system.time_step)
    return found._replace(system=replace(system, model=counted(system.model, system.time_step), whole=whole))


def _prepared(model: Model, options: Options) -> Prepared:
    if options.team is not None:
        refuse_on_ranks(model)
    if model.diffuses:
        return _diffusing(model, options)
    scheme = scheme_of(model, options)
    if model.swells:
        return _swelling(model, options, scheme)
    if model.settings.run.cracks == "particles" and model.materials[0].detour is not None:
        options = options._replace(kernel="listed")  # blocks keep the weights that their bonds began with
    if model.settings.run.adapt == "split":
        return _split(model, options, scheme)
    if model.settings.run.adapt != "none":
        return (_moving if model.grid.dimension == 2 else _in_space)(model, options, scheme)
    if model.settings.run.solver == "static":
        return at_rest(in_load_steps(model, options.precision), options, scheme)
    return system_of(model, options, scheme)


def _diffusing(model: Model, options: Options) -> Prepared:
    """A prepared model of diffusion. Raises ModelError for an unsupported one."""
    diffusion.expect_usual(model, options)
    found, state = diffusion.prepare(model, options.threads, options.kernel == "listed")
    operator, volume = found.operator, found.operator.volume
    system = System(
        model=found.model,
        options=options._replace(threads=found.threads),
        scheme=SCHEMES["conservative"],
        operator=operator,
        stepper=stepper_of_content(model, found, state, options.team),
        drive=found.drive,
        area=volume,
        family=operator.count + found.blocked,
        count=operator.count,
        time_step=found.time_step,
        bound=found.bound,
        initial_energy=0.0,
        transport=found,
    )
    return Prepared(system, state)


def _swelling(model: Model, options: Options, scheme: Scheme) -> Prepared:
    """A model of a motion that a content swells. Raises ModelError for what cannot be solved so."""
    if not scheme.symmetric:
        raise ModelError(f"{model.name}: found {scheme.name}, expected mode conservative of bonds that swell")
    options, rests = for_swelling(model, options), model.settings.run.solver == "static"
    if rests:
        model = in_steps_of_content(model, options.precision)
        system, state = at_rest(model.moving_part(), options, scheme)
    else:
        system, state = system_of(model.moving_part(), options, scheme)
    content = _diffusing(model.diffusing_part(system.time_step), Options(threads=options.threads))
    transport, marches, cycle = content.system.transport, content.system.stepper, 1
    bonds = bonded(system.operator)
    assert isinstance(bonds, BondList | SimdLattice)
    assert transport is not None
    if not rests:
        cycle = cycle_of(model.settings.run, system.time_step, transport.bound)
        marches = Euler(transport.operator, transport.drive, cycle * system.time_step)
    assert model.settings.medium is not None
    share = model.settings.medium.broken
    broken = None if share == 1 else BrokenBonds(transport, bonds, share)
    if model.settings.medium.heat_capacity is not None:
        content = content._replace(state=content.state._replace(second=np.zeros((len(model.grid), 1))))
    stepper = Swelling((marches, content.state), system.stepper, bonds, model, cycle, broken, transport.free)
    if not rests:  # the first half step goes with what the strains of time 0 pull
        pull = forces(system.operator, state) / system.model.rho[:, None]
        state.second[:] += np.where(held(system.drive), 0.0, pull)
        stepper.begin(state)
    energy = system.initial_energy + float(np.sum(system.area * system.operator.energies(state)[0]))
    return Prepared(replace(system, stepper=stepper, whole=model, beside=(content,), initial_energy=energy), state)


def _moving(model: Model, options: Options, scheme: Scheme) -> Prepared:
    """A prepared model with a moving fine zone. Raises ModelError for an unsupported one."""
    threads = options.threads or crew(len(model.grid), WORTH_HYBRID)
    shown, bound = moving_of(model, options.mode, options.precision, step_of, threads)
    state = shown.state()
    system = System(
        model=shown.model,
        options=options._replace(threads=threads),
        scheme=scheme,
        operator=shown,
        stepper=FusedMarch(shown),
        drive=shown.hybrid.drive,
        area=shown.area,
        family=shown.counts[1],
        count=shown.counts[0],
        time_step=float(shown.hybrid.ground.dt),
        bound=bound,
        initial_energy=shown.books().kinetic,
        whole=model,
    )
    return Prepared(system, state)


def _split(model: Model, options: Options, scheme: Scheme) -> Prepared:
    """A prepared model whose cells can split; none has yet. Raises ModelError for an unsupported one."""
    tree = tree_over(model, scheme.name, options.precision, options.kernel)
    cells = tree.roots()
    now = tree.model_of(cells)
    found, threads = filled(scheme.by_pairs(now)), threads_of(options, len(model.grid), False)
    operator = Leaves(tree, cells, now, found, scheme.symmetric, threads)
    bound = SURE[scheme.name] * stable(operator.stiffness_bound(), now.rho) / 2**tree.levels
    rest = assembled(now, options, scheme, operator, found.assembly.counted, (step_of(model, bound), bound))
    return _set_going(rest, tree.model, initial_velocity(model))  # of which `now` knows nothing


def _in_space(model: Model, options: Options, scheme: Scheme) -> Prepared:
    """A prepared body with a moving fine zone. Raises ModelError for an unsupported one."""
    threads = threads_of(options, len(model.grid), True)
    operator, options = body_of(model, options, threads), options._replace(threads=threads)
    bound = stable(operator.stiffness_bound(), operator.model.rho)
    steps, driven = (step_of(model, bound), bound), drive_of_nodes(operator, 0.0)
    rest = assembled(operator.model, options, scheme, operator, operator.counted, steps, driven)
    return _set_going(rest, model, initial_velocity(model)[operator.rows])


def _set_going(rest: Prepared, whole: Model, velocity: NDArray[np.float64]) -> Prepared:
    """The start of a run of the `whole` model whose current nodes have these velocities (n, d), m/s."""
    _set_off(rest.state, velocity, damping(rest.system.model), rest.system.drive)
    energy = float(np.sum(rest.system.model.rho / 2 * rest.system.area * (velocity**2).sum(axis=1)))
    return rest._replace(system=replace(rest.system, whole=whole, initial_energy=energy))


def moved(system: System, shown: Moving) -> System:
    """The system of changed nodes of the same plate."""
    count, family = shown.counts
    return replace(
        system,
        model=counted(shown.model, system.time_step),
        operator=shown,
        stepper=FusedMarch(shown),
        area=shown.area,
        family=family,
        count=count,
    )


def _filling(model: Model, scheme: Scheme) -> Filling:
    """The bonds of a model; with cracks of particles, none breaks by itself."""
    filling = scheme.fill(model)
    return StaticBreakage(filling).filling() if model.settings.run.cracks == "particles" else filling


def _growth(model: Model, operator: Operator, filling: Filling, driven: Drive, step: float | None) -> Growth | None:
    """The growth of cracks of particles, if there are any, in steps of `step` s; None: at rest. Raises ModelError."""
    if model.settings.run.cracks == "bonds":
        return None
    from pdsolve.crack_growth.growth import Growth, every_of  # shapely takes long to import, and few runs need it

    return Growth(model, operator, filling, driven, None if step is None else every_of(model, step))


def system_of(model: Model, options: Options, scheme: Scheme) -> Prepared:
    """A model's system and its state at time 0, with the bonds of this scheme. Raises ModelError."""
    filling = _filling(model, scheme)
    bonds, filled = operator_of(model, options, scheme, filling, model.settings.run.cracks == "particles")
    operator, touching = touched(model, filled.area, supported(model, filled.area, bonds))
    bound = stable(operator.stiffness_bound(), model.rho)
    found = assembled(model, options, scheme, operator, filled, (step_of(model, bound), bound))
    if touching is not None:
        touching.rigid.start(found.state, found.system.drive, found.system.time_step)
    growth = _growth(model, bonds, filling, found.system.drive, found.system.time_step)
    return found._replace(system=replace(found.system, growth=growth, contact=touching))


def assembled(
    model: Model,
    options: Options,
    scheme: Scheme,
    operator: Operator,
    filled: Counted,
    steps: tuple[float, float],
    driven: Drive | None = None,
) -> Prepared:
    """The system of a model with this operator, and its state.

    `steps`, s, are the run's step and the surely stable one; `driven` are the conditions, if not those of the model.
    """
    kind, (step, bound) = np.dtype(options.precision).type, steps
    rho = model.rho.astype(kind)
    width = sum(unknown.width for unknown in operator.unknowns)
    driven = widened(driven or drive(model, filled.area, scheme.exact_load, kind), width)
    if not driven.varies:
        driven = driven._replace(before=driven.force)
    velocity, nodes = initial_velocity(model, width), len(model.grid)
    u, v = np.zeros((2, nodes, width), dtype=kind)
    state = State(u, v, initial_acceleration(driven, rho), *np.zeros((3, nodes)))
    state, damped = operator.place(state), damping(model)
    _set_off(state, velocity, damped, driven)
    stepper, driven = stepper_of(operator, state, driven, rho, step, damped)
    energy = float(np.sum(model.rho / 2 * filled.area * (velocity**2).sum(axis=1))) if velocity.any() else 0.0
    refuse_fields(model, operator, state)
    system = System(model, options, scheme, operator, stepper, driven, *filled, step, bound, energy)
    stepper.march(state, 1, 1)  # no step: compiles before the clock runs
    return Prepared(system, state)


def _set_off(state: State, velocity: NDArray[np.float64], damped: NDArray[np.float64], driven: Drive) -> None:
    """Set velocities (n, w), m/s, and the accelerations from damping (n,), 1/s, except of prescribed components."""
    if velocity.any():
        state.rate[:] = velocity
    if damped.any():
        slowed = damped[:, None] * velocity
        slowed[driven.holds.node, driven.holds.axis] = 0.0
        state.second[:] -= slowed


def _along_path(model: Model, options: Options, scheme: Scheme) -> Prepared:
    """A model whose bonds soften, to be followed along its equilibrium path. Raises ModelError."""
    if not scheme.symmetric:
        raise ModelError(f"mode: found {scheme.name}, expected conservative, as bonds soften at rest")
    filling = scheme.fill(model)
    bonded, filled = operator_of(model, options._replace(kernel="listed"), scheme, filling)
    area, nodes = filling.area, len(model.grid)
    operator, contact = touched_at_rest(model, area, bonded)
    width = sum(unknown.width for unknown in operator.unknowns)
    driven = widened(drive(model, area, scheme.exact_load, np.float64), width)
    if driven.force.size - len(driven.holds.node) > FACTORED_IN[2]:
        most = FACTORED_IN[2] // width
        raise ModelError(f"{model.name}: $.nodes: found {nodes}, expected at most {most}, as bonds soften at rest")
    driven.force[:] = driven.before[:] = driven.held_force[:] = 0
    state = operator.place(State(*np.zeros((3, *driven.force.shape)), *np.zeros((3, nodes))))
    bonds = softening_of(model, filling.whole(), contact)
    stepper = PathSteps(model, bonded, driven, area, bonds, contact)
    step, bound = model.settings.run.time_step or 1.0, stable(operator.stiffness_bound(), model.rho)
    found = System(model, options, scheme, operator, stepper, driven, *filled, step, bound, 0.0, contact=contact)
    return Prepared(found, state)


def at_rest(model: Model, options: Options, scheme: Scheme, breaks: bool = True) -> Prepared:
    """A model in load steps, to be solved at rest; `breaks`: whether its bonds break. Raises ModelError."""
    grows = breaks and model.settings.run.cracks == "particles"
    breaks = breaks and not grows
    if breaks and follows_path(model):
        return _along_path(model, options, scheme)
    law, whole, static = law_of(model), scheme.fill(model), model.settings.run.static
    of_families = breaks and law.pair is None and any(material.failure != "none" for material in model.materials)
    no_fail = StaticBreakage(whole)
    filling = whole if of_families else no_fail.filling()
    options = options._replace(kernel="listed") if of_families else options
    bonds, filled = operator_of(model, options, scheme, filling, lasting=not of_families)
    area = filling.area
    operator, contact = touched_at_rest(model, area, supported(model, area, bonds))
    driven = drive(model, area, scheme.exact_load, np.float64)
    driven.force[:] = driven.before[:] = driven.held_force[:] = 0  # nothing acts before the first load step
    state = operator.place(State(*np.zeros((3, *driven.force.shape)), *np.zeros((3, len(area)))))
    method: Method
    if static.method == "relaxation":
        method = Relaxation(operator, static.tolerance, static.iterations)
    else:
        free, most = driven.force.size - len(driven.holds.node), FACTORED_IN[model.grid.dimension]
        method = Newton(operator, area, static.tolerance, static.iterations, free, most)
    if contact is not None:
        method = Touching(method, operator, contact)
    breakable = no_fail.breakable() if breaks and law.pair is not None else None
    breaking = FamilyBonds(bonds) if of_families and isinstance(bonds, BondList) else breakable
    remember = {"remember": bonds.remember} if isinstance(bonds, BondList) else {}
    growth = _growth(model, bonds, filling, driven, None) if grows else None
    fatigue, look = model.settings.run.fatigue, growth.look if growth else None
    stepper = LoadSteps(model, operator, driven, area, method, breaking, None if fatigue else look, **remember)
    step, bound = float(model.settings.run.time_step or 0.0), stable(operator.stiffness_bound(), model.rho)
    found = System(model, options, scheme, operator, stepper, driven, *filled, step, bound, 0.0)
    found = replace(found, growth=growth, contact=contact)
    if fatigue is not None and (breaks or grows):
        found = replace(found, stepper=repeating(model, operator, stepper, breakable, *filled[1:], growth))
    return Prepared(found, state)
