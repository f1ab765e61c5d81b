"""Constants of the material by node, before there are nodes: functions, tables, files, pictures and random strengths.

Random strengths are Weibull's: of a volume V, s = s0 (V0 / V)^(1/m) (-ln U)^(1/m), U even between 0 and 1. They are
drawn for cubes of a fixed size, and nodes have the value of their cube. A bond has the mean of its ends: if each node
had a value of its own, the mean of two would hide the weakest, and large bodies would not be weaker than small ones.
U is a hash of the seed and the number of the cube (splitmix64: G. L. Steele, D. Lea, C. H. Flood, OOPSLA 2014), so that
a finer spacing or another outline leaves the values where they are.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.node_fields import QUANTITIES
from pdmesh.model.values_at_places import (
    LARGEST_OF_PIXELS,
    array_of_nodes,
    nearest_at,
    path_beside,
    read_table,
    values_at,
)
from pdmesh.model.values_of_place import PlaceError, Table, Value, is_file
from pdmesh.scene.mesh_files import is_mesh, table_of_mesh
from pdmesh.scene.shapes import SceneError

Array = NDArray[np.float64]
STRETCH = "critical_stretch"  # of brittle bonds, whose G0 the grid file has
STRENGTHS = {"f_t": 1, "strength": 1, "yield_stress": 1, STRETCH: 1, "G0": 2}  # power of a factor on the strength
FEWEST = 2.0  # spacings of a cube
ON = 1e-6  # of a cube: a node this near to its lower side is in it


@dataclass(frozen=True)
class Weibull:
    """Random strengths of modulus `m`: s0 is that of the volume `V0`, m^3, in a plate the area, m^2.

    `block` is the side of the cubes with one value each, m; the default is one horizon of the coarsest nodes.
    """

    m: float
    V0: float
    seed: int
    block: float | None = None

    def factors(self, position: Array, block: float) -> Array:
        """Strengths (n,) over s0 at places (n, d), m, in cubes with this side, m."""
        numbers = np.floor(position / block + ON).astype(np.int64).view(np.uint64)
        state = _mixed(np.full(len(position), self.seed, dtype=np.uint64))
        for along in numbers.T:
            state = _mixed(state ^ along)
        U = ((state >> np.uint64(11)).astype(float) + 0.5) * 2.0**-53
        return np.asarray((-np.log(U) * self.V0 / block ** position.shape[1]) ** (1 / self.m))


def _mixed(state: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """The next output of splitmix64 for each state (n,)."""
    state = state + np.uint64(0x9E3779B97F4A7C15)
    state = (state ^ (state >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    state = (state ^ (state >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return np.asarray(state ^ (state >> np.uint64(31)))


@dataclass(frozen=True)
class Picture:
    """Values by the grey of a picture's pixels, as of a slice of a CT scan.

    `levels` are pairs of a grey level and the value from there on: 0 to 255 in most files, 0 to 65535 in those of 16
    bits. `box` is what the picture covers: x0, y0, x1, y1, m; the default is that of all nodes. Its first row of pixels
    is at y1. In a body, the values are the same along z.
    """

    file: str
    levels: Sequence[tuple[float, float]]
    box: tuple[float, float, float, float] | None = None
    pixels: Array | None = None  # (rows, columns) grey levels, once they are read

    def values(self, position: Array) -> Array:
        """Values (n,) at places (n, d), m. Raises PlaceError for a place outside of the picture."""
        assert self.pixels is not None
        rows, columns = self.pixels.shape
        x, y = position[:, 0], position[:, 1]
        x0, y0, x1, y1 = self.box or (x.min(), y.min(), x.max(), y.max())
        column, row = ((x - x0) / (x1 - x0) * columns, (y1 - y) / (y1 - y0) * rows)
        outside = (column < -0.5) | (column > columns + 0.5) | (row < -0.5) | (row > rows + 0.5)
        if outside.any():
            at = int(outside.argmax())
            raise PlaceError(
                f"the node at ({x[at]:g}, {y[at]:g}) m is outside of {self.file}; use a box that covers it"
            )
        grey = self.pixels[row.astype(int).clip(0, rows - 1), column.astype(int).clip(0, columns - 1)]
        levels, values = np.array(sorted(self.levels)).T
        at_level = np.searchsorted(levels, grey, side="right") - 1
        if (at_level < 0).any():
            raise PlaceError(f"{self.file} has a grey of {grey.min():g}, below all levels; begin them with 0")
        return np.asarray(values[at_level])


Source = Value | Callable[..., Any] | Array | Weibull | Picture


@dataclass(frozen=True)
class PlacedField:
    """A constant of the material whose values at nodes are still to be computed."""

    quantity: str
    value: Source
    region: str  # name of the region whose nodes have it; "": all
    rule: Literal["linear", "nearest"]  # between the places of a table
    source: str  # in words

    def read(self, folder: Path, dimension: int) -> PlacedField:
        """The field with the values of a file of a folder in place of its name. Raises PlaceError."""
        value = self.value
        if isinstance(value, Picture):
            return replace(self, value=replace(value, pixels=_pixels(value.file, folder)))
        if not isinstance(value, str) or not is_file(value):
            return self
        if is_mesh(value):
            table = table_of_mesh(value, folder, dimension)
            if table.times:
                raise PlaceError(f"{value.partition(':')[0]} has times; use a mesh of one")
            return replace(self, value=table)
        own = array_of_nodes(value, folder)
        return replace(self, value=read_table(value, folder, dimension) if own is None else own)

    def tabulated(self, position: Array) -> PlacedField:
        """The field with a table of the values of its function at places (n, d), m. Raises SceneError."""
        if not callable(self.value):
            return self
        table = Table(tuple(map(tuple, position.tolist())), tuple(_called(self.value, position, self.place).tolist()))
        return replace(self, value=table, rule="nearest")

    @property
    def place(self) -> str:
        """The field in messages."""
        return f"field of {self.quantity}"

    def values(self, position: Array, rows: NDArray[np.int64]) -> Array:
        """The values (k,) of the nodes in `rows`, of all at places (n, d), m. Raises PlaceError or SceneError."""
        value = self.value
        if isinstance(value, np.ndarray):
            if value.shape != (len(position),):
                raise PlaceError(
                    f"{self.source} has the shape {value.shape}; give ({len(position)},), one for each node"
                )
            return np.asarray(value[rows], dtype=float)
        if isinstance(value, Picture):
            low, high = position.min(axis=0), position.max(axis=0)
            return replace(value, box=value.box or (low[0], low[1], high[0], high[1])).values(position[rows])
        if callable(value):
            return _called(value, position[rows], self.place)
        if isinstance(value, Table) and self.rule == "nearest":
            return nearest_at(value, position[rows])
        assert not isinstance(value, Weibull)
        return values_at(value, position[rows])


def placed(quantity: str, value: Any, region: str, rule: str) -> PlacedField:
    """A field as a scene has it. Raises SceneError for what it cannot be."""
    place = f"field of {quantity}"
    if quantity not in (*QUANTITIES, STRETCH):
        raise SceneError(f"{place}: no such constant; use {', '.join((*QUANTITIES, STRETCH))}")
    if rule not in ("linear", "nearest"):
        raise SceneError(f"{place}: rule is '{rule}'; use linear or nearest")
    if isinstance(value, Weibull):
        if quantity not in STRENGTHS:
            raise SceneError(f"{place}: Weibull draws strengths; use it for {', '.join(STRENGTHS)}")
        if not (value.m > 0 and value.V0 > 0 and value.seed >= 0 and (value.block is None or value.block > 0)):
            raise SceneError(f"{place} is {value}; use positive m, V0 and block, and a seed of 0 or more")
    elif isinstance(value, Picture):
        if not value.levels or any(len(pair) != 2 for pair in value.levels):
            raise SceneError(f"{place}: {value.file} has no levels; give pairs of a grey level and a value")
    elif not isinstance(value, str | Table) and not callable(value):
        try:
            value = np.asarray(value, dtype=float) if np.ndim(value) else float(value)
        except (TypeError, ValueError):
            raise SceneError(f"{place} is {value!r:.80}; use a number, numbers or one of the sources") from None
    return PlacedField(quantity, value, region, rule, _described(value, rule))  # type: ignore[arg-type]


def _described(value: Source, rule: str) -> str:
    """A source in words, for the grid file."""
    if isinstance(value, Picture):
        return f"{value.file}, levels {tuple(value.levels)!r:.200}, box {value.box}"
    if isinstance(value, np.ndarray):
        return "an array in the order of nodes"
    if callable(value):
        return f"function {getattr(value, '__name__', '')}"
    if isinstance(value, str):
        return f"{value}, {rule}" if is_file(value) else value
    return f"{value!r:.200}"


def _called(function: Callable[..., Any], position: Array, place: str) -> Array:
    """Values (n,) of a function of place. Raises SceneError."""
    values = np.empty(len(position))
    for number, at in enumerate(position.tolist()):
        try:
            values[number] = float(function(*at))
        except Exception as error:  # a user's program may raise anything
            where = ", ".join(f"{number:g}" for number in at)
            raise SceneError(
                f"{place}: the function raises {type(error).__name__} at ({where}) m ({error}); return a number"
            ) from None
    return values


def _pixels(name: str, folder: Path) -> Array:
    """Grey levels (rows, columns) of a picture. Raises PlaceError."""
    from PIL import Image  # few scenes have pictures

    try:
        with Image.open(path_beside(name, folder)) as picture:
            if picture.width * picture.height > LARGEST_OF_PIXELS:
                raise PlaceError(f"{name} has {picture.width} x {picture.height} pixels; use fewer")
            grey = picture if picture.mode in ("L", "F") or picture.mode.startswith("I") else picture.convert("L")
            return np.asarray(grey, dtype=float)
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        if isinstance(error, PlaceError):
            raise
        raise PlaceError(f"{name}: cannot be read ({error}); use a picture that Pillow reads") from None
