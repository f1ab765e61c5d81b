"""Conditions of diffusion: prescribed concentrations, sources, and exchange with the outside."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Concentration, Exchange, InitialConcentration, Solid, Source
from pdsolve.conditions import Drive, Entries, chosen, constrained_components, drive_of, entries, prescribe_values
from pdsolve.diffusion.edges import beside_edge, extent_of, held_edge, outer_faces, parts
from pdsolve.diffusion.families import extended
from pdsolve.diffusion.walls import NEAREST, Array, Bonds, Edges, Faces, Rows
from pdsolve.model import Model, ModelError

ValuesAtRows = Callable[[Rows], Array | float]  # at some rows, (k,) where they depend on the place


class Flux(NamedTuple):
    """What goes through an edge of k nodes."""

    condition: Source | Exchange
    rows: Rows  # (k,)
    profile: int
    walled: NDArray[np.bool_] | None  # (k,) nodes through whose wall it goes, see `surfaces`; None: nodes behind the
    # edge take shares that leave linear fields exact
    values: ValuesAtRows  # the flux, mol/(m^2 s), or what is outside, mol/m^3


class AtEdge(NamedTuple):
    """An edge at which values are prescribed or exchanged."""

    faces: Faces
    extent: float  # m^(d - 1); 0 where a value is prescribed
    values: ValuesAtRows  # mol/m^3
    profile: int


class BoundaryConditions:
    """All conditions on n nodes; `Entries` name their profile by its number."""

    def __init__(self, model: Model, volume: Array) -> None:
        """Nodes have the `volume` (n,), m^d. Raises ModelError for conditions that contradict each other."""
        medium = model.settings.medium
        assert medium is not None
        self._model, self._volume, self._corrects = model, volume, medium.surface_correction
        self._has_edges = medium.surface_correction and model.settings.run.adapt != "collocation"
        self.exchange = np.zeros(len(volume))  # (n,) 1/s: what goes out for each mol/m^3
        self.free, self._on_edge = np.ones(len(volume), dtype=bool), np.zeros(len(volume), dtype=bool)  # free: not held
        self._profiles, self._at_edges = list[tuple[tuple[float, float], ...]](), list[AtEdge]()
        self._holds, self._sources = list[Entries](), list[Entries]()  # of two of one node the later one counts
        self.fluxes = list[Flux]()
        for number, condition in enumerate(model.settings.conditions):
            if not isinstance(condition, Concentration | Source | Exchange):
                continue
            profile, rows = len(self._profiles), model.selected(condition)
            self._profiles.append(condition.profile)
            if isinstance(condition, Concentration):
                values = partial(model.values, condition.value)
                most = float(np.max(values(rows))) * max((at for _, at in condition.profile), default=1.0)
                _expect_possible(model, number, most)
                if condition.edge is not None and self._has_edges:
                    rows, faces = held_edge(model, number, len(self._at_edges))
                    self._at_edges.append(AtEdge(faces, 0.0, values, profile))
                    self._on_edge[rows] = True
                self._holds.append(entries(rows, 0, values(rows), profile))
                self.free[rows] = False
            elif isinstance(condition, Source) and condition.rate is not None:
                self._sources.append(entries(rows, 0, model.values(condition.rate, rows), profile))
            else:  # lets something into nodes, or through an edge
                through = condition.flux if isinstance(condition, Source) else condition.value
                values, walled = partial(model.values, through or 0.0), None
                if isinstance(condition, Exchange) and self._has_edges:
                    rows, walled, faces, extent = outer_faces(model, number, volume, len(self._at_edges))
                    self._at_edges.append(AtEdge(faces, extent, values, profile))
                elif not self._corrects:
                    walled = np.zeros(len(rows), bool)
                self.fluxes.append(Flux(condition, rows, profile, walled, values))

    @property
    def edges(self) -> Edges:
        """The edges at which values are prescribed or exchanged."""
        # the first of equally near faces counts: that of the last condition
        none, d = np.zeros(0), len(extended(self._model))
        no_faces = Faces(np.zeros((0, d)), np.zeros((0, d)), none, np.zeros(0, dtype=np.int64), none)
        faces = (*(edge.faces for edge in self._at_edges[::-1]), no_faces)
        together = Faces(*(np.concatenate(column) for column in zip(*faces, strict=True)))
        nearest = 0.0 if self._model.settings.run.solver in ("implicit", "static") else NEAREST
        return Edges(self._on_edge, together, np.array([edge.extent for edge in self._at_edges]), nearest)

    def drive(self) -> Drive:
        """Sources and prescribed contents for a stepper; prescribed nodes have no sources."""
        sources = [chosen(source, self.free[source.node]) for source in self._sources]
        drive = drive_of(self._profiles, sources, self._holds, (len(self.free), 1))
        return drive._replace(held_force=np.zeros(0), held_speed=np.zeros(0))

    def add_edges(self, to_edge: Array, edge: Rows) -> None:
        """Add conductances (w, n), 1/s, from each node to the `edge` (w, n) of that number; -1: to none."""
        for conductance, of_edge in zip(to_edge, edge, strict=True):
            for number, (_, _, values, profile) in enumerate(self._at_edges):
                rows = np.flatnonzero((of_edge == number) & (conductance > 0))
                self._sources.append(entries(rows, 0, conductance[rows] * values(rows), profile))
            self.exchange += np.where(of_edge >= 0, conductance, 0.0)

    def add_fluxes(self, bonds: Bonds, gain: Array) -> None:
        """Add the fluxes through edges of nodes that gain so much (n, d) in linear fields; see `edges`."""
        for condition, rows, profile, walled, values in self.fluxes:
            extent = extent_of(condition)
            if walled is None:
                to, part, resistance = beside_edge(bonds, self._volume, gain, rows, extent)
            else:
                part, _ = parts(self._volume[rows], bonds.delta[rows])
                to, part, resistance = rows[~walled], part[~walled], np.zeros(1)
            share = extent * part / self._volume[to]
            if isinstance(condition, Exchange):
                share /= 1 / condition.coefficient + resistance
                np.add.at(self.exchange, to, share)
            self._sources.append(entries(to, 0, values(to) * share, profile))
        self.exchange[~self.free] = 0


def _expect_possible(model: Model, number: int, value: float) -> None:
    """Raise ModelError for a condition of that number whose value is above C_sat."""
    medium = model.settings.medium
    assert medium is not None
    if medium.C_sat is not None and value > medium.C_sat:
        raise ModelError(
            f"{model.name}: $.conditions[{number}].value is {value:g} mol/m^3; use at most C_sat, {medium.C_sat:g}"
            " mol/m^3"
        )


def begin(model: Model, drive: Drive) -> tuple[Array, NDArray[np.uint8]]:
    """Contents (n,) at time 0, mol/m^3, and a mask (n,) of solid nodes. Raises ModelError."""
    content, solid = np.zeros(len(model.grid)), np.zeros(len(model.grid), dtype=np.uint8)
    medium, is_prescribed = model.settings.medium, constrained_components(drive)[:, 0]
    assert medium is not None
    for number, condition in enumerate(model.settings.conditions):
        if isinstance(condition, InitialConcentration):
            rows = model.selected(condition)
            content[rows] = model.values(condition.value, rows)
            _expect_possible(model, number, float(np.max(content[rows], initial=0.0)))
    for number, condition in enumerate(model.settings.conditions):
        if isinstance(condition, Solid):
            place, rows = f"{model.name}: $.conditions[{number}]", model.selected(condition)
            assert medium.C_solid is not None
            if is_prescribed[rows].any():
                node = model.grid.ids[rows[is_prescribed[rows]][0]]
                raise ModelError(f"{place}: node {node} is solid and held; use one of them")
            content[rows], solid[rows] = medium.C_solid, 1
    prescribe_values(drive, content, 0.0)
    return content, solid
