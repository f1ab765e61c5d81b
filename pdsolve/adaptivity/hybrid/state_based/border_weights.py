"""Weights c of the pieces that end on the border of the fine zone; see `pdsolve.adaptivity.hybrid.state_based`.

v is a site's area in the fine zone over h^2. A piece of share s of its bond has c = v / s at a free site. What is left
of the bond's v of both ends goes to sites on the border. There s c adds up, for each way of bonds, to v times the
number of bonds that the site has along it. Weights begin with those between which the piece ends and change as little
as they can.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

NEAR = 2  # spacings from where a piece ends to the sites on the border that take its rest
SLIGHT, ROUNDS = 1e-5, 4  # of the squares of weights in a round; each leaves about as much of what is missing
NOTHING = 1e-14  # c that are none


class Wanted(NamedTuple):
    """What is known of p pieces and s sites on the border."""

    way: NDArray[np.int64]  # (p,) of the bond
    share: NDArray[np.float64]  # (p,) s
    rest: NDArray[np.float64]  # (p,) what goes to the border
    end: NDArray[np.float64]  # (e, 2) ends on the border, in spacings
    of: NDArray[np.int64]  # (e,) piece of each end
    site: NDArray[np.int64]  # (ny + 1, nx + 1) number of the site at a fine node, -1 of others
    v: NDArray[np.float64]  # (s,)
    number: NDArray[np.int64]  # (s, k) of bonds along each way


class Weights(NamedTuple):
    """w weights of pieces at sites."""

    piece: NDArray[np.int64]  # (w,)
    site: NDArray[np.int64]  # (w,)
    c: NDArray[np.float64]  # (w,)


def weights_of(wanted: Wanted) -> Weights:
    """The weights of pieces at sites on the border."""
    count = len(wanted.v)
    if not len(wanted.end):
        return Weights(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0))
    first, guess = _between(wanted)
    key, at = np.unique(first[:, 0] * count + first[:, 1], return_inverse=True)
    known = np.bincount(at.ravel(), guess, minlength=len(key))
    every = distinct(np.concatenate([key, _near(wanted, key)]))
    piece, site = np.divmod(every, count)
    c = np.zeros(len(every))
    c[np.searchsorted(every, key)] = known
    c = _mended(wanted, piece, site, c)
    some = np.abs(c) > NOTHING
    return Weights(piece[some], site[some], c[some])


def _between(wanted: Wanted) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Pieces and sites (., 2) on both sides of where pieces end, and the weights that the pieces begin with."""
    x, y = wanted.end.T
    upright = (np.abs(x - np.rint(x)) < 1e-9) & (np.rint(x) % 2 == 0)
    along = np.where(upright, y, x)
    low = np.floor(along + 1e-9)
    ends = np.bincount(wanted.of, minlength=len(wanted.way))[wanted.of]
    share = wanted.rest[wanted.of] / ends
    found, weight = [], []
    for step in (0, 1):
        w = 1 - np.abs(along - low - step)
        column = np.rint(np.where(upright, x, low + step)).astype(np.int64)
        line = np.rint(np.where(upright, low + step, y)).astype(np.int64)
        some = np.flatnonzero(w > 1e-9)
        site = wanted.site[line[some], column[some]]
        there = site >= 0
        found.append(np.column_stack([wanted.of[some], site])[there])
        weight.append((w * share)[some][there])
    return np.concatenate(found), np.concatenate(weight)


def distinct(values: NDArray[np.int64]) -> NDArray[np.int64]:
    """The values that there are, in order."""
    found = np.sort(values)
    return np.asarray(found[np.append(True, found[1:] != found[:-1])])


def _near(wanted: Wanted, key: NDArray[np.int64]) -> NDArray[np.int64]:
    """Piece times the number of sites, plus site, of those near to where pieces end and with bonds along them."""
    piece, site = np.divmod(key, len(wanted.v))
    own = np.argwhere(wanted.site >= 0)
    order = np.empty_like(own)
    order[wanted.site[own[:, 0], own[:, 1]]] = own
    ny, nx = wanted.site.shape
    found = []
    for dy in range(-NEAR, NEAR + 1):
        for dx in range(-NEAR, NEAR + 1):
            y, x = (order[site] + (dy, dx)).T
            inside = (y >= 0) & (y < ny) & (x >= 0) & (x < nx)
            other = np.where(inside, wanted.site[y.clip(0, ny - 1), x.clip(0, nx - 1)], -1)
            some = (other >= 0) & (wanted.number[other, wanted.way[piece]] > 0)
            found.append(piece[some] * len(wanted.v) + other[some])
    return np.concatenate(found)


def _mended(
    wanted: Wanted, piece: NDArray[np.int64], site: NDArray[np.int64], c: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The weights nearest to c (w,) that meet both conditions."""
    from scipy import sparse  # few runs need it
    from scipy.sparse.linalg import splu

    pieces, row = np.unique(piece, return_inverse=True)
    sites, column = np.unique(site * wanted.number.shape[1] + wanted.way[piece], return_inverse=True)
    goal = np.concatenate([wanted.rest[pieces], (wanted.v[:, None] * wanted.number).ravel()[sites]])
    rows = np.concatenate([row.ravel(), len(pieces) + column.ravel()])
    terms = np.concatenate([np.ones(len(c)), wanted.share[piece]])
    conditions = sparse.csr_array((terms, (rows, np.tile(np.arange(len(c)), 2))), shape=(len(goal), len(c)))
    solve = splu((conditions @ conditions.T + SLIGHT * sparse.eye_array(len(goal))).tocsc()).solve
    for _ in range(ROUNDS):
        c = c + conditions.T @ solve(goal - conditions @ c)
    return np.asarray(c)
