"""The medium of diffusion, the solid that may dissolve in it, and the conditions on both."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec

from pdmesh.model.base_structs import Amount, PlainStruct, Positive, Selection, Timed, Vector
from pdmesh.model.values_of_place import Expression, Table, Value

AmountOfPlace = Amount | Expression | Table


class Medium(PlainStruct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """The liquid in which a solid may dissolve, or any medium of diffusion or of heat.

    A solid of `C_solid` dissolves into liquid below `C_sat`. With ``enthalpy``, the rate is that at which diffusion
    carries dissolved material away. With ``kinetic``, bonds between solid and liquid have their own stiffness,
    `k_diss`.
    """

    D: Positive  # m^2/s: diffusivity; of heat: thermal diffusivity
    power: Literal[0, 1, 2] = 1  # the conductance of a bond is proportional to its length to the power -power
    C_solid: Positive | None = None  # mol/m^3: concentration of the substance in the solid; none: nothing dissolves
    C_sat: Positive | None = None  # mol/m^3: concentration at which the liquid is saturated
    dissolution: Literal["enthalpy", "kinetic"] = "enthalpy"  # what limits the rate of dissolution: diffusion in the
    # liquid (enthalpy), or bonds between solid and liquid (kinetic)
    k_diss: Positive = 1.0  # with dissolution kinetic: conductance of a bond between solid and liquid, divided by that
    # of a bond in the liquid
    surface_correction: bool = True  # true: bonds near free surfaces, cracks and prescribed layers are corrected
    broken: Annotated[float, msgspec.Meta(ge=0, le=1)] = 1.0  # conductance of a broken bond divided by that of the same
    # bond before it broke
    heat_capacity: Positive | None = None  # J/(m^3 K): heat capacity per volume; none: not known, and amounts of heat
    # are in K m^2, in 3D in K m^3
    deformation: bool = False  # true: stretching cools the body, and compression heats it
    capped: bool = True  # with dissolution kinetic: true if the solid dissolves only while the liquid is below C_sat
    carries: Literal["substance", "heat"] = "substance"  # what diffuses: a substance (concentrations in mol/m^3), or
    # heat (temperatures in K)


def contradiction(medium: Medium) -> tuple[str, str, str] | None:
    """The contradiction in a medium with a solid: key, what was found, what was expected; None if there is none."""
    C_solid, C_sat = medium.C_solid, medium.C_sat
    if (C_solid is None) != (C_sat is None):
        missing = "C_sat" if C_sat is None else "C_solid"
        return missing, "none", "one, as there is the other of C_solid and C_sat"
    if C_solid is not None and C_sat is not None and not C_sat < C_solid:
        return "C_sat", f"{C_sat:g} mol/m^3", f"less than C_solid, {C_solid:g} mol/m^3"
    if medium.carries == "heat" and C_solid is not None:
        return "carries", "heat", "substance, as there is a solid"
    if medium.carries == "substance" and medium.heat_capacity is not None:
        return "heat_capacity", f"{medium.heat_capacity:g}", "none, as the medium carries a substance"
    if medium.deformation and medium.heat_capacity is None:
        return "heat_capacity", "none", "a number, as deformation heats"
    if medium.dissolution == "kinetic" and C_solid is None:
        return "C_solid", "none", "one, as the dissolution is kinetic"
    return None


def amount_of(medium: Medium, dimension: int) -> tuple[float, str]:
    """The factor from sums of contents times volumes to amounts, and their unit; of heat in a plate, per thickness."""
    if medium.carries == "substance":
        return 1.0, "mol"
    if medium.heat_capacity is None:
        return 1.0, f"K m^{dimension}"
    return medium.heat_capacity, "J/m" if dimension == 2 else "J"


class MediumRegion(Selection, frozen=True, kw_only=True):
    """Nodes with another diffusivity; of several regions with a node, the last one counts."""

    D: Positive  # m^2/s


class Concentration(Timed, frozen=True, kw_only=True, tag="concentration", tag_field="kind"):
    """A prescribed concentration, mol/m^3, at the nodes or on an edge beside them.

    `edge` holds the vector from each of `nodes` to the edge, m; with it, the nodes themselves are not prescribed.
    """

    value: AmountOfPlace
    edge: tuple[Vector, ...] | None = None


class Source(Timed, frozen=True, kw_only=True, tag="source", tag_field="kind"):
    """A source: ``rate``, mol/(m^3 s), or ``flux``, mol/(m^2 s), through a ``length``, m, or a ``surface``, m^2.

    A flux is distributed over its nodes' cells, so that the total is flux times length.
    """

    rate: Value | None = None
    flux: Value | None = None
    length: Positive | None = None
    surface: Positive | None = None


class Exchange(Timed, frozen=True, kw_only=True, tag="exchange", tag_field="kind"):
    """A flux through an edge (``length``, m) or a ``surface`` (m^2), proportional to a concentration difference.

    It is ``coefficient`` (m/s) times (``value`` - C); `profile` is that of the value, mol/m^3. `edge` holds the vector
    from each of `nodes` to the edge, m; without it, the edge is where the nodes' cells end.
    """

    coefficient: Positive
    value: AmountOfPlace = 0.0
    length: Positive | None = None
    surface: Positive | None = None
    edge: tuple[Vector, ...] | None = None


class InitialConcentration(Selection, frozen=True, kw_only=True, tag="initial concentration", tag_field="kind"):
    """A concentration at time 0, mol/m^3."""

    value: AmountOfPlace


class Solid(Selection, frozen=True, kw_only=True, tag="solid", tag_field="kind"):
    """Nodes that are solid at time 0."""


OfDiffusion = Concentration | Source | Exchange | InitialConcentration | Solid
