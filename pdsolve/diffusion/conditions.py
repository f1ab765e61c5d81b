"""Conditions of diffusion: prescribed concentrations, sources, and exchange with the outside."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Concentration, Exchange, InitialConcentration, Solid, Source
from pdsolve.conditions import Drive, Entries, chosen, constrained_components, drive_of, entries, prescribe_values
from pdsolve.diffusion.edge_fluxes import Cloud, beside_edge, over_cells
from pdsolve.diffusion.exchange_faces import extent_of, held_edge, outer_faces
from pdsolve.diffusion.families import extended
from pdsolve.diffusion.walls import NEAREST, Edges, Faces, nothing
from pdsolve.model import Model, ModelError

Profile = tuple[tuple[float, float], ...]


Values = Callable[[NDArray[np.int64]], NDArray[np.float64] | float]  # at rows (k,): (k,) where they depend on the place


class Flux(NamedTuple):
    """What goes through an edge of k nodes."""

    condition: Source | Exchange
    rows: NDArray[np.int64]  # (k,)
    profile: int
    walled: NDArray[np.bool_]  # (k,) nodes through whose wall it goes; see `surfaces`
    spread: bool  # whether nodes behind the edge take shares that leave linear fields exact
    values: Values  # the flux, mol/(m^2 s), or what is outside, mol/m^3


class BoundaryConditions(NamedTuple):
    """All conditions on n nodes; `Entries` name their profile by its number."""

    profiles: list[Profile]
    held: list[Entries]  # mol/m^3; of two of one node the later one counts
    supplied: list[Entries]  # mol/(m^3 s), of nodes that are not held
    free: NDArray[np.bool_]  # (n,) nodes that are not held
    exchange: NDArray[np.float64]  # (n,) 1/s: what goes out for each mol/m^3
    edges: Edges
    at_edges: list[tuple[Values, int]]  # what each held edge holds, and its profile
    fluxes: list[Flux]

    def drive(self) -> Drive:
        """Sources and prescribed contents for a stepper."""
        drive = drive_of(self.profiles, self.supplied, self.held, (len(self.free), 1))
        return drive._replace(held_force=np.zeros(0), held_speed=np.zeros(0))


def with_edges(done: BoundaryConditions, to_edge: NDArray[np.float64], edge: NDArray[np.int64]) -> BoundaryConditions:
    """Conditions with conductances (w, n), 1/s, from each node to the `edge` (w, n) of that number; -1: to none."""
    supplied, exchange = list(done.supplied), done.exchange
    for conductance, of_edge in zip(to_edge, edge, strict=True):
        for number, (values, profile) in enumerate(done.at_edges):
            rows = np.flatnonzero((of_edge == number) & (conductance > 0))
            supplied.append(entries(rows, 0, conductance[rows] * values(rows), profile))
        exchange = exchange + np.where(of_edge >= 0, conductance, 0.0)
    return done._replace(supplied=supplied, exchange=exchange)


def boundary_conditions(model: Model, volume: NDArray[np.float64]) -> BoundaryConditions:
    """The conditions of a model. Raises ModelError if they contradict each other."""
    exchange, free, on_edge = np.zeros(len(volume)), np.ones(len(volume), dtype=bool), np.zeros(len(volume), dtype=bool)
    profiles: list[Profile] = []
    held: list[Entries] = []
    supplied: list[Entries] = []
    at_edges: list[tuple[Values, int]] = []
    extents: list[float] = []
    edges = [nothing(len(extended(model)))]
    fluxes: list[Flux] = []
    for number, condition in enumerate(model.settings.conditions):
        if not isinstance(condition, Concentration | Source | Exchange):
            continue
        rows, profile = model.selected(condition), len(profiles)
        profiles.append(condition.profile)
        if isinstance(condition, Concentration):
            most = float(np.max(model.values(condition.value, rows)))
            most *= max((at for _, at in condition.profile), default=1.0)
            _possible(model, f"$.conditions[{number}].value", most)
            if condition.edge is not None and _has_edges(model):
                rows, faces = held_edge(model, number, len(at_edges))
                edges.append(faces)
                at_edges.append((partial(model.values, condition.value), profile))
                extents.append(0.0)
                on_edge[rows] = True
            held.append(entries(rows, 0, model.values(condition.value, rows), profile))
            free[rows] = False
            continue
        if isinstance(condition, Source) and condition.rate is not None:
            supplied.append(entries(rows, 0, model.values(condition.rate, rows), profile))
        else:
            walled, spread = np.zeros(len(rows), dtype=bool), _is_corrected(model)
            if isinstance(condition, Exchange) and _has_edges(model):
                spread = False
                rows, walled, faces, extent = outer_faces(model, number, rows, volume, len(at_edges))
                edges.append(faces)
                at_edges.append((partial(model.values, condition.value), profile))
                extents.append(extent)
            through = condition.flux if isinstance(condition, Source) else condition.value
            fluxes.append(Flux(condition, rows, profile, walled, spread, partial(model.values, through or 0.0)))
    supplied = [chosen(source, free[source.node]) for source in supplied]
    faces = Faces(*(np.concatenate(column) for column in zip(*edges[::-1], strict=True)))  # the last one holds
    nearest = 0.0 if model.settings.run.solver in ("implicit", "static") else NEAREST
    together = Edges(on_edge, faces, np.array(extents), nearest)
    return BoundaryConditions(profiles, held, supplied, free, exchange, together, at_edges, fluxes)


def with_fluxes(done: BoundaryConditions, cloud: Cloud) -> BoundaryConditions:
    """Conditions with the fluxes through edges."""
    supplied, exchange = list(done.supplied), done.exchange.copy()
    for condition, rows, profile, walled, spread, values in done.fluxes:
        extent = extent_of(condition)
        flux_spread = beside_edge(cloud, rows, extent, walled) if spread else over_cells(cloud, rows, walled)
        share = extent * flux_spread.share / cloud.volume[flux_spread.rows]
        if isinstance(condition, Source):
            rate = values(flux_spread.rows) * share
        else:
            coefficient = share / (1 / condition.coefficient + flux_spread.resistance)
            np.add.at(exchange, flux_spread.rows, coefficient)
            rate = coefficient * values(flux_spread.rows)
        supplied.append(chosen(entries(flux_spread.rows, 0, rate, profile), done.free[flux_spread.rows]))
    exchange[~done.free] = 0
    return done._replace(supplied=supplied, exchange=exchange)


def _has_edges(model: Model) -> bool:
    """Whether values are prescribed on edges as such; otherwise on the nodes beside them."""
    return _is_corrected(model) and model.settings.run.adapt != "collocation"


def _is_corrected(model: Model) -> bool:
    """Whether bonds near surfaces are corrected."""
    return model.settings.medium is not None and model.settings.medium.surface_correction


def _possible(model: Model, place: str, value: float) -> None:
    medium = model.settings.medium
    assert medium is not None
    if medium.C_sat is not None and value > medium.C_sat:
        raise ModelError(f"{model.name}: {place} is {value:g} mol/m^3; use at most C_sat, {medium.C_sat:g} mol/m^3")


def begin(model: Model, drive: Drive) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """Contents (n,) at time 0, mol/m^3, and a mask (n,) of solid nodes. Raises ModelError."""
    content, solid = np.zeros(len(model.grid)), np.zeros(len(model.grid), dtype=np.uint8)
    medium, free = model.settings.medium, ~constrained_components(drive)[:, 0]
    assert medium is not None
    for number, condition in enumerate(model.settings.conditions):
        place = f"$.conditions[{number}]"
        if isinstance(condition, InitialConcentration):
            rows = model.selected(condition)
            values = model.values(condition.value, rows)
            _possible(model, f"{place}.value", float(np.max(values, initial=0.0)))
            content[rows] = values
    for number, condition in enumerate(model.settings.conditions):
        if isinstance(condition, Solid):
            if medium.C_solid is None:
                raise ModelError(
                    f"{model.name}: $.conditions[{number}] is a solid, without medium.C_solid and C_sat; give both,"
                    " or leave it out"
                )
            rows = model.selected(condition)
            both = rows[~free[rows]]
            if len(both):
                raise ModelError(
                    f"{model.name}: $.conditions[{number}]: node {model.grid.ids[both[0]]} is solid and held; use"
                    " one of them"
                )
            content[rows], solid[rows] = medium.C_solid, 1
    prescribe_values(drive, content, 0.0)
    return content, solid
