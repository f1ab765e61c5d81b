"""What of a pulse comes back from the seam of a fine zone, of whatever kind.

A P pulse exp(-(x / w)^2) leaves the fine left part of a plate for its coarse right part, upright to the seam between
them. The plate is so high that nothing comes from its edges to the middle row, where velocities are compared: the
largest left of the seam when what comes back of the pulse is where it began, over the largest at the start.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh import Scene, box
from pdmesh.grid.building import build
from pdmesh.model.document import Collocation, Material, Run
from pdmesh.model.material_constants import C11
from pdsolve.adaptivity.collocation.engine import CollocationEngine
from pdsolve.adaptivity.collocation.operator import CollocationOperator
from pdsolve.adaptivity.collocation.zone import COARSE as ACTIVE
from pdsolve.adaptivity.collocation.zone import FINE as BONDED
from pdsolve.adaptivity.hybrid.engine import HybridEngine
from pdsolve.adaptivity.hybrid.operator import HybridOperator
from pdsolve.adaptivity.quadtree.leaf_mapping import leaves_after_split_and_merge
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun
from pdsolve.zone.cells import AROUND, COARSE, FINE, FREE, VOID

H, RATIO = 1e-3, 4  # m; horizon over spacing
WIDTHS = (4, 8, 16)  # spacings: half, one and two times two horizons
MATERIAL = Material(E=1e9, rho=1e3, G0=1e30, plane="strain")
SPEED = float((C11["strain"] * MATERIAL.E / MATERIAL.rho) ** 0.5)  # m/s
HEIGHT = 1e-6  # m
STEP = 0.5  # H sqrt(rho / E)

Field = Callable[[NDArray[np.float64]], NDArray[np.float64]]  # along x, by x


class Marching(NamedTuple):
    """A plate on which a pulse is put."""

    put: Callable[[Field, Field, Field], None]  # displacements, velocities at the start and half a step later
    advance: Callable[[int, int], None]
    seen: Callable[[], tuple[NDArray[np.float64], NDArray[np.float64]]]  # places and velocities (n, 2) of fine nodes


def sent_back(adapt: str, drawn: bool, collocation: Collocation, widths: tuple[int, ...] = WIDTHS) -> tuple[float, ...]:
    """The share of pulses of these widths, spacings, that comes back; `drawn`: the seam is that of drawn zones."""
    return tuple(_sent_back(adapt, drawn, collocation, width) for width in widths)


def _sent_back(adapt: str, drawn: bool, collocation: Collocation, width: int) -> float:
    start = max(5 * width, 40)
    seam = 3 * start + 4 * width
    size = seam + start // 2 + 4 * width, 4 * start + 8 * RATIO
    scene = Scene(box(0, 0, *(H * side for side in size)), H, MATERIAL, RATIO, Run(steps=1))
    if drawn or adapt == "split":
        wide = seam if drawn else size[0]
        scene = replace(scene.zone(box(0, 0, H * wide, H * size[1]), H), spacing=2 * H)
    lattice = "hybrid" if adapt == "collocation" or (adapt == "none" and not drawn) else adapt
    built = build(scene.adapt(lattice))  # type: ignore[arg-type]
    step = STEP * H * (MATERIAL.rho / MATERIAL.E) ** 0.5
    run = msgspec.structs.replace(built.settings.run, adapt=adapt, collocation=collocation, time_step=step)
    model = Model(built.grid, msgspec.structs.replace(built.settings, run=run))
    plate = _plate(model, H * seam)
    shape, rate = _pulse(H * (seam - start), H * width)
    plate.put(shape, rate, lambda x: rate(x - SPEED * step / 2))
    middle, first, last = H * size[1] / 2, H * (seam - start - 3 * width), H * (seam - 3 * RATIO)

    def largest() -> float:
        place, velocity = plate.seen()
        own = (np.abs(place[:, 1] - middle) < H) & (place[:, 0] > first) & (place[:, 0] < last)
        return float(np.abs(velocity[own, 0]).max())

    sent = largest()
    plate.advance(1, round(2 * start * H / SPEED / step) + 1)
    return largest() / sent


def _pulse(centre: float, width: float) -> tuple[Field, Field]:
    """Displacements of a pulse that goes to the right, and its velocities."""

    def shape(x: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(HEIGHT * np.exp(-(((x - centre) / width) ** 2)))

    return shape, lambda x: 2 * SPEED * (x - centre) / width**2 * shape(x)


def _plate(model: Model, seam: float) -> Marching:
    """A plate of this model, fine left of the seam."""
    problem = prepare(model, Options(threads=1))
    if isinstance(problem.system.operator, HybridOperator):
        return _hybrid(problem.system.operator.engine, model, seam)
    if isinstance(problem.system.operator, CollocationOperator):
        return _collocation(problem.system.operator.engine, seam)
    if model.settings.run.adapt == "split":
        problem = split_where(problem, lambda place: place[:, 0] < seam)
    return _bonds(problem)


def _bonds(problem: PreparedRun) -> Marching:
    """Nodes that have bonds all over."""
    place, state = problem.system.model.grid.position, problem.state

    def put(shape: Field, _: Field, rate: Field) -> None:  # forces are not known yet: half a kick is left out
        state.value[:, 0], state.rate[:, 0] = shape(place[:, 0]), rate(place[:, 0])

    return Marching(put, problem.advance, lambda: (place, state.rate))


def split_where(problem: PreparedRun, where: Callable[[NDArray[np.float64]], NDArray[np.bool_]]) -> PreparedRun:
    """Cells, by the places (n, 2) of their middles, are split there and nowhere else."""
    splitting = problem.system.regridder
    tree = splitting.tree
    cells = tree.roots()
    splits = tree.mask_splittable(cells) & where(tree.centres(cells))
    new, _ = leaves_after_split_and_merge(tree, cells, splits, cells.select(np.zeros(0, dtype=np.int64)))
    kept = {"ids": tree.node_ids(new), "calm": np.zeros(len(new.root_row), dtype=np.int64), "made": np.zeros(1)}
    return splitting.create_system_with_checkpoint_nodes(problem.system, kept)


def _collocation(engine: CollocationEngine, seam: float) -> Marching:
    """Coarse nodes are active right of the seam alone."""
    lattice, plate, zone = engine.lattice, engine.plate, engine.zone
    x = lattice.spacing * (
        np.arange(lattice.numbering.place_count) % lattice.numbering.row_stride - lattice.numbering.left_margin
    )
    engine.set_active_coarse_nodes((zone.node_kinds == ACTIVE) & (x > seam))
    place = plate.model.grid.position

    def put(shape: Field, _: Field, rate: Field) -> None:
        zone.u[0, plate.place_of_grid_row], zone.v[0, plate.place_of_grid_row] = shape(place[:, 0]), rate(place[:, 0])

    def seen() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        own = engine.zone.node_kinds[plate.place_of_grid_row] == BONDED
        return place[own], engine.zone.v[:, plate.place_of_grid_row[own]].T

    return Marching(put, engine.advance, seen)


def _hybrid(hybrid: HybridEngine, model: Model, seam: float) -> Marching:
    """Cells are fine left of the seam alone."""
    zone, wide = hybrid.zone, hybrid.plate.numbering.cells.strides[1]
    cell = np.arange(hybrid.plate.numbering.cells.place_count)
    left = (
        (2 * hybrid.plate.spacing * (cell % wide - AROUND) < seam)
        & (cell // wide >= AROUND)
        & (zone.cell_kinds != VOID)
    )
    zone.cell_kinds[zone.cell_kinds == FINE] = COARSE
    zone.cell_kinds[left] = FINE
    hybrid.derive_nodes_from_cells()
    hybrid.compute_initial_forces()
    place, coarse = model.grid.position, np.flatnonzero(zone.coarse.node_kinds == FREE)
    lattices = (
        (hybrid.plate.fine_places, place),
        (coarse, place[hybrid.plate.grid_rows_at(hybrid.fine_places_of_coarse(coarse))]),
    )

    def free() -> list[tuple[object, NDArray[np.int64], NDArray[np.float64]]]:
        found = []
        for nodes, (own, at) in zip((hybrid.zone.fine, hybrid.zone.coarse), lattices, strict=True):
            some = nodes.node_kinds[own] == FREE
            found.append((nodes, own[some], at[some]))
        return found

    def put(shape: Field, rate: Field, _: Field) -> None:
        for nodes, own, place in free():
            nodes.u[0][0, own], nodes.v[0, own] = shape(place[:, 0]), rate(place[:, 0])  # type: ignore[attr-defined]
        hybrid.compute_initial_forces()

    def seen() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        nodes, own, place = free()[0]
        return place, nodes.v[:, own].T  # type: ignore[attr-defined]

    return Marching(put, hybrid.advance, seen)
