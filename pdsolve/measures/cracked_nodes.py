"""Which nodes are cracked and since which step, from the steps in which their bonds broke.

Separation is 1 - intact / initial bonds, where bonds cut by a pre-crack count as broken. A node is cracked above the
separation of `cracked_damage_of`. A node that is born cracked takes the place of an earlier cracked node, and is
cracked since that one was.

Damage is what the run breaks: the broken ones of the bonds that pre-cracks leave.
"""

from __future__ import annotations

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.cracked_damage import cracked_damage
from pdmesh.model.document import Horizon, Material
from pdmesh.model.lattice_calibration import has_partial_cells
from pdmesh.model.neighbours import Neighbours, tree_of
from pdmesh.model.node_grid import Grid
from pdmesh.model.visibility import sight_of
from pdsolve.measures.embedded_model import read
from pdsolve.measures.softened_bonds import separation_history
from pdsolve.results import Results

LINKED = 1.5  # spacings between two nodes of a crack
ROUND_OFF = 1e-6
SAME_PLACE = 1e-12  # m: ends of pre-cracks as near as that are one


class _BondGridFileKeys(msgspec.Struct):
    """The keys of the grid file that say who is bonded."""

    horizon: Horizon = Horizon()
    material: Material | None = None


def cracked_damage_of(results: Results, threshold: float | None = None) -> float:
    """Damage above which the nodes of a run are cracked: `threshold` or, by default, what follows from the horizon."""
    if threshold is not None:
        return threshold
    bonded = read(results, _BondGridFileKeys)
    return cracked_damage(bonded.horizon.ratio, bonded.material, results.dimension)


def damage_with_pre_cracks_at(results: Results, step: int) -> NDArray[np.float64]:
    """Separation (n,) of the living nodes after any step, also between frames; see above."""
    family, broken_count = _count_bonds_and_broken_bonds_at(results, step)
    return np.asarray(broken_count / np.maximum(family, 1))


def separation_at(results: Results, step: int) -> NDArray[np.float64]:
    """Separation (n,) as above, to which bonds that have softened in load steps add the energy they dissipated."""
    damage, history = damage_with_pre_cracks_at(results, step), separation_history(results)
    return damage if history is None else np.maximum(damage, history.at(step))


def damage_without_pre_cracks_at(results: Results, step: int) -> NDArray[np.float64]:
    """Damage (n,) of the living nodes after any step, also between frames; see above."""
    family, broken_count = _count_bonds_and_broken_bonds_at(results, step)
    lives, rows, cracks = results.lives(), results.rows(step), results.cracks()
    nodes, cut = results.nodes(step), lives.nodes.cut[rows]
    # Nodes that are born during a run are also born without bonds that broke before; pre-cracks cut those of their
    # pairs that cross one.
    born = np.flatnonzero((lives.birth[rows] > 0) & (cut > 0))
    if len(born):
        crossing = np.zeros(len(rows), dtype=np.int64)
        if len(cracks):
            bonded, nowhere = read(results, _BondGridFileKeys), np.full(len(rows), -1)
            margin = 0.5 if bonded.material is not None and has_partial_cells(bonded.material) else 0.0
            around = Neighbours(nodes.position, nodes.delta, (bonded.horizon.ratio + margin) * nodes.delta, mutual=True)
            grid = Grid(nodes.ids, nodes.position, nodes.delta, nowhere >= 0, nowhere, cracks)
            pairs = around.pairs(born)
            crossing = np.bincount(pairs.source[sight_of(grid).cut(pairs)], minlength=len(rows))
        cut = np.where(lives.birth[rows] > 0, np.minimum(cut, crossing), cut)
    return np.asarray((broken_count - cut) / np.maximum(family - cut, 1))


def _count_bonds_and_broken_bonds_at(results: Results, step: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Bonds (n,) of the living nodes, and those of them that are gone after a step."""
    lives, breaks, rows = results.lives(), results.breaks(), results.rows(step)
    before = breaks.step <= step
    row = lives.at(breaks.node[before], breaks.step[before])
    broken_count = lives.nodes.cut + np.bincount(row, minlength=len(lives.birth))
    return lives.nodes.family[rows], broken_count[rows]


def first_cracked_step_of_nodes(
    results: Results, threshold: float | None = None, step: int | None = None
) -> NDArray[np.int64]:
    """The step (n,) from which each node's separation exceeds `threshold`; -1 for nodes that stay sound.

    The nodes are those at `step`, by default those of the last frame.
    """
    lives, breaks, threshold = results.lives(), results.breaks(), cracked_damage_of(results, threshold)
    nodes = lives.nodes
    family = np.maximum(nodes.family, 1)
    most = np.floor(threshold * family).astype(np.int64)  # bonds a node may lose, but for a rounding
    most += ((most + 1) / family <= threshold).astype(np.int64) - (most / family > threshold)
    further = most + 1 - nodes.cut  # breaks that a node needs
    row = lives.at(breaks.node, breaks.step)
    order = np.lexsort((breaks.step, row))
    count = np.bincount(row, minlength=len(family))
    first = np.cumsum(count) - count
    since = np.where(further <= 0, lives.birth, -1)
    broke = (further > 0) & (further <= count)
    since[broke] = breaks.step[order][(first + further - 1)[broke]]
    ends, hurt = np.argsort(lives.death, kind="stable"), count > 0
    place, half, birth = nodes.position, nodes.delta / 2, lives.birth
    # Nodes that are born cracked are so since the overlapping nodes that die at the same time were. If none of these
    # was and none had lost bonds during the run, a pre-crack cut them: since step 0.
    for epoch in results.epochs()[1:].tolist():
        born, died = (slice(*np.searchsorted(steps, [epoch, epoch + 1])) for steps in (lives.birth, lives.death[ends]))
        born_rows, died_rows = np.arange(len(since))[born], ends[died]
        if len(born_rows) and len(died_rows):
            reach = half[born_rows] + half[died_rows].max()
            near = tree_of(place[died_rows]).query_ball_point(place[born_rows], reach * (1 + ROUND_OFF), p=np.inf)
            overlaps = np.array([len(rows) for rows in near])
            born_row = np.repeat(born_rows, overlaps)
            died_row = died_rows[np.concatenate([np.zeros(0, dtype=np.int64), *near]).astype(np.int64)]
            apart = np.abs(place[born_row] - place[died_row]).max(axis=1)
            touch = apart < (half[born_row] + half[died_row]) * (1 - ROUND_OFF)
            born_row, died_row = born_row[touch], died_row[touch]
            hurt[born_row[hurt[died_row]]] = True
            inherits = (since[died_row] >= 0) & (since[born_row] == birth[born_row])
            np.minimum.at(since, born_row[inherits], since[died_row[inherits]])
        since[born_rows[(since[born_rows] == birth[born_rows]) & ~hurt[born_rows]]] = 0
    since = since[results.rows(step)]
    history = separation_history(results)
    if history is not None:  # a node is cracked once its bonds have softened as far, in a frame
        softened = history.separation > threshold
        first_step = history.step[softened.argmax(axis=0)]
        earlier = softened.any(axis=0) & ((since < 0) | (first_step < since))
        since = np.where(earlier, first_step, since)
    return since


def find_free_pre_crack_tips(
    pre_cracks: NDArray[np.float64],
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Ends of pre-cracks (k, 4) that no other segment touches, each with the unit vector of the arriving crack."""
    ends = np.concatenate([pre_cracks[:, :2], pre_cracks[:, 2:]])
    starts = np.concatenate([pre_cracks[:, 2:], pre_cracks[:, :2]])
    if not len(ends):
        return []
    alone = tree_of(ends).query_ball_point(ends, SAME_PLACE, p=np.inf, return_length=True) == 1
    return [
        (tip, (tip - start) / np.hypot(*(tip - start))) for tip, start in zip(ends[alone], starts[alone], strict=True)
    ]
