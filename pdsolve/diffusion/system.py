"""Bonds, conditions and steps of a model of diffusion."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.bonds.assembly import areas
from pdsolve.conditions import Drive
from pdsolve.diffusion.collocation import Collocated
from pdsolve.diffusion.conditions import BoundaryConditions, begin
from pdsolve.diffusion.dissolution import crossing
from pdsolve.diffusion.edges import Cloud
from pdsolve.diffusion.families import DiffusionFamilies
from pdsolve.diffusion.operator import BondStorage, Fick
from pdsolve.diffusion.surfaces import Surfaces
from pdsolve.diffusion.walls import Bonds
from pdsolve.lattice.flux_operator import FluxesInList, links_between
from pdsolve.model import Model, ModelError, counted
from pdsolve.numerics.thread_team import useful_threads
from pdsolve.options import Options
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
    conditions = BoundaryConditions(model, volume)
    free, stored = conditions.free, _stored(model, volume, conditions.free, threads, listed)
    change = None
    if medium.surface_correction:
        correction = Surfaces(stored.bonds, volume, free, conditions.edges).correction(stored.has_partial_family)
        conditions.add_edges(correction.to_edge, correction.edge)
        links = links_between(correction.source, correction.target, len(volume))
        change = FluxesInList(links, correction.conductance, volume, threads)
    bonds = (lambda: stored.bonds) if run.adapt == "collocation" else partial(DiffusionFamilies, model)
    if conditions.fluxes:
        inside = Fick(stored.exchange, bonds, medium, None, change)
        x, around = stored.bonds.position, (stored.bonds.delta, stored.bonds.reach, stored.bonds.diffusivity)
        gain = np.zeros(x.T.shape)  # of nodes in linear fields
        for rates, along in zip(gain, x.T, strict=True):
            inside.rates(np.ascontiguousarray(along), rates)
        conditions.add_fluxes(Cloud(x, volume, *around, volume[:, None] * gain.T))
    operator, drive = Fick(stored.exchange, bonds, medium, conditions.exchange, change), conditions.drive()
    content, operator.solid = begin(model, drive)
    most = stable_time_step(operator, free)
    step = _step(model, most)
    stepper: ForwardEuler | ThetaSteps = ForwardEuler(operator, drive, step)
    if run.solver == "implicit":
        factor_once = medium.C_sat is None and operator.count.sum() <= FACTORED
        stepper = ThetaSteps(operator, drive, step, run.theta, factor_once)
    transport = Transport(
        counted(model, step), operator, drive, free, stepper, step, most, stored.blocked, crossing(model), threads,
        held=float((volume * content)[~free].sum()),
    )  # fmt: skip
    state = zero_state(len(content), 1)
    return transport, state._replace(value=content[:, None], second=np.zeros((len(content), 0)))


def refuse_kernel(model: Model, options: Options) -> None:
    """Raise ModelError for a kernel that diffusion does not use."""
    if options.kernel not in (None, "listed"):
        raise ModelError(f"{model.name}: kernel is {options.kernel}; leave it out, or use listed for diffusion")


class Stored(NamedTuple):
    """The bonds of n nodes in their storage, and what a surface correction asks of them."""

    exchange: BondStorage
    bonds: Bonds
    has_partial_family: NDArray[np.bool_]  # (n,) nodes whose bonds may differ from those of a full lattice
    blocked: NDArray[np.int64]  # (n,) bonds that cracks block


def _stored(model: Model, volume: NDArray[np.float64], free: NDArray[np.bool_], threads: int, listed: bool) -> Stored:
    """Bonds of a model whose `free` nodes (n,) have no prescribed content; `listed` excludes tiles."""
    medium, families = model.settings.medium, DiffusionFamilies(model)
    assert medium is not None
    if model.settings.run.adapt == "collocation":
        exchange, none = Collocated(families, volume, free, threads), np.zeros(len(volume), dtype=np.int64)
        return Stored(exchange, exchange, none > 0, none)
    asks_both_ends = medium.dissolution == "kinetic"
    placed = None if listed or asks_both_ends else families.in_tiles(volume, threads)
    fluxes, blocked = placed or families.in_list(volume, threads)
    cell = float(model.grid.delta[0]) ** model.grid.dimension
    return Stored(fluxes, families, fluxes.mask_partial_families(cell), blocked)


def _step(model: Model, most: float) -> float:
    """Time step of a run, s; `most` is the surely stable one. Raises ModelError for a longer one."""
    run = model.settings.run
    if run.solver == "implicit" and run.time_step is not None:
        return run.time_step
    if run.time_step is None:
        if not np.isfinite(most):
            raise ModelError(f"{model.name}: $.run.time_step is missing, which a model without bonds needs; give one")
        return most
    if run.time_step > most * (1 + SLACK):
        raise ModelError(
            f"{model.name}: $.run.time_step is {run.time_step:.6g} s, more than the stable time step; use at most"
            f" {most:.6g} s, or run.solver = 'implicit'"
        )
    return run.time_step
