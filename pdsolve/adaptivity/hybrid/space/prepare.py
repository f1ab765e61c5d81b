"""Prepares a body for a moving fine zone."""

from __future__ import annotations

from collections.abc import Callable
from math import prod

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Hybrid
from pdsolve.adaptivity.hybrid.prepare import rows_with_content_jumps
from pdsolve.adaptivity.hybrid.space import coarse_springs
from pdsolve.adaptivity.hybrid.space.arrangement import (
    BLOCK,
    FineLattice,
    list_distinct_bond_piece_vectors,
    locate_bond_part_ends,
)
from pdsolve.adaptivity.hybrid.space.engine import BodyEngine
from pdsolve.adaptivity.hybrid.space.layout import FullBody
from pdsolve.adaptivity.hybrid.space.materials import (
    least_stretches_that_make_cells_fine,
    limit_strain_ratios_of_pairs,
    relative_cell_moduli,
)
from pdsolve.adaptivity.hybrid.space.operator import HybridBodyOperator
from pdsolve.adaptivity.hybrid.space.zone import initial_cell_kinds
from pdsolve.codegen.vector_code import ROW
from pdsolve.conditions import damping, drive, initial_velocity
from pdsolve.lattice import tile_bonds
from pdsolve.lattice.sites import Sites
from pdsolve.lattice.tile_bonds import INVERSE, PULL
from pdsolve.lattice.tiles import VOLUME, Tiles
from pdsolve.laws import law_of
from pdsolve.laws.calls import bind, pair_of
from pdsolve.laws.law import Law
from pdsolve.model import Model
from pdsolve.operators.ground_supports import springs_of_components
from pdsolve.schemes.cubic_lattice_bonds import tiled
from pdsolve.zone.bond_parts import divide_bonds_at_cell_borders
from pdsolve.zone.cells import FINE, VOID, create_body_numbering, lattice_coordinates
from pdsolve.zone.prescribed_motion import nodes_kept_fine_by_prescribed_motion
from pdsolve.zone.refusals import check_straight_at_rest, create_unsupported_error

SEAM = 0.9  # of the squared sure step of the fine lattice: what short, stiff pieces leave
SHEAR = 1e-6  # of the block in which tau is found
CUBE = 8  # cells along the side of the block in which tau is found


def create_body_operator_and_stable_step(
    model: Model, precision: str, choose_time_step: Callable[[Model, float], float], threads: int
) -> tuple[HybridBodyOperator, float]:
    """The operator at the start, whose motion has this `precision`, and the surely stable step, s; `choose_time_step`
    chooses the step.

    Raises ModelError for a body that the method does not support.
    """
    swells, steep = model.swells, rows_with_content_jumps(model)
    model = model.moving_part() if swells else model
    law = law_of(model)
    pair = law.pair
    if pair is not None and pair.is_curved and (pair.elastic_in_compression or len(model.materials) > 1):
        which = f"{model.place_of(len(model.materials) - 1)}.law", f"'{model.materials[-1].law}'"
        raise create_unsupported_error(model, *which, "one material, and no elastic_in_compression, of a curved law")
    tiling = tiled(model, np.float64)
    if tiling is None:
        raise create_unsupported_error(
            model, "$.nodes", "on nodes that fit no tiles", "one cubic lattice, more than two horizons long"
        )
    h = tiling.sites.spacing
    full_body = create_full_body(law, model, tiling.sites, tiling.tiles)._replace(
        precrack_cut_counts_of_places=tiling.counted.family - tiling.counted.bonds,
    )
    numbering, tiles = full_body.fine_lattice.numbering, tiling.tiles
    check_straight_at_rest(model, float(full_body.refinement_stretch.min()))
    nodes = prod(int(count) + BLOCK for count in numbering.fine.counts)
    if (
        nodes * full_body.fine_lattice.part_ends.units_per_spacing**3 >= 1 << 63
    ):  # integers cannot count where pieces end
        reach = f"{full_body.fine_lattice.reach} spacings"
        raise create_unsupported_error(model, "$.horizon.ratio", reach, f"fewer in a lattice of {nodes} places")
    shape, count, first = numbering.fine.shape, numbering.fine.place_count, model.grid.position.min(axis=0)
    volume = tiles.cells[VOLUME][tiling.sites.margin :][:count].reshape(shape)
    cracks = (model.grid.cracks.reshape(-1, 3, 3) - first) / h
    lookups = (tiling.sites.site.astype(np.int64) - tiling.sites.margin).__getitem__, tiles.node.__getitem__
    unfit_nodes = nodes_kept_fine_by_prescribed_motion(model, numbering.fine, *lookups)
    steep_nodes = np.column_stack(lattice_coordinates(numbering.fine, lookups[0](steep)))
    has_node = tiles.node[:count].reshape(shape) >= 0
    of_surroundings = full_body.fine_lattice.reach, cracks, unfit_nodes, steep_nodes
    cells = initial_cell_kinds(numbering, volume, has_node, *of_surroundings)
    ground_springs = springs_of_components(model, model.grid.cells)
    support = (ground_springs.value / model.rho[ground_springs.node]).max(initial=0.0) / 2
    resistance = float((tiling.stiffness_bound / model.rho).max()) / SEAM + support
    driven = drive(model, model.grid.cells, True, np.float64)
    full_body = full_body._replace(
        stiffness_over_density=resistance,
        solid_cell_count=int(np.count_nonzero(cells != VOID)),
        full_drive=driven,
        damping_rates=damping(model),
        ground_springs=ground_springs,
        swells=swells,
    )
    vertex_force, kind = compute_vertex_force_ratio(law, tiles.vectors, h), np.dtype(precision).type
    engine, bound = BodyEngine(full_body, cells, vertex_force, threads, kind), float(np.sqrt(2 / resistance))
    engine.time_step = choose_time_step(model, bound)
    engine.initialize_motion(initial_velocity(model))
    return HybridBodyOperator(engine), bound


def create_operator_of_cells(
    full_body: FullBody,
    cells: NDArray[np.uint8],
    vertex_force_ratio: float,
    threads: int = 1,
    kind: type[np.floating] = np.float64,
) -> HybridBodyOperator:
    """The operator of these cells (c,), whose motion has the precision `kind`."""
    return HybridBodyOperator(BodyEngine(full_body, cells, vertex_force_ratio, threads, kind))


def create_full_body(law: Law, model: Model | None, sites: Sites, tiles: Tiles) -> FullBody:
    """What does not change of a body with these bonds, of this law."""
    bind(law)
    reach, half = int(np.abs(sites.ways).max()), len(sites.ways) // 2
    numbering = create_body_numbering(tuple(int(side) for side in sites.sides), reach)
    parts = divide_bonds_at_cell_borders(sites.ways[half:])
    fine = FineLattice(
        numbering,
        tiles,
        parts,
        np.bitwise_or.reduce(parts.side_cell_bits, axis=2),
        locate_bond_part_ends(parts, reach),
        reach,
        sites.spacing**3,
        limit_strain_ratios_of_pairs(tiles),
        *list_distinct_bond_piece_vectors(parts, tiles.vectors, sites.spacing),
    )
    at = coarse_springs.create_coarse_sites(numbering.coarse, sites.spacing)
    kappa = (Hybrid() if model is None else model.settings.run.hybrid).kappa
    return FullBody(
        law,
        model,
        fine,
        sites,
        at,
        np.zeros(len(sites.site), dtype=np.int64),
        relative_cell_moduli(numbering, tiles),
        least_stretches_that_make_cells_fine(numbering, tiles, kappa),
        pair_of(tiles.law).is_curved,
    )


def create_full_block(law: Law, table: NDArray[np.floating], h: float, cells: tuple[int, int, int]) -> FullBody:
    """A block of so many cells along each axis, all of whose bonds are those of a full lattice; see `Tiles.vectors`."""
    x, y, z = (2 * cell_count + 1 for cell_count in cells)
    ways, count, stride = np.rint(table[:, :3] / h).astype(np.int64), x * y * z, np.array([1, x, x * y])
    node = np.full(-(-count // ROW) * ROW, -1, dtype=np.int32)
    node[:count] = np.arange(count)
    margin = -(-int(np.abs(ways @ stride).max()) // ROW) * ROW
    sites = Sites((np.arange(count) + margin).astype(np.int32), node, (x, y, z), margin, h, ways)
    strength, never = table[:, PULL] / np.sqrt(table[:, INVERSE]), np.full((1, len(ways)), np.inf)
    alike = np.ones(count), np.full(count, 0.5), np.ones(count, np.bool_), np.zeros(count, np.uint8)
    springs = tile_bonds.Springs(strength, *alike, never, never)
    tiles = tile_bonds.tiles_of(law, sites, tile_bonds.bits_of_pairs(sites), springs)
    return create_full_body(law, None, sites, tiles)


def compute_vertex_force_ratio(law: Law, table: NDArray[np.floating], h: float) -> float:
    """The force on the vertex of a fine cube in a sheared block of coarse cells without body diagonals, over
    C11 h^2 gamma."""
    full_body, half = create_full_block(law, table, h, (CUBE, CUBE, CUBE)), CUBE // 2
    cells, nodes = np.zeros((CUBE,) * 3, dtype=np.uint8), 2 * CUBE + 1
    cells[half:, half:, half:] = FINE
    cells = np.pad(cells, full_body.fine_lattice.numbering.cells.margins[0], constant_values=VOID)
    operator = create_operator_of_cells(full_body, cells.ravel(), 0.0)
    vertex = CUBE * (1 + nodes + nodes**2)
    value, row = np.zeros((len(operator.places), 3)), np.searchsorted(operator.places, vertex)
    value[:, 1] = SHEAR * h * (operator.places // nodes**2)
    force = (operator.forces_at_displacements(value) - operator.forces_at_displacements(-value))[
        row, 0
    ] / 2  # without what is quadratic in the shear
    return abs(float(force)) / (coarse_springs.cubic_stiffness(table).c11 * h**2 * SHEAR)
