"""Chooses between a moving fine zone and fine nodes everywhere, before the first step, by what the two will cost.

Symbols: F share of the plate that is fine, h spacing, A area, L length that the cracks may run, N number of fine nodes,
q largest strain that the conditions bring over the strain at which coarse cells become fine, c_R Rayleigh wave speed. A
crack that runs leaves a strip of STRIP h, so that F grows by STRIP h L / A until the end. With the mean F of a run, its
steps cost EVEN + FIXED / N + FINE_NODES F times those with fine nodes everywhere. The constants fit the scenes of
docs/verification/adaptivity.md.
"""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Sequence
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.contradictions import Case
from pdmesh.model.document import (
    Acceleration,
    Adapt,
    Displacement,
    Hybrid,
    InitialDisplacement,
    InitialVelocity,
    Load,
    Selection,
    Velocity,
)
from pdmesh.model.material_constants import pressure_speed, rayleigh_speed
from pdmesh.model.materials import MIXED
from pdmesh.model.possible import impossible
from pdmesh.model.selection import components, given_of
from pdmesh.model.values_at_places import largest
from pdmesh.model.values_of_place import Value, is_of_place
from pdsolve.adaptivity.hybrid.coarse_cells import create_hybrid_plate, initial_cell_kinds, precrack_tips
from pdsolve.errors import FineZoneTooLateError, UnstableError
from pdsolve.model import Model, ModelError, ModelNote
from pdsolve.options import Options
from pdsolve.zone.cells import COARSE, FINE
from pdsolve.zone.springs import create_springs_of_materials

EVEN, FIXED, FINE_NODES = 0.06, 1200.0, 2.2
STRIP = 25.0  # h, width of what a crack leaves fine
GROWN = 0.45  # mean growth of F during a run, over that until its end
SPEED = 0.5  # of cracks, over c_R
SWING = 2.0  # largest stress over that at rest of a load that begins at once, as its wave comes back
DEAR = 0.85  # cost above which nodes are fine everywhere
WIDER = (0.5,)  # values of run.hybrid.kappa to begin anew with, in turn, where fine cells come too late
UNSURE = 1.2  # of the surely stable step: longer ones may make what they stretch


class ZoneSizeAndCostPrediction(NamedTuple):
    """What is known of a run with a moving fine zone before it begins."""

    fine_share_at_start: float  # F at the start
    fine_share_at_end: float  # F at the end
    strain_over_refinement_strain: float  # q
    cost_over_fine_everywhere: float  # of the steps, over those with fine nodes everywhere


def choose_adaptivity(model: Model, options: Options) -> Model:
    """The model with run.adapt hybrid or none in place of auto; a warning says which and why."""
    how, why = _choose_with_reason(model, options)
    named = "peridynamics near cracks alone (hybrid)" if how == "hybrid" else "fine nodes everywhere (none)"
    warnings.warn(f"{model.name}: $.run.adapt: auto takes {named}: {why}", ModelNote, stacklevel=3)
    return with_adaptivity(model, how) if how == "hybrid" else with_fine_nodes_everywhere(model)


def model_with_wider_zone_or_fine_everywhere(model: Model) -> Model:
    """The model with cells that become fine sooner, or with fine nodes everywhere where no wider zone is left."""
    kappa = next((wider for wider in WIDER if wider < refinement_stretch_ratio(model)), None)
    return with_fine_nodes_everywhere(model) if kappa is None else model_with_refinement_stretch_ratio(model, kappa)


def refinement_stretch_ratio(model: Model) -> float:
    """The share of the stretch that breaks bonds at which cells become fine."""
    return model.settings.run.hybrid.kappa


def model_with_refinement_stretch_ratio(model: Model, kappa: float) -> Model:
    """The model with cells that become fine at this share of the stretch that breaks bonds."""
    return with_adaptivity(model, "hybrid", hybrid=msgspec.structs.replace(model.settings.run.hybrid, kappa=kappa))


def with_fine_nodes_everywhere(model: Model) -> Model:
    """The model with fine nodes everywhere, and without the settings of fine zones."""
    return with_adaptivity(model, "none", hybrid=Hybrid())


def with_adaptivity(model: Model, adaptivity: Adapt, **settings: object) -> Model:
    """The model with this adaptivity and these settings of the run."""
    run = msgspec.structs.replace(model.settings.run, adapt=adaptivity, **settings)
    return dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, run=run))


def _choose_with_reason(model: Model, options: Options) -> tuple[Adapt, str]:
    """The adaptivity that a model gets, and why, in words."""
    if model.grid.dimension == 3:
        return "none", "its costs are known for plates only, and this is a body in space"
    if any(material.model != "bond" for material in model.materials):
        return "none", "its costs are known for bonds only, and this is a model of families"
    if any(material.law not in MIXED for material in model.materials):
        return "none", "its costs are known for brittle and bilinear bonds only"
    if model.swells:
        return "none", "its costs are known for mechanics only, and this plate swells by a content"
    hybrid = with_adaptivity(model, "hybrid")
    case = Case(hybrid.settings, 2, options.mode, options.precision, fields=model.grid.field_quantities)
    refused = next(impossible(case), None)
    if refused is not None:
        return "none", f"hybrid does not support it, {refused}"
    try:
        prediction = predict_zone_size_and_cost(hybrid, options)
    except ModelError as error:
        return "none", f"hybrid does not support it, {error}"
    shares = (
        f"{prediction.fine_share_at_start:.0%} of the plate is fine at the start, and an estimated"
        f" {prediction.fine_share_at_end:.0%} at the end"
    )
    relative_strain = prediction.strain_over_refinement_strain
    if relative_strain >= 1:
        return (
            "none",
            f"the conditions strain all of it to {relative_strain:.2g} of what makes cells fine",
        )
    how: Adapt = "hybrid" if prediction.cost_over_fine_everywhere <= DEAR else "none"
    return how, f"{shares}, about {prediction.cost_over_fine_everywhere:.2g} of the steps of fine nodes everywhere"


def predict_zone_size_and_cost(model: Model, options: Options) -> ZoneSizeAndCostPrediction:
    """Predicts what a moving fine zone will cost. Raises ModelError for a model that the method does not support."""
    plate = create_hybrid_plate(model)
    springs = create_springs_of_materials(model.materials, model.settings.horizon.ratio, plate.spacing)
    cells = initial_cell_kinds(plate, int(np.abs(springs[0].family_dx).max()))
    fine, coarse = (int(np.count_nonzero(cells == kind)) for kind in (FINE, COARSE))
    begins = fine / max(fine + coarse, 1)
    q = _estimate_largest_strain(model) / (
        model.settings.run.hybrid.kappa
        * min(float(material_springs.peak_stretch.min()) for material_springs in springs)
    )
    run, side = model.settings.run, float(np.sqrt(plate.plate_area_over_cell_area) * plate.spacing)
    material = model.materials[0]
    lasts = run.duration if run.duration is not None else run.steps * (run.time_step or 0.0)
    way = SPEED * rayleigh_speed(material.E, material.rho, material.plane) * lasts
    cracks = max(
        len(precrack_tips(plate)), int(begins > 0)
    )  # of pre-cracks, else one where an outline makes cells fine
    length = cracks * min(way or side, side)
    grows = STRIP * plate.spacing * length / (plate.plate_area_over_cell_area * plate.spacing**2)
    ends = 1.0 if q >= 1 else min(begins + grows, 1.0)
    mean = begins + GROWN * (ends - begins)
    return ZoneSizeAndCostPrediction(begins, ends, q, EVEN + FIXED / len(model.grid) + FINE_NODES * mean)


def _estimate_largest_strain(model: Model) -> float:
    """The largest strain that a single condition brings to the whole plate."""
    softest = min(material.E for material in model.materials)
    speed = min(float(pressure_speed(material)) for material in model.materials)
    sides, strain = np.ptp(model.grid.position, axis=0), 0.0
    for condition in model.settings.conditions:
        most = max((abs(float(factor)) for _, factor in getattr(condition, "profile", ())), default=1.0)
        if isinstance(condition, Load):
            across = {"traction": 1.0, "pressure": 1.0, "body_force": sides, "force": 1 / sides[::-1]}  # to stress
            stress = [
                _largest_absolute_components(model, condition, v[:2]) * across[name]
                for name, v in given_of(condition).items()
            ]
            strain = max(strain, most * SWING * float(np.max(stress)) / softest)
        elif isinstance(condition, Velocity | InitialVelocity | Displacement | InitialDisplacement | Acceleration):
            amplitude = _largest_absolute_components(model, condition, components(condition, 2))
            if isinstance(condition, Acceleration):  # as of a body force
                strains = SWING * amplitude * sides / speed**2
            else:
                is_displacement = isinstance(condition, Displacement | InitialDisplacement)
                strains = amplitude / (sides if is_displacement else speed)
            strain = max(strain, most * float(np.max(strains)))
            if isinstance(condition, InitialVelocity) and condition.spin:  # that of a rod which begins to turn
                turning = abs(float(np.max(np.abs(condition.spin)))) * float(sides.max())
                strain = max(strain, SWING * (turning / speed) ** 2 / 8)
    return strain


def _largest_absolute_components(
    model: Model, condition: Selection, vector: Sequence[Value | None]
) -> NDArray[np.float64]:
    """The largest sizes (d,) of a condition's components on its nodes."""
    is_place_dependent = any(map(is_of_place, vector))
    position = model.grid.part(model.selected(condition)).position if is_place_dependent else np.zeros((0, len(vector)))
    return np.array([largest(value, position) for value in vector])


def error_of_too_late_fine_zone(error: BaseException, time_step: float, stable_time_step: float) -> BaseException:
    """The error; UnstableError for a zone that was late in time steps, s, longer than the stable one, as no wider zone
    cures that."""
    if not isinstance(error, FineZoneTooLateError) or time_step <= UNSURE * stable_time_step:
        return error
    return UnstableError(
        f"{error}; the time step {time_step:.3g} s exceeds the stable time step {stable_time_step:.3g} s;"
        " reduce run.time_step"
    )
