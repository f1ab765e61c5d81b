"""Values of a scene's fields at the nodes of its grid."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pdmesh.model import selection
from pdmesh.model.document import Material, Settings
from pdmesh.model.fracture_energy import energy_of_stretch
from pdmesh.model.material import USUAL_LAW
from pdmesh.model.neighbours import Neighbours, row_chunks
from pdmesh.model.node_arrays import Grid
from pdmesh.model.node_fields import FieldColumn, unused, with_field, wrong_values
from pdmesh.model.values_of_place import PlaceError
from pdmesh.scene.node_fields import FEWEST, STRENGTHS, STRETCH, PlacedField, Weibull
from pdmesh.scene.shapes import SceneError

STEEP = 2.0  # factor of E within a horizon that no lattice resolves


def with_fields(grid: Grid, settings: Settings, placed: Sequence[PlacedField], spacing: float) -> Grid:
    """The grid with the values of these fields, of which later ones count more; `spacing` is the coarsest, m.

    Raises SceneError for a value that a constant cannot have.
    """
    if not placed:
        return grid
    if settings.material is None:
        raise SceneError(f"{placed[0].place}: the scene has no material; give it one")
    materials = (settings.material, *(region.material for region in settings.regions))
    number = selection.last_selecting(settings.regions, grid)
    for field in sorted(placed, key=lambda field: field.quantity == STRETCH):  # their energies depend on E
        rows = _rows(field, settings, number)
        quantity = "G0" if field.quantity == STRETCH else field.quantity
        for material in materials:  # constants of all are columns
            needed = unused(quantity, material, settings.physics)
            if needed is not None:
                raise SceneError(f"{field.place} cannot differ by node; give the material {needed}")
        of_materials = np.array([getattr(material, quantity) for material in materials], dtype=float)[number]
        before = with_field(grid.fields, quantity, of_materials)
        if isinstance(field.value, Weibull) and field.value.block is None:
            drawn = replace(field.value, block=settings.horizon.ratio * spacing)
            field = replace(field, value=drawn, source=f"{drawn}")
        try:
            values = _values(field, grid, materials, number, before, rows, settings.horizon.ratio, spacing)
        except PlaceError as error:
            raise SceneError(f"{field.place}: {error}") from None
        wrong = wrong_values(quantity, np.where(np.isnan(values), -np.inf, values), materials)
        if wrong is not None:
            place = ", ".join(f"{along:g}" for along in grid.part(rows[[wrong[0]]]).position[0])
            raise SceneError(f"{field.place} is {values[wrong[0]]:g} at ({place}) m; use {wrong[1]}")
        grid = replace(grid, fields=_added(grid, quantity, rows, values, field.source))
    return grid


def _rows(field: PlacedField, settings: Settings, number: NDArray[np.int64]) -> NDArray[np.int64]:
    """The rows (k,) of a field's nodes. Raises SceneError for a region that is not there."""
    if not field.region:
        return np.arange(len(number))
    names = [region.name for region in settings.regions]
    if field.region not in names:
        raise SceneError(f"{field.place}: no region is called '{field.region}'; use {', '.join(names) or 'none'}")
    return np.flatnonzero(np.isin(number, [at + 1 for at, name in enumerate(names) if name == field.region]))


def _values(
    field: PlacedField,
    grid: Grid,
    materials: Sequence[Material],
    number: NDArray[np.int64],
    before: NDArray[np.float64],
    rows: NDArray[np.int64],
    ratio: float,
    spacing: float,
) -> NDArray[np.float64]:
    """The values (k,) of a field on these rows (k,), of which nodes have those `before` (n,). Raises SceneError."""
    if isinstance(field.value, Weibull):
        block = field.value.block or 0.0
        if block < FEWEST * spacing * (1 - 1e-9):
            raise SceneError(f"{field.place}: block is {block:g} m; use at least {FEWEST:g} spacings of {spacing:g} m")
        factors = field.value.factors(grid.part(rows).position, block)
        return np.asarray(before[rows] * factors ** (2 if field.quantity == STRETCH else STRENGTHS[field.quantity]))
    values = field.values(grid.position, rows)
    if field.quantity != STRETCH:
        return values
    E = with_field(grid.fields, "E", np.array([material.E for material in materials])[number])[rows]
    energy, finest = np.empty(len(rows)), float(grid.delta.min())
    for at in np.unique(number[rows]).tolist():
        if materials[at].model != "bond" or materials[at].law != USUAL_LAW:
            raise SceneError(f"{field.place} is of brittle bonds; give G0")
        here = number[rows] == at
        energy[here] = energy_of_stretch(values[here], E[here], materials[at], ratio, finest, grid.dimension)
    return energy


def _added(
    grid: Grid, quantity: str, rows: NDArray[np.int64], values: NDArray[np.float64], source: str
) -> tuple[FieldColumn, ...]:
    """The fields of a grid with values (k,) on these rows (k,)."""
    own, sources = np.full(len(grid), np.nan), [source]
    for column in grid.fields:
        if column.quantity == quantity:
            own, sources = column.values.copy(), [column.source, source]
    own[rows] = values
    others = tuple(column for column in grid.fields if column.quantity != quantity)
    return (*others, FieldColumn(quantity, own, "; ".join(sources)[:1000]))  # type: ignore[arg-type]


def remarks(grid: Grid, settings: Settings) -> Iterator[str]:
    """A remark on a Young's modulus that changes by more than `STEEP` within a horizon."""
    if "E" not in grid.field_quantities or settings.material is None:
        return
    materials = (settings.material, *(region.material for region in settings.regions))
    of_materials = np.array([material.E for material in materials])[selection.last_selecting(settings.regions, grid)]
    E, horizon = np.log(with_field(grid.fields, "E", of_materials)), settings.horizon.ratio * grid.delta
    neighbours, steepest, at = Neighbours(grid.position, grid.delta, horizon), 0.0, 0
    for rows in row_chunks(len(grid)):
        source, target, _ = neighbours.pairs(rows)
        change = np.abs(E[source] - E[target])
        if change.max(initial=0.0) > steepest:
            steepest, at = float(change.max()), int(source[change.argmax()])
    if steepest > np.log(STEEP):
        place = ", ".join(f"{along:g}" for along in grid.position[at])
        yield (
            f"fields: E changes by a factor of {np.exp(steepest):.3g} within a horizon of ({place}) m; a lattice is up"
            " to 7 % too stiff there, and layers thinner than a horizon are not resolved: use finer nodes"
        )
