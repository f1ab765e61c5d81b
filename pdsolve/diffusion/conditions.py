"""Conditions of diffusion: prescribed concentrations, sources, and exchange with the outside."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Concentration, Exchange, InitialConcentration, Solid, Source, Timed
from pdsolve.diffusion.links import extended
from pdsolve.diffusion.surfaces import Faces, Held, nothing
from pdsolve.model import Model, ModelError

ON_EDGE = 1e-3  # of a spacing

Profile = tuple[tuple[float, float], ...]


class Act(NamedTuple):
    """A condition on k nodes, multiplied by a factor in time."""

    rows: NDArray[np.int64]  # (k,)
    value: NDArray[np.float64]  # (k,)
    profile: Profile

    def at(self, time: float) -> NDArray[np.float64]:
        """The values (k,) at `time`, s."""
        return self.value * factor(self.profile, time)


class BoundaryConditions(NamedTuple):
    """All conditions on n nodes."""

    held: tuple[Act, ...]  # mol/m^3; no node is in two of them
    supplied: tuple[Act, ...]  # mol/(m^3 s)
    free: NDArray[np.bool_]  # (n,) nodes that are not held
    exchange: NDArray[np.float64]  # (n,) 1/s: what goes out for each mol/m^3
    edges: Held
    at_edges: tuple[Act, ...]  # mol/m^3, what is held there, by number of the edge; without rows

    def hold(self, content: NDArray[np.float64], time: float) -> None:
        """Set the prescribed contents (n,) at `time`, s."""
        for act in self.held:
            content[act.rows] = act.at(time)

    def supply(self, time: float, out: NDArray[np.float64]) -> None:
        """Set `out` (n,) to the sources at `time`, s, per volume and time."""
        out[:] = 0
        for act in self.supplied:
            out[act.rows] += act.at(time)


def linked(done: BoundaryConditions, to_edge: NDArray[np.float64], edge: NDArray[np.int64]) -> BoundaryConditions:
    """Conditions with a conductance, 1/s, from each node (n,) to the `edge` (n,) of that number; -1: to none."""
    acts = list(done.supplied)
    for number, act in enumerate(done.at_edges):
        rows = np.flatnonzero((edge == number) & (to_edge > 0))
        acts.append(Act(rows, to_edge[rows] * act.value, act.profile))
    return done._replace(supplied=tuple(acts), exchange=done.exchange + np.where(edge >= 0, to_edge, 0.0))


def factor(profile: Profile, time: float) -> float:
    """The factor of a profile at `time`, s: linear between points, constant outside."""
    return float(np.interp(time, *np.array(profile).T)) if profile else 1.0


def boundary_conditions(model: Model, volume: NDArray[np.float64]) -> BoundaryConditions:
    """The conditions of a model. Raises ModelError if they contradict each other."""
    nodes = len(model.grid)
    owner, exchange = np.full(nodes, -1), np.zeros(nodes)
    held: dict[int, Concentration] = {}
    supplied: list[Act] = []
    at_edges: list[Act] = []
    edges, on_edge = [nothing(len(extended(model)))], np.zeros(nodes, dtype=bool)
    for number, condition in enumerate(model.settings.conditions):
        rows = model.selected(condition)
        if isinstance(condition, Concentration):
            _possible(model, f"$.conditions[{number}].value", _largest(condition.value, condition))
            held[number] = condition
            if condition.edge is not None and _has_edges(model):
                rows, faces = _edge(model, number, condition, len(at_edges))
                edges.append(faces)
                at_edges.append(Act(rows[:0], np.array([condition.value]), condition.profile))
                on_edge[rows] = True
            owner[rows] = number
        elif isinstance(condition, Source):
            rate = condition.rate
            if rate is None:
                rate = (condition.flux or 0.0) * _extent(condition) / volume[rows].sum()
            supplied.append(Act(rows, np.full(len(rows), rate), condition.profile))
        elif isinstance(condition, Exchange):
            share = condition.coefficient * _extent(condition) / volume[rows].sum()
            exchange[rows] += share
            supplied.append(Act(rows, np.full(len(rows), share * condition.value), condition.profile))
    free = owner < 0
    acts = []
    for number, condition in held.items():
        rows = np.flatnonzero(owner == number)
        acts.append(Act(rows, np.full(len(rows), condition.value), condition.profile))
    mine = [act._replace(rows=act.rows[free[act.rows]], value=act.value[free[act.rows]]) for act in supplied]
    exchange[~free] = 0
    together = Faces(*(np.concatenate(column) for column in zip(*edges[::-1], strict=True)))  # the last one holds
    return BoundaryConditions(tuple(acts), tuple(mine), free, exchange, Held(on_edge, together), tuple(at_edges))


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


def begin(model: Model, done: BoundaryConditions) -> tuple[NDArray[np.float64], NDArray[np.uint8]]:
    """Contents (n,) at time 0, mol/m^3, and a mask (n,) of solid nodes. Raises ModelError."""
    content, solid = np.zeros(len(model.grid)), np.zeros(len(model.grid), dtype=np.uint8)
    medium = model.settings.medium
    assert medium is not None
    for number, condition in enumerate(model.settings.conditions):
        place = f"$.conditions[{number}]"
        if isinstance(condition, InitialConcentration):
            _possible(model, f"{place}.value", condition.value)
            content[model.selected(condition)] = condition.value
    for number, condition in enumerate(model.settings.conditions):
        if isinstance(condition, Solid):
            if medium.C_solid is None:
                raise ModelError(
                    f"{model.name}: $.conditions[{number}]: found a solid, expected none, or medium.C_solid and C_sat"
                )
            rows = model.selected(condition)
            both = rows[~done.free[rows]]
            if len(both):
                raise ModelError(
                    f"{model.name}: $.conditions[{number}]: found node {model.grid.ids[both[0]]} solid and held,"
                    " expected one of them"
                )
            content[rows], solid[rows] = medium.C_solid, 1
    done.hold(content, 0.0)
    return content, solid
