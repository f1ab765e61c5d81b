"""A body in space as described by an engineer, before there are nodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Generic, TypeAlias, TypeVar

import numpy as np
import shapely

from pdmesh.model.base_structs import PlainFields
from pdmesh.model.document import (
    Adapt,
    AnyCondition,
    Contact,
    Load,
    Material,
    MediumRegion,
    Region,
    RigidBody,
    Run,
    Spring,
)
from pdmesh.model.document import Solid as Dissolving
from pdmesh.model.interfaces import Interface
from pdmesh.model.mechanical_conditions import REST, wrong_spring
from pdmesh.model.medium import Medium
from pdmesh.model.pressed_faces import Faces
from pdmesh.model.rigid_bodies import contradiction
from pdmesh.scene import actions
from pdmesh.scene.checks import composed, described, passable, ratio
from pdmesh.scene.conditions import Profile, unchecked
from pdmesh.scene.diffusion_conditions import DiffusionConditions
from pdmesh.scene.faces import SIDES, parsed
from pdmesh.scene.functions_of_place import Function, ValueOfPlace, without_functions
from pdmesh.scene.heat import Heat, Physics, physics_of
from pdmesh.scene.mechanical_conditions import MechanicalConditions
from pdmesh.scene.node_fields import PlacedField
from pdmesh.scene.pressed_edges import CRACK, named_crack
from pdmesh.scene.shapes import SceneError, checked_spacing
from pdmesh.scene.solids import NodeCloud, Sheet, Shell, Solid, checked, name_of

DEFAULT_RUN = Run()
ROUND_OFF = 1e-6  # of a halving
Where: TypeAlias = str | Solid | Sheet | shapely.Point
R = TypeVar("R", Region, MediumRegion)


@dataclass(frozen=True)
class SolidZone(PlainFields):
    """A part of the body whose nodes have at most this spacing; where zones overlap the finest counts."""

    name: str
    solid: Solid
    spacing: float  # m
    grown: bool = True  # by the horizon of the nodes it replaces, so that none outside sees it


@dataclass(frozen=True)
class CrackFace:
    """A pre-crack: a surface that no bond may cross."""

    name: str
    sheet: Sheet


@dataclass(frozen=True)
class SolidRegion(Generic[R]):
    """A part of the body with another material or medium; of several with a node, the last one counts."""

    solid: Solid
    region: R


@dataclass(frozen=True)
class SolidCondition(PlainFields):
    """A condition of the grid file whose nodes are still to be found: in a solid, or in rows along a face."""

    where: Where
    rows: int
    action: AnyCondition
    functions: tuple[Function, ...] = ()  # of place, that give values of the condition


@dataclass(frozen=True)
class SolidBeside(PlainFields):
    """A body besides the first one, with a lattice of its own."""

    name: str
    body: Body  # its conditions and regions too; its run does not count
    velocity: tuple[float, ...] = (0.0, 0.0, 0.0)  # m/s, at time 0
    spin: tuple[float, ...] = (0.0, 0.0, 0.0)  # rad/s, about x, y, z, at time 0
    rigid: RigidBody | None = None  # without nodes; None: it deforms


@dataclass(frozen=True)
class Body(PlainFields, MechanicalConditions[Where], DiffusionConditions[Where]):
    """Description of a body in space; lengths in metres. Each method returns a body with an addition.

    Nodes are the centres of cubes `spacing` wide that fill the bounding box of the solid; those with their centre in it
    stay. With `adapt`, the first nodes lie on the faces of that box, and all are as fine as the finest.
    """

    AXES: ClassVar[str] = "xyz"

    solid: Solid
    spacing: float  # m, of the coarsest nodes
    material: Material | None = None
    horizon: float = 3.0  # m = horizon / spacing of a node
    run: Run = DEFAULT_RUN
    zones: tuple[SolidZone, ...] = ()
    cracks: tuple[CrackFace, ...] = ()
    regions: tuple[SolidRegion[Region], ...] = ()
    conditions: tuple[SolidCondition, ...] = ()
    fields: tuple[PlacedField, ...] = ()  # constants of the material by node
    interfaces: tuple[Interface, ...] = ()  # between regions, or along surfaces
    medium: Medium | Heat | None = None  # what a substance or heat diffuses through
    media: tuple[SolidRegion[MediumRegion], ...] = ()  # parts of another diffusivity
    bodies: tuple[SolidBeside, ...] = ()  # no bonds join them to this one or to each other
    touching: Contact | None = None  # how bodies and faces of cracks push each other apart
    source: str = ""  # file the scene comes from
    drawing: str = ""  # its text
    parameters: tuple[tuple[str, float | str], ...] = ()  # that it was read with
    notes: tuple[str, ...] = ()  # what there is to say of the file
    nodes: NodeCloud | None = None  # None: they are to be placed

    def __post_init__(self) -> None:
        super().__post_init__()
        checked(self.solid, "body")
        if self.medium is not None:
            passable(self.medium)
        if self.material is not None:
            composed(self.material, "material")
        for region in self.regions:
            composed(region.region.material, f"material '{region.region.name}'")
        described(self.run, Run, "run")
        _ = self.physics  # raises for half of what heat and mechanics together need
        ratio(self.horizon)
        checked_spacing(self.spacing, "spacing")
        for zone in self.zones:
            halved = np.log2(self.spacing / checked_spacing(zone.spacing, f"zone '{zone.name}': spacing"))
            if halved < -ROUND_OFF or abs(halved - round(halved)) > ROUND_OFF:
                raise SceneError(
                    f"zone '{zone.name}': spacing is {zone.spacing:g} m; use {self.spacing:g} m over 1, 2, 4, 8, ..."
                )

    @property
    def physics(self) -> Physics:
        """The physics of its material, regions and medium. Raises SceneError for half of it."""
        return physics_of(self.medium, self.material, (part.region for part in self.regions))

    @property
    def shell(self) -> Shell:
        """The triangulated surface of this body. Raises SceneError before Gmsh has made it."""
        if not isinstance(self.solid, Shell):
            kind = type(self.solid).__name__
            raise SceneError(f"body is {kind}, not its surface; use pdmesh.build or read_scene, which make one")
        return self.solid

    @property
    def finest(self) -> float:
        """The finest spacing, m."""
        return min([self.spacing, *(zone.spacing for zone in self.zones)])

    def adapt(self, how: Adapt = "hybrid") -> Body:
        """The body with an adaptive method: "none" or "auto", or "hybrid", peridynamics only where bonds may break."""
        return self._run(adapt=how)

    def zone(self, solid: Solid, spacing: float, name: str = "", grown: bool = True) -> Body:
        """The body with nodes of this `spacing` (m) in a solid; if `grown`, also around it within the coarser
        nodes' horizon."""
        name = name or f"{len(self.zones) + 1}"
        zone = SolidZone(name, checked(solid, f"zone '{name}'"), spacing, grown)
        return replace(self, zones=(*self.zones, zone))

    def body(
        self,
        body_or_solid: Body | Solid,
        name: str,
        spacing: float | None = None,
        material: Material | None = None,
        velocity: tuple[float, float, float] = (0.0, 0.0, 0.0),
        spin: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> Body:
        """The body with another one beside it, which no bond joins to it and which pushes what it touches.

        The other one is a solid with this `spacing` (m) and `material`, without them those of this body; or a `Body`,
        as of a file of its own. `velocity` (m/s) and `spin` (rad/s, about x, y and z through its centre of mass) are
        those at time 0.
        """
        way, turn = (
            actions.vector(components, 3, f"body '{name}': {word}")
            for word, components in (("velocity", velocity), ("spin", spin))
        )
        return self._beside(SolidBeside(name, self._like(body_or_solid, name, spacing, material), way, turn))

    def rigid(
        self,
        body_or_solid: Body | Solid,
        name: str,
        mass: float | None = None,
        velocity: tuple[float, float, float] = (0.0, 0.0, 0.0),
        spin: tuple[float, float, float] = (0.0, 0.0, 0.0),
        held: str | Sequence[str] = (),
        profile: Profile = (),
        spacing: float | None = None,
        *,
        radius: float | None = None,
    ) -> Body:
        """The body with a rigid one beside it, of a `mass` (kg), which moves as one; `spin` (rad/s) is about x, y, z.

        Of "x", "y", "z" and "spin" those `held` keep what they have at time 0, times the `profile`. A body that is
        wholly held needs no mass. With a `radius` (m) its surface is a sphere about its centre, not that of its nodes.
        """
        about = actions.vector(spin, 3, f"rigid '{name}': spin")
        rigid_body = self._rigid(name, velocity, held, mass=mass, spin=about, profile=profile, radius=radius)
        wrong = contradiction(rigid_body, 3)
        if wrong is not None:
            raise SceneError(f"rigid '{name}': {wrong}")
        return self._beside(SolidBeside(name, self._like(body_or_solid, name, spacing, None), rigid=rigid_body))

    def _like(self, body_or_solid: Body | Solid, name: str, spacing: float | None, material: Material | None) -> Body:
        if isinstance(body_or_solid, Body):
            for word, setting in (("spacing", spacing), ("material", body_or_solid.material and material)):
                if setting is not None:
                    raise SceneError(f"body '{name}' has a {word} of its own; give it there only")
            return (
                body_or_solid
                if body_or_solid.material is not None
                else replace(body_or_solid, material=material or self.material)
            )
        body_spacing = self.spacing if spacing is None else spacing
        return Body(body_or_solid, body_spacing, material or self.material, self.horizon, medium=self.medium)

    def _beside(self, other_body: SolidBeside) -> Body:
        if not other_body.name or other_body.name in (REST, *(body.name for body in self.bodies)):
            raise SceneError(f"body '{other_body.name}' has no name, or one that another body has; use one of its own")
        if (
            other_body.body.bodies
            or other_body.body.medium not in (None, self.medium)
            or other_body.body.horizon != self.horizon
        ):
            raise SceneError(
                f"body '{other_body.name}' has bodies, a medium or another horizon ratio of its own; leave them out"
            )
        return replace(self, bodies=(*self.bodies, other_body), touching=self.touching or Contact())

    def crack(self, sheet: Sheet | Any, name: str = "") -> Body:
        """The body with a crack: a `Sheet`, or triangles (t, 3, 3), m."""
        name = name or f"{len(self.cracks) + 1}"
        return replace(self, cracks=(*self.cracks, CrackFace(name, _sheet(sheet, f"crack '{name}'"))))

    def _faces_along(self, along: Sheet | Any, place: str) -> Faces:
        return tuple(map(tuple, _sheet(along, place).triangles.reshape(-1, 9).tolist()))

    def region(self, solid: Solid, material: Material, name: str = "") -> Body:
        """The body with another material in a solid."""
        name = name or name_of(solid)
        part = SolidRegion(checked(solid, f"material '{name}'"), Region(name=name, material=material))
        composed(material, f"material '{name}'")
        physics_of(self.medium, self.material, [solid_region.region for solid_region in (*self.regions[:1], part)])
        return unchecked(self, regions=(*self.regions, part))

    def fix(
        self,
        where: Where,
        x: ValueOfPlace | None = 0.0,
        y: ValueOfPlace | None = 0.0,
        z: ValueOfPlace | None = 0.0,
        rows: int | None = None,
        profile: Profile = (),
        name: str = "",
        breakable: bool = False,
    ) -> Body:
        """The body with prescribed displacements, m; None leaves a component free.

        Other arguments are those of `load`.
        """
        return self._fixed(where, (x, y, z), rows, profile, name, breakable)

    def pin(self, x: float, y: float, z: float, name: str = "") -> Body:
        """The body with a pin: the node nearest to (x, y, z), m, does not move."""
        return self.fix(shapely.Point(x, y, z), name=name)

    def roller(self, x: float, y: float, z: float, along: str = "x", name: str = "") -> Body:
        """The body with a roller: the node nearest to (x, y, z), m, moves along one or two axes ("x", "xy") alone."""
        return self._rolling((x, y, z), along, name)

    def dissolve(self, solid: Solid, name: str = "") -> Body:
        """The body with a dissolving solid."""
        return self._with(Dissolving, {}, solid, 1, name)

    def diffusivity(self, solid: Solid, D: float, name: str = "") -> Body:
        """The body with another diffusivity (m^2/s) in a solid."""
        name = name or name_of(solid)
        part = SolidRegion(checked(solid, f"medium '{name}'"), actions.medium(name, D))
        return replace(self, media=(*self.media, part))

    def _named(self, where: Where, kind: str) -> str:
        return name_of(where)

    def _size(self, where: Where, place: str) -> dict[str, float]:
        if not isinstance(where, Sheet):
            raise SceneError(f"{place} is {type(where).__name__}; use a sheet that the flux goes through")
        return {"surface": where.area}

    def _with(
        self, kind: type[AnyCondition], values: dict[str, Any], where: Where, rows: int | None, name: str, **more: Any
    ) -> Body:
        name = name or name_of(where)
        place = f"{kind.__struct_config__.tag} '{name}'"
        if isinstance(where, str) and where.startswith(CRACK) and "pressure" in values:
            named_crack(where, self.cracks, place)
        elif isinstance(where, str) and where not in SIDES:
            parsed(where, place)
        elif "pressure" in values and not isinstance(where, str | Sheet):
            raise SceneError(f"{place}: a pressure acts on faces; use a side, a sheet or 'crack NAME'")
        rows = 1 if rows is None else rows
        more |= {"rows": rows} if kind in (Load, Spring) else {}
        plain, functions = without_functions(values)
        action = actions.action(kind, name, plain | more, len(self.AXES))
        wrong = wrong_spring(action, 3) if isinstance(action, Spring) else None
        if wrong is not None:
            raise SceneError(f"{place}{wrong}")
        if isinstance(where, shapely.Point):
            actions.vector(where.coords[0], 3, place)
        elif not isinstance(where, str | Sheet):
            checked(where, place)
        condition = SolidCondition(where, rows, action, functions)
        return replace(self, conditions=(*self.conditions, condition))


def _sheet(sheet: Sheet | Any, place: str) -> Sheet:
    """A sheet, or triangles (t, 3, 3), m, as one. Raises SceneError, beginning with `place`."""
    if isinstance(sheet, Sheet):
        return sheet
    try:
        triangles = np.asarray(sheet, dtype=float)
    except (TypeError, ValueError):
        triangles = np.zeros(0)
    if triangles.shape[1:] != (3, 3) or not np.isfinite(triangles).all() or not len(triangles):
        raise SceneError(f"{place} is {sheet!r:.80}; use triangles of three places (x, y, z) in metres")
    return Sheet(triangles)
