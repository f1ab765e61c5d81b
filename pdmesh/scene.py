"""A scene: shapes with meaning, before any node exists. Frozen; lengths in metres, SI units throughout."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from shapely import LineString, MultiLineString, MultiPolygon, Polygon, unary_union

from pdmesh.grid import Horizon, Material, Run


class SceneError(ValueError):
    """A scene that makes no sense; the message names the place, what was found and what was expected."""


@dataclass(frozen=True)
class Zone:
    """A part of the plate filled with nodes of one spacing."""

    name: str
    shape: Polygon | MultiPolygon
    spacing: float  # m


@dataclass(frozen=True)
class Crack:
    """A pre-crack: a polyline no bond may cross."""

    name: str
    line: LineString


@dataclass(frozen=True)
class Traction:
    """A constant traction on an edge, carried by the `rows` rows of nodes next to it."""

    name: str
    edge: LineString | MultiLineString
    value: tuple[float, float]  # Pa
    rows: int


@dataclass(frozen=True)
class Scene:
    """Everything an engineer says about a plate. Raises SceneError where the parts contradict each other."""

    zones: tuple[Zone, ...]
    cracks: tuple[Crack, ...]
    tractions: tuple[Traction, ...]
    material: Material
    horizon: Horizon
    run: Run
    source: str = ""
    parameters: tuple[tuple[str, float | str], ...] = ()

    def __post_init__(self) -> None:
        if not self.zones:
            raise SceneError("zones: found none, expected at least one (a surface in a group 'zone:NAME')")
        for zone in self.zones:
            if not zone.spacing > 0:
                raise SceneError(f"zone '{zone.name}': spacing: found {zone.spacing:g}, expected more than 0")
            width = max(zone.shape.bounds[2] - zone.shape.bounds[0], zone.shape.bounds[3] - zone.shape.bounds[1])
            if zone.spacing > width:
                raise SceneError(
                    f"zone '{zone.name}': spacing: found {zone.spacing:g} m, expected less than its size {width:g} m"
                )
        for crack in self.cracks:
            if not self.shape.buffer(1e-6 * self.finest).covers(crack.line):
                raise SceneError(f"crack '{crack.name}': found {crack.line.wkt}, expected it inside the plate")
        for traction in self.tractions:
            if traction.rows < 1:
                raise SceneError(f"load '{traction.name}': rows: found {traction.rows}, expected at least 1")

    @cached_property
    def shape(self) -> Polygon | MultiPolygon:
        """The plate: all zones together, less its holes."""
        return unary_union([zone.shape for zone in self.zones])

    @cached_property
    def finest(self) -> float:
        """The smallest spacing, m."""
        return min(zone.spacing for zone in self.zones)

    @cached_property
    def parts(self) -> tuple[Polygon, ...]:
        """The connected parts of the plate."""
        return tuple(self.shape.geoms) if isinstance(self.shape, MultiPolygon) else (self.shape,)

    @cached_property
    def holes(self) -> tuple[Polygon, ...]:
        """The holes of all parts, in a fixed order; a node's hole_id counts them from 0."""
        return tuple(Polygon(ring) for part in self.parts for ring in part.interiors)
