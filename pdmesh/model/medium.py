"""What a substance diffuses through, the solid that may dissolve into it, and what is done to it."""

from __future__ import annotations

from typing import Literal

import msgspec

from pdmesh.model.timed_selection import Amount, Positive, Selection, Timed, Vector


class Medium(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """The liquid, or any medium without one that dissolves.

    A solid of `C_solid` dissolves into liquid below `C_sat`. By ``enthalpy`` that is as fast as what is dissolved is
    carried away; by ``kinetic`` its bonds to liquid have a stiffness of their own, `k_diss`.
    """

    D: Positive  # diffusivity, m^2/s
    power: Literal[0, 1, 2] = 1  # of the distance that the micro-diffusivity falls with
    C_solid: Positive | None = None  # mol/m^3; None: nothing dissolves
    C_sat: Positive | None = None  # mol/m^3, that liquid can hold
    dissolution: Literal["enthalpy", "kinetic"] = "enthalpy"
    k_diss: Positive = 1.0  # kinetic: of bonds from solid to liquid, over that from liquid to liquid
    surface_correction: bool = True  # of links near free surfaces, cracks and held layers; see the guide
    capped: bool = True  # kinetic: nothing dissolves into liquid that holds C_sat


def contradiction(medium: Medium) -> str | None:
    """What is wrong with a solid that cannot be one: the key, what was found and what was expected."""
    C_solid, C_sat = medium.C_solid, medium.C_sat
    if (C_solid is None) != (C_sat is None):
        missing = "C_sat" if C_sat is None else "C_solid"
        return f"{missing}: found none, expected one, as there is the other of C_solid and C_sat"
    if C_solid is not None and C_sat is not None and not C_sat < C_solid:
        return f"C_sat: found {C_sat:g} mol/m^3, expected less than C_solid, {C_solid:g} mol/m^3"
    if medium.dissolution == "kinetic" and C_solid is None:
        return "C_solid: found none, expected one, as the dissolution is kinetic"
    return None


class MediumRegion(Selection, frozen=True, kw_only=True):
    """Nodes where another diffusivity holds than in the rest; of several with a node, the last one has it."""

    D: Positive  # m^2/s


class Concentration(Timed, frozen=True, kw_only=True, tag="concentration", tag_field="kind"):
    """A concentration that is held, mol/m^3: at the nodes, or at an edge beside them.

    `edge` has the way from each of `nodes` to the edge, m. These nodes are not held themselves.
    """

    value: Amount
    edge: tuple[Vector, ...] | None = None


class Source(Timed, frozen=True, kw_only=True, tag="source", tag_field="kind"):
    """What is supplied: ``rate``, mol/(m^3 s), or ``flux``, mol/(m^2 s), through an edge of this ``length``, m, or, of
    a body, a ``surface``, m^2.

    A flux is shared by its nodes' cells, so that the total is flux times length.
    """

    rate: float | None = None
    flux: float | None = None
    length: Positive | None = None
    surface: Positive | None = None


class Exchange(Timed, frozen=True, kw_only=True, tag="exchange", tag_field="kind"):
    """A flux through an edge of this ``length`` (m), or a ``surface`` (m^2), as what is outside differs from inside.

    It is ``coefficient`` (m/s) times (``value`` - C); `profile` is that of the value, mol/m^3.
    """

    coefficient: Positive
    value: Amount = 0.0
    length: Positive | None = None
    surface: Positive | None = None


class InitialConcentration(Selection, frozen=True, kw_only=True, tag="initial concentration", tag_field="kind"):
    """A concentration at time 0, mol/m^3."""

    value: Amount


class Solid(Selection, frozen=True, kw_only=True, tag="solid", tag_field="kind"):
    """Nodes that are solid at time 0."""


OfDiffusion = Concentration | Source | Exchange | InitialConcentration | Solid
