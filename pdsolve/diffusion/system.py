"""Bonds, conditions and steps of a model of diffusion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import areas
from pdsolve.conditions import Drive
from pdsolve.diffusion.collocation import Collocated
from pdsolve.diffusion.conditions import BoundaryConditions, begin
from pdsolve.diffusion.families import DiffusionFamilies
from pdsolve.diffusion.operator import BondStorage, Fick
from pdsolve.diffusion.surfaces import Surfaces
from pdsolve.diffusion.walls import Bonds
from pdsolve.lattice.flux_operator import FluxesInList
from pdsolve.model import Model, ModelError, counted
from pdsolve.numerics.thread_team import useful_threads
from pdsolve.state import State, zero_state
from pdsolve.steppers.euler import ForwardEuler, stable_time_step
from pdsolve.steppers.theta import ThetaSteps

SLACK = 1e-9  # of a step: what is typed
FACTORED = 1_000_000  # bonds: implicit equations of more are not factored


@dataclass(frozen=True)
class Transport:
    """The transport of a substance through a model; n nodes."""

    model: Model
    operator: Fick
    drive: Drive  # sources and prescribed contents
    free: NDArray[np.bool_]  # (n,) nodes whose content is not prescribed
    stepper: ForwardEuler | ThetaSteps
    time_step: float  # s
    bound: float  # s, surely stable
    blocked: NDArray[np.int64]  # (n,) bonds that cracks block
    crossing: float  # m/s: contrast of a unit of surface
    threads: int
    held: float  # mol in nodes whose content is prescribed, at time 0


def prepare(model: Model, threads: int | None = None, listed: bool = False) -> tuple[Transport, State]:
    """A model's bonds and conditions, and its state at time 0. Raises ModelError for an unsupported model."""
    medium, run = model.settings.medium, model.settings.run
    assert medium is not None
    threads = threads or useful_threads(len(model.grid))
    volume = areas(model, "cells")
    conditions, families = BoundaryConditions(model, volume), DiffusionFamilies(model)
    free, blocked = conditions.free, np.zeros(len(volume), dtype=np.int64)
    exchange: BondStorage
    bonds: Bonds = families
    if run.adapt == "collocation":
        exchange = bonds = Collocated(families, volume, free, threads)
        has_partial_family = np.zeros(len(volume), dtype=np.bool_)
    else:
        asks_both_ends = medium.dissolution == "kinetic"
        placed = None if listed or asks_both_ends else families.in_tiles(volume, threads)
        fluxes, blocked = placed or families.in_list(volume, threads)
        has_partial_family = fluxes.mask_partial_families(float(model.grid.delta[0]) ** model.grid.dimension)
        exchange = fluxes
    change = None
    if medium.surface_correction:
        surfaces = Surfaces(bonds, volume, free, conditions.edges)
        links, conductance, to_edge, edge = surfaces.correction(has_partial_family)
        conditions.add_edges(to_edge, edge)
        change = FluxesInList(links, conductance, volume, threads)
    listing = (lambda: bonds) if run.adapt == "collocation" else partial(DiffusionFamilies, model)
    if conditions.fluxes:
        inside = Fick(exchange, listing, medium, None, change)
        gain = np.zeros(bonds.position.T.shape)  # of nodes in linear fields
        for rates, along in zip(gain, bonds.position.T, strict=True):
            inside.rates(np.ascontiguousarray(along), rates)
        conditions.add_fluxes(bonds, volume[:, None] * gain.T)
    operator, drive = Fick(exchange, listing, medium, conditions.exchange, change), conditions.drive()
    content, operator.solid = begin(model, drive)
    most = stable_time_step(operator, free)
    step = most if run.time_step is None else run.time_step
    if not np.isfinite(step):
        raise ModelError(f"{model.name}: $.run.time_step is missing, which a model without bonds needs; give one")
    if run.solver != "implicit" and step > most * (1 + SLACK):
        raise ModelError(
            f"{model.name}: $.run.time_step is {step:.6g} s, more than the stable time step; use at most {most:.6g} s,"
            " or run.solver = 'implicit'"
        )
    stepper: ForwardEuler | ThetaSteps = ForwardEuler(operator, drive, step)
    if run.solver == "implicit":
        factor_once = medium.C_sat is None and operator.count.sum() <= FACTORED
        stepper = ThetaSteps(operator, drive, step, run.theta, factor_once)
    transport = Transport(
        counted(model, step), operator, drive, free, stepper, step, most, blocked, families.crossing, threads,
        held=float((volume * content)[~free].sum()),
    )  # fmt: skip
    state = zero_state(len(content), 1)
    return transport, state._replace(value=content[:, None], second=np.zeros((len(content), 0)))
