"""Forces of a pair law on every kernel, against the list of bonds: before bonds are stretched far and after.

As a program it takes the words of a `Case`, for laws that no kernel on disk may know.
"""

from __future__ import annotations

import json
import sys
import warnings
from typing import Any, NamedTuple

import curved_law
import msgspec
import numpy as np
from node_clouds import DELTA, glass
from numpy.typing import NDArray
from plates import plate, square_grid, two_scale_grid
from scipy.spatial import cKDTree
from zoned_plates import rectangle

from pdmesh import Body, Box, build
from pdmesh.model.document import Material, Run
from pdsolve.adaptivity.two_lattice_operator import TwoLatticeOperator
from pdsolve.laws import LAWS
from pdsolve.model import Model, on_device
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun

RATIO = {2: 3.0, 3: 2.0}  # horizon over spacing
FAR = 1.2e-6  # m, displacements that soften and break bonds
KERNELS = {
    2: {"blocks": "BlockLattice", "graded": "BlockLattice", "device": "BlocksOnDevice", "zone": "HybridOperator"},
    3: {"tiles": "TileLattice", "graded": "BlockLattice", "device": "TilesOnDevice", "zone": "HybridBodyOperator"},
}  # and the class of their operator


class Case(NamedTuple):
    """A pair law on a kernel."""

    law: str
    kernel: str
    dimension: int
    precision: str

    def __str__(self) -> str:
        return f"{self.law}-{self.kernel}-{self.dimension}D-{self.precision}"


class Difference(NamedTuple):
    """How far the forces of a kernel are from those of the list."""

    stretched: float  # largest difference over the largest force, once bonds are stretched far
    released: float  # and after that at half of these displacements: of what softening and breaking have left
    broken: int  # bonds of the nodes that are compared
    same_broken: bool
    nodes: int  # that are compared


def material(law: str, dimension: int) -> Material:
    """Glass of a law, also of one that no table of the program has."""
    if law in curved_law.OWN:
        LAWS[law] = curved_law.OWN[law]
    return msgspec.structs.replace(glass(law), plane="stress" if dimension == 2 else "space", micromodulus="constant")


def model_of(case: Case) -> Model:
    """A plate or a body for a kernel, without a zone."""
    run, ratio, matter = Run(time_step=1e-9), RATIO[case.dimension], material(case.law, case.dimension)
    if case.dimension == 2:
        if case.kernel == "zone":
            return plate(rectangle(40, 40, DELTA, [(0.0, 20.5, 12.0, 20.5)]), ratio, material=matter, run=run)
        return plate(
            two_scale_grid() if case.kernel == "graded" else square_grid(24, 21), ratio, material=matter, run=run
        )
    if case.kernel == "zone":
        return cracked_block(matter, ratio, run)
    body = Body(Box((0, 0, 0), (12 * DELTA, 8 * DELTA, 8 * DELTA)), DELTA, matter, ratio, run)
    if case.kernel == "graded":
        body = body.zone(Box((8 * DELTA, 0, 0), (10 * DELTA, 8 * DELTA, 8 * DELTA)), DELTA / 2, grown=False)
    built = build(body)
    return Model(built.grid, built.settings)


def cracked_block(matter: Material, ratio: float, run: Run) -> Model:
    """A block with a crack at its left end, most of whose nodes are coarse in a zone."""
    long, wide, up = 40 * DELTA, 16 * DELTA, 6.52 * DELTA
    y = (-DELTA, wide + DELTA)
    corners = [(-DELTA, y[0], up), (7.1 * DELTA, y[0], up), (7.1 * DELTA, y[1], up), (-DELTA, y[1], up)]
    body = Body(Box((0, 0, 0), (long, wide, wide)), DELTA, matter, ratio, run).adapt("hybrid")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        built = build(body.crack([[corners[0], *corners[k : k + 2]] for k in (1, 2)]))
    return Model(built.grid, msgspec.structs.replace(built.settings, run=run))


def fine_nodes_deep_in_the_zone(operator: Any, model: Model, ratio: float) -> NDArray[np.bool_]:
    """Nodes (n,) of a zone's operator around which all nodes of the model are fine, as far as two bonds reach."""
    position, widths = model.grid.position, operator.current_nodes_model.grid.delta
    is_fine = np.zeros(len(position), dtype=np.bool_)
    is_fine[operator.grid_rows] = widths < 1.5 * DELTA
    away, _ = cKDTree(position[~is_fine]).query(position)
    return np.asarray(away[operator.grid_rows] > 2 * ratio * DELTA)


def zoned(model: Model) -> Model:
    """The model with a moving fine zone."""
    run = msgspec.structs.replace(model.settings.run, adapt="hybrid")
    return Model(model.grid, msgspec.structs.replace(model.settings, run=run), model.name)


class Kernel(NamedTuple):
    """A problem on a kernel, and the rows of the model's nodes that are compared."""

    problem: PreparedRun
    rows: NDArray[np.int64]  # (k,) of the model
    own_rows: NDArray[np.int64]  # (k,) of the operator

    def forces(self, displacement: NDArray[np.float64], step: int) -> NDArray[np.float64]:
        """Force densities (k, d) where all nodes of the model are displaced so (n, d); far bonds break in `step`."""
        (system, state), operator = self.problem, self.problem.system.operator
        every = operator.grid_rows if isinstance(operator, TwoLatticeOperator) else slice(None)
        state.value[:] = displacement[every]
        state.rate[:] = state.second[:] = 0
        if isinstance(operator, TwoLatticeOperator):
            force = np.zeros(state.value.shape)
            operator.accumulate_force(state, force, step, 0.0)
            return force[self.own_rows]
        self.problem.advance(step, step + 1)  # at rest: nothing moves before the forces are summed
        system.stepper.synchronize()
        return (state.second.astype(np.float64) * system.model.rho[:, None])[self.own_rows]

    def broken(self) -> set[tuple[int, int]]:
        """Source and target rows, of the model, of the broken bonds of the nodes that are compared."""
        rows, broken = (
            np.zeros(len(self.problem.state.value), dtype=np.int64) - 1,
            self.problem.system.operator.broken(),
        )
        rows[self.own_rows] = self.rows
        every = getattr(self.problem.system.operator, "grid_rows", np.arange(len(rows)))
        ends = rows[broken.source], every[broken.target]
        return {(i, j) for i, j in zip(*(end.tolist() for end in ends), strict=True) if i >= 0}


def kernel_of(case: Case, model: Model) -> Kernel:
    """The model on the kernel of a case."""
    options = Options("conservative", case.precision, 1, "listed" if case.kernel == "listed" else None)
    if case.kernel == "device":
        model = on_device(model, "opencl")
    problem = prepare(zoned(model) if case.kernel == "zone" else model, options)
    operator = problem.system.operator
    if not isinstance(operator, TwoLatticeOperator):
        every = np.arange(len(model.grid))
        return Kernel(problem, every, every)
    fine = np.flatnonzero(fine_nodes_deep_in_the_zone(operator, model, RATIO[case.dimension]))
    return Kernel(problem, operator.grid_rows[fine], fine)


def compare(case: Case) -> Difference:
    """Compare the forces of a kernel with those of the list of bonds in double precision."""
    model = model_of(case)
    kernel = kernel_of(case, model)
    assert type(kernel.problem.system.operator).__name__ == KERNELS[case.dimension][case.kernel]
    listed = kernel_of(case._replace(kernel="listed", precision="float64"), model)._replace(
        rows=kernel.rows, own_rows=kernel.rows
    )
    position = model.grid.position
    near = np.zeros(len(position), dtype=np.bool_)
    near[kernel.rows] = True  # others stay where they are, so that no bond breaks that leaves the fine cells
    random = FAR * np.random.default_rng(3).standard_normal(position.shape)
    displacement = (random * near[:, None]).astype(np.float32).astype(np.float64)
    found = [
        [each.forces(share * displacement, step) for each in (kernel, listed)] for step, share in ((1, 1), (5, 0.5))
    ]
    apart = [float(np.abs(one - other).max() / np.abs(other).max()) for one, other in found]
    broken = listed.broken()
    return Difference(*apart, len(broken), kernel.broken() == broken, len(kernel.rows))


if __name__ == "__main__":
    law, kernel, dimension, precision = sys.argv[1:]
    print(json.dumps(compare(Case(law, kernel, int(dimension), precision))))
