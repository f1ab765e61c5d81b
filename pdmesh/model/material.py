"""A material: constants that every one has, and a tagged struct for each kind, law and solid with what is its own.

A grid file, a settings file and a call of `Material` write them as one flat table. The tag of a struct is the word of
that table by which it is chosen: `Cohesive` belongs to materials whose ``law`` is "cohesive". A parameter is declared
here and nowhere else: default, bounds, unit, name in drawings, and whether it must be given.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple, get_args, get_type_hints

import msgspec
from msgspec import Meta

from pdmesh.model.base_structs import Amount, PlainStruct, Positive

USUAL_LAW = "brittle"
UNKNOWN = 0.0  # G0 until it follows from the critical stretch; see `pdmesh.model.fracture_energy`


class Declared(NamedTuple):
    """What a parameter's declaration says besides its type, default and bounds."""

    unit: str = ""  # "" of words and of numbers without one
    drawing_name: str = ""  # its name in drawings; "": its own in words, such as Yield stress
    needed: str = ""  # what must be given where its struct is chosen; "": nothing
    refused: bool = True  # with other kinds; else it is said that it is not used


class Elastic(msgspec.Struct, frozen=True):
    """What every material has."""

    E: Annotated[Positive, Declared("Pa", "E")]  # Young's modulus
    rho: Annotated[Positive, Declared("kg/m^3", "rho")]  # density
    G0: Annotated[Amount, Declared("J/m^2", "G0")] = UNKNOWN  # fracture energy, the energy that a crack dissipates per
    # area; for brittle bonds critical_stretch may replace it
    critical_stretch: Annotated[Positive | None, Declared("", "Critical stretch")] = None  # critical stretch of the
    # brittle bonds between the finest nodes, in place of G0
    nu: Annotated[Annotated[float, Meta(gt=-1, lt=1)] | None, Declared("", "nu")] = (
        None  # Poisson's ratio; none: that of bonds, 1/3 in plane stress, 1/4 in plane strain and 3D
    )
    model: Literal["bond", "ordinary", "correspondence", "micropolar"] = "bond"  # material model: forces of bonds
    # (bond), of families of bonds (ordinary, correspondence), or of bonds and rotations (micropolar)
    micromodulus: Literal["conical", "constant"] = "conical"  # stiffness of a bond by its length: constant, or
    # decreasing to 0 at the horizon (conical)
    calibration: Literal["mean", "isotropic"] = "mean"  # stiffness of a lattice: that of the material as a mean over
    # directions, or in each direction (isotropic)
    coarse: Literal["own", "matched", "unbreakable"] = "own"  # strength of bonds outside the finest zone of a body:
    # their own, that of the finest zone (matched), or no limit
    plane: Literal["stress", "strain", "space"] = "stress"  # plane stress, plane strain, or a 3D model (space)
    sight: Literal["visibility", "diffraction"] = "visibility"  # bonds across a crack: none (visibility), or weaker
    # ones round its tips (diffraction)
    failure: Literal["stretch", "energy", "stress", "none"] = "stretch"  # quantity whose limit breaks a bond; the model
    # bond has only stretch


class Diffraction(msgspec.Struct, frozen=True, tag_field="sight", tag="diffraction"):
    """Bonds that go round the tips of cracks."""

    gamma: Annotated[float, Meta(ge=1)] = 1.0  # exponent of diffraction: a bond of length s0 whose way round the crack
    # is s1 + s2 has the influence of one of length ((s1 + s2) / s0)^gamma s0


class BondLaw(msgspec.Struct, frozen=True):
    """Bonds whose force a law gives."""

    law: Annotated[str, Declared(drawing_name="Force law")] = USUAL_LAW  # force law of bonds: brittle, bilinear,
    # cohesive, or the name of a law of your own


class Bilinear(msgspec.Struct, frozen=True, tag_field="law", tag="bilinear"):
    """Bonds that soften along a line."""

    kr: Annotated[float, Meta(ge=1), Declared("", "kr")] = 1.0  # stretch at which a bilinear bond breaks, divided by
    # the stretch of its largest force
    keep_G0: Annotated[bool, Declared(refused=False)] = True  # true: a crack of bilinear bonds dissipates G0 per area;
    # false: G0 / kr, as in the thesis


class Cohesive(msgspec.Struct, frozen=True, tag_field="law", tag="cohesive"):
    """Bonds that soften by their opening."""

    f_t: Annotated[Positive | None, Declared("Pa", "f_t", needed="the tensile strength, Pa")] = None  # tensile
    # strength; required with law cohesive
    shape: Literal["linear", "bilinear", "exponential"] = "linear"  # softening curve of cohesive bonds: the stress as a
    # function of the crack opening


class Family(msgspec.Struct, frozen=True):
    """Forces that all neighbours of a node decide on."""

    influence: Literal["cubic spline", "constant", "inverse"] | None = None  # weight of a neighbour by its distance;
    # none: constant for ordinary, cubic spline for correspondence


class Correspondence(msgspec.Struct, frozen=True, tag_field="model", tag="correspondence"):
    """A solid behind the gradient of a family."""

    solid: Literal["linear", "svk", "neo hooke", "j2", "orthotropic"] = "linear"  # stress-strain law of a
    # correspondence model
    form: Literal["total", "rate"] = "total"  # the stress follows from the total deformation, or is integrated over the
    # steps (rate)
    control: Literal["silling", "none", "wan", "breitzman-dayal"] = "silling"  # method that controls the zero-energy
    # modes of a correspondence model
    order: Annotated[int, Meta(ge=1, le=7)] = 1  # order of the polynomial that is fitted to the displacements of a
    # family
    constant_term: bool = False  # true: the fitted polynomial has a constant term, so that its value at the node may
    # differ from the displacement of the node


class StressFailure(msgspec.Struct, frozen=True, tag_field="failure", tag="stress"):
    """Bonds that fail by the stress of their ends."""

    strength: Annotated[Positive | None, Declared("Pa", needed="the largest principal stress, Pa")] = None  # largest
    # principal stress, at which bonds break; required with failure stress


class Silling(msgspec.Struct, frozen=True, tag_field="control", tag="silling"):
    """Control of modes without energy by springs along the bonds."""

    control_factor: Annotated[float, Meta(ge=0), Declared(refused=False)] = 0.5  # factor of the forces that control
    # zero-energy modes, with control silling


class Plastic(msgspec.Struct, frozen=True, tag_field="solid", tag="j2"):
    """A metal that yields."""

    yield_stress: Annotated[Positive | None, Declared("Pa", needed="the yield stress, Pa")] = None  # yield stress;
    # required with solid j2
    hardening: Annotated[float, Declared("Pa")] = 0.0  # increase of the yield stress per plastic strain


class Orthotropic(msgspec.Struct, frozen=True, tag_field="solid", tag="orthotropic"):
    """A ply: stiffer, and stronger, along its fibres, axis 1; E is E1 and nu is nu12."""

    angle: Annotated[float, Declared("degrees")] = 0.0  # direction of the fibres of an orthotropic solid, from x to y
    E2: Annotated[Positive | None, Declared("Pa", "E2", needed="Young's modulus across the fibres, Pa")] = (
        None  # Young's
    )
    # modulus across the fibres; required with solid orthotropic, whose E is that along them
    G12: Annotated[Positive | None, Declared("Pa", "G12", needed="the shear modulus in the plane, Pa")] = None  # shear
    # modulus in the plane of the ply; required with solid orthotropic
    E3: Annotated[Positive | None, Declared("Pa", "E3")] = None  # Young's modulus across the plane of the ply; required
    # in plane strain and in 3D, as nu13 and nu23 are
    nu13: Annotated[float | None, Declared("", "nu13")] = None  # Poisson's ratio, strain across the plane over strain
    # along the fibres
    nu23: Annotated[float | None, Declared("", "nu23")] = None  # Poisson's ratio, strain across the plane over strain
    # across the fibres
    G13: Annotated[Positive | None, Declared("Pa", "G13")] = None  # shear modulus across the plane, along the fibres;
    # required in 3D, as G23 is
    G23: Annotated[Positive | None, Declared("Pa", "G23")] = None  # shear modulus across the plane and the fibres
    strength_across: Annotated[Positive | None, Declared("Pa")] = None  # tensile strength across the fibres; required
    # with solid orthotropic and failure stress, whose strength is that along them
    shear_strength: Annotated[Positive | None, Declared("Pa")] = None  # shear strength along the fibres; likewise


class Expansion(msgspec.Struct, frozen=True, tag_field="physics", tag="thermoelastic"):
    """A solid that heat or a solvent swells."""

    alpha: Annotated[float | None, Declared("1/K", "alpha", needed="a number")] = None  # strain of a free body per K
    # above T0, or per mol/m^3 of a substance; required with physics thermoelastic
    T0: Annotated[float | None, Declared("K", "T0", needed="a number")] = (
        None  # temperature without thermal strain, and
    )
    # the default at time 0; required with physics thermoelastic


CHOSEN = (
    *(Diffraction, BondLaw, Bilinear, Cohesive, Family, Correspondence, StressFailure, Silling, Plastic, Orthotropic),
    Expansion,
)

if TYPE_CHECKING:

    class _Flat(
        Expansion, Orthotropic, Plastic, Silling, StressFailure, Correspondence, Family, Cohesive, Bilinear, BondLaw,
        Diffraction, Elastic, frozen=True
    ):  # fmt: skip
        """All of them in one table."""

else:  # a struct with several bases is none
    _Flat = msgspec.defstruct(
        "_Flat",
        [
            (field.name, field.type) if field.required else (field.name, field.type, field.default)
            for struct in (Elastic, *CHOSEN)
            for field in msgspec.structs.fields(struct)
        ],
        frozen=True,
    )


class Material(_Flat, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Material of the plate or of a region: `Elastic`, and what it chooses of the structs in `CHOSEN`."""

    def __post_init__(self) -> None:
        PlainStruct.__post_init__(self)  # type: ignore[arg-type]
        if self.law == USUAL_LAW:  # the very word: defaults are left out of files by identity
            msgspec.structs.force_setattr(self, "law", USUAL_LAW)

    @property
    def detour(self) -> float | None:
        """Exponent of the distance round a crack's tips; None if bonds across a crack are cut."""
        return self.gamma if self.sight == "diffraction" else None


DECLARED: dict[str, Declared] = {
    name: next((part for part in get_args(hint) if isinstance(part, Declared)), Declared())
    for struct in (Elastic, *CHOSEN)
    for name, hint in get_type_hints(struct, include_extras=True).items()
    if name in struct.__struct_fields__
}


def switch_of(struct: type[msgspec.Struct]) -> tuple[str, str] | None:
    """The word of a material that chooses a struct, and its value; None if its kind of material alone does."""
    config = struct.__struct_config__
    return None if config.tag_field in (None, "model") else (str(config.tag_field), str(config.tag))


def missing(material: Material, struct: type[msgspec.Struct]) -> Iterator[tuple[str, str]]:
    """Parameters of a struct that must be given and are not, and what is expected."""
    for name in struct.__struct_fields__:
        if DECLARED[name].needed and getattr(material, name) is None:
            yield name, DECLARED[name].needed
