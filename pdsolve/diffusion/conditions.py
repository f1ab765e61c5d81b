"""Conditions of diffusion: prescribed concentrations, sources, and exchange with the outside."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Concentration, Exchange, InitialConcentration, Solid, Source, Timed
from pdmesh.model.values_of_place import Value
from pdsolve.conditions import Drive, Entries, chosen, drive_of, entries, held, hold_values
from pdsolve.diffusion.edge_fluxes import Cloud, beside_edge, is_coarse, outward, over_cells, parts
from pdsolve.diffusion.families import diffusivities, extended
from pdsolve.diffusion.surfaces import Faces, Held, nothing
from pdsolve.model import Model, ModelError

ON_EDGE = 1e-3  # of a spacing

Profile = tuple[tuple[float, float], ...]


class OnEdge(NamedTuple):
    """A value on an edge, beside nodes of a model."""

    model: Model
    value: Value

    def values(self, rows: NDArray[np.int64]) -> NDArray[np.float64] | float:
        """The value beside these nodes, (k,) where it depends on the place."""
        return self.model.values(self.value, rows)


class Flux(NamedTuple):
    """What goes through an edge of k nodes."""

    condition: Source | Exchange
    rows: NDArray[np.int64]  # (k,)
    profile: int
    walled: NDArray[np.bool_]  # (k,) nodes at which it is a prescribed value outside
    value: OnEdge  # the flux, mol/(m^2 s), or what is outside, mol/m^3


class BoundaryConditions(NamedTuple):
    """All conditions on n nodes; `Entries` name their profile by its number."""

    profiles: list[Profile]
    held: list[Entries]  # mol/m^3; of two of one node the later one counts
    supplied: list[Entries]  # mol/(m^3 s), of nodes that are not held
    free: NDArray[np.bool_]  # (n,) nodes that are not held
    exchange: NDArray[np.float64]  # (n,) 1/s: what goes out for each mol/m^3
    edges: Held
    at_edges: list[tuple[OnEdge, int]]  # what each held edge holds, and its profile
    fluxes: list[Flux]

    def drive(self) -> Drive:
        """Sources and prescribed contents for a stepper."""
        found = drive_of(self.profiles, self.supplied, self.held, (len(self.free), 1))
        return found._replace(held_force=np.zeros(0), held_speed=np.zeros(0))


def with_edges(done: BoundaryConditions, to_edge: NDArray[np.float64], edge: NDArray[np.int64]) -> BoundaryConditions:
    """Conditions with a conductance, 1/s, from each node (n,) to the `edge` (n,) of that number; -1: to none."""
    supplied = list(done.supplied)
    for number, (held_there, profile) in enumerate(done.at_edges):
        rows = np.flatnonzero((edge == number) & (to_edge > 0))
        supplied.append(entries(rows, 0, to_edge[rows] * held_there.values(rows), profile))
    return done._replace(supplied=supplied, exchange=done.exchange + np.where(edge >= 0, to_edge, 0.0))


def boundary_conditions(model: Model, volume: NDArray[np.float64]) -> BoundaryConditions:
    """The conditions of a model. Raises ModelError if they contradict each other."""
    nodes = len(model.grid)
    exchange, free, on_edge = np.zeros(nodes), np.ones(nodes, dtype=bool), np.zeros(nodes, dtype=bool)
    profiles: list[Profile] = []
    held: list[Entries] = []
    supplied: list[Entries] = []
    at_edges: list[tuple[OnEdge, int]] = []
    edges = [nothing(len(extended(model)))]
    fluxes: list[Flux] = []
    for number, condition in enumerate(model.settings.conditions):
        if not isinstance(condition, Concentration | Source | Exchange):
            continue
        rows, profile = model.selected(condition), len(profiles)
        profiles.append(condition.profile)
        if isinstance(condition, Concentration):
            most = float(np.max(model.values(condition.value, rows)))
            _possible(model, f"$.conditions[{number}].value", _largest(most, condition))
            if condition.edge is not None and _has_edges(model):
                rows, faces = _edge(model, number, condition, len(at_edges))
                edges.append(faces)
                at_edges.append((OnEdge(model, condition.value), profile))
                on_edge[rows] = True
            held.append(entries(rows, 0, model.values(condition.value, rows), profile))
            free[rows] = False
            continue
        if isinstance(condition, Source) and condition.rate is not None:
            supplied.append(entries(rows, 0, model.values(condition.rate, rows), profile))
        else:
            walled = np.zeros(len(rows), dtype=bool)
            if isinstance(condition, Exchange) and _has_edges(model):
                faces, walled = _outside(model, condition, rows, volume[rows], len(at_edges))
                edges.append(faces)
                at_edges.append((OnEdge(model, condition.value), profile))
            through = condition.flux if isinstance(condition, Source) else condition.value
            fluxes.append(Flux(condition, rows, profile, walled, OnEdge(model, through or 0.0)))
    supplied = [chosen(each, free[each.node]) for each in supplied]
    together = Faces(*(np.concatenate(column) for column in zip(*edges[::-1], strict=True)))  # the last one holds
    return BoundaryConditions(profiles, held, supplied, free, exchange, Held(on_edge, together), at_edges, fluxes)


def with_fluxes(done: BoundaryConditions, cloud: Cloud, corrected: bool) -> BoundaryConditions:
    """Conditions with the fluxes through edges; `corrected`: where they leave linear fields exact."""
    supplied, exchange = list(done.supplied), done.exchange.copy()
    for condition, rows, profile, walled, value in done.fluxes:
        extent, coarse = _extent(condition), ~walled
        coarse &= isinstance(condition, Exchange) and is_coarse(
            cloud.delta[rows], cloud.diffusivity[rows], condition.coefficient
        )
        spread = over_cells(cloud, rows, walled) if coarse.any() or not corrected else None
        found = spread or beside_edge(cloud, rows, extent, walled)
        share = extent * found.share / cloud.volume[found.rows]
        if isinstance(condition, Source):
            rate = value.values(found.rows) * share
        else:
            coefficient = share / (1 / condition.coefficient + found.resistance)
            np.add.at(exchange, found.rows, coefficient)
            rate = coefficient * value.values(found.rows)
        supplied.append(chosen(entries(found.rows, 0, rate, profile), done.free[found.rows]))
    exchange[~done.free] = 0
    return done._replace(supplied=supplied, exchange=exchange)


def _has_edges(model: Model) -> bool:
    """Whether values are prescribed on edges as such; otherwise on the nodes beside them."""
    medium, run = model.settings.medium, model.settings.run
    return medium is not None and medium.surface_correction and run.adapt != "collocation"


def _edge(model: Model, number: int, condition: Concentration, edge: int) -> tuple[NDArray[np.int64], Faces]:
    """Nodes on the edge, which have the prescribed value themselves, and the faces of the first row beside it."""
    nodes, grid = np.array(condition.nodes or (), dtype=np.int64), model.grid
    given = condition.edge or ()
    if len(given) != len(nodes) or any(len(way) != grid.dimension for way in given):
        raise ModelError(
            f"{model.name}: $.conditions[{number}].edge: found {len(given)} ways, expected {len(nodes)}, one for each"
            f" of its nodes, in {grid.dimension} dimensions"
        )
    rows = model.selected(condition)
    order = np.argsort(nodes, kind="stable")
    way = np.array(given)[order[np.searchsorted(nodes, grid.ids[rows], sorter=order)]]
    far, delta = np.sqrt((way**2).sum(axis=1)), grid.delta[rows]
    on, first = far < ON_EDGE * delta, (far >= ON_EDGE * delta) & (far < delta * (1 - ON_EDGE))
    middle, normal = grid.position[rows] + way, way / np.where(on, 1.0, far)[:, None]
    axes = extended(model)
    area = delta ** (len(axes) - 1)
    return rows[on], Faces(middle[:, axes], normal[:, axes], area, np.full(len(rows), edge)).chosen(first)


def _outside(
    model: Model, condition: Exchange, rows: NDArray[np.int64], volume: NDArray[np.float64], edge: int
) -> tuple[Faces, NDArray[np.bool_]]:
    """Faces D / coefficient outside the nodes (k,) at which spacings do not resolve the exchange; and which these are.

    Only where an edge is free.
    """
    grid, D, axes = model.grid, diffusivities(model)[rows], extended(model)
    delta, position = grid.delta, grid.position[:, axes]
    coarse = is_coarse(delta[rows], D, condition.coefficient)
    if not coarse.any():
        return nothing(len(axes)), coarse
    normal, free = outward(position, delta, 2 * delta, rows)
    depth = parts(volume, delta[rows])[1] / _extent(condition)
    way = depth - delta[rows] / 2 + D / condition.coefficient
    middle = position[rows] + way[:, None] * normal
    area = delta[rows] ** (len(axes) - 1)
    walled = coarse & free
    return Faces(middle, normal, area, np.full(len(rows), edge)).chosen(walled), walled


def _extent(condition: Source | Exchange) -> float:
    """Length, m, or area, m^2, that a flux goes through."""
    return condition.length or condition.surface or 0.0


def _largest(value: float, condition: Timed) -> float:
    return value * max((at for _, at in condition.profile), default=1.0)


def _possible(model: Model, place: str, value: float) -> None:
    medium = model.settings.medium
    assert medium is not None
    if medium.C_sat is not None and value > medium.C_sat:
        raise ModelError(
            f"{model.name}: {place}: found {value:g} mol/m^3, expected at most C_sat, {medium.C_sat:g} mol/m^3"
        )


def begin(model: Model, drive: Drive) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """Contents (n,) at time 0, mol/m^3, and a mask (n,) of solid nodes. Raises ModelError."""
    content, solid = np.zeros(len(model.grid)), np.zeros(len(model.grid), dtype=np.uint8)
    medium, free = model.settings.medium, ~held(drive)[:, 0]
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
                    f"{model.name}: $.conditions[{number}]: found a solid, expected none, or medium.C_solid and C_sat"
                )
            rows = model.selected(condition)
            both = rows[~free[rows]]
            if len(both):
                raise ModelError(
                    f"{model.name}: $.conditions[{number}]: found node {model.grid.ids[both[0]]} solid and held,"
                    " expected one of them"
                )
            content[rows], solid[rows] = medium.C_solid, 1
    hold_values(drive, content, 0.0)
    return content, solid
