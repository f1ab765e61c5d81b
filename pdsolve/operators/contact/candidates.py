"""Pairs of nodes that may touch soon: of surfaces and beside broken bonds, of two bodies or without an intact bond."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import lengths, row_chunks, tree_of
from pdsolve.model import Model
from pdsolve.operators.contact.drawn_faces import drawn_faces
from pdsolve.operators.contact.kernel import Faces, Nodes, learn_faces, surface_nodes
from pdsolve.operators.protocol import Operator

EVERY, SOON = 25, 5  # steps after which broken bonds are asked for, where none had broken and where some had
CORNER = {2: 3, 3: 7}  # nearest bonds of a node at one: nodes with fewer are loose, they have no normal
LENGTH = {2: 1 + 2**0.5, 3: 1 + 4 / 2**0.5 + 4 / 3**0.5}  # of the normal of a flat face of a lattice
ALONG = 1e-6  # smallest over largest moment of the nearest nodes: below it they are in a plane, or a line
NEAREST = {2: 1.5, 3: 1.8}  # spacings: of the bonds that tell a normal, to 8 nodes of a plane and 26 of space


class Joined:
    """The bonds of n nodes, as contact knows them: which join two nodes up to a step."""

    def __init__(self, model: Model, operator: Operator, use_drawn_faces: bool) -> None:
        """`use_drawn_faces`: whether round and inclined bodies touch by their drawn surfaces."""
        self._operator, self._nodes, self._gone = operator, len(model.grid), 0
        self.until, self.wait = 0, EVERY  # step before which broken bonds are known; steps until they are asked for
        ends = [operator.bonds(int(rows[0]), int(rows[-1]) + 1, at_start=True) for rows in row_chunks(self._nodes)]
        source, target = (np.concatenate(column) for column in zip(*ends, strict=True))
        x, delta, self._bodies = model.grid.position, model.grid.delta, model.grid.bodies
        if self._bodies is not None and self._bodies.rigid:
            # As if bonds joined the nearest nodes of rigid bodies, for their normals
            rows = np.flatnonzero(np.isin(self._bodies.number, self._bodies.rigid))
            reach = NEAREST[model.grid.dimension] * float(model.grid.delta[rows].max())
            pairs = rows[tree_of(model.grid.position[rows]).query_pairs(reach, output_type="ndarray")].reshape(-1, 2)
            i, j = pairs[self._bodies.moving_as_one(*pairs.T)].T
            source, target = np.concatenate([source, i, j]), np.concatenate([target, j, i])
            order = np.lexsort((target, source))
            source, target = source[order], target[order]
        once = source < target
        self._key = source[once] * self._nodes + target[once]
        self.intact = np.ones(len(self._key), dtype=np.bool_)
        mean = (delta[source] + delta[target]) / 2
        length = lengths(x[target] - x[source])
        near = length <= NEAREST[x.shape[1]] * mean
        source, target = source[near], target[near]
        self._number, self._near_source = self._found(source, target), source  # of each nearest bond among all
        start = np.searchsorted(source, np.arange(self._nodes + 1))
        near_by, intact = target.astype(np.int32), np.ones(len(source), dtype=np.bool_)
        self.nodes = Nodes(x, start, near_by, 1 / length[near], intact)
        self.surface = np.zeros(self._nodes, dtype=np.bool_)
        surface_nodes(self.nodes, self.surface)
        self.drawn = drawn_faces(model.grid, self.surface & use_drawn_faces)
        self._marred = np.zeros(self._nodes, dtype=np.bool_)  # nodes that lost one of their nearest bonds

    def _found(self, source: NDArray[np.int64], target: NDArray[np.int64]) -> NDArray[np.int64]:
        """Numbers (k,) of the bonds between these rows (k,); those of no bond are arbitrary."""
        key = np.minimum(source, target) * self._nodes + np.maximum(source, target)
        return np.asarray(np.searchsorted(self._key, key).clip(max=max(len(self._key) - 1, 0)), dtype=np.int64)

    def faces(self, rows: NDArray[np.int64]) -> Faces:
        """Normals of these nodes (m,), in order, of the bonds that are intact now."""
        nodes, begin = self.nodes, self.nodes.start[rows]
        count = nodes.start[rows + 1] - begin
        ends = np.concatenate([[0], np.cumsum(count)])
        bonds = np.arange(ends[-1]) + np.repeat(begin - ends[:-1], count)
        intact = nodes.intact[bonds]
        remaining = np.diff(np.concatenate([[0], np.cumsum(intact)])[ends])
        intact &= np.repeat(remaining >= CORNER[nodes.x.shape[1]], count)
        start, bonds, m = np.concatenate([[0], np.cumsum(intact)])[ends], bonds[intact], len(rows)
        near, inverse, is_known = nodes.near[bonds].astype(np.int64), nodes.inverse[bonds], np.zeros(m, dtype=np.bool_)
        faces = Faces(rows, start, near, inverse, np.zeros((m, 3)), np.zeros(m), np.zeros((m, 3)), is_known)
        learn_faces(nodes, faces)
        # Intact nodes get the normals of their drawn surface, which turn with the nearest nodes: a normal is a sum over
        # the vectors to these, with the factors nearest to the usual ones, one over the length
        d = self.nodes.x.shape[1]
        wanted = np.where(self._marred[faces.rows, None], 0.0, self.drawn.normal[faces.rows])
        count = np.diff(faces.start)
        laid = wanted.any(axis=1) & (count > 0)
        node = np.repeat(np.arange(len(faces.rows)), count)
        bonds = np.flatnonzero(laid[node])
        node, apart = node[bonds], self.nodes.x[faces.near[bonds]] - self.nodes.x[faces.rows[node[bonds]]]
        moment = np.zeros((len(faces.rows), d, d))
        np.add.at(moment, node, apart[:, :, None] * apart[:, None, :])
        spread = np.linalg.eigvalsh(moment)
        laid &= spread[:, 0] > ALONG * spread[:, -1]  # else all are in a line or a plane
        laid_nodes = np.flatnonzero(laid)
        more = np.zeros((len(faces.rows), d))
        change = -LENGTH[d] * wanted[laid_nodes] + faces.still[laid_nodes, :d]
        more[laid_nodes] = np.linalg.solve(moment[laid_nodes], change[:, :, None])[:, :, 0]
        faces.inverse[bonds] += (apart * more[node]).sum(axis=1)
        faces.still[laid_nodes, :d], faces.bent[laid_nodes] = LENGTH[d] * wanted[laid_nodes], 0.0
        return faces

    def behind(self, rows: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Mask (k,) of rows whose nodes are behind others at their drawn surface, as long as they have all bonds."""
        return np.asarray(self.drawn.behind[rows] & ~self._marred[rows])

    def forget(self) -> None:
        """Ask for broken bonds anew the next time."""
        self.wait = 0

    def follow(self, step: int) -> bool:
        """Learn which bonds broke before a step, if they are to be asked for now; returns whether anything changed."""
        if 0 <= step - self.until < self.wait:
            return False
        broken, self.until = self._operator.broken(), step
        past = broken.step < step
        changed = int(past.sum()) != self._gone
        self.wait = SOON if changed else EVERY
        if not changed:
            return False
        self._gone = int(past.sum())
        self.intact[:] = True
        self.intact[self._found(broken.source[past], broken.target[past])] = False
        self.nodes.intact[:] = self.intact[self._number]
        self._marred[:] = np.bincount(self._near_source[~self.nodes.intact], minlength=self._nodes) > 0
        surface_nodes(self.nodes, self.surface)
        return True

    def join(self, source: NDArray[np.int64], target: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Mask (k,) of pairs of rows that an intact bond joins, or that are of one rigid body."""
        as_one = np.zeros(len(source), dtype=np.bool_)
        if self._bodies is not None and self._bodies.rigid:
            as_one = self._bodies.moving_as_one(source, target)
        if not len(self._key):
            return as_one
        number = self._found(source, target)
        key = np.minimum(source, target) * self._nodes + np.maximum(source, target)
        return np.asarray((self._key[number] == key) & self.intact[number] | as_one)


def candidates(
    joined: Joined, u: NDArray[np.floating], rows: NDArray[np.int64], reach: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs (p,) of these rows (k,), in order, that no bond joins and that are at most as far apart now as one of the
    two has its `reach` (k,), m."""
    place = joined.nodes.x[rows] + u[rows].astype(np.float64)
    first, second = tree_of(place).query_pairs(float(reach.max(initial=0.0)), output_type="ndarray").reshape(-1, 2).T
    if len(reach) and reach.min() < reach.max():
        near = lengths(place[second] - place[first]) <= np.maximum(reach[first], reach[second])
        first, second = first[near], second[near]
    i, j = np.minimum(rows[first], rows[second]), np.maximum(rows[first], rows[second])
    loose = ~joined.join(i, j)
    i, j = i[loose], j[loose]
    order = np.lexsort((j, i))
    return i[order], j[order]
