"""The node grid's JSON file: what it may say, read and written.

The file is the thesis's (A. De Checchi, Padua 2013, "Pre-processore"): ``notch``, a list of crack segments
``[x0, y0, z0, x1, y1, z1]``, and ``nodes``, each with ``id``, ``border`` (the *string* "true" or "false"),
``position``, ``hole_id`` (-1 where none) and ``delta``. Everything else is optional; the keys are those of
`Document` and `Settings` below, and ``version`` says which edition of them a file was written for.
SI units throughout; the model is plane, per unit thickness.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, get_args

import msgspec

from pdmesh.files import read_bytes, write_atomically
from pdmesh.model.fields import USUAL, Column

FORMAT_VERSION = 1

LARGEST = 1e9  # m
MOST = 1e30  # of any number; products of more than that leave what a number can hold
MOST_LEVELS = 6  # how often a cell can be split
USUAL_LAW = "brittle"

Positive = Annotated[float, msgspec.Meta(gt=0)]
# hybrid: peridynamics where bonds may break, a compact lattice elsewhere; split: cells split where energy is
Adapt = Literal["none", "hybrid", "split"]
ADAPTS: tuple[str, ...] = get_args(Adapt)
Id = Annotated[int, msgspec.Meta(ge=-(2**62), le=2**62)]
MOST_STEPS = 2**31 - 1  # what a broken bond can remember
Share = Annotated[float, msgspec.Meta(gt=0, le=1)]
PositiveInt = Annotated[int, msgspec.Meta(gt=0, le=MOST_STEPS)]
Point = tuple[float, float]
Box = tuple[float, float, float, float]


class GridError(ValueError):
    """A grid file that cannot be used; the message names file, place, what was found and expected."""


class Material(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """What the plate, or a region of it, is made of."""

    E: Positive  # Young's modulus, Pa
    rho: Positive  # density, kg/m^3
    G0: Positive  # fracture energy, J/m^2
    nu: Annotated[float, msgspec.Meta(gt=-1, lt=1)] | None = None  # of bonds as published: they have 1/3 or 1/4
    model: Literal["bond", "ordinary", "correspondence", "micropolar"] = "bond"
    law: str = USUAL_LAW  # of bonds: one of those that the solver knows
    kr: Annotated[float, msgspec.Meta(ge=1)] = 1.0  # bilinear: stretch at which a bond breaks over that of its peak
    keep_G0: bool = True  # bilinear: spend G0 on a crack; False: G0 / kr, as in the thesis
    micromodulus: Literal["conical", "constant"] = "conical"
    plane: Literal["stress", "strain"] = "stress"
    influence: Literal["cubic spline", "constant", "inverse"] | None = None  # of neighbours; None: the model's own
    failure: Literal["stretch", "energy", "stress", "none"] = "stretch"  # of models that are not bond: what breaks
    strength: Positive | None = None  # correspondence: largest principal stress of a bond that fails by it, Pa
    solid: Literal["linear", "svk", "neo hooke", "j2"] = "linear"  # correspondence: what stress follows strain
    form: Literal["total", "rate"] = "total"  # correspondence: from the start, or from step to step
    control: Literal["silling", "none", "wan", "breitzman-dayal"] = "silling"  # correspondence: of modes without energy
    control_factor: Annotated[float, msgspec.Meta(ge=0)] = 0.5  # silling
    order: Annotated[int, msgspec.Meta(ge=1, le=7)] = 1  # correspondence: of the polynomials gradients are fitted by
    constant_term: bool = False  # correspondence: the fit does not have to pass through its own node
    yield_stress: Positive | None = None  # j2, Pa
    hardening: float = 0.0  # j2: stress per plastic strain, Pa

    def __post_init__(self) -> None:
        if self.law == USUAL_LAW:  # the very word: defaults are left out of files by identity
            msgspec.structs.force_setattr(self, "law", USUAL_LAW)


class Horizon(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How far a node sees."""

    ratio: Annotated[float, msgspec.Meta(ge=1, le=64)] = 3.0  # m = horizon / delta of the node


class Selection(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True, kw_only=True):
    """Some of a grid's nodes: those listed by id, or those inside a box."""

    name: str = ""
    nodes: tuple[Id, ...] | None = None
    box: Box | None = None  # x0, y0, x1, y1, m


class Region(Selection, frozen=True, kw_only=True):
    """Nodes of another material than the rest; of several regions with a node, the last one has it."""

    material: Material


class Condition(Selection, frozen=True, kw_only=True):
    """Something done to nodes. Its values are multiplied by a factor that follows time.

    `profile` holds points (time in s, factor): linear between them, constant before the first and after the
    last; none at all means 1 for ever. The bonds of these nodes do not break unless `breakable`.
    """

    profile: tuple[Point, ...] = ()
    breakable: bool = False


class Load(Condition, frozen=True, kw_only=True, tag="load", tag_field="kind"):
    """A body force: ``body_force`` (N/m^3), or ``traction`` (Pa) over ``rows`` rows of nodes.

    A traction is traction / (rows delta) at each node; ``length`` (m) of the loaded edge, where known, lets a
    solver make the total exact.
    """

    body_force: Point | None = None
    traction: Point | None = None
    rows: PositiveInt = 1
    length: Positive | None = None


class Displacement(Condition, frozen=True, kw_only=True, tag="displacement", tag_field="kind"):
    """Displacements that are held, m; a component left out is free."""

    x: float | None = None
    y: float | None = None


class Velocity(Condition, frozen=True, kw_only=True, tag="velocity", tag_field="kind"):
    """Velocities that are held throughout, m/s; a component left out is free."""

    x: float | None = None
    y: float | None = None


class Acceleration(Condition, frozen=True, kw_only=True, tag="acceleration", tag_field="kind"):
    """Accelerations that are held throughout, m/s^2; a component left out is free."""

    x: float | None = None
    y: float | None = None


class InitialVelocity(Selection, frozen=True, kw_only=True, tag="initial velocity", tag_field="kind"):
    """Velocities at time 0, m/s; from then on the nodes are free."""

    x: float = 0.0
    y: float = 0.0


class Absorb(Selection, frozen=True, kw_only=True, tag="absorb", tag_field="kind"):
    """A layer along an edge in which waves die out: the more, the farther a node is from those that are not in it."""

    depth: Positive | None = None  # m; None: as far as one of its nodes is from all that are not in it


AnyCondition = Load | Displacement | Velocity | Acceleration | InitialVelocity | Absorb


Tolerance = Annotated[float, msgspec.Meta(ge=1e-14, le=0.1)]  # less is round-off, more is no rest


class Static(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """How a plate is brought to rest."""

    method: Literal["newton", "relaxation"] = "newton"
    load_steps: PositiveInt | None = None  # from time 0 to the end of the profiles; None: 10, 1 if nothing varies
    tolerance: Tolerance = 1e-8  # what is left of the forces over those from outside
    iterations: PositiveInt | None = None  # in one go, then it is given up; None: as the method has it
    floating: bool = False  # bodies that nothing supports are held softly, not refused


class Split(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Which cells are split into four, and which four merge, where `Run.adapt` is split."""

    by: Literal["energy", "stretch"] = "energy"  # of nodes, over the plate's largest; of bonds, over the critical one
    threshold: Share = 0.3  # of that: what is above is split, with all within its horizon
    floor: Annotated[float, msgspec.Meta(ge=0)] = 0.1  # of the energy density at the critical stretch: none below it
    ceiling: Positive = 1.0  # of the same: what is more counts as that much, so that what is crushed hides no tip
    merge: Annotated[float, msgspec.Meta(ge=0, lt=1)] = 0.1  # as the threshold: what stays below merges; 0: nothing
    hold: PositiveInt = 10  # looks that it must stay below
    every: PositiveInt = 10  # steps between two looks
    levels: Annotated[int, msgspec.Meta(ge=1, le=MOST_LEVELS)] = 1  # how often a cell of the grid can be split


class Run(msgspec.Struct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """How long the solver goes on and how often it writes."""

    time_step: Positive | None = None  # s; None: from the stability bound
    steps: Annotated[int, msgspec.Meta(ge=0, le=MOST_STEPS)] = 1000
    every: PositiveInt = 50  # steps between two frames
    ledger: PositiveInt | None = None  # steps between two entries of the ledger and the probes; None: as frames
    fields: tuple[Column, ...] = USUAL  # what a frame holds; with all of these also what the model has of its own
    probes: tuple[Point, ...] = ()  # places whose nearest node is written down with the ledger, m
    adapt: Adapt = "none"
    split: Split = Split()  # where adapt is that
    until: Literal["split", "quiet"] | None = None  # stop early: the plate is in two, or breaks no more
    quiet: Positive | None = None  # s without a broken bond, after the first, that count as quiet
    solver: Literal["explicit", "static"] = "explicit"  # static: a load step is a step and a frame
    start: Literal["unloaded", "static"] = "unloaded"  # static: at rest under what acts at time 0
    damping: Annotated[float, msgspec.Meta(ge=0)] = 0.0  # 1/s: force against motion over mass and velocity
    static: Static = Static()


class Settings(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the thesis kept outside its file; also the shape of a settings TOML and of ``--set``."""

    material: Material | None = None
    horizon: Horizon = Horizon()
    regions: tuple[Region, ...] = ()
    conditions: tuple[AnyCondition, ...] = ()
    area_rule: Literal["cells", "eq19", "square"] | None = None  # None: as the solver's mode has it
    run: Run = Run()


class NodeRecord(msgspec.Struct, frozen=True, gc=False, forbid_unknown_fields=True):
    """One node exactly as the thesis writes it."""

    id: Id
    border: Literal["true", "false"]
    position: tuple[float, float, float]  # m
    hole_id: Id
    delta: tuple[float, float, float]  # m


class Lattice(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """All nodes of a rectangle, which a file holds in place of millions of them.

    Their ids count from 1, row by row from the lower left corner; those at its sides have half a cell, those at its
    corners a quarter.
    """

    origin: Point  # of the first node, m
    spacing: Positive  # m
    columns: Annotated[int, msgspec.Meta(ge=2, le=10**6)]
    rows: Annotated[int, msgspec.Meta(ge=2, le=10**6)]


class Document(Settings, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A whole file: the thesis's two keys, then the optional ones."""

    notch: tuple[tuple[float, float, float, float, float, float], ...]
    nodes: tuple[NodeRecord, ...]
    version: int = FORMAT_VERSION
    outline: tuple[tuple[Point, ...], ...] = ()  # exterior rings of the plate, m
    holes: tuple[tuple[Point, ...], ...] = ()  # rings; hole_id counts them from 0
    areas: tuple[Positive, ...] | None = None  # of the nodes' cells, in their order, m^2
    lattice: Lattice | None = None  # all nodes, in place of a list of them
    source: str = ""  # the drawing the grid was built from
    drawing: str = ""  # its text, so that the grid can be built again
    parameters: dict[str, float | str] = {}  # of that drawing, as used


def read_document(data: bytes | str, name: str) -> Document:
    """Parse and check the text of a file called `name` in messages. Raises GridError."""
    try:
        document = msgspec.json.decode(data, type=Document)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise GridError(f"{name}: {error}") from None
    if document.version != FORMAT_VERSION:
        raise GridError(f"{name}: $.version: found {document.version}, expected {FORMAT_VERSION}")
    return document


def read_file(path: Path) -> Document:
    """Read the document in the file at `path`. Raises GridError."""
    try:
        data = read_bytes(path)
    except OSError as error:
        raise GridError(f"{path}: cannot be read: {error.strerror}") from None
    return read_document(data, str(path))


def encode(document: Document) -> bytes:
    """The document as JSON, a line for each node and for each other key."""
    fields: dict[str, Any] = {"version": document.version, "notch": document.notch}
    fields |= {name: getattr(document, name) for name in document.__struct_fields__ if name != "nodes"}
    nodes = b"  " + msgspec.json.encode(document.nodes)[1:-1].replace(b"},{", b"},\n  {")  # no node has braces inside
    lines = [b"%s: %s" % (msgspec.json.encode(name), msgspec.json.encode(value)) for name, value in fields.items()]
    return b"{\n" + b",\n".join([*lines, b'"nodes": [\n' + nodes + b"\n]"]) + b"\n}\n"


def write_file(document: Document, path: Path) -> None:
    """Write the document in one atomic step: the file at `path` is complete or untouched."""
    write_atomically(path, encode(document))


def schema() -> dict[str, Any]:
    """The JSON Schema of the file."""
    found: dict[str, Any] = msgspec.json.schema(Document)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "Peridynamic node grid"} | found


def settings_of(document: Document) -> Settings:
    """What a document says besides its nodes and shapes."""
    return Settings(**{field: getattr(document, field) for field in Settings.__struct_fields__})
