"""Whether an exact border exists between a fine zone of a law with nodal fields and cells of its elasticity.

Writes its section of `docs/adaptivity.md`: python -m benchmarks.state_based_border

The fine zone is a union of square cells of twice the spacing h = 1. A bond xi counts in it by its pieces there, of
share s of the bond, extension e_p and multiplicity mu: 1, or 1/2 along the border. The energy has two fields,

    sum over pieces of  mu k e_p^2 / (2 s)  +  sum_i c_i p_i a e_p,    less  sum over sites of  v_i p_i^2 / (2 lambda),

for a linear peridynamic solid of dilatation theta_i = p_i / lambda; bonds with shear have a rotation in place of p. v_i
is a site's share of area in the fine zone. The weights c_i of a piece add up to 2 mu. Those of a free site are 1 / s,
so that its sum over pieces is that over its whole family under a linear field. The rest goes to sites on the border
near the piece, by least squares, such that each site's c s add up to 2 v over the pieces of each xi. Both are
conditions of the patch; the form is symmetric by construction.

u: displacement, m; C: elasticity (3, 3) of the lattice, N/m^2 by Voigt; omega: angular frequency for nodes of mass 1.
"""

from __future__ import annotations

import itertools
import sys
from collections import defaultdict
from fractions import Fraction
from functools import cached_property
from typing import NamedTuple

import numpy as np
import scipy.sparse as sparse
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from benchmarks.adaptivity import BORDER, PAGE
from benchmarks.pages import put_section

M = 3  # horizon over spacing
NEAR = 2  # spacings between a piece's end and the border sites that take its rest
STEP = 0.3  # of the march
WIDTHS = (12, 24, 48)  # spacings: full widths of cosine pulses; twice two horizons is the second
PULSE = 60, 130, 70.0  # cells of the fine part before the border, cells in all; spacings from the pulse to the border

Site = tuple[int, int]
Weights = dict[Site, float]


class Law(NamedTuple):
    """Stiffnesses of a law with a nodal field."""

    name: str
    normal: float = 1.0  # of bonds
    volumetric: float = 0.0  # lambda
    tangential: float = 0.0


class Piece(NamedTuple):
    """The part from t0 to t1 of a bond xi."""

    xi: Site
    start: Site
    t0: Fraction
    t1: Fraction
    mu: float

    @property
    def share(self) -> float:
        """Share of the bond's length."""
        return float(self.t1 - self.t0)

    def ends(self) -> tuple[tuple[Fraction, Fraction], tuple[Fraction, Fraction]]:
        """Both ends."""
        (x, y), (dx, dy) = self.start, self.xi
        return (x + self.t0 * dx, y + self.t0 * dy), (x + self.t1 * dx, y + self.t1 * dy)


LAWS = (
    Law("bonds"),
    Law("linear peridynamic solid", volumetric=2.0),
    Law("linear peridynamic solid", volumetric=-0.5),
    Law("bonds with shear", tangential=0.4),
    Law("bonds with shear", tangential=-0.15),
)
HALF = [(x, y) for x in range(M + 1) for y in range(-M, M + 1) if 0 < x * x + y * y <= M * M and (x > 0 or y > 0)]


def _around(value: int) -> list[tuple[int, float]]:
    """Columns (or rows) of cells that meet at a site, and shares."""
    return [(value // 2 - 1, 0.5), (value // 2, 0.5)] if value % 2 == 0 else [(value // 2, 1.0)]


class Zone:
    """Fine cells (nx, ny) among coarse ones, the plate's upper and lower edges joined if it is `round`."""

    def __init__(self, fine: NDArray[np.bool_], is_round: bool) -> None:
        self.fine, self.round = fine, is_round
        self.size = fine.shape
        self.free: dict[Site, None] = {}
        self.border: Weights = {}  # shares of area
        self.dof: dict[Site, int] = {}
        nx, ny = self.size
        for x in range(2 * nx + 1):
            for y in range(2 * ny + (not is_round)):
                share = sum(a * b * self.is_fine(i, j) for i, a in _around(x) for j, b in _around(y))
                if share == 1:
                    self.free[x, y] = None
                elif share > 0:
                    self.border[x, y] = share
                if share == 1 or (x % 2 == 0 and y % 2 == 0):
                    self.dof[x, y] = len(self.dof)

    def is_fine(self, i: int, j: int) -> bool:
        """Whether a cell exists and is fine."""
        j = j % self.size[1] if self.round else j
        return 0 <= i < self.size[0] and 0 <= j < self.size[1] and bool(self.fine[i, j])

    def site(self, x: int, y: int) -> Site:
        """The site at a place."""
        return (x, y % (2 * self.size[1])) if self.round else (x, y)

    def at(self, x: Fraction, y: Fraction) -> Site | None:
        """The free site at a place, if there is one."""
        if x.denominator != 1 or y.denominator != 1:
            return None
        site = self.site(int(x), int(y))
        return site if site in self.free else None

    def between(self, x: Fraction, y: Fraction, step: int) -> Weights:
        """Weights of the sites `step` apart on the border on both sides of a place on it."""
        upright = x.denominator == 1 and int(x) % 2 == 0
        along = y if upright else x
        first = int(along // step) * step
        w = float((along - first) / step)
        pairs = [(first, 1 - w), (first + step, w)]
        return {self.site(int(x), a) if upright else self.site(a, int(y)): w for a, w in pairs if w}

    def moves(self, x: Fraction, y: Fraction) -> dict[int, float]:
        """Weights of the nodes that a place moves with."""
        site = self.at(x, y)
        found = {site: 1.0} if site else self.between(x, y, 2)
        return {self.dof[one]: w for one, w in found.items()}

    @cached_property
    def weighted(self) -> list[tuple[Piece, Weights]]:
        """All pieces of bonds in the fine zone, and the weights of each."""
        pieces = self._pieces()
        return list(zip(pieces, weights_of(self, pieces), strict=True))

    def _pieces(self) -> list[Piece]:
        nx, ny = self.size
        found = []
        for xi in HALF:
            for x in range(-M, 2 * nx + M + 1):
                for y in range(2 * ny) if self.round else range(-M, 2 * ny + M + 1):
                    found += self._pieces_of(xi, (x, y))
        return found

    def _pieces_of(self, xi: Site, start: Site) -> list[Piece]:
        crossed = {Fraction(0), Fraction(1)}
        for origin, way in zip(start, xi, strict=True):
            low, high = sorted((origin, origin + way))
            crossed |= {Fraction(line - origin, way) for line in range(low, high + 1) if way and line % 2 == 0}
        found: list[Piece] = []
        times = sorted(crossed)
        for t0, t1 in itertools.pairwise(times):
            x, y = (origin + (t0 + t1) / 2 * way for origin, way in zip(start, xi, strict=True))
            mu = sum(a * b * self.is_fine(i, j) for i, a in _cells(x) for j, b in _cells(y))
            if found and found[-1].t1 == t0 and found[-1].mu == mu == 1:
                found[-1] = found[-1]._replace(t1=t1)
            elif mu:
                found.append(Piece(xi, start, t0, t1, mu))
        return found


def _cells(value: Fraction) -> list[tuple[int, float]]:
    """Columns of cells at a place, and shares."""
    return _around(int(value)) if value.denominator == 1 else [(int(value // 2), 1.0)]


def weights_of(zone: Zone, pieces: list[Piece]) -> list[Weights]:
    """The weights c of each piece."""
    found: list[Weights] = [{} for _ in pieces]
    for xi in HALF:
        own = [n for n, piece in enumerate(pieces) if piece.xi == xi]
        unknown: list[tuple[int, Site]] = []
        guess: list[float] = []
        rest: dict[int, float] = {}
        for n in own:
            piece = pieces[n]
            sites = [zone.at(*end) for end in piece.ends()]
            found[n] = {site: 1 / piece.share for site in sites if site}
            borders = [end for end, site in zip(piece.ends(), sites, strict=True) if not site]
            if not borders:
                continue
            rest[n] = 2 * piece.mu - sum(found[n].values())
            first: Weights = defaultdict(float)
            for end in borders:
                for site, w in zone.between(*end, 1).items():
                    first[site] += w * rest[n] / len(borders)
            near = {
                zone.site(x + dx, y + dy)
                for x, y in first
                for dx in range(-NEAR, NEAR + 1)
                for dy in range(-NEAR, NEAR + 1)
            }
            for site in sorted(near & zone.border.keys()):
                unknown.append((n, site))
                guess.append(first.get(site, 0.0))
        if unknown:
            _distribute(zone, pieces, unknown, np.array(guess), rest, found)
    return found


def _distribute(
    zone: Zone,
    pieces: list[Piece],
    unknown: list[tuple[int, Site]],
    guess: NDArray[np.float64],
    rest: dict[int, float],
    found: list[Weights],
) -> None:
    """The weights nearest to a guess that meet both conditions."""
    rows = {n: k for k, n in enumerate(rest)}
    sites = {site: len(rows) + k for k, site in enumerate(sorted({site for _, site in unknown}))}
    conditions = np.zeros((len(rows) + len(sites), len(unknown)))
    for k, (n, site) in enumerate(unknown):
        conditions[rows[n], k] = 1
        conditions[sites[site], k] = pieces[n].share
    wanted = np.array([*rest.values(), *(2 * zone.border[site] for site in sites)])
    c = guess + np.linalg.lstsq(conditions, wanted - conditions @ guess, rcond=None)[0]
    for k, (n, site) in enumerate(unknown):
        found[n][site] = found[n].get(site, 0.0) + c[k]


class Plate:
    """Stiffness of a plate with a fine zone; rotations of bonds with shear come last."""

    def __init__(self, zone: Zone, law: Law) -> None:
        self.zone, self.n = zone, 2 * len(zone.dof)
        sites = sorted({*zone.free, *zone.border})
        area = np.array([zone.border.get(site, 1.0) for site in sites])
        number = {site: n for n, site in enumerate(sites)}
        self.turning = len(sites) if law.tangential else 0
        self.C = elasticity(law)
        across = 1 / len(HALF)  # theta is the sum of across / length * e over a whole family
        springs, fields = [], []
        for piece, c in zone.weighted:
            length = float(np.hypot(*piece.xi))
            n = np.array(piece.xi) / length
            first, second = (zone.moves(*end) for end in piece.ends())
            ext = _projected(first, second, n)
            springs.append((ext, law.normal / length * piece.mu / piece.share))
            if law.volumetric:
                fields += [(number[site], d, w * across / length * x) for site, w in c.items() for d, x in ext.items()]
            if law.tangential:
                row = {d: x / piece.share for d, x in _projected(first, second, np.array([-n[1], n[0]])).items()}
                row |= {self.n + number[site]: -length * w / (2 * piece.mu) for site, w in c.items()}
                springs.append((row, law.tangential / length * piece.mu * piece.share))
        self.K = _sum(springs, self.n + self.turning) + self._coarse()
        if fields:
            rows, columns, values = zip(*fields, strict=True)
            sums = sparse.csr_matrix((values, (rows, columns)), shape=(len(sites), self.n + self.turning))
            self.K = self.K + law.volumetric * (sums.T @ sparse.diags(1 / area) @ sums)
        self.K = self.K.tocsr()
        self.mass = self._mass(dict(zip(sites, area, strict=True)))

    def _coarse(self) -> sparse.csr_matrix:
        """Bilinear cells of the lattice's elasticity."""
        own, found = _bilinear(self.C), []
        for i, j in zip(*np.nonzero(~self.zone.fine), strict=True):
            nodes = [self.zone.dof[self.zone.site(2 * (i + p), 2 * (j + q))] for q in (0, 1) for p in (0, 1)]
            at = np.array([2 * node + axis for node in nodes for axis in (0, 1)])
            found.append((np.repeat(at, 8), np.tile(at, 8), own.ravel()))
        rows, columns, values = map(np.concatenate, zip(*found, strict=True))
        size = self.n + self.turning
        return sparse.csr_matrix((values, (rows, columns)), shape=(size, size))

    def _mass(self, area: Weights) -> NDArray[np.float64]:
        found = np.zeros(len(self.zone.dof))
        for i, j in zip(*np.nonzero(~self.zone.fine), strict=True):
            for p, q in ((0, 0), (1, 0), (0, 1), (1, 1)):
                found[self.zone.dof[self.zone.site(2 * (i + p), 2 * (j + q))]] += 1
        for (x, y), share in area.items():
            for node, w in self.zone.moves(Fraction(x), Fraction(y)).items():
                found[node] += w * share
        return np.repeat(found, 2)

    @property
    def place(self) -> NDArray[np.float64]:
        """Places (n / 2, 2) of the nodes."""
        return np.array(list(self.zone.dof), dtype=np.float64)

    def inner(self) -> NDArray[np.int64]:
        """Unknowns away from the plate's edges."""
        nx, ny = self.zone.size
        x, y = self.place.T
        some = (x > 0) & (x < 2 * nx) & (self.zone.round | ((y > 0) & (y < 2 * ny)))
        return np.concatenate([np.flatnonzero(np.repeat(some, 2)), np.arange(self.n, self.n + self.turning)])

    def residual(self) -> float:
        """The largest force inside under linear fields, over the largest held by the edges."""
        worst = 0.0
        for gradient in ([[1, 0], [0, 0]], [[0, 0], [0, 1]], [[0, 1], [1, 0]], [[0, 1], [-1, 0]], [[0, 0], [1, 0]]):
            g = np.array(gradient, dtype=np.float64)
            if self.zone.round and g[:, 1].any():
                continue
            u = np.concatenate([(self.place @ g.T).ravel(), np.full(self.turning, (g[1, 0] - g[0, 1]) / 2)])
            worst = max(worst, float(np.abs((self.K @ u)[self.inner()]).max()))
        size = np.concatenate([self.place.ravel(), np.zeros(self.turning)])
        return worst / float(np.abs(self.K @ size).max())

    def frequencies(self) -> tuple[float, float]:
        """The least and the largest omega^2 with the edges held."""
        inner = self.inner()
        moving = inner[inner < self.n]
        K = self.K[inner][:, inner].toarray()
        at = len(moving)
        if self.turning:
            K = K[:at, :at] - K[:at, at:] @ np.linalg.solve(K[at:, at:], K[at:, :at])
        found = np.linalg.eigvalsh(K / np.sqrt(np.outer(self.mass[moving], self.mass[moving])))
        return float(found[0]), float(found[-1])

    def sent_back(self, axis: int, width: float) -> float:
        """Amplitude left of the border, over 1, after a cosine pulse went from the fine left part to the right one."""
        x, n = np.repeat(self.place[:, 0], 2), self.n
        border = 2 * PULSE[0]
        speed = np.sqrt(self.C[0, 0] if axis == 0 else self.C[2, 2])

        def shape(x: NDArray[np.float64]) -> NDArray[np.float64]:
            at = (x - border + PULSE[2]) / (width / 2)
            return np.where((np.abs(at) < 1) & (np.arange(n) % 2 == axis), (1 + np.cos(np.pi * at)) / 2, 0.0)

        K, turn = self.K[:n, :n], self.K[:n, n:]
        solve = splu(self.K[n:, n:].tocsc()).solve if self.turning else None
        old, u = shape(x + speed * STEP), shape(x)
        for _ in range(round((2 * PULSE[2] + width) / speed / STEP)):
            force = K @ u - (turn @ solve(turn.T @ u) if solve else 0)
            old, u = u, 2 * u - old - STEP**2 * force / self.mass
        return float(np.abs(u[x < border - 3]).max())


def _sum(springs: list[tuple[dict[int, float], float]], size: int) -> sparse.csr_matrix:
    """Stiffness of springs, each of weights of unknowns and a stiffness."""
    rows = np.repeat(np.arange(len(springs)), [len(row) for row, _ in springs])
    columns = np.fromiter((d for row, _ in springs for d in row), dtype=np.int64)
    values = np.fromiter((x for row, _ in springs for x in row.values()), dtype=np.float64)
    found = sparse.csr_matrix((values, (rows, columns)), shape=(len(springs), size))
    return (found.T @ sparse.diags([k for _, k in springs]) @ found).tocsr()


def _projected(first: dict[int, float], second: dict[int, float], way: NDArray[np.float64]) -> dict[int, float]:
    """Weights of the unknowns in the difference of two ends' displacements along a unit vector."""
    found: dict[int, float] = defaultdict(float)
    for sign, end in ((-1, first), (1, second)):
        for node, w in end.items():
            for axis in (0, 1):
                found[2 * node + axis] += sign * w * way[axis]
    return found


def elasticity(law: Law) -> NDArray[np.float64]:
    """C of a whole lattice."""
    found = np.zeros((3, 3))
    for xi in HALF:
        length = np.hypot(*xi)
        x, y = np.array(xi) / length
        along, across = (
            length * np.array([x * x, y * y, x * y]),
            length * np.array([-x * y, x * y, (x * x - y * y) / 2]),
        )
        found += (law.normal * np.outer(along, along) + law.tangential * np.outer(across, across)) / length
    found[:2, :2] += law.volumetric
    return found


def _bilinear(C: NDArray[np.float64]) -> NDArray[np.float64]:
    """Stiffness (8, 8) of a bilinear cell with sides of 2, by four points."""
    found = np.zeros((8, 8))
    for gx in (-(3**-0.5), 3**-0.5):
        for gy in (-(3**-0.5), 3**-0.5):
            B = np.zeros((3, 8))
            for n, (x, y) in enumerate(((-1, -1), (1, -1), (-1, 1), (1, 1))):
                dx, dy = x * (1 + y * gy) / 4, y * (1 + x * gx) / 4
                B[:, 2 * n], B[:, 2 * n + 1] = (dx, 0, dy), (0, dy, dx)
            found += B.T @ C @ B
    return found


def shapes() -> dict[str, NDArray[np.bool_]]:
    """Fine cells of different borders."""
    x, y = np.indices((14, 14)) + 0.5
    square = (abs(x - 7) < 3) & (abs(y - 7) < 3)
    hook = (abs(x - 7) < 4) & (abs(y - 7) < 4) & ~((x > 7) & (y > 7))
    blob = (x - 7) ** 2 + (y - 7) ** 2 < 16 + 6 * np.sin(3 * np.arctan2(y - 7, x - 7))
    return {"a strip": (abs(x - 7) < 3)[:, :6], "a square": square, "an L": hook, "a blob": blob}


def section() -> str:
    """The section of the page."""
    x = np.arange(PULSE[1])
    long = Zone(np.repeat(((x >= 8) & (x < PULSE[0]))[:, None], 3, axis=1), is_round=True)
    zones = [Zone(fine, name == "a strip") for name, fine in shapes().items()]
    rows = []
    for law in LAWS:
        plates = [Plate(zone, law) for zone in zones]
        worst, ranges = max(plate.residual() for plate in plates), [plate.frequencies() for plate in plates]
        pulses = Plate(long, law)
        back = [[100 * pulses.sent_back(axis, width) for width in WIDTHS] for axis in (0, 1)]
        C = plates[0].C
        cells = (law.name, f"{C[0, 1] / C[0, 0]:.2f}", f"{worst:.0e}", f"{min(r[0] for r in ranges):.3f}")
        cells += (f"{ranges[0][1]:.2f}", f"{max(r[1] for r in ranges[1:]):.2f}")
        rows.append((*cells, *(", ".join(f"{one:.2g}" for one in some) for some in back)))
    return TEXT.format(
        table="".join(f"| {' | '.join(row)} |\n" for row in rows), shapes=", ".join(shapes()), m=M, title=BORDER
    )


TEXT = """{title}

A hybrid solves bonds without shear. `python -m benchmarks.state_based_border` asks whether a fine zone of a linear
peridynamic solid, or of bonds with shear and a rotation of each node, can lie in a lattice of its own elasticity as
exactly: {shapes} of fine cells, of horizon {m} spacings, in bilinear cells of twice the spacing.

It can. Each node has its pressure (or rotation) p as a second field, so that the energy of a bond holds p once and a
bond, or a piece of one, is a pair again. A piece of share s of its bond counts 1/s times in the sum of the free node at
its end: the node's dilatation under a linear field is that of its whole family. What is left of the bond's two shares
goes to p of sites on the border near the piece. There it has to add up, for each direction, to twice the site's share
of area; along straight borders it does by itself, at corners a small least squares problem finds the weights. Forces
come from one energy, so momentum and energy hold. With p eliminated the volumetric part is a sum of squares.

| law | nu, plane stress | residual | least omega^2 | largest, strip | largest, others | P back, % | S back, % |
|---|---|---|---|---|---|---|---|
{table}
Residuals are the largest forces inside under linear fields, relative to those that the edges take. No omega^2 is
negative, and that of corners is no larger than that of the strip: the time step stays that of the lattice. Pulses are
cosines of full widths 12, 24 and 48 spacings that cross a straight border; what comes back is, of 100, their amplitude.

The solver has this border for linear peridynamic solids (`model` `ordinary`) in the plane, in motion, with a zone that
grows; [the guide](guide/adaptivity.md#a-solid-of-any-poissons-ratio) says what it gives and costs.
"""


def main() -> int:
    """Write the section."""
    put_section(PAGE, section())
    return 0


if __name__ == "__main__":
    sys.exit(main())
