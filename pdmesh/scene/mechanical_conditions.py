"""Loads, supports, motions, contact and monitors, which plates and bodies share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, ClassVar, Literal, Self

import msgspec
import shapely

from pdmesh.model.document import (
    AnyCondition,
    Contact,
    Displacement,
    Gap,
    Load,
    LoadCell,
    RigidBody,
    Run,
    Spring,
)
from pdmesh.model.interfaces import Interface
from pdmesh.model.pressed_faces import Faces
from pdmesh.model.values_of_place import is_of_place
from pdmesh.scene import actions
from pdmesh.scene.conditions import Conditioned, Profile, W
from pdmesh.scene.functions_of_place import ValueOfPlace, VectorOfPlace
from pdmesh.scene.node_fields import PlacedField, placed
from pdmesh.scene.shapes import SceneError

Vector = Sequence[float]  # along each axis
Components = actions.Components  # likewise; None leaves one free


class MechanicalConditions(Conditioned[W]):
    """What `pdmesh.Scene` and `pdmesh.Body` add to themselves. Vectors have a number for each of `AXES`.

    `where` is a side, other words that pick an edge or a face (`pdmesh.scene.edges`, `faces`), a shape or a solid, a
    curve or a sheet, or a `shapely.Point`, which stands for the one node nearest to it. A curve, a sheet or a side
    stands for its `rows` nearest rows of nodes. `profile` holds points (time in s, factor). Bonds of the nodes of a
    condition do not break unless `breakable`.

    Without `rows`, an edge of a plate is held or loaded as if the material went on beyond it: a grip holds the first
    row, whose bonds make up for those that end there, and a traction is shared by the rows of a horizon. With `rows`
    these have equal parts and plain bonds: one row is then as soft as 0.4 to 2.7 spacings more of material.

    A component of a motion, a traction or a body force may be a number, a function of place f(x, y) or f(x, y, z), m,
    an expression such as "1e6 * (1 - (y/0.02)^2)", or the name of a CSV or .npy file; one function may give all
    components.
    """

    AXES: ClassVar[str]
    run: Run
    touching: Contact | None
    fields: tuple[PlacedField, ...]
    interfaces: tuple[Interface, ...]

    def _faces_along(self, along: Any, place: str) -> Faces:
        """Segments along a polyline, or triangles of a sheet. Raises SceneError, beginning with `place`."""
        raise NotImplementedError

    def contact(
        self, friction: float = 0.0, stiffness: float = 15.0, distance: float = 1.0, restitution: float = 1.0
    ) -> Self:
        """With bodies, and faces of cracks, that push each other apart; the settings are those of `Contact`."""
        settings = {"friction": friction, "stiffness": stiffness, "distance": distance, "restitution": restitution}
        return self._changed(touching=actions.converted(settings, Contact, "contact"))

    def vary(self, quantity: str, value: Any, region: str = "", rule: Literal["linear", "nearest"] = "linear") -> Self:
        """With a constant of the material that differs by node, in place of that of the node's material.

        Parameters
        ----------
        quantity
            E, rho, G0 or the critical_stretch of brittle bonds, f_t, strength, nu, yield_stress, hardening, alpha, or
            angle (degrees, of the fibres of orthotropic solids).
        value
            A function of place f(x, y) or f(x, y, z), m; an expression such as "70e9 * (1 + x / 0.1)"; an array in the
            order of nodes; a `Weibull`, which multiplies the values so far; a `Picture`; or the name of a file: .npy
            with an array in the order of nodes or rows of coordinates and value, .csv, FILE.vtu or FILE.vtk with :NAME.
        region
            Name of the region whose nodes have it; all nodes by default.
        rule
            Between the places of a file: linear, or that of the nearest place. Nodes must not be outside of the places
            by more than a tenth of their extent.
        """
        return self._changed(fields=(*self.fields, placed(quantity, value, region, rule)))

    def interface(
        self,
        between: tuple[str, str] | None = None,
        along: Any = None,
        G0: float | None = None,
        f_t: float | None = None,
        stiffness: float = 1.0,
        name: str = "",
    ) -> Self:
        """With an interface, whose bonds have constants of their own.

        Parameters
        ----------
        between
            Names of two regions; "rest" stands for the nodes of no region, "*" for any others.
        along
            In place of regions: a polyline, in space a `Sheet` or triangles (t, 3, 3), m.
        G0
            Fracture energy, J/m^2, of a cut along the interface; by default that of the materials.
        f_t
            Tensile strength of cohesive bonds, Pa; by default that of the materials.
        stiffness
            Of its bonds, over that of the materials.
        """
        name = name or f"{len(self.interfaces) + 1}"
        place = f"interface '{name}'"
        values: dict[str, Any] = {"G0": G0, "f_t": f_t, "stiffness": stiffness, "between": between}
        if along is not None:
            values["faces"] = self._faces_along(along, place)
        interface = actions.converted({"name": name} | values, Interface, place)
        return self._changed(interfaces=(*self.interfaces, interface))

    def load(
        self,
        where: W,
        traction: VectorOfPlace | None = None,
        body_force: VectorOfPlace | None = None,
        rows: int | None = None,
        profile: Profile = (),
        name: str = "",
        breakable: bool = False,
        force: Vector | None = None,
        *,
        pressure: ValueOfPlace | None = None,
        following: bool = False,
    ) -> Self:
        """With a traction (Pa) on a curve, a sheet or a side; or a body force (N/m^3) or a total `force` (N, in a
        plate per metre of thickness) there or in a shape or a solid.

        A `pressure` (Pa) pushes against an edge or a face, or, `where` is "crack NAME", against both faces of that
        pre-crack. If it is `following`, it turns with them and grows with their area, in dynamic runs.
        """
        values = {"traction": traction, "body_force": body_force, "force": force, "pressure": pressure}
        if following and (pressure is None or callable(pressure) or is_of_place(pressure)):
            what = "is not a pressure" if pressure is None else "varies with place"
            raise SceneError(f"load '{name or self._named(where, 'load')}' {what}; use a pressure that is a number")
        more = {"following": True} if following else {}
        return self._acting(Load, values, where, rows, name, profile=profile, breakable=breakable, **more)

    def spring(
        self,
        where: W,
        stiffness: Vector | None = None,
        body_stiffness: Vector | None = None,
        rows: int = 1,
        name: str = "",
        breakable: bool = False,
    ) -> Self:
        """With springs to the ground, an elastic bed: a `stiffness` along each axis of an edge, a side or a sheet
        (traction over displacement, N/m^3), or a `body_stiffness` (body force over displacement, N/m^4) of a shape or a
        solid."""
        values = {"stiffness": stiffness, "body_stiffness": body_stiffness}
        return self._acting(Spring, values, where, rows, name, breakable=breakable)

    def move(
        self,
        where: W,
        velocity: Components | None = None,
        acceleration: Components | None = None,
        initial_velocity: Components | None = None,
        rows: int | None = None,
        profile: Profile = (),
        name: str = "",
        breakable: bool = False,
        *,
        initial_displacement: Components | None = None,
    ) -> Self:
        """With one of: a prescribed velocity (m/s) or acceleration (m/s^2), or a velocity (m/s) or displacement (m) at
        time 0, which have no profile. None leaves a component free."""
        moves = {"velocity": velocity, "acceleration": acceleration, "initial_velocity": initial_velocity}
        moves["initial_displacement"], name = initial_displacement, name or self._named(where, "move")
        kind, values = actions.motion(name, self.AXES, moves, profile=profile, breakable=breakable)
        return self._with(kind, values, where, rows, name)

    def gap(self, name: str, first: Vector, second: Vector) -> Self:
        """With a monitored opening between the nodes nearest to two places, m."""
        ends = tuple(actions.vector(end, len(self.AXES), f"gap '{name}'") for end in (first, second))
        return self._run(gaps=(*self.run.gaps, Gap(name, ends)))  # type: ignore[arg-type]

    def load_cell(self, name: str, *conditions: str) -> Self:
        """With a load cell: the sum of the forces of conditions of these names."""
        return self._run(load_cells=(*self.run.load_cells, LoadCell(name, conditions)))

    def _fixed(
        self,
        where: W,
        values: Sequence[ValueOfPlace | None],
        rows: int | None = None,
        profile: Profile = (),
        name: str = "",
        breakable: bool = False,
    ) -> Self:
        along = dict(zip(self.AXES, values, strict=True))
        return self._with(Displacement, along, where, rows, name, profile=profile, breakable=breakable)

    def _rolling(self, place: Vector, along: str, name: str) -> Self:
        """With the node nearest to a place, m, free along these axes alone."""
        free = set(along) if isinstance(along, str) else set()
        if not free < set(self.AXES) or len(free) != len(along):
            expected = "x or y" if len(self.AXES) == 2 else "one or two of x, y and z"
            raise SceneError(f"roller '{name}': along is {along!r:.40}; use {expected}")
        return self._fixed(shapely.Point(*place), [None if axis in free else 0.0 for axis in self.AXES], name=name)

    def _rigid(self, name: str, velocity: Vector, held: str | Sequence[str], **settings: Any) -> RigidBody:
        """The motion of a rigid body called `name`."""
        along = dict(zip(self.AXES, actions.vector(velocity, len(self.AXES), f"rigid '{name}': velocity"), strict=True))
        settings |= along | {"held": [held] if isinstance(held, str) else held}
        rigid_body = actions.action(
            RigidBody, name, {key: value for key, value in settings.items() if value is not None}
        )
        assert isinstance(rigid_body, RigidBody)
        return rigid_body

    def _acting(
        self,
        kind: type[AnyCondition],
        values: dict[str, Any],
        where: W,
        rows: int | None,
        name: str,
        **more: Any,
    ) -> Self:
        """With the one of some vectors that is given."""
        name = name or self._named(where, str(kind.__struct_config__.tag))
        place = f"{kind.__struct_config__.tag} '{name}'"
        of_numbers = actions.vector if kind is Spring else actions.vector_of_place
        vectors = {
            key: vector if key == "pressure" else of_numbers(vector, len(self.AXES), f"{place}: {key}")
            for key, vector in values.items()
            if vector is not None
        }
        if len(vectors) != 1:
            raise SceneError(f"{place}: {' and '.join(vectors) or 'none'} given; give one of {', '.join(values)}")
        return self._with(kind, dict(vectors), where, rows, name, **more)

    def _run(self, **changed: Any) -> Self:
        return self._changed(run=msgspec.structs.replace(self.run, **changed))

    def _changed(self, **changed: Any) -> Self:
        return replace(self, **changed)  # type: ignore[type-var]
