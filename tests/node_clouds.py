"""Clouds of nodes in the plane and in space, and an operator for each law on them."""

from __future__ import annotations

from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray
from plates import GLASS, plate, square_grid
from scipy.spatial import cKDTree

from pdmesh.model.document import Material, Run
from pdmesh.model.node_grid import Grid
from pdsolve.bonds.assembly import Bonds
from pdsolve.conditions import Drive, drive
from pdsolve.laws import LAWS, MODELS, breitzman_dayal, correspondence, higher_order_correspondence, wan
from pdsolve.operators.bond_list import BondList
from pdsolve.operators.protocol import Operator
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.state import State
from pdsolve.steppers.verlet import Verlet

DELTA, LIMIT = 1e-3, 1e-3  # m; stretch at which a bond in space breaks, in the plane it is 1.3e-3


def glass(law: str) -> Material:
    """Glass of this law, of a Poisson's ratio that springs do not have, where the law is not theirs."""
    if law == "cohesive":
        return msgspec.structs.replace(GLASS, law=law, G0=60.0, f_t=30e6)
    if law in LAWS:
        return msgspec.structs.replace(GLASS, law=law, kr=3.0)
    return msgspec.structs.replace(GLASS, **({"model": law, "nu": 0.2} | VARIANTS.get(law, {})))


SVK = {"model": "correspondence", "solid": "svk"}  # as linear ones do not turn
VARIANTS = {
    "correspondence": SVK,
    "neo-hooke": SVK | {"solid": "neo hooke"},
    "order-3": SVK | {"order": 3},
    "constant-term": SVK | {"constant_term": True, "solid": "neo hooke"},
    "breitzman-dayal": SVK | {"control": "breitzman-dayal"},
    "wan": SVK | {"control": "wan"},
    "wan-neo-hooke": SVK | {"control": "wan", "solid": "neo hooke"},
}
MODULES = {
    "neo-hooke": correspondence.LAW,
    "order-3": higher_order_correspondence.LAW,
    "constant-term": higher_order_correspondence.LAW,
    "wan-neo-hooke": wan.LAW,
}
EVERY = LAWS | MODELS | MODULES | {"breitzman-dayal": breitzman_dayal.LAW, "wan": wan.LAW}


class Case(NamedTuple):
    """A law under an operator."""

    law: str
    operator: str
    dimension: int
    precision: str

    @property
    def single(self) -> bool:
        """Whether in single precision."""
        return self.precision == "float32"

    @property
    def softens(self) -> bool:
        """Whether bonds remember how far they were stretched."""
        return "worst" in EVERY[self.law].bond_history

    @property
    def kinked(self) -> bool:
        """Whether stiffness jumps where a softened bond goes from tension to compression."""
        return self.law == "cohesive"

    @property
    def curved(self) -> bool:
        """Whether the force of an intact bond is no straight line."""
        pair = EVERY[self.law].pair
        return pair is not None and pair.is_curved

    def __str__(self) -> str:
        return f"{self.law}-{self.operator}-{self.dimension}D-{self.precision}"


CASES = [  # but for beams, which have a third unknown and small rotations (tests/laws/test_micropolar.py)
    *(
        Case(law, "listed", d, kind)
        for law in (*LAWS, "ordinary", "correspondence")
        for d in (2, 3)
        for kind in ("float64", "float32")
    ),
    *(Case(law, "listed", 2, "float64") for law in VARIANTS if law not in MODELS),
    *(Case(law, "blocks", 2, kind) for law in (*LAWS, "ordinary", "correspondence") for kind in ("float64", "float32")),
    *(Case(law, "blocks", 3, kind) for law in (*LAWS, "ordinary") for kind in ("float64", "float32")),
    Case("neo-hooke", "blocks", 2, "float64"),
    *(Case("wan", "blocks", 2, kind) for kind in ("float64", "float32")),
    Case("wan", "listed", 3, "float64"),
    Case("wan", "listed", 2, "float32"),
]
LONG = ("ordinary", "neo-hooke", "order-3", "constant-term", "breitzman-dayal", "wan", "wan-neo-hooke")  # to compile
SLOW = [  # quick are those of brittle bonds and, of each other law, one cell: each cell compiles kernels of its own
    case
    for case in CASES
    if case.law in (*LONG, "correspondence")
    or case.single
    or (case.operator, case.dimension)
    not in {"brittle": [("listed", 2), ("blocks", 2), ("listed", 3)]}.get(case.law, [("listed", 2)])
]


class Cloud(NamedTuple):
    """n nodes of a square or cubic lattice and what pulls at them."""

    operator: Operator
    state: State  # at rest
    position: NDArray[np.float64]  # (n, d) m
    cell: NDArray[np.float64]  # (n,) m^d
    rho: NDArray[np.floating]  # (n,) kg/m^3
    bound: float  # s

    def forces(self, step: int = 2, dt: float = 1e-12) -> NDArray[np.float64]:
        """Force densities (n, d) of the state as it is."""
        out = np.zeros(self.position.shape)
        self.operator.accumulate_force(self.state, out, step, dt)
        return out

    def energy(self) -> float:
        """Held by all bonds, J."""
        return float(np.sum(self.cell * self.operator.energies(self.state)[0]))

    def advance(self, first_step: int, end_step: int) -> None:
        """Take the steps `first_step` to `end_step` - 1 at half the bound, free of loads."""
        nodes, dimension = self.position.shape
        Verlet(self.operator, idle(nodes, dimension), self.rho, self.bound / 2).advance(
            self.state, first_step, end_step
        )

    def shake(self, size: float, seed: int = 3) -> None:
        """Random displacements of this size, m, at rest."""
        self.state.value[:] = size * np.random.default_rng(seed).standard_normal(self.position.shape)
        self.state.rate[:] = 0

    def tear(self) -> None:
        """Some bonds broken, others softened where they do, and then all let go to less than half the way."""
        self.shake(1.2e-6)
        self.forces(1)
        self.state.value[:] *= 0.4


def idle(nodes: int, dimension: int) -> Drive:
    """Nothing that acts on so many nodes."""
    nothing = drive(plate(square_grid(2, 1)), np.ones(2), True, np.float64)
    return nothing._replace(force=np.zeros((nodes, dimension)), before=np.zeros((nodes, dimension)))


def cloud(case: Case, side: int, order: NDArray[np.int64] | None = None, threads: int = 1) -> Cloud:
    """A lattice of side^d nodes in this order; row by row if None."""
    if case.dimension == 3 and case.operator == "listed":
        return in_space(case, side, order, threads)
    return on_a_lattice(case, side, order, threads)


def on_a_lattice(case: Case, side: int, order: NDArray[np.int64] | None, threads: int) -> Cloud:
    """A plate of the conservative mode, m = 3, or a cube, m = 2."""
    grid = square_grid(side, side) if case.dimension == 2 else cubic_grid(side)
    if order is not None:
        grid.position[:] = grid.position[order]
    material = glass(case.law)
    if case.dimension == 3:
        material = msgspec.structs.replace(material, plane="space")
    model = plate(grid, 5 - case.dimension, material=material, run=Run(time_step=1e-9))
    system, state = prepare(model, Options("conservative", case.precision, threads, case.operator))
    assert system.operator.name == case.operator
    rho = model.rho.astype(case.precision)
    return Cloud(system.operator, state, grid.position, system.area, rho, system.stable_time_step)


def cubic_grid(side: int) -> Grid:
    """A cube of side^3 nodes, the last axis changing fastest."""
    position = DELTA * np.stack(np.meshgrid(*[np.arange(side)] * 3, indexing="ij"), axis=-1).reshape(-1, 3)
    nowhere = np.full(len(position), -1)
    ids, delta = np.arange(len(position)) + 1, np.full(len(position), DELTA)
    return Grid(ids, position, delta, nowhere >= 0, nowhere, np.zeros((0, 9)))


def in_space(case: Case, side: int, order: NDArray[np.int64] | None, threads: int) -> Cloud:
    """A cube, m = 2."""
    position = cubic_grid(side).position[slice(None) if order is None else order]
    nodes = len(position)
    pairs = cKDTree(position).query_pairs(2.001 * DELTA, output_type="ndarray")
    source, target = np.concatenate([pairs, pairs[:, ::-1]]).T
    at = np.lexsort((target, source))
    source, target = source[at], target[at]
    every, cell = np.ones(len(source)), DELTA**3
    limit = LIMIT * every
    exact = Bonds(
        start=np.searchsorted(source, np.arange(nodes + 1)),
        neighbour=target.astype(np.int32),
        xi=position[target] - position[source],
        stiffness=6 * GLASS.E / (np.pi * (2 * DELTA) ** 4) * cell * every,
        peak=limit if case.law == "brittle" else limit / 3,
        limit=limit,
        weight=cell * every,
    )
    model = plate(square_grid(nodes, 1), material=glass(case.law))
    operator = BondList(EVERY[case.law], model, exact, True, case.precision, threads)
    zeros = (np.zeros((nodes, 3), dtype=case.precision) for _ in range(3))
    state = State(*zeros, dissipated=np.zeros(nodes), work=np.zeros(nodes), damped=np.zeros(nodes))
    rho = np.full(nodes, GLASS.rho, dtype=case.precision)
    bound = float(np.sqrt(2 * GLASS.rho / operator.stiffness_bound().max()))
    return Cloud(operator, state, position, np.full(nodes, cell), rho, bound)


def all_kernels(case: Case) -> None:
    """Call all that is compiled for a case."""
    made = cloud(case, 6)
    made.advance(1, 3)
    made.energy()
    if not case.single:
        made.operator.tangent(made.state)


def turn(dimension: int, degrees: float = 40.0) -> NDArray[np.float64]:
    """A rotation (d, d); in space around an axis that is none of the lattice's."""
    angle = np.radians(degrees)
    if dimension == 2:
        return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    x, y, z = np.array([1.0, 2.0, 3.0]) / np.sqrt(14)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)
