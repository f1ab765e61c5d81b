"""The node grid's JSON file: what it may say, read and written.

The file is the thesis's (A. De Checchi, Padua 2013, "Pre-processore"): ``notch``, a list of crack segments
``[x0, y0, z0, x1, y1, z1]``, and ``nodes``, each with ``id``, ``border`` (the *string* "true" or "false"),
``position``, ``hole_id`` (-1 where none) and ``delta``. Everything else is optional; the keys are those of
`Document` and `Settings` below, and ``version`` says which edition of them a file was written for.
SI units throughout. The last key, `digest`, is the SHA-256 of all bytes before its own line, and shows whether the file
is still as a program wrote it; it detects accidents, not intent, as the key can be removed.

Version 1 is a plate, a plane model per unit thickness. Version 2 is a body in space, of the same keys: z and delta z
are real, vectors and boxes have their z too, `notch` holds triangles ``[x0, y0, z0, ..., z2]``, `outline` the triangles
of the body's surface, and `areas` the volumes of the cells.
"""

from __future__ import annotations

import hashlib
import math
import warnings
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, get_args

import msgspec

from pdmesh.background_thread import BackgroundThread
from pdmesh.files import read_bytes, write_atomically
from pdmesh.model.base_structs import MOST_STEPS as MOST_STEPS
from pdmesh.model.base_structs import Amount, PlainStruct, Share
from pdmesh.model.base_structs import Box as Box
from pdmesh.model.base_structs import Id as Id
from pdmesh.model.base_structs import Point as Point
from pdmesh.model.base_structs import Positive as Positive
from pdmesh.model.base_structs import PositiveInt as PositiveInt
from pdmesh.model.base_structs import Selection as Selection
from pdmesh.model.base_structs import Timed as Timed
from pdmesh.model.base_structs import Vector as Vector
from pdmesh.model.grid_file_nodes import BEGIN, NodeColumns, NodeRecord, columns_of, repeated_key, taken_out, written
from pdmesh.model.grid_file_nodes import END as END_OF_NODES
from pdmesh.model.interfaces import Interface
from pdmesh.model.material import Material as Material
from pdmesh.model.mechanical_conditions import Absorb as Absorb
from pdmesh.model.mechanical_conditions import Acceleration as Acceleration
from pdmesh.model.mechanical_conditions import BodyNodes as BodyNodes
from pdmesh.model.mechanical_conditions import Condition as Condition
from pdmesh.model.mechanical_conditions import Contact as Contact
from pdmesh.model.mechanical_conditions import Displacement as Displacement
from pdmesh.model.mechanical_conditions import InitialDisplacement as InitialDisplacement
from pdmesh.model.mechanical_conditions import InitialVelocity as InitialVelocity
from pdmesh.model.mechanical_conditions import Load as Load
from pdmesh.model.mechanical_conditions import Pin as Pin
from pdmesh.model.mechanical_conditions import RigidBody as RigidBody
from pdmesh.model.mechanical_conditions import Spring as Spring
from pdmesh.model.mechanical_conditions import Velocity as Velocity
from pdmesh.model.medium import Concentration as Concentration
from pdmesh.model.medium import Exchange as Exchange
from pdmesh.model.medium import InitialConcentration as InitialConcentration
from pdmesh.model.medium import Medium as Medium
from pdmesh.model.medium import MediumRegion as MediumRegion
from pdmesh.model.medium import OfDiffusion as OfDiffusion
from pdmesh.model.medium import Solid as Solid
from pdmesh.model.medium import Source as Source
from pdmesh.model.node_fields import NodeField
from pdmesh.model.output_fields import USUAL, Column
from pdmesh.model.suggestions import explained
from pdmesh.model.values_of_place import PlaceError

CRACK, ARC = "crack", "arc"  # controls: the length of cracks of particles; that of the path of an elastic body
Exponent = Annotated[float, msgspec.Meta(ge=1, le=100)]
MOST_CYCLES = 1e15
FORMAT_VERSION, SPACE_VERSION = 1, 2  # of plates; of bodies in space
LARGEST = 1e9  # m
MOST = 1e30  # of any number; products of more than that leave what a number can hold
SLACK = 1e-9  # of a step: round-off
MOST_LEVELS = 6  # how often a cell can be split
START, END = b',\n"digest": "', b'"\n}\n'  # around the hexadecimal digits
LARGE = 4_000_000  # bytes of a file whose digest is computed beside its reading
KEY = b'"digest"'  # in a file that another program has written anew
# hybrid: peridynamics where bonds may break, a compact lattice elsewhere; auto: hybrid or none, as costs less;
# collocation: stencils of the same horizon there; split: cells split where energy is
Adapt = Literal["none", "auto", "hybrid", "split", "collocation"]
ON_ONE_LATTICE = ("auto", "hybrid", "collocation")  # ways to be solved for which the finest nodes are laid everywhere
ADAPTS: tuple[str, ...] = get_args(Adapt)
Crack = Annotated[tuple[float, ...], msgspec.Meta(min_length=6, max_length=9)]  # corners of a segment or a triangle, m


class Gap(PlainStruct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """A monitored opening: how much longer the distance between the nodes nearest to two places has become."""

    name: str
    ends: tuple[Vector, Vector]  # m


class LoadCell(PlainStruct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """The sum of the forces of some conditions."""

    name: str
    of: tuple[str, ...]  # names of conditions


class Fatigue(PlainStruct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """How bonds tire, and the cycle of the loads.

    After S. A. Silling and A. Askari, SAND2014-18590 (2014).

    Every bond begins with a remaining life of 1, and breaks when none is left. A cycle of N takes of it

        growth:      A eps^m      next to damage
        initiation:  A1 eps^m1    elsewhere

    where eps is the range of the bond's stretch within a cycle; up to `threshold` and `endurance`, nothing. The first
    is Paris's line da/dN = C dK^m with the same exponent, whose C is proportional to A; the second is the line of
    Wöhler's diagram, with the life 1 / (A1 eps^m1).

    Cracks of particles grow by that line itself: C and m are given, and K is that of the tip.
    """

    A: Positive | None = None  # life that a bond next to damage loses in a cycle is A eps^m, with the range eps of its
    # stretch; none: A1 eps^m1 everywhere
    m: Exponent | None = None  # exponent of the range in A eps^m, and of dK in C dK^m
    C: Positive | None = (
        None  # m/cycle: growth of crack particles per cycle at dK = 1 Pa m^0.5; the C of da/dN = C dK^m
    )
    threshold_K: Annotated[float, msgspec.Meta(ge=0)] = 0.0  # Pa m^0.5: range of K up to which crack particles do not
    # grow
    A1: Positive | None = None  # life that a bond not next to damage loses in a cycle is A1 eps^m1; none: such a bond
    # loses none
    m1: Exponent | None = None  # exponent of the range in A1 eps^m1
    endurance: Amount = 0.0  # range of stretch up to which a bond not next to damage loses no life
    threshold: Amount = 0.0  # range of stretch up to which a bond next to damage loses no life
    damaged: Share = 0.25  # damage of a node from which the bonds within a horizon of it are next to damage
    ratio: Annotated[float, msgspec.Meta(ge=-1, lt=1)] = 0.0  # load ratio R: smallest loads of a cycle divided by the
    # largest
    cycles: Annotated[float, msgspec.Meta(gt=0, le=MOST_CYCLES)] = MOST_CYCLES  # number of cycles at which the run ends
    blocks: tuple[tuple[Positive, Share], ...] = ()  # load blocks: pairs of a number of cycles and a factor on the
    # loads, applied one after the other and repeated


class Cycled(NamedTuple):
    """What one step of jumps came to; checkpoints hold a row for each."""

    step: int
    iterations: int  # in all
    residual: float  # what is left of the forces over those from outside
    cycles: float  # since the start
    broken: int  # directed bonds since the start


class GridError(ValueError):
    """A grid file that cannot be used; the message names file, place, what was found and expected."""


class GridWarning(UserWarning):
    """A grid file that can be used but may not be what was built; one line."""


class Horizon(PlainStruct, frozen=True, forbid_unknown_fields=True):
    """Radius of a node's interactions over its spacing."""

    ratio: Annotated[float, msgspec.Meta(ge=1, le=64)] = 3.0  # horizon of a node divided by its spacing


class Region(Selection, frozen=True, kw_only=True):
    """Nodes with another material; of several regions with a node, the last one counts."""

    material: Material


OfMechanics = (
    Load
    | Displacement
    | Velocity
    | Acceleration
    | InitialVelocity
    | InitialDisplacement
    | Absorb
    | RigidBody
    | Spring
    | Pin
)


AnyCondition = OfMechanics | OfDiffusion


Tolerance = Annotated[float, msgspec.Meta(ge=1e-14, le=0.1)]  # less is round-off, more is no rest


class Static(PlainStruct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Settings of a static solution."""

    method: Literal["newton", "relaxation"] = "newton"  # method that finds equilibria: Newton's method, or adaptive
    # dynamic relaxation
    load_steps: PositiveInt | None = None  # number of load steps; in path following it sets the step size; none: 10, 1
    # without profiles, 80 in path following, extent of the body over the particle spacing with control crack
    tolerance: Tolerance = 1e-8  # largest permitted ratio of the norm of the residual forces to that of the external
    # forces (loads and reactions)
    iterations: PositiveInt | None = None  # largest number of iterations for one equilibrium; none: 15 (25 for plastic
    # flow) of Newton's method, 100 000 of relaxation
    floating: bool = False  # true: solve a body without supports, whose loads must balance
    control: str | None = None  # control parameter of path following: the name of a gap, crack or arc; none: the energy
    # that softening bonds dissipate
    opening: Positive | None = None  # m: final opening of the gap that control names


class ParticleRules(PlainStruct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Rules for the growth of cracks of particles."""

    criterion: Literal["intensity", "stress"] = "intensity"  # a tip grows if its stress intensity factor reaches
    # toughness (intensity), or the stress ahead of it reaches strength (stress)
    direction: Literal["hoop", "principal"] = "hoop"  # direction of growth: that of the largest hoop stress, or
    # perpendicular to the largest principal mean stress (criterion stress only)
    spacing: Annotated[float, msgspec.Meta(ge=1, le=64)] = 1.0  # distance of two crack particles divided by the spacing
    # of the nodes
    toughness: Positive | None = None  # Pa m^0.5: critical stress intensity factor of criterion intensity; none:
    # sqrt(E' G0)
    strength: Positive | None = None  # Pa: critical stress of criterion stress
    branch: Share = 0.95  # with criterion stress: smallest ratio of the second maximum of the hoop stress to the first
    # at which a crack branches
    most: PositiveInt | None = None  # largest number of crack particles that a run adds; none: no limit


class Split(PlainStruct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Which cells split into four and which four merge, if `Run.adapt` is split."""

    by: Literal["energy", "stretch"] = "energy"  # criterion of a node: its energy density divided by the reference
    # density (see ceiling), or its largest bond stretch divided by the critical stretch
    threshold: Share = 0.3  # criterion above which a node is flagged; all cells within the horizon of a flagged node
    # split
    floor: Annotated[float, msgspec.Meta(ge=0)] = 0.1  # with by energy: energy density below which no node is flagged,
    # divided by that at the critical stretch
    ceiling: Positive = 1.0  # with by energy: upper limit of the reference density, the largest energy density of the
    # plate, divided by that at the critical stretch
    merge: Annotated[float, msgspec.Meta(ge=0, lt=1)] = 0.1  # criterion below which cells merge again; 0: never
    hold: PositiveInt = 10  # number of checks for which the criterion must stay below merge before cells merge
    every: PositiveInt = 10  # number of time steps between two checks
    levels: Annotated[int, msgspec.Meta(ge=1, le=MOST_LEVELS)] = 1  # number of successive splits of one cell of the
    # grid; each split halves the spacing


class Hybrid(PlainStruct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Settings of a run with `adapt` = hybrid."""

    REMOVED: ClassVar = {"wake": "1.0.0"}  # settings, and the last version that had each; see `suggestions.explained`

    kappa: Annotated[float, msgspec.Meta(gt=0, lt=1)] = 0.7  # stretch of a spring divided by the critical stretch (of
    # bilinear bonds: by the stretch at which they soften) from which cells around the spring become fine


class Collocation(PlainStruct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Settings of a run with `adapt` = collocation."""

    kappa: Annotated[float, msgspec.Meta(gt=0, lt=1)] = 0.95  # stretch between two neighbouring coarse nodes divided by
    # the critical stretch, from which nodes around them become fine
    margin: Annotated[float, msgspec.Meta(ge=0)] = 0.5  # nodes are fine within 1 + margin horizons of edges and notches
    damping: Annotated[float, msgspec.Meta(ge=0)] | None = None  # damping coefficient of nodes within a horizon of the
    # seam, divided by sqrt(E / rho) / spacing; none: 0.05 with fewer than 6 spacings in a horizon, 0.02 with fewer than
    # 16, else 0
    damped: bool = False  # true: permit models with fewer than 12 spacings in a horizon, whose damping removes energy


LEAST_FRAMES, MOST_BETWEEN_FRAMES = 40, 50  # of runs whose model says neither
INTERVALS = MOST_BETWEEN_FRAMES, 40, 20, 10, 5  # steps: a frame of a small plate takes as long as ten steps
DeviceName = Annotated[str, msgspec.Meta(pattern=r"^(cpu|opencl(:\d{1,3})?)$")]


class Run(PlainStruct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """Duration, solver and output of a run."""

    time_step: Positive | None = None  # s: time step; none: the stable time step
    steps: Annotated[int, msgspec.Meta(ge=0, le=MOST_STEPS)] = 1000  # number of time steps, unless duration is given
    every: PositiveInt | None = (
        None  # number of steps between two frames; none: 5 to 50, for 40 frames from 200 steps on
    )
    ledger: PositiveInt | None = None  # number of steps between two records of the energy balance, reactions and
    # probes; none: that of frames
    fields: tuple[Column, ...] = USUAL  # fields that a frame stores; the default list stores the further fields of the
    # material model too
    probes: tuple[Vector, ...] = ()  # m: points; the motion of the node nearest to each is recorded with the energy
    # balance
    gaps: tuple[Gap, ...] = ()  # monitored openings: the name of each, and its ends, two points in m, which are probes
    # too
    load_cells: tuple[LoadCell, ...] = ()  # monitored sums of forces: the name of each, and the names of the conditions
    # that it sums
    adapt: Adapt = "none"  # method that makes nodes fine only near cracks; auto: hybrid or none, by estimated time
    split: Split = Split()  # where adapt is that
    cracks: Literal["bonds", "particles"] = "bonds"  # cracks are broken bonds, or crack particles that grow from tips
    # and cut bonds
    particles: ParticleRules = ParticleRules()
    until: Literal["split", "quiet"] | None = None  # early end of the run: when the body is in two pieces (split), or
    # when no bond breaks any more (quiet)
    quiet: Positive | None = None  # s: time after the last broken bond at which a run with until quiet ends
    solver: Literal["explicit", "static", "implicit"] = "explicit"  # explicit: time steps; static: quasi-static load
    # steps; implicit: time steps of diffusion, of any length
    theta: Annotated[float, msgspec.Meta(ge=0.5, le=1)] = 1.0  # weight of the end of a step in implicit steps of
    # diffusion and heat conduction
    start: Literal["unloaded", "static"] = "unloaded"  # state at time 0: unloaded, or in equilibrium with the
    # conditions of time 0 (static)
    damping: Annotated[float, msgspec.Meta(ge=0)] = 0.0  # 1/s: mass-proportional damping: force against the motion,
    # divided by mass and velocity
    damping_time: Annotated[float, msgspec.Meta(ge=0)] = 0.0  # s: stiffness-proportional damping: force against the
    # motion, divided by stiffness and velocity
    static: Static = Static()
    after: Literal["path", "stop", "motion"] = "path"  # what follows the largest dead loads of an equilibrium path:
    # smaller loads (path), the end (stop), or a dynamic run (motion)
    fatigue: Fatigue | None = None  # static: loads repeat and bonds tire; a step is some jumps of cycles
    collocation: Collocation = Collocation()
    hybrid: Hybrid = Hybrid()
    duration: Positive | None = None  # s: duration of the run in place of its number of steps; with solver static: of
    # the dynamic run of after
    device: DeviceName = "cpu"  # what sums the bonds: the processor (cpu), the first OpenCL device, or the OpenCL
    # device of this number

    @property
    def frame_interval(self) -> int:
        """Number of steps between two frames; of files that do not say it, that of the runs they are of."""
        return self.every or MOST_BETWEEN_FRAMES


def in_steps(run: Run, step: float) -> Run:
    """The run with its duration expressed in steps of `step` s, and with the number of steps between two frames; a run
    at rest is returned unchanged.

    Raises GridError for too many steps.
    """
    if run.solver == "static":
        return run
    if run.duration is None:
        return _with_frame_interval(run)
    steps = max(1.0, run.duration / step - SLACK)
    if steps > MOST_STEPS:
        raise GridError(
            f"$.run.duration: {run.duration:g} s in steps of {step:.3g} s are too many steps; use at most"
            f" {MOST_STEPS:g}"
        )
    return _with_frame_interval(msgspec.structs.replace(run, steps=math.ceil(steps), duration=None))


def _with_frame_interval(run: Run) -> Run:
    if run.every is not None:
        return run
    fitting = (interval for interval in INTERVALS if interval * LEAST_FRAMES <= run.steps)
    return msgspec.structs.replace(run, every=next(fitting, INTERVALS[-1]))


class Settings(PlainStruct, frozen=True, forbid_unknown_fields=True):
    """Settings that the thesis kept outside its file; also the layout of a settings TOML and of ``--set``."""

    material: Material | None = None
    horizon: Horizon = Horizon()
    regions: tuple[Region, ...] = ()
    interfaces: tuple[Interface, ...] = ()
    physics: Literal["mechanics", "diffusion", "thermoelastic"] = "mechanics"  # motion or equilibrium (mechanics),
    # diffusion alone, or both with swelling (thermoelastic)
    medium: Medium | None = None  # of diffusion; of heat, whose D is the thermal diffusivity and whose content is T, K
    media: tuple[MediumRegion, ...] = ()
    conditions: tuple[AnyCondition, ...] = ()
    area_rule: Literal["cells", "eq19", "square"] | None = None  # areas of nodes: exact cells, equation 19 of the
    # thesis, or squared spacings; none: those of the scheme (--mode)
    contact: Contact | None = None  # between bodies, and the faces of cracks; None: they pass through each other
    run: Run = Run()


Many = Annotated[int, msgspec.Meta(ge=2, le=10**6)]


class Lattice(PlainStruct, frozen=True, forbid_unknown_fields=True, omit_defaults=True):
    """All nodes of a rectangle, or of a box in space, which a file holds in place of millions of them.

    Ids count from 1, row by row from the lower left corner, in space layer by layer from the lowest. In a rectangle
    nodes at the sides have half a cell, those at the corners a quarter. In a box nodes are the middles of full cells.
    """

    origin: Vector  # of the first node, m
    spacing: Positive  # m
    columns: Many
    rows: Many
    layers: Many | None = None  # of a box

    @property
    def counts(self) -> tuple[int, ...]:
        """Number of nodes along x, y and, in space, z."""
        return (self.columns, self.rows) if self.layers is None else (self.columns, self.rows, self.layers)


class Document(Settings, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A whole file: the thesis's two keys, then the optional ones."""

    notch: tuple[Crack, ...]
    nodes: NodeColumns
    version: int = FORMAT_VERSION
    outline: tuple[tuple[Vector, ...], ...] = ()  # exterior rings of the plate, or triangles of a body's surface, m
    holes: tuple[tuple[Point, ...], ...] = ()  # rings; hole_id counts them from 0
    areas: tuple[Positive, ...] | None = None  # of the nodes' cells, in their order, m^2; in space volumes, m^3
    fields: tuple[NodeField, ...] = ()  # constants of the material by node
    lattice: Lattice | None = None  # all nodes, in place of a list of them
    bodies: tuple[BodyNodes, ...] = ()  # of which no bonds join two; nodes of none are the first body
    source: str = ""  # the drawing the grid was built from
    drawing: str = ""  # its text, so that the grid can be built again
    parameters: dict[str, float | str] = msgspec.field(default_factory=dict)  # of that drawing, as used
    digest: str = ""  # of the text before it; only files hold it

    @property
    def dimension(self) -> int:
        """2 for a plate, 3 for a body in space."""
        return 3 if self.version == SPACE_VERSION else 2


class GridFile(Document, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A document as its text has it."""

    nodes: tuple[NodeRecord, ...]  # type: ignore[assignment]


def read_document(data: bytes | str, name: str) -> Document:
    """Parse and check the text of a file called `name` in messages. Raises GridError."""
    if not data or data.isspace():
        raise GridError(f"{name} is empty; use a grid file")
    try:
        text = data.encode() if isinstance(data, str) else data
        text_and_nodes = taken_out(text)
        file = msgspec.json.decode(text if text_and_nodes is None else text_and_nodes[0], type=GridFile)
    except (msgspec.DecodeError, UnicodeError, RecursionError) as error:
        raise GridError(f"{name}: {explained(error, GridFile, lambda: msgspec.json.decode(data))}") from None
    if (repeated := repeated_key(text)) is not None:
        raise GridError(f"{name}: {repeated} is there twice, and readers would take the last in silence; keep one")
    if file.version not in (FORMAT_VERSION, SPACE_VERSION):
        raise GridError(
            f"{name}: $.version is {file.version}; use {FORMAT_VERSION}, or {SPACE_VERSION} for a body in space"
        )
    parts = {field: getattr(file, field) for field in file.__struct_fields__}
    return Document(
        **parts | {"digest": "", "nodes": columns_of(file.nodes) if text_and_nodes is None else text_and_nodes[1]}
    )


def read_file(path: Path) -> Document:
    """Read the document in the file at `path`, with the tables of files beside it.

    Raises GridError; warns with GridWarning if it was edited.
    """
    try:
        data = read_bytes(path)
    except OSError as error:
        raise GridError(f"{path}: cannot be read: {error.strerror}") from None
    if len(data) < LARGE:
        document = read_document(data, str(path))
        _compare(str(path), _matches(data))
    else:
        matches: list[bool] = []
        digest = BackgroundThread("digest")  # which leaves Python to what reads
        try:
            digest.begin(lambda: matches.append(_matches(data)))
            document = read_document(data, str(path))
            digest.wait()
        finally:
            digest.end()
        _compare(str(path), all(matches))
    conditions = tables_beside(document.conditions, path, document.dimension)
    return msgspec.structs.replace(document, conditions=conditions)


def tables_beside(conditions: tuple[AnyCondition, ...], path: Path, dimension: int) -> tuple[AnyCondition, ...]:
    """The conditions of the file at `path` with the tables of files beside it. Raises GridError."""
    from pdmesh.model.values_at_places import with_tables  # here, as it needs numpy, which takes --help too long

    try:
        return with_tables(conditions, path.parent, dimension, "$.conditions")
    except PlaceError as error:
        raise GridError(f"{path}: {error}") from None


def encode(document: Document) -> bytes:
    """The document as JSON, a line for each node and for each other key, its digest last."""
    fields: dict[str, Any] = {"version": document.version, "notch": document.notch}
    usual: dict[str, Any] = {"physics": "mechanics", "medium": None, "contact": None}  # is left out
    usual |= dict.fromkeys(("media", "bodies", "fields", "interfaces"), ())
    values = {name: getattr(document, name) for name in document.__struct_fields__ if name not in ("nodes", "digest")}
    fields |= {name: value for name, value in values.items() if name not in usual or value != usual[name]}
    lines = [b"%s: %s" % (msgspec.json.encode(name), msgspec.json.encode(value)) for name, value in fields.items()]
    head = b"{\n" + b",\n".join([*lines, BEGIN])
    return sealed(head, *written(document.nodes), END_OF_NODES)


def write_file(document: Document, path: Path) -> None:
    """Write the document in one atomic step: the file at `path` is complete or untouched."""
    write_atomically(path, encode(document))


def schema() -> dict[str, Any]:
    """The JSON Schema of the file."""
    json_schema: dict[str, Any] = msgspec.json.schema(GridFile)
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "Peridynamic node grid"} | json_schema


def settings_of(document: Document) -> Settings:
    """The settings of a document: everything except its nodes and shapes."""
    return Settings(**{field: getattr(document, field) for field in Settings.__struct_fields__})


def sealed(*head: bytes) -> bytes:
    """A whole file: `head`, the text of an object up to its last value in parts, and the digest."""
    return b"".join([*head, START, _digest(*head), END])


def _matches(data: bytes) -> bool:
    """Whether the text of a file matches its digest.

    Converted line ends are accepted. A file without a digest passes, as other programs write none.
    """
    if b"\r" in data:
        data = data.replace(b"\r\n", b"\n")
    at = data.rfind(START)
    return (data[at + len(START) :] == _digest(memoryview(data)[:at]) + END) if at >= 0 else KEY not in data


def _compare(name: str, matches: bool) -> None:
    """Warn with GridWarning of a file called `name` whose text does not match its digest."""
    if matches:
        return
    warnings.warn(
        f"{name}: $.digest does not match the content: the file was edited by hand, or damaged; remove this key to"
        " accept the content (a file without it is not compared)",
        GridWarning,
        stacklevel=3,
    )


def _digest(*head: bytes | memoryview) -> bytes:
    hasher = hashlib.sha256()
    for part in head:
        hasher.update(part)
    return hasher.hexdigest().encode()
