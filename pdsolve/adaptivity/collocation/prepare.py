"""Prepares a model for stencils on a coarse grid wherever nothing breaks."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pdmesh.model.document import Collocation
from pdmesh.model.material_constants import pressure_speed
from pdsolve.adaptivity.collocation.engine import CollocationEngine, CollocationSettings
from pdsolve.adaptivity.collocation.layout import create_constants_and_plate, create_numbering_and_places
from pdsolve.adaptivity.collocation.operator import CollocationOperator
from pdsolve.adaptivity.collocation.row_stiffness import largest_stiffness_bound, store_stiffness_once_for_equal_rows
from pdsolve.adaptivity.collocation.zone import mask_possible_coarse_nodes
from pdsolve.conditions import drive, initial_velocity
from pdsolve.model import Model
from pdsolve.operators.stencils import StencilError, elastic, longest, stencil_of
from pdsolve.zone.refusals import check_one_spacing, create_unsupported_error
from pdsolve.zone.springs import create_fine_springs

OFTEN = 8  # steps between two looks, at most
# Horizons over spacing up to which the coupling grows fast enough to need damping, and how much stops free vibration
# from growing within 4000 units of time, sqrt(E / rho) / spacing
DAMPED = ((6.0, 0.05), (16.0, 0.02))


def create_collocation_operator_and_stable_step(
    model: Model, choose_time_step: Callable[[Model, float], float], threads: int = 1
) -> tuple[CollocationOperator, float]:
    """The operator at the start, and the surely stable step, s; `choose_time_step` chooses the step.

    Raises ModelError for a model that this method does not support.
    """
    check_one_spacing(model)
    ratio, material = model.settings.horizon.ratio, model.materials[0]
    h = float(model.grid.delta[0])
    springs = create_fine_springs(material, ratio, h)
    try:
        stencil = stencil_of(ratio / 2, elastic(springs.c11, springs.c66, 2), 2)
    except StencilError as error:
        raise create_unsupported_error(
            model, "$.horizon.ratio", f"{ratio:g} ({error})", "one whose stencil is stable"
        ) from None
    at, place = create_numbering_and_places(model, int(np.abs(springs.family_dx).max()))
    lattice, plate = create_constants_and_plate(model, springs, at, place, stencil)
    lattice, plate = store_stiffness_once_for_equal_rows(lattice, plate)
    # of fine nodes: those at edges, and one full family for all others
    odd = np.flatnonzero((plate.grid_row_at_place >= 0) & ~plate.has_full_family)
    stiffness = largest_stiffness_bound(
        lattice, plate.cut_bond_bits, np.concatenate([odd, np.flatnonzero(plate.has_full_family)[:1]])
    )
    bound = min(float(np.sqrt(2 * lattice.rho / stiffness)), longest(stencil, 2 * h, material.rho))
    lattice = lattice._replace(dt=choose_time_step(model, bound))
    run_settings = model.settings.run.collocation
    every = int(ratio * h / (2 * pressure_speed(material) * lattice.dt))
    settings = CollocationSettings(
        run_settings.kappa, compute_border_damping(run_settings, model), max(1, min(OFTEN, every)), threads
    )
    margin = round(min(run_settings.margin * ratio, at.nx + at.ny))
    drive_of_rows = drive(model, plate.node_areas, True, np.float64)
    force, before = np.zeros((2, at.place_count, 2))
    force[place], before[place] = drive_of_rows.force, drive_of_rows.before
    loads, holds = (
        entries._replace(node=place[entries.node]) for entries in (drive_of_rows.loads, drive_of_rows.holds)
    )
    drive_of_places = drive_of_rows._replace(force=force, before=before, loads=loads, holds=holds)
    engine = CollocationEngine(
        plate, lattice, mask_possible_coarse_nodes(lattice, plate, margin), drive_of_places, settings
    )
    engine.set_initial_motion(initial_velocity(model))
    return CollocationOperator(engine), bound


def compute_border_damping(settings: Collocation, model: Model) -> float:
    """Damping of nodes within a horizon of the seam between fine and coarse nodes, 1/s."""
    material, ratio = model.materials[0], model.settings.horizon.ratio
    share = settings.damping
    if share is None:
        share = next((damped for below, damped in DAMPED if ratio < below), 0.0)
    return float(share * np.sqrt(material.E / material.rho) / model.grid.delta[0])
