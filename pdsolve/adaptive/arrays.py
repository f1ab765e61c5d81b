"""What a run has: what stays, and what it changes."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptive.family import Springs, Stretches, coarse_springs, stretches
from pdsolve.adaptive.lattice import AROUND, COARSE, VOID, Lattice
from pdsolve.operators.blocks.lanes import ROW
from pdsolve.operators.blocks.layout import aligned

EVERY = 8  # steps between two looks at what has broken and what is stretched
AHEAD = 8  # h: cells this near to a node that has lost a bond become fine
TIPS = 12  # h: likewise to the tip of a pre-crack, at the start
KAPPA = 0.7  # of the critical stretch: likewise within `AHEAD` of a coarse bond that is stretched more

PLACE, AXIS, PROFILE, KIND = range(4)  # of `Entries.what`
VALUE, SPEED, LAST, FORCE = range(4)  # of `Entries.value`
# of `Zone.number`
ROWS, COARSE_ROWS, PIECES, BORDERS, BREAKS, LOADS, HOLDS, FINE_CELLS, REGRIDS, KNOWN, ENTRIES, HOT = range(12)
# of `Zone.total`
WORK, DISSIPATED, REFINEMENT, CLIPPED, LARGEST = range(5)


class Ground(NamedTuple):
    """What stays."""

    at: Lattice
    h: float  # m
    dx: NDArray[np.int64]  # (k,) fine family
    dy: NDArray[np.int64]
    table: NDArray[np.float64]  # (k, 8)
    ways: NDArray[np.int64]  # (k,)
    coarse_dx: NDArray[np.int64]  # (8,)
    coarse_dy: NDArray[np.int64]
    coarse_table: NDArray[np.float64]  # (8, 8)
    coarse_ways: NDArray[np.int64]  # (8,)
    cut: Stretches
    reach: int  # h, of the family along an axis
    c11: float
    e_limit: float  # e of the critical stretch
    e_hot: float  # e of a coarse bond beside which cells become fine
    cell_mass: float  # rho h^2, kg/m
    dt: float  # s
    lack: NDArray[np.float64]  # (2, n) what a node of a full lattice holds over what this one does, less 1
    lasting: NDArray[np.bool_]  # (n,) nodes whose bonds do not break
    coarse_bits: NDArray[np.uint8]  # (q,) coarse bonds that no pre-crack cuts, of the first four springs: inverted
    edge_cut: NDArray[np.float64]  # (2, q) where a pre-crack cuts the edge to the east, and to the north; 0: nowhere
    cut_cells: NDArray[np.bool_]  # (c,) cells that a pre-crack crosses
    cracks: NDArray[np.float64]  # (j, 4) segments in fine spacings


class Nodes(NamedTuple):
    """Nodes of one lattice, and their rows of 16."""

    u: NDArray[np.float64]  # (2, 2, n) displacements now and one step on, in turn, m
    v: NDArray[np.float64]  # (2, n) velocity, m/s
    f: NDArray[np.float64]  # (2, n) forces besides the springs', of a touched row in the end all, N/m
    mass: NDArray[np.float64]  # (n,) kg/m
    light: NDArray[np.float64]  # (n,) 1 / mass; 0 where nothing is to move
    kind: NDArray[np.uint8]  # (n,)
    rows: NDArray[np.int64]  # those with a node that is not idle, in order
    entry: NDArray[
        np.int32
    ]  # (n / 16,) row of `own`; below 0 where all is as in the table, -2 less the row if it has one
    own: NDArray[np.float64]  # (., k, 16) stiffnesses
    touched: NDArray[np.bool_]  # (n / 16,) whether there are forces besides those of springs
    wide: NDArray[np.uint8]  # (n / 16,) how far stretches went; of coarse rows whether one was hot


class Pieces(NamedTuple):
    """What is left of clipped bonds, in the order of their owners."""

    owner: NDArray[np.int64]  # (p,)
    end: NDArray[np.int64]  # (p, 4) of both ends: fine node and -1, or two coarse nodes
    value: NDArray[np.float64]  # (p, 8) w of both ends, xi, 1 / |xi|^2, k, and 0 if it is to last


class Border(NamedTuple):
    """Fine nodes on the border, that move with coarse ones."""

    node: NDArray[np.int64]
    end: NDArray[np.int64]  # (., 2)
    w: NDArray[np.float64]


class Entries(NamedTuple):
    """Loads, or held components: those of all fine nodes, and those of nodes that move."""

    what: NDArray[np.int64]  # (e, 4) fine place, axis, profile, kind
    value: NDArray[np.float64]  # (e, 4) N/m, m or m/s at factor 1; of holds: mean velocity since the last step,
    # velocity at the last step, m/s, and force on the component then, N/m
    on: NDArray[np.int64]  # (., 2) fine place, or -1 - coarse place; and entry
    part: NDArray[np.float64]  # (.,) of the entry's value that this node has


class Breaks(NamedTuple):
    """Bonds that broke, directed, in order."""

    step: NDArray[np.int32]
    node: NDArray[np.int64]
    spring: NDArray[np.int32]


class Zone(NamedTuple):
    """What changes."""

    cells: NDArray[np.uint8]  # (c,)
    bits: NDArray[np.uint64]  # (n,) intact bonds, of the first half of the family; of idle nodes too. Never set again
    fine: Nodes
    coarse: Nodes
    pieces: Pieces
    spare: Pieces
    border: Border
    breaks: Breaks
    loads: Entries
    holds: Entries
    mark: NDArray[np.bool_]  # (n,) scratch
    new: NDArray[np.int64]  # scratch: cells that are to be fine
    dirty: NDArray[np.int64]  # scratch: fine nodes, in order
    dirty_coarse: NDArray[np.int64]
    number: NDArray[np.int64]
    total: NDArray[np.float64]
    s: NDArray[np.float64]  # scratch of the vector code


def nodes_of(places: int, springs: int, entries: int) -> Nodes:
    """Idle nodes, with room for `entries` rows of stiffnesses; what is never touched takes no memory."""
    rows = places // ROW

    def zeros(*shape: int) -> NDArray[np.float64]:
        return _aligned_zeros(shape)

    return Nodes(
        u=zeros(2, 2, places),
        v=zeros(2, places),
        f=zeros(2, places),
        mass=zeros(places),
        light=zeros(places),
        kind=np.zeros(places, dtype=np.uint8),
        rows=np.zeros(rows, dtype=np.int64),
        entry=np.full(rows, -1, dtype=np.int32),
        own=zeros(entries, springs, ROW),
        touched=np.zeros(rows, dtype=np.bool_),
        wide=np.zeros(rows, dtype=np.uint8),
    )


def _aligned_zeros(shape: tuple[int, ...]) -> NDArray[np.float64]:
    """Zeros that begin at a multiple of 64 bytes."""
    wanted = 8 * int(np.prod(shape))
    room = np.zeros(wanted + 64, dtype=np.uint8)
    first = -room.ctypes.data % 64
    return room[first : first + wanted].view(np.float64).reshape(shape)


def ground_of(at: Lattice, springs: Springs, h: float, rho: float, dt: float, kappa: float = KAPPA) -> Ground:
    """A plate without pre-cracks, its surfaces not corrected."""
    coarse = coarse_springs(springs, h)

    def e_of(stretch: float) -> float:
        return stretch * (stretch + 2)

    return Ground(
        at=at,
        h=h,
        dx=springs.dx,
        dy=springs.dy,
        table=aligned(springs.table),
        ways=springs.dy * at.stride + springs.dx,
        coarse_dx=coarse.dx,
        coarse_dy=coarse.dy,
        coarse_table=aligned(coarse.table),
        coarse_ways=coarse.dy * at.coarse_stride + coarse.dx,
        cut=stretches(springs),
        reach=int(np.abs(springs.dx).max()),
        c11=springs.c11,
        e_limit=e_of(springs.limit),
        e_hot=e_of(kappa * springs.limit),
        cell_mass=rho * h * h,
        dt=dt,
        lack=np.zeros((2, at.places)),
        lasting=np.zeros(at.places, dtype=np.bool_),
        coarse_bits=np.zeros(at.coarse_places, dtype=np.uint8),
        edge_cut=np.zeros((2, at.coarse_places)),
        cut_cells=np.zeros(at.cells, dtype=np.bool_),
        cracks=np.zeros((0, 4)),
    )


def _coarse_cells(at: Lattice) -> NDArray[np.uint8]:
    """A plate of coarse cells, with nothing around."""
    cells = np.full(at.cells, VOID, dtype=np.uint8)
    inner = cells.reshape(-1, at.cell_stride)[AROUND:-AROUND, AROUND:-AROUND]
    inner[:] = COARSE
    return cells


def zone_of(at: Lattice, springs: int, rows: int) -> Zone:
    """A plate all coarse, with room for `rows` rows of fine nodes."""
    piece = ROW * rows * springs // 4
    nothing = Entries(np.zeros((0, 4), np.int64), np.zeros((0, 4)), np.zeros((0, 2), np.int64), np.zeros(0))

    def pieces() -> Pieces:
        return Pieces(np.zeros(piece, np.int64), np.zeros((piece, 4), np.int64), np.zeros((piece, 8)))

    events, nodes = ROW * rows * springs, ROW * rows
    return Zone(
        cells=_coarse_cells(at),
        bits=np.zeros(at.places, dtype=np.uint64),
        fine=nodes_of(at.places, springs, rows),
        coarse=nodes_of(at.coarse_places, 8, at.coarse_places // ROW),
        pieces=pieces(),
        spare=pieces(),
        border=Border(np.zeros(nodes, np.int64), np.zeros((nodes, 2), np.int64), np.zeros(nodes)),
        breaks=Breaks(np.zeros(events, np.int32), np.zeros(events, np.int64), np.zeros(events, np.int32)),
        loads=nothing,
        holds=nothing,
        mark=np.zeros(at.places, dtype=np.bool_),
        new=np.zeros(at.cells, dtype=np.int64),
        dirty=np.zeros(at.places, dtype=np.int64),
        dirty_coarse=np.zeros(at.coarse_places, dtype=np.int64),
        number=np.zeros(12, dtype=np.int64),
        total=np.zeros(5),
        s=_aligned_zeros((3 * ROW,)),
    )


def grown(zone: Zone) -> Zone:
    """The same with room for twice as much."""

    def twice(array: Any) -> NDArray[Any]:
        more = np.zeros((2 * len(array), *array.shape[1:]), dtype=array.dtype)
        more[: len(array)] = array
        return more

    return zone._replace(
        fine=zone.fine._replace(own=_aligned_twice(zone.fine.own)),
        pieces=Pieces(*map(twice, zone.pieces)),
        spare=Pieces(*map(twice, zone.spare)),
        border=Border(*map(twice, zone.border)),
        breaks=Breaks(*map(twice, zone.breaks)),
    )


def _aligned_twice(array: NDArray[np.float64]) -> NDArray[np.float64]:
    more = _aligned_zeros((2 * len(array), *array.shape[1:]))
    more[: len(array)] = array
    return more
