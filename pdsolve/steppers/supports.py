"""Bodies that nothing supports: parts of a plate that may move as they are, without a force from neighbours."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Pairs = tuple[NDArray[np.int64], NDArray[np.int64]]

LOOSE = 1e-9  # of the largest eigenvalue: a node whose bonds resist less than that in a direction may go there
FIXED = 1e-6  # of the largest: supports that resist less than that do not hold a body
BALANCED = 1e-6  # of the sum of all forces: a resultant less than that is none


class Loose(NamedTuple):
    """What may move, of n nodes."""

    nodes: NDArray[np.bool_]  # (n,) all that may
    said: str  # the largest of them in words: how many nodes, and where; empty where there is none
    body: NDArray[np.int64]  # (n,) number of the body that a node belongs to


def loose(
    position: NDArray[np.float64],
    ids: NDArray[np.int64],
    bonds: Pairs,
    held: NDArray[np.bool_],
) -> Loose:
    """Bodies with fewer supports than a plane body needs, and nodes whose bonds are in one line.

    `position` (n, 2) m, `bonds` the rows (b,) of both nodes of intact bonds, `held` (n, 2) components. A body of one
    node has no rotation to be held.
    """
    from scipy.sparse import coo_array  # slow to import, and few runs ask
    from scipy.sparse.csgraph import connected_components

    source, target = bonds
    nodes = len(position)
    graph = coo_array((np.ones(len(source), dtype=bool), (source, target)), (nodes, nodes))
    count, part = connected_components(graph, directed=False)
    size = np.bincount(part, minlength=count)
    missing = _unsupported(position, part, size, held)
    swinging = _swinging(position, source, target, held) & ~missing[part]
    found = missing[part] | swinging
    if not found.any():
        return Loose(found, "", part)
    if missing.any():
        number = int(np.flatnonzero(missing)[size[missing].argmax()])
        own = part == number
        what = "the whole plate" if size[number] == nodes else f"a body of {size[number]} nodes"
        others = int(missing.sum()) - 1
        more = f", and {others} more" if others else ""
    else:
        own, what, more = swinging, f"{int(swinging.sum())} nodes that bonds hold in one direction only", ""
    x, y = position[own].mean(axis=0)
    return Loose(found, f"{what} around ({x:.4g}, {y:.4g}) m (node {ids[own][0]}) free to move{more}", part)


def _unsupported(
    position: NDArray[np.float64], part: NDArray[np.int64], size: NDArray[np.int64], held: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Which bodies (p,) have supports that leave a motion free: along x, along y, or a turn about their middle."""
    count = len(size)
    middle = np.stack([np.bincount(part, column, count) / size for column in position.T], axis=1)
    arm = position - middle[part]
    reach = np.sqrt(np.bincount(part, (arm**2).sum(axis=1), count) / size)
    turn = np.column_stack([-arm[:, 1], arm[:, 0]]) / np.where(reach > 0, reach, 1.0)[part][:, None]
    gram = np.zeros((count, 3, 3))
    for axis in range(2):
        rows = np.flatnonzero(held[:, axis])
        resists = np.zeros((len(rows), 3))
        resists[:, axis], resists[:, 2] = 1.0, turn[rows, axis]
        np.add.at(gram, part[rows], resists[:, :, None] * resists[:, None, :])
    gram[reach == 0, 2, 2] = 1.0
    values = np.linalg.eigvalsh(gram)
    return np.asarray(values[:, 0] <= FIXED * np.maximum(values[:, -1], 1e-300))


def _swinging(
    position: NDArray[np.float64], source: NDArray[np.int64], target: NDArray[np.int64], held: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Which nodes (n,) have all their bonds in one line, and are not held."""
    nodes, xi = len(position), position[target] - position[source]
    n = xi / np.sqrt((xi**2).sum(axis=1))[:, None]
    xx, xy, yy = (
        np.bincount(source, terms, minlength=nodes) for terms in (n[:, 0] ** 2, n[:, 0] * n[:, 1], n[:, 1] ** 2)
    )
    xx, yy = xx + held[:, 0], yy + held[:, 1]
    middle, half = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    return np.asarray(middle - half <= LOOSE * (middle + half))


def unbalanced(position: NDArray[np.float64], force: NDArray[np.float64], found: Loose) -> str:
    """In words, the first of the bodies found whose forces (n, 2), N/m, have a resultant or a moment; or nothing."""
    for number in np.unique(found.body[found.nodes]).tolist():
        own = found.body == number
        arm = position[own] - position[own].mean(axis=0)
        push, reach = force[own], float(np.sqrt((arm**2).sum(axis=1).max()))
        moment = float(np.sum(arm[:, 0] * push[:, 1] - arm[:, 1] * push[:, 0]))
        most = float(np.abs(push).sum())
        if np.abs(push.sum(axis=0)).max() > BALANCED * most or abs(moment) > BALANCED * most * reach:
            x, y = position[own].mean(axis=0)
            return f"a body of {int(own.sum())} nodes around ({x:.4g}, {y:.4g}) m"
    return ""
