"""Cost of a run: the estimate behind `pdsolve --dry-run`, `pdmesh plan` and `pdmesh info`.

Bonds and steps are those of the run. Memory and time follow measured rules, checked by `make bench-speed`. Time is that
of the measured machine, scaled by the speed of a multiplication on this one.
"""

from __future__ import annotations

import dataclasses
import time
from functools import cache
from typing import Any, NamedTuple

import msgspec
import numpy as np

from pdmesh.model.document import ARC, ON_ONE_LATTICE, Absorb, Load, Run, Settings
from pdsolve.checks import warn_of_model
from pdsolve.conditions import has_conditions
from pdsolve.diffusion.swelling import steps_per_content_step
from pdsolve.laws import law_of
from pdsolve.model import Model, counted
from pdsolve.numerics.memory import aligned
from pdsolve.operators.protocol import BondLayout
from pdsolve.operators.stiffness_damping import damped_stable_time_step
from pdsolve.options import Options, threads_of
from pdsolve.rest.newton import FACTORED
from pdsolve.rest.path import CRACK_STEPS
from pdsolve.rest.static_loads import (
    uses_arc_length_control,
    uses_crack_length_control,
    uses_softening_path_control,
)
from pdsolve.run.assembly import (
    choose_time_step,
    compute_stable_time_step,
    count_bonds_and_compute_stiffness_bound,
    stable_time_step_from_stiffness_bound,
)
from pdsolve.run.initial_states import prepare_quasi_static_model_of_start
from pdsolve.run.prepare import prepare, select_scheme, with_chosen_adaptivity
from pdsolve.run.system import System

DEFAULT = Options()
PATH_CONTROLS = uses_arc_length_control, uses_crack_length_control, uses_softening_path_control

# Peak of the whole process, bytes: at least, half of it libraries' files, of which systems map more or less; and for
# each node
MEMORY = {"thesis": (196e6, 1030.0), "conservative": (181e6, 1030.0)}
IN_SPACE = 1700.0  # bytes for each node of a body in tiles whose file lists it
IN_BLOCKS = 100.0  # bytes for each bond of a body in blocks
LATTICE = {"float64": 550.0, "float32": 385.0}  # bytes for each node of a box in space whose file holds a lattice
LISTED = 130.0  # bytes for each bond of a law that is no pair's
SPLITTING = 640.0  # the same where cells split: all pairs are kept, and two lists there while they do
# Seconds: of a bond and of a node in a step on one thread, breaking included; of a bond of another law; of an entry of
# the ledger and of a frame, each at least, and for each bond or node; of the beginning
BOND = {"float64": 0.35e-9, "float32": 0.2e-9}
NODE = {"float64": 9.5e-9, "float32": 6e-9}
LISTED_BOND = 12e-9
SWELLING = 4.0  # more steps' work in each cycle: what a content adds to the energy of bonds is booked
SHARED = 0.5  # of more threads' work that another thread takes over
DAMPED = 2.5  # times as long
TILED = 2.8  # likewise: of bonds in space, in tiles
BLOCKED = 7.0  # likewise, in blocks
COLLOCATED = 4.0  # likewise: most bonds are at edges, whose correction is computed in each step
LEDGER, LEDGER_BOND = 0.5e-3, 4e-9
FRAME, FRAME_NODE = 0.3e-3, 1.5e-7
BEGIN, BEGIN_NODE = 0.06, 3e-6
# At rest. Bytes: at least, of a bond, of an entry of the factors, of a bond where there are none, of one that relaxes.
# Seconds of a load step in which nothing breaks: of a bond's part of the tangent, of an entry (and its square over
# nodes) of the factors, of a bond and the root of nodes without; of a bond in an iteration of relaxation, which takes
# so many times the root of nodes
REST, REST_BOND, ENTRY, GRADIENT = 190e6, 150.0, 16.0, 700.0
RELAXED_BOND = 150.0
# Entries of the factors for each bond of a thousand nodes, and how they grow with nodes: of a plate twice as long as
# wide; those of a square are more, those of a strip fewer
FILL, GROWTH = 20.4, 0.31
DEAD = 1.2  # times as much beyond the least under dead loads, where pivots say whether a body stays
# Along an equilibrium path of softening bonds: steps at least, and for each of the load steps asked for (19 to 72 with
# 10 to 160); seconds of a step at least, of a bond, and of factors, in the plane: .54 to 2.2 of eight runs' CPU
TAKEN, TAKEN_MORE = 30, 0.25
STEPPED, STEPPED_BOND, STEPPED_FACTORS = 0.01, 1.6e-6, 4.5e-8
# By arc length: steps for each load step (.27 of 80, .5 of 10), which take as long as one; in space, of softening, a
# step beside a load step
ARCS, ARC_STEP, IN_SPACE_STEP = 0.4, 1.0, 0.7
JUMPED = 4.0  # times as long as a load step takes a step of jumps of cycles
TANGENT, SOLVED, FACTOR, WITHOUT = 1.5e-6, 1.6e-8, 0.9e-10, 7e-8
RELAXED, LONG = 1.1e-9, 28.0
# Of diffusion: s of a bond and of a node in a step; bytes at least, of a bond while it is prepared, of a node
DIFFUSING_BOND, DIFFUSING_NODE = 2e-9, 2e-8
DIFFUSING, DIFFUSING_BOND_BYTES, DIFFUSING_NODE_BYTES = 1.6e8, 90.0, 1700.0
PRODUCTS, ROUNDS, REFERENCE = 4096, 3000, 0.84e-6  # s of so many products where that was measured


REPORT_KEYS = {  # of fields of a plan, where they differ
    "steps_are_load_steps": "at_rest",
    "steps_are_path_steps": "along_path",
    "steps_are_cycle_jumps": "in_jumps",
    "uses_block_kernels": "in_blocks",
    "node_count_if_all_fine": "finest",
    "cut_bond_count": "cut",
    "node_count_if_all_split": "most",
}


class Plan(NamedTuple):
    """Size, memory and time of a run."""

    nodes: int
    bonds: int  # directed, at the start, those that pre-cracks cut left out
    steps: int
    time_step: float  # s
    stable_time_step: float  # s
    memory: int  # bytes of the process at its peak
    wall_time: float  # s of the time loop, with its ledger and frames; at rest, what breaking adds is left out
    steps_are_load_steps: bool = False
    steps_are_path_steps: bool = False  # of an equilibrium path, about so many
    steps_are_cycle_jumps: bool = False  # at most so many
    uses_block_kernels: bool = True  # summed by the kernels of pairs on lattices; False: bond by bond
    node_count_if_all_fine: int | None = None  # where the others are twice as far apart, and come and go
    cut_bond_count: int = 0  # directed bonds that pre-cracks cut
    node_count_if_all_split: int | None = None  # nodes if all cells were to split, of which none has at the start

    def report_entries(self) -> dict[str, Any]:
        """The numbers by their keys in reports."""
        return {REPORT_KEYS.get(name, name): value for name, value in self._asdict().items()}


def estimate_run(model: Model, options: Options = DEFAULT) -> Plan:
    """Cost of solving the model; with a moving fine zone, that of its initial state. Raises ModelError."""
    if model.has_diffusion_only:
        return _estimate_diffusion_cost(model, options)
    model = with_chosen_adaptivity(model, options)
    scheme, settings = select_scheme(model, options), model.settings
    paired, splits = law_of(model).pair is not None, settings.run.adapt == "split"
    moves = settings.run.adapt in ON_ONE_LATTICE
    most = len(model.grid) * 4**settings.run.split.levels
    cycle: int | None = None  # of steps for one of a content
    along_path = False
    paired &= not splits  # which is listed bond by bond
    prepared = (
        prepare_quasi_static_model_of_start(model, options, scheme).system if settings.run.start == "static" else None
    )
    summed: BondLayout = "blocks" if paired and model.grid.dimension == 2 and (moves or not model.swells) else "listed"
    if prepared is not None and not moves:
        summed = prepared.operator.bond_layout if paired and summed == "listed" else summed
        count, family = prepared.initial_bond_counts, prepared.family_sizes
        bound = compute_stable_time_step(model, prepared.operator)
        step = choose_time_step(model, bound)
    elif paired and not (moves or model.swells) and settings.run.solver != "static":
        counts, stiffness_bound, summed = count_bonds_and_compute_stiffness_bound(model, options, scheme)
        count, family = counts.bonds, counts.family
        undamped = stable_time_step_from_stiffness_bound(stiffness_bound, model.rho)
        bound = damped_stable_time_step(undamped, settings.run.damping_time)
        step = choose_time_step(model, bound)
    else:
        system = prepare(model, options._replace(team=None)).system  # all nodes, also where ranks ask
        model = system.model
        if system.coupled_runs and settings.run.solver != "static":
            content_step = system.coupled_runs[0].system.stable_time_step
            cycle = steps_per_content_step(system.time_step, content_step)
        summed = system.operator.bond_layout if paired and summed == "listed" else summed
        count, family, settings = system.initial_bond_counts, system.family_sizes, system.model.settings
        bound, step = system.stable_time_step, system.time_step
        along_path = settings.run.solver == "static" and any(control(model) for control in PATH_CONTROLS)
        if along_path:
            run = msgspec.structs.replace(settings.run, steps=_estimate_path_step_count(settings.run))
            settings = msgspec.structs.replace(settings, run=run)
            model = dataclasses.replace(model, settings=settings)
    settings = counted(model, step).settings
    warn_of_model(model, np.flatnonzero(count == 0), scheme.partial_cells, scheme.symmetric)
    options = options._replace(threads=1) if moves else options
    plan = estimate_size(settings, options, len(model.grid), int(count.sum()), (step, bound), summed != "listed")
    plan = plan._replace(cut_bond_count=int((family - count).sum()))
    if splits:
        plan = plan._replace(
            node_count_if_all_split=most, memory=plan.memory + round((SPLITTING - LISTED) * plan.bonds)
        )
    if model.grid.dimension == 3 and summed != "listed" and not plan.steps_are_load_steps:
        plan = _estimate_3d_motion_cost(plan, model, options, summed == "tiles")
    if along_path:
        plan = plan._replace(wall_time=_estimate_path_wall_time(system, plan), steps_are_path_steps=True)
    if cycle is not None:
        plan = plan._replace(wall_time=(1 + SWELLING / cycle) * plan.wall_time)
    grid = model.grid  # with a moving zone that of the start
    return plan._replace(node_count_if_all_fine=int(np.isclose(grid.delta, grid.delta.min()).sum())) if moves else plan


def _estimate_3d_motion_cost(plan: Plan, model: Model, options: Options, bonds_in_tiles: bool) -> Plan:
    """The plan of a body in motion from that of a plate with as many bonds in blocks."""
    if not bonds_in_tiles:
        return plan._replace(wall_time=BLOCKED * plan.wall_time, memory=plan.memory + round(IN_BLOCKS * plan.bonds))
    bytes_per_node = IN_SPACE if model.grid.lattice is None else LATTICE[options.precision]
    memory = round(MEMORY[options.mode][0] + bytes_per_node * plan.nodes)
    return plan._replace(wall_time=TILED * plan.wall_time, memory=memory)


def _estimate_path_step_count(run: Run) -> int:
    """About how many steps a path takes."""
    load_steps = run.static.load_steps or CRACK_STEPS
    if run.static.control == ARC:
        return round(ARCS * load_steps)
    return load_steps if run.static.control is not None else round(TAKEN + TAKEN_MORE * load_steps)


def _estimate_path_wall_time(system: System, plan: Plan) -> float:
    """Seconds of a path with the steps of a plan, of whose load steps this is the time."""
    if not uses_softening_path_control(system.model):
        return ARC_STEP * plan.wall_time
    if system.model.grid.dimension == 3:
        return IN_SPACE_STEP * plan.wall_time
    grid, width = system.model.grid, sum(unknown.width for unknown in system.operator.unknowns) / 2  # of two
    across = min(float(np.ptp(grid.position, axis=0).min() / np.median(grid.delta)) + 1, plan.nodes**0.5)  # nodes
    step_time = STEPPED + STEPPED_BOND * plan.bonds * width**2 + STEPPED_FACTORS * plan.nodes * across**2 * width**3
    return measure_machine_slowdown() * float(BEGIN + plan.steps * step_time)


def _estimate_diffusion_cost(model: Model, options: Options) -> Plan:
    """Cost of solving a model of diffusion, which is prepared for this."""
    system = prepare(model, options).system
    bonds, run, nodes = system.directed_bond_count, system.model.settings.run, len(model.grid)
    seconds = run.steps * (DIFFUSING_BOND * bonds + DIFFUSING_NODE * nodes) + run.steps / run.frame_interval * (
        FRAME + FRAME_NODE * nodes
    )
    memory = DIFFUSING + DIFFUSING_BOND_BYTES * bonds + DIFFUSING_NODE_BYTES * nodes
    return Plan(
        nodes,
        bonds,
        run.steps,
        system.time_step,
        system.stable_time_step,
        round(memory),
        measure_machine_slowdown() * (BEGIN + seconds),
        cut_bond_count=int((system.family_sizes - system.initial_bond_counts).sum()),
    )


def estimate_size(
    settings: Settings,
    options: Options,
    node_count: int,
    directed_bond_count: int,
    run_and_stable_time_step: tuple[float, float],
    in_blocks: bool = True,
) -> Plan:
    """Cost of solving so many nodes and bonds with the run's time step and the surely stable one, s."""
    run = settings.run
    rest, load_step = estimate_load_step_memory_and_time(run, node_count, directed_bond_count)
    if run.solver == "static":
        if has_conditions(settings, Load) and 2 * node_count <= FACTORED:
            rest = REST + DEAD * (rest - REST)
        tires = run.fatigue is not None
        seconds = measure_machine_slowdown() * (BEGIN + run.steps * (JUMPED if tires else 1) * load_step)
        return Plan(
            node_count,
            directed_bond_count,
            run.steps,
            *run_and_stable_time_step,
            round(rest),
            seconds,
            steps_are_load_steps=True,
            steps_are_cycle_jumps=tires,
        )
    least, bytes_per_node = MEMORY[options.mode]
    memory = least + bytes_per_node * node_count + (0 if in_blocks else LISTED * directed_bond_count)
    threads = threads_of(options, node_count, in_blocks)
    update = (
        directed_bond_count * BOND[options.precision] + node_count * NODE[options.precision]
        if in_blocks
        else directed_bond_count * LISTED_BOND
    )
    if in_blocks and (run.damping or has_conditions(settings, Absorb)):
        update *= DAMPED
    if run.adapt == "collocation":
        update *= COLLOCATED
    ledgers, frames = run.steps / (run.ledger or run.frame_interval), run.steps / run.frame_interval
    seconds = run.steps * update / (1 + SHARED * (threads - 1))
    seconds += ledgers * (LEDGER + LEDGER_BOND * directed_bond_count) + frames * (FRAME + FRAME_NODE * node_count)
    if run.start == "static":
        memory, seconds = max(memory, rest), seconds + load_step
    seconds = measure_machine_slowdown() * (seconds + BEGIN + BEGIN_NODE * node_count)
    return Plan(
        node_count,
        directed_bond_count,
        run.steps,
        *run_and_stable_time_step,
        round(memory),
        seconds,
        uses_block_kernels=in_blocks,
    )


def estimate_load_step_memory_and_time(run: Run, node_count: int, directed_bond_count: int) -> tuple[float, float]:
    """Memory (bytes) and time (s on the measured machine) of a load step in which nothing breaks."""
    if run.static.method == "relaxation":
        return REST + RELAXED_BOND * directed_bond_count, RELAXED * LONG * directed_bond_count * node_count**0.5
    if 2 * node_count > FACTORED:
        return (
            REST + GRADIENT * directed_bond_count,
            TANGENT * directed_bond_count + WITHOUT * directed_bond_count * node_count**0.5,
        )
    entries = FILL * directed_bond_count * (node_count / 1000) ** GROWTH
    return (
        REST + REST_BOND * directed_bond_count + ENTRY * entries,
        TANGENT * directed_bond_count + SOLVED * entries + FACTOR * entries**2 / node_count,
    )


@cache
def measure_machine_slowdown() -> float:
    """Time of a multiplication on this machine over that on the measured one, measured once: plans can be compared."""
    values, best = aligned(np.full(PRODUCTS, 0.999)), float("inf")  # else it is 1.4 in half of all processes
    for _ in range(ROUNDS):
        began = time.perf_counter()
        np.multiply(values, values, out=values)
        best = min(best, time.perf_counter() - began)
    return best / REFERENCE
