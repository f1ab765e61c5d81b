"""Plates with a fine zone of any shape, to ask questions of."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray
from plates import plate, square_grid

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh.model.document import Material, Region, Run, Velocity
from pdmesh.model.node_grid import Grid
from pdsolve.adaptivity.hybrid.arrays import LatticeConstants, PlateZone
from pdsolve.adaptivity.hybrid.engine import HybridEngine
from pdsolve.adaptivity.hybrid.prepare import create_hybrid_operator_and_stable_step
from pdsolve.model import Model, ModelWarning
from pdsolve.options import Options
from pdsolve.run.assembly import choose_time_step
from pdsolve.run.measures import EnergyBalanceRow
from pdsolve.run.prepare import prepare
from pdsolve.run.system import create_system_if_zone_changed
from pdsolve.zone.cells import COARSE, FAR, FINE, FREE, VOID, lattice_coordinates, place_number_at

H = 1e-3  # m

Where = Callable[[NDArray[np.float64], NDArray[np.float64]], NDArray[Any]]


class Zoned(NamedTuple):
    """A plate, and where its nodes that move are."""

    hybrid: HybridEngine

    @property
    def lattice(self) -> LatticeConstants:
        """What stays."""
        return self.hybrid.lattice

    @property
    def zone(self) -> PlateZone:
        """What changes."""
        return self.hybrid.zone

    @property
    def c11(self) -> float:
        """Of the material, N/m^2."""
        return float(self.lattice.coarse_cell_constants[0].max() + self.lattice.coarse_cell_constants[1].max())

    def lattices(self) -> Iterable[tuple[Any, NDArray[np.int64], NDArray[np.float64]]]:
        """Fine, coarse and far nodes, the places (k,) of those that move, and where they are (k, 2), m."""
        numbering = self.lattice.numbering
        zone = self.zone
        lattices = (zone.fine, numbering.fine, 1), (zone.coarse, numbering.coarse, 2), (zone.far, numbering.far, 4)
        for nodes, own, step in lattices:
            y, x = (index.ravel() for index in np.indices(own.counts[::-1]))
            places = place_number_at(own, (x, y))
            free = nodes.node_kinds[places] == FREE
            yield nodes, places[free], step * H * np.column_stack([x, y])[free]

    def put(self, displacement: Where | None = None, velocity: Where | None = None) -> None:
        """Give all nodes that move displacements, m, and velocities, m/s, by where they are."""
        for nodes, places, position in self.lattices():
            if displacement is not None:
                nodes.u[0][:, places] = displacement(*position.T)
            if velocity is not None:
                nodes.v[:, places] = velocity(*position.T)
        tied = self.zone.tied_coarse_nodes[: self.zone.counts.tied_nodes]
        first, second, w = (tied[name] for name in ("first_coarser_node", "second_coarser_node", "second_weight"))
        u = self.zone.far.u[0]
        self.zone.coarse.u[0][:, tied["border_node"]] = (1 - w) * u[:, first] + w * u[:, second]
        self.advance(1, 1)

    def advance(self, first_step: int, end_step: int) -> None:
        """Take steps; none with `end_step` = `first_step`, which computes the forces."""
        if first_step == end_step:
            self.hybrid.compute_initial_forces()
        self.hybrid.advance(first_step, end_step)
        if self.hybrid.displacement_buffer_index == 1:
            self.hybrid.displacement_buffer_index = 0
            for nodes in (self.zone.fine, self.zone.coarse, self.zone.far):
                nodes.u[0] = nodes.u[1]

    def forces(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Forces (k, 2), N/m, on all nodes that move, and where these are (k, 2), m."""
        found = [(nodes.f[:, places].T, position) for nodes, places, position in self.lattices()]
        return np.concatenate([force for force, _ in found]), np.concatenate([place for _, place in found])

    def energy(self) -> float:
        """Kinetic and strain energy, J/m."""
        return float(
            self.hybrid.kinetic_energy_and_momentum()[0] + sum(part.sum() for part in self.hybrid.strain_energies())
        )

    def conserved(self) -> float:
        """The energy that leapfrog conserves where forces are linear, J/m: that of the velocities half a step before
        and half a step after, v^2 - (a dt / 2)^2."""
        found = self.energy()
        for nodes, places, _ in self.lattices():
            found -= float((nodes.inverse_mass[places] * (nodes.f[:, places] * self.lattice.dt / 2) ** 2).sum() / 2)
        return found

    @property
    def pieces(self) -> int:
        """How many pieces of clipped bonds there are."""
        return int(self.zone.counts.clipped_pieces)


def rectangle(columns: int, rows: int, delta: float, cracks: Any = ()) -> Grid:
    """Nodes on the edges of a plate of so many spacings, half and quarter cells there; `cracks` in spacings."""
    share_x, share_y = np.ones(columns + 1), np.ones(rows + 1)
    share_x[[0, -1]] = share_y[[0, -1]] = 0.5
    corners = delta * np.array([(0, 0), (columns, 0), (columns, rows), (0, rows)], dtype=float)
    return dataclasses.replace(
        square_grid(columns + 1, rows + 1, delta),
        areas=delta**2 * np.outer(share_y, share_x).ravel(),
        outline=(corners,),
        cracks=delta * np.array(cracks, dtype=float).reshape(-1, 4),
    )


def zoned(
    columns: int,
    rows: int,
    fine: Callable[[NDArray[Any], NDArray[Any]], NDArray[np.bool_]],
    material: Material,
    ratio: float = 4.0,
    step: float = 1.0,
    cracks: Iterable[tuple[float, float, float, float]] = (),
    *,
    far: Callable[[NDArray[Any], NDArray[Any]], NDArray[np.bool_]] | None = None,
    regions: tuple[Region, ...] = (),
) -> Zoned:
    """A plate of `columns` by `rows` fine spacings, whose cells are fine where `fine(x, y)` of their columns and rows
    is true; steps of `step` times h sqrt(rho / E), `cracks` in spacings. Cells of 4 h are those of
    columns and rows where `far(x, y)` is true."""
    run = Run(time_step=step * H * (material.rho / material.E) ** 0.5, adapt="hybrid")
    grid = rectangle(columns, rows, H, list(cracks))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ModelWarning)
        shown, _ = create_hybrid_operator_and_stable_step(
            plate(grid, ratio, material=material, run=run, regions=regions), "float64", choose_time_step
        )
    hybrid = shown.engine
    numbering = hybrid.plate.numbering
    x, y = lattice_coordinates(numbering.cells, np.arange(numbering.cells.place_count))
    wanted = fine(x, y) & (hybrid.zone.cell_kinds != VOID)
    hybrid.zone.cell_kinds[hybrid.zone.cell_kinds == FINE] = COARSE
    hybrid.zone.cell_kinds[wanted] = FINE
    if far is not None:
        wide, high = (2 * (count - 1) for count in numbering.far.counts)
        inside = (x >= 0) & (y >= 0) & (x < wide) & (y < high)
        hybrid.zone.cell_kinds[inside & far(x // 2, y // 2)] = FAR
    return again(hybrid)


def again(hybrid: HybridEngine) -> Zoned:
    """The same plate numbered anew, once its cells were changed by hand; at rest."""
    hybrid.derive_nodes_from_cells()
    hybrid.compute_initial_forces()
    return Zoned(hybrid)


def pulse(centre: float, width: float) -> Any:
    """Displacements of a pulse."""
    return lambda x: 1e-6 * np.exp(-(((x - centre) / width) ** 2))


def slope(shape: Any, x: NDArray[np.float64], speed: float) -> NDArray[np.float64]:
    """Velocities of what goes to the right."""
    return np.asarray(-speed * (shape(x + H / 1000) - shape(x - H / 1000)) / (H / 500))


STEEL = Material(E=191e9, rho=8000, G0=42408, plane="strain")


STRUCK: dict[str, dict[str, Any]] = {
    "brittle": {},
    "bilinear": {"kr": 1.638, "keep_G0": True},
    "cohesive": {"f_t": 8e8, "shape": "exponential"},
}  # what steel has besides its law


def struck(adapt: str, steps: int = 170, law: str = "brittle") -> Model:
    """Kalthoff and Winkler's plate of steel, 2 mm between nodes; its bonds may soften, or have a law of one's own."""
    grid = rectangle(50, 100, 2e-3, [(0, 37.5, 25, 37.5), (0, 62.5, 25, 62.5)])
    impact = Velocity(box=(-1.0, 75e-3, 1e-4, 125e-3), x=15.0 if law == "bilinear" else 16.5)
    material = msgspec.structs.replace(STEEL, law=law, **STRUCK.get(law, {"kr": 2.0}))
    run = Run(steps=steps, every=34, ledger=17, adapt=adapt)
    return plate(grid, 4, material=material, conditions=(impact,), run=run)


class Solved(NamedTuple):
    """What a run came to."""

    first: int  # step of the first broken bond; the last step without one
    books: EnergyBalanceRow
    balance: float


def side_by_side(model: Model, steps: int | None = None) -> tuple[Solved, Solved]:
    """A model solved with a fine zone that moves, and with the fine lattice everywhere."""
    found, steps = [], steps or model.settings.run.steps
    for adapt in ("hybrid", "none"):
        run = msgspec.structs.replace(model.settings.run, adapt=adapt)
        settings = msgspec.structs.replace(model.settings, run=run)
        problem = prepare(dataclasses.replace(model, settings=settings), Options(threads=1))
        problem.advance(1, steps + 1)
        change = create_system_if_zone_changed(problem.system) if adapt == "hybrid" else None
        system, state = (problem.system, problem.state) if change is None else (change.system, change.state)
        broken, ledger = system.operator.broken(), compute_energy_balance_row(system, state, steps)
        found.append(Solved(int(broken.step.min(initial=steps)), ledger, ledger.balance_error(system.initial_energy)))
    return found[0], found[1]
