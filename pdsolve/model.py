"""A model: grid, material, horizon, conditions and run settings, checked against each other."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.files import FilePath
from pdmesh.model import selection
from pdmesh.model.consistency import examine
from pdmesh.model.contradictions import beyond
from pdmesh.model.document import (
    LARGEST,
    GridError,
    InitialConcentration,
    Material,
    OfDiffusion,
    OfMechanics,
    Pin,
    Run,
    Selection,
    Settings,
    Spring,
    encode,
    in_steps,
    read_file,
    settings_of,
)
from pdmesh.model.document import read_document as parse_document
from pdmesh.model.fracture_energy import with_fracture_energy
from pdmesh.model.material import UNKNOWN
from pdmesh.model.material_constants import MaterialColumns
from pdmesh.model.mechanical_conditions import RigidBody
from pdmesh.model.node_fields import unused, with_field
from pdmesh.model.node_grid import Grid, document_of, grid_of
from pdmesh.model.output_fields import OF_CONTENT
from pdmesh.model.rigid_bodies import densities, without_bonds
from pdmesh.model.settings_overlay import ModelError, overlaid
from pdmesh.model.values_at_places import values_at, vectors_at
from pdmesh.model.values_of_place import Value, is_of_place

PARTS = {"mechanics": ("material",), "diffusion": ("medium",), "thermoelastic": ("material", "medium")}


class ModelWarning(UserWarning):
    """A model that can be solved but may not mean what its author intends; one line."""


class ModelNote(ModelWarning):
    """What a run will do, for information: its model means what its author intends; one line."""

    informs = True  # left out by --quiet


def counted(model: Model, step: float) -> Model:
    """The model with its duration expressed in steps of `step` s. Raises ModelError for too many steps."""
    try:
        run = in_steps(model.settings.run, step)
    except GridError as error:
        raise ModelError(f"{model.name}: {error}") from None
    if run is model.settings.run:
        return model
    return replace(model, settings=msgspec.structs.replace(model.settings, run=run))


@dataclass(frozen=True)
class Model:
    """A grid and everything needed to solve it. Raises ModelError for contradictory parts."""

    grid: Grid
    settings: Settings
    name: str = "model"

    def __post_init__(self) -> None:
        for part in PARTS[self.settings.physics]:
            if getattr(self.settings, part) is None:
                needed, first = ("E, rho and G0", "E") if part == "material" else ("D", "D")
                raise ModelError(
                    f"{self.name}: $.{part} is missing; give {needed} (in the file, a --settings TOML or --set"
                    f" {part}.{first}=...)"
                )
        self._check_fields()
        self._resolve_fracture_energies()
        large = beyond(self.settings, "$")
        if large is not None:
            raise ModelError(f"{self.name}: {large}")
        if self.grid.lattice is None:
            self._check_places()
        try:
            selection.check(self.settings, self.grid, self.name)
            if self.has_rigid_bodies:
                object.__setattr__(self, "grid", without_bonds(self.grid, self.settings, self.name))
        except GridError as error:
            raise ModelError(str(error)) from None

    def _resolve_fracture_energies(self) -> None:
        """Give materials with a critical stretch their fracture energy. Raises ModelError."""
        every = () if self.settings.material is None else (self.settings.material, *self._of_regions())
        if all(
            material_settings.critical_stretch is None and material_settings.G0 != UNKNOWN
            for material_settings in every
        ):
            return
        size = self.settings.horizon.ratio, float(self.grid.delta.min()), self.grid.dimension
        try:
            materials = [with_fracture_energy(material_settings, *size) for material_settings in every]
        except ValueError as error:
            raise ModelError(f"{self.name}: $.material.{error}") from None
        pairs = zip(self.settings.regions, materials[1:], strict=True)
        regions = tuple(msgspec.structs.replace(region, material=material) for region, material in pairs)
        settings = msgspec.structs.replace(self.settings, material=materials[0], regions=regions)
        object.__setattr__(self, "settings", settings)

    def _of_regions(self) -> Iterator[Material]:
        return (region.material for region in self.settings.regions)

    def _check_fields(self) -> None:
        """Raise ModelError for a field of a constant that a material does not use."""
        if self.settings.material is None:
            return
        for number, column in enumerate(self.grid.fields):
            for at, material in enumerate((self.settings.material, *self._of_regions())):
                needed = unused(column.quantity, material, self.settings.physics)
                if needed is not None:
                    place = self.place_of(at).removeprefix(f"{self.name}: ")
                    raise ModelError(
                        f"{self.name}: $.fields[{number}] is of {column.quantity}, which cannot differ by node with"
                        f" {place}; give it {needed}, or leave the field out"
                    )

    @property
    def has_diffusion_only(self) -> bool:
        """Whether the model is one of diffusion alone."""
        return self.settings.physics == "diffusion"

    @property
    def swells(self) -> bool:
        """Whether the model is one of a motion and of a content that swells it."""
        return self.settings.physics == "thermoelastic"

    def moving_part(self) -> Model:
        """The mechanics of a model that swells."""
        mine = tuple(condition for condition in self.settings.conditions if isinstance(condition, OfMechanics))
        fields = tuple(name for name in self.settings.run.fields if name not in OF_CONTENT)
        run = msgspec.structs.replace(self.settings.run, fields=fields)
        grid = replace(self.grid, fields=tuple(one for one in self.grid.fields if one.quantity != "alpha"))
        return self._part(grid, physics="mechanics", medium=None, media=(), conditions=mine, run=run)

    def diffusing_part(self, time_step: float) -> Model:
        """The diffusion of a model that swells, in steps of `time_step`, s."""
        mine = tuple(condition for condition in self.settings.conditions if isinstance(condition, OfDiffusion))
        run = self.settings.run
        assert self.settings.material is not None
        # nodes begin with the contents T0 of the materials where no condition says another
        every = self.grid.dimension * (-LARGEST,) + self.grid.dimension * (LARGEST,)
        unstressed = [InitialConcentration(box=every, value=self.settings.material.T0 or 0.0)]
        for region in self.settings.regions:
            value = region.material.T0 or 0.0
            unstressed.append(InitialConcentration(nodes=region.nodes, box=region.box, value=value))
        mine = (*unstressed, *mine)
        steps = Run(time_step=time_step, steps=run.steps, every=run.every, ledger=run.ledger)
        if run.solver == "static":
            steps = msgspec.structs.replace(steps, solver="implicit", theta=run.theta)
        assert self.settings.medium is not None
        # `Swelling` knows what breaks and what deforms
        medium = msgspec.structs.replace(self.settings.medium, broken=1.0, deformation=False)
        grid = replace(self.grid, fields=())
        nothing: dict[str, Any] = {"material": None, "regions": (), "interfaces": ()}
        return self._part(grid, physics="diffusion", medium=medium, conditions=mine, run=steps, **nothing)

    def _part(self, grid: Grid, **settings: Any) -> Model:
        return replace(self, grid=grid, settings=msgspec.structs.replace(self.settings, **settings))

    def _check_places(self) -> None:
        position = self.grid.position
        above = np.zeros(max(len(position) - 1, 0), dtype=np.bool_)
        for along in position.T:  # what a later one says counts more
            step = np.diff(along)
            above = (step > 0) | (step == 0) & above
        if above.all():  # places are in order, the last coordinate first, and none is there twice
            return
        order = np.lexsort(position.T)
        same = (np.diff(position[order], axis=0) == 0).all(axis=1)
        if same.any():
            at = int(same.argmax())
            first, second = sorted(self.grid.ids[order[at : at + 2]].tolist())
            raise ModelError(f"{self.name}: $.nodes: {first} and {second} are at the same place; move them apart")

    @cached_property
    def materials(self) -> tuple[Material, ...]:
        """The plate's material, then those of its regions; in a body in space, with plane "space"."""
        assert self.settings.material is not None
        every = self.settings.material, *self._of_regions()
        if self.grid.dimension == 2:
            return every
        return tuple(msgspec.structs.replace(material, plane="space") for material in every)

    def place_of(self, number: int) -> str:
        """Place of the material with this number, in the words of messages."""
        return f"{self.name}: $.material" if number == 0 else f"{self.name}: $.regions[{number - 1}].material"

    @cached_property
    def material_columns(self) -> MaterialColumns:
        """The numbers of `materials` as arrays."""
        return MaterialColumns(self.materials)

    @property
    def varies(self) -> bool:
        """Whether nodes differ in their constants."""
        return len(self.materials) > 1 or bool(self.grid.fields)

    def materials_at(self, rows: NDArray[np.int64]) -> Iterator[tuple[NDArray[np.int64] | slice, Material]]:
        """The places in `rows` (b,) of nodes that differ in numbers alone, and a material whose numbers are theirs."""
        for places, material in self.material_columns.of(self.material_of[rows]):
            if self.grid.fields:
                material = copy.copy(material)
                for quantity, *_ in self.grid.fields:
                    values = with_field(self.grid.fields, quantity, getattr(material, quantity), rows[places])
                    msgspec.structs.force_setattr(material, quantity, values)
            yield places, material

    def node_values(self, name: str, missing: float = 0.0) -> NDArray[np.float64]:
        """A constant (n,) of each node's material or of the field in its place; `missing` where it has none."""
        values = (getattr(material, name) for material in self.materials)
        of_nodes = np.array([missing if value is None else value for value in values])[self.material_of]
        return with_field(self.grid.fields, name, of_nodes) if self.grid.fields else of_nodes

    @cached_property
    def material_of(self) -> NDArray[np.int64]:
        """The number in `materials` of each node's material (n,); without regions it takes no memory."""
        if not self.settings.regions:
            return np.broadcast_to(np.int64(0), len(self.grid))
        return selection.last_selecting(self.settings.regions, self.grid)

    @property
    def has_rigid_bodies(self) -> bool:
        """Whether a body of the model is rigid."""
        return any(isinstance(condition, RigidBody) for condition in self.settings.conditions)

    @property
    def has_supports(self) -> bool:
        """Whether springs to the ground or pins hold the model."""
        return any(isinstance(condition, Spring | Pin) for condition in self.settings.conditions)

    @property
    def rho(self) -> NDArray[np.float64]:
        """Each node's density (n,), kg/m^3; that of a rigid body's is its mass over its cells."""
        rho = self.node_values("rho")
        return densities(self.grid, self.settings, rho) if self.has_rigid_bodies else rho

    @property
    def horizons(self) -> NDArray[np.float64]:
        """Each node's horizon (n,), m: the ratio m times its spacing."""
        return self.settings.horizon.ratio * self.grid.delta

    @cached_property
    def finest_horizons(self) -> NDArray[np.float64]:
        """The smallest horizon of each body, m; of a window too, those of whole bodies."""
        return self.settings.horizon.ratio * self.grid.finest_spacings

    def finest_horizon_of(self, rows: NDArray[np.int64]) -> NDArray[np.float64]:
        """The smallest horizon of the body of each of these rows (k,) of the grid, m."""
        bodies = self.grid.bodies
        return self.finest_horizons[np.zeros_like(rows) if bodies is None else bodies.number[rows]]

    def values(self, value: Value, rows: NDArray[np.int64], time: float | None = None) -> NDArray[np.float64] | float:
        """A value of a condition on these rows (k,) of the grid: one number, or (k,) if it depends on the place.

        That of data over time is at a `time`, s, or when the largest of it acts.
        """
        if isinstance(value, float | int):
            return value
        return values_at(value, self.grid.part(rows).position, time)

    def vectors(self, vector: Sequence[Value], rows: NDArray[np.int64]) -> NDArray[np.float64]:
        """A vector of a condition on these rows: (k, d)."""
        position = np.zeros((len(rows), len(vector)))  # of numbers alone, whose places do not matter
        varies = any(map(is_of_place, vector))
        return vectors_at(vector, self.grid.part(rows).position if varies else position)

    def selected(self, target: Selection) -> NDArray[np.int64]:
        """The rows of the grid a condition or a region acts on."""
        return self.grid.chosen(target.nodes, target.box)

    def window(self, first: int, last: int) -> Model:
        """The model of the rows `first` to `last` - 1, of which a condition or a region may have none."""
        part = object.__new__(Model)
        part.__dict__.update(grid=self.grid.window(first, last), settings=self.settings, name=self.name)
        part.__dict__.update(finest_horizons=self.finest_horizons)
        return part

    def _repr_svg_(self) -> str | None:
        """SVG for a notebook: that of the grid."""
        return self.grid._repr_svg_()

    def to_json(self) -> str:
        """The model as one JSON document, which `model_of` reads."""
        return encode(document_of(self.grid, self.settings)).decode()


def on_device(model: Model, device: str) -> Model:
    """The model, whose bonds another device sums. Raises ModelError for one of no such name, or that cannot."""
    settings = overlaid(model.settings, Path(model.name), assignments=[("run.device", f'"{device}"')])
    return replace(model, settings=settings)


def model_of(text: str, name: str) -> Model:
    """The model in the text of a document. Raises GridError or ModelError."""
    document = parse_document(text, name)
    return Model(grid_of(document, name), settings_of(document), name)


def read_model(path: FilePath, settings: FilePath | None = None, assignments: Sequence[tuple[str, str]] = ()) -> Model:
    """The model in a grid file, with the keys of a TOML file and then ``NAME=VALUE`` assignments laid over it.

    Names are dotted (``run.steps``), values TOML; fields may also be ``all``, ``ux,uy`` or ``+energy``. Raises
    GridError or ModelError.
    """
    path, settings = Path(path), None if settings is None else Path(settings)
    document = read_file(path)
    merged = overlaid(settings_of(document), path, settings, assignments, document.dimension)
    grid = grid_of(document, str(path))
    examine(grid, str(path))
    return Model(grid, merged, str(path))


__all__ = ["GridError", "Model", "ModelError", "model_of", "overlaid", "read_model"]
