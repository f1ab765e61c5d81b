"""Every operator keeps the whole protocol: bonds in a list, on lattices, in two parts; split cells; two lattices."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable, Iterable
from functools import cache, partial
from typing import Any, NamedTuple

import msgspec
import numpy as np
import pytest
from collocation_plates import cracked
from diffusion_models import disc
from node_clouds import idle
from numpy.typing import NDArray
from plates import GLASS, plate
from scipy.sparse.linalg import eigs
from zoned_plates import H, rectangle

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh import Body, Box, build
from pdmesh.model.document import Collocation, InitialVelocity, Region, Run, Split
from pdmesh.model.node_grid import Grid
from pdsolve.adaptivity.collocation.operator import CollocationOperator
from pdsolve.adaptivity.hybrid.operator import HybridOperator
from pdsolve.bonds.assembly import Bonds
from pdsolve.errors import CheckpointError
from pdsolve.lattice.operator import BlockLattice, TileLattice
from pdsolve.laws import law_of
from pdsolve.model import Model
from pdsolve.numerics.thread_team import cores
from pdsolve.operators.bond_list import BondList
from pdsolve.operators.protocol import Operator
from pdsolve.operators.together import Together
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun
from pdsolve.schemes import average_horizon
from pdsolve.state import Broken, State
from pdsolve.steppers.verlet import Verlet


class Case(NamedTuple):
    """A model, and how it is solved; digits are those that its forces have."""

    model: Callable[[Run], Model]
    run: Run
    kernel: str | None = None
    precision: str = "float64"
    digits: float = 1e-12


COHESIVE = msgspec.structs.replace(GLASS, law="cohesive", shape="exponential", f_t=6e7)


def notched(run: Run, **more: Any) -> Model:
    """Glass with a crack from the left edge, that spins slowly."""
    start = (InitialVelocity(box=(0.0, 0.0, 1.0, 0.02), x=0.5), InitialVelocity(box=(0.02, 0.0, 1.0, 1.0), y=-0.3))
    return plate(rectangle(40, 40, H, [(0.0, 20.5, 12.0, 20.5)]), 3.0, run=run, conditions=start, **more)


def cubic(run: Run, sides: tuple[int, int, int] = (14, 12, 10), **material: Any) -> Model:
    """A block of glass with a crack of two triangles into it, that spins slowly; its right end is twice as tough."""
    along = np.meshgrid(*((np.arange(side) + 0.5) * H for side in sides), indexing="ij")
    position = np.stack(along, axis=-1).reshape(-1, 3)
    nowhere = np.full(len(position), -1)
    far, up, end = 14 * H, 5 * H, (sides[0] - 3) * H
    corners = ((0, -H, up), (6 * H, -H, up), (6 * H, far, up), (0, far, up))
    cracks = np.array([[*corners[0], *corners[k], *corners[k + 1]] for k in (1, 2)])
    grid = Grid(np.arange(len(position)) + 1, position, np.full(len(position), H), nowhere >= 0, nowhere, cracks)
    start = (InitialVelocity(box=(-1.0, -1.0, -1.0, 1.0, 1.0, up), x=0.5, z=0.1),)
    glass = msgspec.structs.replace(GLASS, plane="space", **material)
    tough = Region(
        material=msgspec.structs.replace(glass, E=0.5 * glass.E, G0=2 * glass.G0), box=(end, -1, -1, 1, 1, 1)
    )
    return plate(grid, 3.0, run=run, conditions=start, material=glass, regions=(tough,))


def graded(run: Run, **material: Any) -> Model:
    """The block of `cubic`, and cells twice as wide at its left end, off its lattice; its crack reaches into both."""
    fine = cubic(run, **material)
    coarse = np.meshgrid(*(2 * H * (np.arange(side) + 0.5) for side in (3, 6, 5)), indexing="ij")
    position = np.vstack([np.stack(coarse, axis=-1).reshape(-1, 3) - [6 * H, 0, 0], fine.grid.position])
    nowhere = np.full(len(position), -1)
    delta = np.where(position[:, 0] < 0, 2 * H, H)
    cracks = fine.grid.cracks - np.tile([2 * H, 0, 0], 3)
    grid = Grid(np.arange(len(position)) + 1, position, delta, nowhere >= 0, nowhere, cracks)
    return Model(grid, fine.settings)


@cache
def on_cells(run: Run) -> Model:
    """A block with a crack at its left end, most of whose nodes are coarse, that spins slowly; its corner is at 0."""
    long, wide, up = 40 * H, 16 * H, 6.52 * H
    corners = [(-H, -H, up), (7.1 * H, -H, up), (7.1 * H, wide + H, up), (-H, wide + H, up)]
    body = Body(Box((0, 0, 0), (long, wide, wide)), H, GLASS, run=run).adapt("hybrid")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        built = build(body.crack([[corners[0], *corners[k : k + 2]] for k in (1, 2)]))
    start = (InitialVelocity(box=(-1.0, -1.0, -1.0, 1.0, 1.0, up), x=0.5, z=0.1),)
    return Model(built.grid, msgspec.structs.replace(built.settings, run=run, conditions=start))


def stencilled(run: Run) -> Model:
    """Steel with a crack, large enough for coarse nodes."""
    start = (InitialVelocity(box=(0.0, 0.0, 1.0, 0.02), x=0.5),)
    return cracked(61, 60, 4.0, 10.0, conditions=start, run=run)


CASES = {
    "listed": Case(notched, Run(), "listed"),
    "blocks": Case(notched, Run(), "blocks"),
    "blocks, float32": Case(notched, Run(), "blocks", "float32", 5e-3),  # 3.3e-3: where bonds were is rounded
    "together": Case(notched, Run(), "together"),
    "space, listed": Case(cubic, Run(), "listed"),
    "space, blocks": Case(cubic, Run(), "blocks"),
    "space, blocks, softening": Case(partial(cubic, law="bilinear", kr=3.0), Run(), "blocks"),
    "space, blocks, float32": Case(cubic, Run(), "blocks", "float32", 3e-5),
    "space, graded": Case(graded, Run(), "blocks"),
    "space, graded, softening": Case(partial(graded, law="bilinear", kr=3.0), Run(), "blocks"),
    "space, graded, float32": Case(graded, Run(), "blocks", "float32", 5e-3),
    "split": Case(notched, Run(adapt="split", split=Split())),
    "hybrid": Case(notched, Run(adapt="hybrid")),
    "hybrid, softening": Case(partial(notched, material=COHESIVE), Run(adapt="hybrid")),
    "space, hybrid": Case(on_cells, Run(adapt="hybrid")),
    "collocation": Case(stencilled, Run(adapt="collocation", collocation=Collocation(damped=True))),
}
DOUBLE = [name for name, case in CASES.items() if case.precision == "float64"]
ENERGETIC = (  # stencils have no energy
    "listed", "blocks", "together", "space, listed", "space, blocks", "space, graded", "split", "hybrid",
    "hybrid, softening",
    "space, hybrid",
)  # fmt: skip
DEAR = (
    "hybrid",
    "collocation",
    "float32",
    "space, blocks",
    "space, graded",
    "softening",
)  # kernels that take long to compile


def marked(names: Iterable[str]) -> list[Any]:
    """Names of cases for pytest; those whose kernels take long to compile are slow."""
    return [pytest.param(name, marks=[pytest.mark.slow] * name.endswith(DEAR)) for name in names]


def fresh(name: str) -> PreparedRun:
    """A case, at its start."""
    model, run, kernel, precision, _ = CASES[name]
    if kernel == "together":
        return in_parts(model(run))
    return prepare(model(run), Options(kernel=kernel, precision=precision, threads=1))


def halves(model: Model) -> Together:
    """A plate's bonds in two lists, by whether the rows of their nodes add up to an even number."""
    whole, law = average_horizon.fill(model).whole().bonds, law_of(model)
    source = np.repeat(np.arange(len(model.grid)), np.diff(whole.start))
    even, parts = (source + whole.neighbour) % 2 == 0, []
    for which in (even, ~even):
        start = np.concatenate([[0], np.cumsum(np.bincount(source[which], minlength=len(model.grid)))])
        parts.append(BondList(law, model, Bonds(start, *(column[which] for column in whole[1:])), True))
    return Together(*parts)


def in_parts(model: Model) -> PreparedRun:
    """A model whose bonds are in two operators."""
    (system, state), operator = prepare(model, Options(kernel="listed", threads=1)), halves(model)
    stepper = Verlet(operator, system.drive, model.rho, system.time_step)
    return PreparedRun(dataclasses.replace(system, operator=operator, stepper=stepper), operator.to_own_layout(state))


@cache
def prepared(name: str) -> PreparedRun:
    """A case for tests in which nothing breaks."""
    return fresh(name)


def at(system: Any, strain: float, turn: float = 0.0) -> State:
    """Nodes stretched along x by `strain` and sheared as much, with waves in it, then turned by `turn`, rad."""
    x = system.model.grid.position
    waves = strain * H * np.sin(400 * np.roll(x, 1, axis=1) + 300 * x)
    stretch, spin = np.zeros((x.shape[1], x.shape[1])), np.eye(x.shape[1])
    stretch[0, :2] = strain
    u = x @ stretch + waves
    spin[:2, :2] = [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
    return state_of((x + u) @ spin - x, CASES_OF[system.options.precision])


CASES_OF: dict[str, type[np.floating]] = {"float64": np.float64, "float32": np.float32}


def state_of(value: NDArray[np.float64], kind: type[np.floating]) -> State:
    """Nodes with these displacements (n, w), at rest."""
    rest = np.zeros((2, *value.shape), dtype=kind)
    return State(value.astype(kind), *rest, *np.zeros((3, len(value))))


def forces(operator: Operator, state: State) -> NDArray[np.float64]:
    """Force densities (n, w), N/m^3, that are added to nothing."""
    out = np.zeros(state.value.shape, dtype=state.value.dtype)
    operator.accumulate_force(operator.to_own_layout(state), out, 1, 0.0)
    return out.astype(np.float64)


def alone(system: Any) -> NDArray[np.bool_]:
    """Nodes (n,) that are far from those that are tied to others."""
    found = np.ones(len(system.area), dtype=np.bool_)
    if isinstance(system.operator, HybridOperator):
        zone, x = system.operator.engine.zone, system.model.grid.position
        border = zone.border_nodes["border_node"][: zone.counts.border_nodes]
        tied = x[np.isin(system.operator.places, border)]
        found = np.linalg.norm(x[:, None] - tied, axis=2).min(axis=1) > 3 * H
    return found


def marched(system: Any, state: State, steps: int) -> State:
    """The state after so many steps of Verlet, by what the operator adds alone."""
    operator, (nodes, width) = system.operator, state.value.shape
    damping = operator.engine.damping[operator.places] if isinstance(operator, CollocationOperator) else np.zeros(nodes)
    kind = state.value.dtype.type
    drive = idle(nodes, width)
    drive = drive._replace(force=drive.force.astype(kind), before=drive.before.astype(kind))
    rho = system.model.rho.astype(kind)
    Verlet(operator, drive, rho, system.time_step, damping).advance(state, 1, steps + 1)
    return state


def copied(state: State) -> State:
    return State(*(one.copy() for one in state))


def nearly(digits: float, expected: NDArray[np.float64]) -> Any:
    """The same, to so many digits of the largest."""
    return pytest.approx(expected, rel=0, abs=digits * float(np.abs(expected).max()))


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("name", marked(CASES))
def test_forces_are_added_and_nothing_else_changes(name: str) -> None:
    system, _ = prepared(name)
    state = system.operator.to_own_layout(at(system, 1e-5))
    before, out = copied(state), np.full(state.value.shape, 7.0, dtype=state.value.dtype)
    system.operator.accumulate_force(state, out, 0, 0.0)
    found = forces(system.operator, before)
    assert np.abs(found).max() > 0
    assert out - 7.0 == nearly(max(CASES[name].digits, 1e-12), found)
    for one, other in zip(state, before, strict=True):
        assert np.array_equal(one, other)


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("name", marked(DOUBLE))
def test_the_tangent_is_the_derivative_of_forces(name: str) -> None:
    """Of turned and stretched nodes; measured 6e-10 and less, by differences."""
    system, _ = prepared(name)
    state, rng = at(system, 1e-5, turn=0.3), np.random.default_rng(1)
    way, small = rng.normal(size=state.value.shape), 1e-9
    slope = np.zeros(state.value.shape)
    for sign in (1, -1):
        slope += sign / (2 * small) * forces(system.operator, state._replace(value=state.value + sign * small * way))
    found = -(system.operator.tangent(state) @ way.ravel()).reshape(way.shape)
    assert found == nearly(1e-7, slope)


@pytest.mark.parametrize("name", marked(name for name in CASES if name in ENERGETIC))
def test_forces_are_the_slope_of_the_energy(name: str) -> None:
    """Measured 1.1e-6 and less, in space 4e-6, by differences of energies, which lose digits."""
    system, _ = prepared(name)
    assert system.operator.symmetric
    state, rng, small = at(system, 1e-5, turn=0.3), np.random.default_rng(2), 1e-9
    way, slope = rng.normal(size=state.value.shape) * alone(system)[:, None], 0.0
    for sign in (1, -1):
        held, _ = system.operator.energies(state._replace(value=state.value + sign * small * way))
        slope += sign / (2 * small) * float(np.sum(system.area * held))
    work = float(np.sum(system.area[:, None] * forces(system.operator, state) * way))
    assert -work == pytest.approx(slope, rel=2e-6 if state.value.shape[1] == 2 else 1e-5)


@pytest.mark.parametrize("name", marked(CASES))
def test_turning_needs_no_force(name: str) -> None:
    system, _ = prepared(name)
    whole = 2 * float(system.operator.stiffness_bound().max()) * H  # N/m^3 where a spacing is doubled
    turned = forces(system.operator, at(system, 0.0, turn=0.3))
    assert np.abs(turned).max() <= CASES[name].digits * whole


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("name", marked(DOUBLE))
def test_the_bound_is_above_all_frequencies(name: str) -> None:
    system, _ = prepared(name)
    width = system.model.grid.dimension
    operator, rho = system.operator, np.repeat(system.model.rho, width)
    rest = state_of(np.zeros((len(system.area), width)), np.float64)
    fastest = float(
        abs(eigs(operator.tangent(rest).multiply(1 / rho[:, None]).tocsr(), 1, return_eigenvectors=False)[0])
    )
    bound = 2 * float((operator.stiffness_bound() / system.model.rho).max())
    assert fastest <= bound * (1 + 1e-9)
    assert bound < 4 * fastest


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("name", marked(CASES))
def test_verlet_marches_it_as_its_own_stepper_does(name: str) -> None:
    """Twenty steps of a plate that is thrown; measured 3e-14 and less, 2e-5 in single precision."""
    system, state = fresh(name)
    other = marched(system, copied(state), 20)
    found = compute_energy_balance_row(system, other, 20)
    again, start = fresh(name)
    again.stepper.advance(start, 1, 21)
    for field in ("value", "rate", "second"):
        assert getattr(other, field) == nearly(CASES[name].digits, getattr(start, field))
    assert found.kinetic + found.strain == pytest.approx(
        sum(compute_energy_balance_row(again, start, 20)[2:4]), rel=CASES[name].digits
    )


def torn(name: str) -> tuple[PreparedRun, State, NDArray[np.float64]]:
    """A case in which a node at the tip of the crack was moved so far that bonds broke; what was held before, J/m."""
    problem = fresh(name)
    system, x = problem.system, problem.system.model.grid.position
    state = problem.system.operator.to_own_layout(at(system, 1e-7))
    held = system.area * system.operator.energies(state)[0]
    tip = TIPS[x.max() > 0.05] if x.shape[1] == 2 else IN_SPACE
    state.value[np.argmin(np.linalg.norm(x - tip, axis=1)), 1] += 0.05 * H
    return problem, state, held


IN_SPACE = (7 * H, 6 * H, 5 * H)
TIPS = {False: (0.012, 0.020), True: (0.010, 0.030)}


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("name", [name for name in DOUBLE if "softening" not in name])
def test_breaking_spends_what_bonds_held(name: str) -> None:
    """At rest: what bonds hold no more is what is booked, at the nodes that have lost them."""
    problem, state, _ = torn(name)
    system, operator = problem.system, problem.system.operator
    before = float(np.sum(system.area * operator.energies(state)[0]))
    forces(operator, state)
    lost = before - float(np.sum(system.area * operator.energies(state)[0]))
    broken = operator.broken()
    assert len(broken.step) > 5
    assert lost > 0
    assert float(np.sum(system.area * state.dissipated)) == pytest.approx(lost, rel=1e-9)
    assert set(np.flatnonzero(state.dissipated)) <= set(broken.source) | set(broken.target)
    there, ever = (set(zip(*operator.bonds(at_start=start), strict=True)) for start in (False, True))
    assert ever == set(zip(*prepared(name).system.operator.bonds(), strict=True))
    gone = set(zip(broken.source, broken.target, strict=True))
    assert not there & gone
    assert there | gone == ever


@pytest.mark.quick_cases(3)
@pytest.mark.parametrize("name", marked(CASES))
def test_what_is_kept_goes_on_alike(name: str) -> None:
    """To the same bits."""
    problem, state, _ = torn(name)
    operator = problem.system.operator
    forces(operator, state)
    kept = {key: np.array(value) for key, value in operator.checkpoint_arrays().items()}
    other = fresh(name).system.operator
    other.restore(kept, operator.broken())
    assert np.array_equal(forces(other, state), forces(operator, state))
    for one, two in zip(other.broken(), operator.broken(), strict=True):
        assert sorted(one) == sorted(two)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("precision", "digits"), [("float64", 1e-13), pytest.param("float32", 2e-6, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize(
    "law", ["brittle", *(pytest.param(law, marks=pytest.mark.slow) for law in ("bilinear", "cohesive", "ordinary"))]
)
@pytest.mark.parametrize("body", [cubic, graded])
def test_a_body_in_tiles_or_blocks_is_the_one_in_a_list(
    body: Callable[..., Model], law: str, precision: str, digits: float
) -> None:
    """Forces, energies, bonds, which break and what softening remembers; measured 3e-15, in single precision 7e-7."""
    more = {"cohesive": {"f_t": 40e6}, "ordinary": {"law": "brittle", "kr": 1.0, "model": "ordinary", "nu": 0.2}}.get(
        law, {}
    )
    model = body(Run(), **({"law": law, "kr": 3.0} | more))
    listed, tiled = (
        prepare(model, Options(kernel=kernel, precision=precision, threads=1)) for kernel in ("listed", None)
    )
    assert (listed.system.operator.name, tiled.system.operator.name) == ("listed", "blocks")
    for strain in (1e-5, 1e-3, 0.05, 1e-3, -1e-3, -0.01, -0.05):  # the second and third break or soften bonds
        found = [forces(each.system.operator, at(each.system, strain)) for each in (listed, tiled)]
        energies = [each.system.operator.energies(at(each.system, strain)) for each in (listed, tiled)]
        broken = [each.system.operator.broken() for each in (listed, tiled)]
        kept = [each.system.operator.checkpoint_arrays() for each in (listed, tiled)]
        assert found[1] == nearly(digits, found[0])
        for one, other in zip(*energies, strict=True):
            assert one == nearly(digits, other)
        assert (len(broken[0].step) > 0) >= (strain > 0.01)
        for one, other in zip(*(sorted(zip(*each, strict=True)) for each in broken), strict=True):
            assert one == other
        for one, other in zip(*(each.system.operator.bonds() for each in (listed, tiled)), strict=True):
            assert np.array_equal(one, other)
        assert kept[0].keys() <= kept[1].keys()  # blocks store more
    assert tiled.system.operator.stiffness_bound() == pytest.approx(listed.system.operator.stiffness_bound())


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("body", [cubic, graded])
@pytest.mark.parametrize("law", ["brittle", "bilinear", "cohesive"])
def test_a_body_torn_in_motion_is_the_one_in_a_list(law: str, body: Callable[..., Model]) -> None:
    """Bonds that break in a step pull for a second time in the next one; measured 2e-14 and less."""
    model, found = body(Run(time_step=2e-8), law=law, kr=3.0, **({"f_t": 70e6} if law == "cohesive" else {})), []
    for kernel in ("listed", "blocks"):
        system, state = prepare(model, Options(kernel=kernel, threads=1))
        random, x = np.random.default_rng(3), model.grid.position
        far = H if law == "brittle" else 4 * H
        state.value[:] = 3e-4 * far * random.standard_normal(state.value.shape)
        state.rate[:] = 4e3 * far * random.standard_normal(state.value.shape)
        system.stepper.advance(state, 1, 4)
        system.stepper.advance(state, 4, 9)
        broken, kept = system.operator.broken(), system.operator.checkpoint_arrays()
        arrays = [*state[:4], *system.operator.energies(state)]
        if law != "brittle":
            ends = kept["worst_source"], kept["worst_target"]
            gone = np.isin(*(one * len(x) + other for one, other in (ends, broken[1:])))  # of which not all remember
            arrays.append(np.sort(kept["worst"][~gone]))
        found.append((arrays, sorted(zip(*broken, strict=True)), np.unique(broken.step), len(kept["pending"])))
    (listed, expected, steps, pending), (fast, broken_bonds, *_, as_pending) = found
    assert broken_bonds == expected
    assert len(steps) > 3
    assert pending == as_pending
    for one, other in zip(fast, listed, strict=True):
        assert one == pytest.approx(other, rel=0, abs=1e-12 * float(np.abs(other).max(initial=0.0)))


@pytest.mark.slow
@pytest.mark.parametrize("body", [cubic, graded])
def test_softened_bodies_are_kept_to_the_same_bits(body: Callable[..., Model]) -> None:
    """On one thread and on two, and from what a checkpoint has."""
    model, found = body(Run(), law="bilinear", kr=3.0), []
    for threads in (1, min(2, cores())):
        system = prepare(model, Options(threads=threads)).system
        forces(system.operator, at(system, 1e-3))
        other = prepare(model, Options(threads=threads)).system
        other.operator.restore(system.operator.checkpoint_arrays(), system.operator.broken())
        assert len(system.operator.checkpoint_arrays()["worst"]) > 100
        found += [forces(each.operator, at(each, 5e-4)) for each in (system, other)]
    for one in found[1:]:
        assert np.array_equal(one, found[0])


@pytest.mark.parametrize(
    ("sides", "kind"), [((7, 7, 8), TileLattice), ((6, 12, 10), BlockLattice), ((12, 6, 10), BlockLattice)]
)
def test_a_body_with_few_nodes_in_a_row_is_in_no_tiles(sides: tuple[int, int, int], kind: type) -> None:
    """In a row of up to 6 nodes, two ways to a neighbour within 3.5 spacings pass as many sites."""
    assert type(prepare(cubic(Run(), sides), Options(threads=1)).system.operator) is kind


def test_two_operators_of_a_parted_plate_are_the_one_of_the_whole() -> None:
    """Forces, energies, tangent, bonds, which break, what that spends; measured 5e-16 and less."""
    whole, both = fresh("listed").system, fresh("together").system
    for strain in (1e-5, 1e-3):  # of which the last one breaks bonds
        states = [at(each, strain) for each in (whole, both)]
        found = [forces(each.operator, state) for each, state in zip((whole, both), states, strict=True)]
        held = [each.operator.energies(at(each, strain))[0] for each in (whole, both)]
        gone = [sorted(zip(*each.operator.broken(), strict=True)) for each in (whole, both)]
        assert (len(gone[0]) > 0) == (strain > 1e-4)
        assert gone[1] == gone[0]
        for one, other in (found, held, [state.dissipated for state in states]):
            assert other == nearly(1e-13, one)
        tangents = [each.operator.tangent(state) for each, state in zip((whole, both), states, strict=True)]
        assert abs(tangents[1] - tangents[0]).max() <= 1e-13 * abs(tangents[0]).max()
        for one, other in zip(both.operator.bonds(3, 40), whole.operator.bonds(3, 40), strict=True):
            assert np.array_equal(one, other)


def test_contents_and_displacements_do_not_add_up() -> None:
    with pytest.raises(ValueError, match=r"^listed.*unknowns .*'u'.*; use .*'h'"):
        Together(prepare(disc(0.5, 100), Options(threads=1)).system.operator, prepared("listed").system.operator)


def test_a_broken_bond_of_no_part_is_refused() -> None:
    operator = fresh("together").system.operator
    with pytest.raises(CheckpointError, match=r"row 0 to row 900"):
        operator.restore(operator.checkpoint_arrays(), Broken(*np.array([[1], [0], [900]])))
