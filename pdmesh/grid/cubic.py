"""A body as nodes: centres of cubes on nested cubic lattices, one for each spacing.

Layout: cubes of the coarsest spacing fill the bounding box of the body and share its centre. A cube is divided into
eight where a zone asks for it. A zone is grown by the horizon of the nodes it replaces, as in the plane, so that
neighbouring spacings differ by one step. A node whose centre is in the body, or on its surface, stays and stands for
the part of its cube inside the body. Material in cubes with their centre outside goes to the nearest nodes. For a fine
zone that moves there is one lattice, whose outer cubes have their centres on the faces of the box: coarse cells then
end there. The volumes of cubes that the surface cuts are exact for its triangles. They are scaled so that all volumes
sum to the body's, as chords of curved faces are inside it.

The nodes of a body that are on no lattice are those of its file.
"""

from __future__ import annotations

import itertools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.grid.cubes import Cubes, inside, shares
from pdmesh.model.document import ON_ONE_LATTICE
from pdmesh.model.neighbours import tree_of
from pdmesh.model.triangulated_surface import distances, gap, outward
from pdmesh.scene.body import Body
from pdmesh.scene.shapes import SceneError
from pdmesh.scene.solids import NodeSet, Shell

SLACK = 1e-6  # of a spacing: what a box may be larger than cubes that fill it
ON = 1e-4  # of a spacing: a centre this near to the surface is on it
FULL = 1 - 1e-9  # share of a cube that is all of it
MOST_CUBES = 10**8  # of a level
AROUND, ALIKE = 12, 1e-9  # nodes that may be the nearest to a place; relative: distances this near are the same
CROSSED = 1e-2  # of the volume of cut cubes, less than none or more than all of a cube: of chords near each other
MISSED = 0.1  # of the volume of cut cubes: triangles that miss more of a body's volume are not its surface
THINNEST = 3  # nodes that a body is to have across
WEDGE = 4  # nodes from where it has them to a sharp edge; farther away it is thin, but for tips of few nodes
AT_ONCE = 10**6  # pairs of a node and a triangle


class Cubic(NamedTuple):
    """The nodes of one spacing."""

    cubes: Cubes
    at: NDArray[np.int64]  # (k, 3) which of the cubes are nodes, x fastest
    volume: NDArray[np.float64]  # (k,) m^3
    border: NDArray[np.bool_]  # (k,) within a spacing of the surface
    thin: NDArray[np.bool_]  # (k,) where the body is thinner than three spacings

    @property
    def position(self) -> NDArray[np.float64]:
        """The positions (k, 3) of the nodes, m."""
        return self.cubes.middles(self.at)

    @property
    def delta(self) -> NDArray[np.float64]:
        """The spacing (k,) of the nodes, m."""
        return np.full(len(self.at), self.cubes.spacing)

    def within(self, shell: Shell, place: str) -> NDArray[np.bool_]:
        """Mask (k,) of the nodes in a solid. Raises SceneError, beginning with `place`."""
        mask = inside(shell.triangles, self.cubes, place)
        return np.asarray(mask[tuple(self.at.T)])

    @property
    def whole(self) -> bool:
        """Whether all cubes of a box are nodes with full cells."""
        counts = np.ptp(self.at, axis=0) + 1
        cube = self.cubes.spacing**3
        return int(np.prod(counts)) == len(self.at) and bool((np.abs(self.volume - cube) <= SLACK * cube).all())


def place_nodes(body: Body) -> list[Cubic]:
    """The nodes, one level a spacing, the coarsest first.

    Raises SceneError for a body without nodes or too thin for them.
    """
    open_at = gap(body.shell.triangles)
    if open_at is not None:
        place = ", ".join(f"{value:g}" for value in open_at)
        raise SceneError(f"body: the surface is open at ({place}) m; use a closed one")
    surface = outward(body.shell.triangles)
    refined = _refined(body)
    levels: list[Cubic] = []
    lost: list[tuple[NDArray[np.float64], NDArray[np.float64]]] = []
    for step in range(len(refined) + 1):
        cubes = _cubes(body, step)
        if step == 0:
            present = np.ones(cubes.size, dtype=bool)
        else:  # the eighths of what is refined
            present = refined[step - 1].repeat(2, axis=0).repeat(2, axis=1).repeat(2, axis=2)
        if step < len(refined):
            present &= ~refined[step]
        if not present.any():
            continue
        # the bounding box of the cubes in `present`, widened by one cube on each side if possible
        low, high = [], []
        for axis in range(3):
            along = np.flatnonzero(present.any(axis=tuple(other_axis for other_axis in range(3) if other_axis != axis)))
            low.append(max(int(along[0]) - 1, 0))
            high.append(min(int(along[-1]) + 2, present.shape[axis]))
        corner = cubes.corner + np.array(low) * cubes.spacing
        part = Cubes(corner, cubes.spacing, np.array(high) - np.array(low))
        present_part = present[tuple(slice(first, last) for first, last in zip(low, high, strict=True))]
        level, orphans = _level(surface, cubes, part, present_part)
        levels.append(level)
        lost.append(orphans)
    if not sum(len(level.at) for level in levels):
        raise SceneError(f"spacing: the body has no node; use a spacing below {body.spacing:g} m")
    from scipy.ndimage import label

    for level in levels:
        mask = np.zeros(level.cubes.size, dtype=bool)
        mask[tuple(level.at[level.thin].T)] = True
        number = label(mask, np.ones((3, 3, 3)))[0][tuple(level.at.T)]
        thin = level.thin & (np.bincount(number)[number] >= THINNEST**3)
        if thin.any():
            place = ", ".join(f"{value:g}" for value in level.position[int(thin.argmax())])
            raise SceneError(
                f"spacing: {int(thin.sum())} nodes {level.cubes.spacing:g} m apart are where the body is thinner"
                f" than {THINNEST} of them, the first at ({place}) m; use finer ones there"
            )
    return _given(body, levels, lost)


def _cubes(body: Body, step: int) -> Cubes:
    """The cubes that fill the bounding box of a body, halved `step` times. Raises SceneError for too many."""
    low, high = body.shell.bounds
    count = np.maximum(np.ceil((high - low) / body.spacing - SLACK), 1).astype(np.int64)
    count += body.run.adapt in ON_ONE_LATTICE  # whose outer nodes lie on the box, for coarse cells to end there
    if float(np.prod(count.astype(float))) * 8**step > MOST_CUBES:
        size = " x ".join(f"{side:g}" for side in high - low)
        raise SceneError(
            f"spacing is {body.spacing / 2**step:g} m in a box of {size} m; use a larger one, for at most"
            f" {MOST_CUBES:.0e} cubes"
        )
    return Cubes((low + high) / 2 - count / 2 * body.spacing, body.spacing / 2**step, count * 2**step)


def _refined(body: Body) -> list[NDArray[np.bool_]]:
    """For each spacing but the finest, coarsest first, a mask of the cubes that are divided into eight."""
    from scipy.ndimage import distance_transform_edt

    steps = [round(float(np.log2(body.spacing / zone.spacing))) for zone in body.zones]
    refined_masks: list[NDArray[np.bool_]] = []
    finer: NDArray[np.bool_] | None = None
    for step in range(max(steps, default=0) - 1, -1, -1):
        cubes = _cubes(body, step)
        zone_masks = {True: np.zeros(cubes.size, dtype=bool), False: np.zeros(cubes.size, dtype=bool)}
        for zone, its in zip(body.zones, steps, strict=True):
            if its == step + 1:
                assert isinstance(zone.solid, Shell)
                in_zone = inside(zone.solid.triangles, cubes, f"zone '{zone.name}'")
                if not in_zone.any():
                    raise SceneError(f"zone '{zone.name}': the middle of no cube is in it; enlarge it")
                zone_masks[zone.grown] |= in_zone
        if finer is not None:
            x, y, z = (side // 2 for side in finer.shape)
            zone_masks[True] |= finer.reshape(x, 2, y, 2, z, 2).any(axis=(1, 3, 5))
        if zone_masks[True].any():
            zone_masks[True] = distance_transform_edt(~zone_masks[True]) <= body.horizon * (1 + SLACK)
        finer = zone_masks[True] | zone_masks[False]
        refined_masks.append(finer)
    return refined_masks[::-1]


def _level(
    surface: NDArray[np.float64], every: Cubes, cubes: Cubes, present: NDArray[np.bool_]
) -> tuple[Cubic, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Nodes of these cubes, and the places (k, 3) and volumes (k,) of material in cubes that are no nodes.

    `surface` are triangles (t, 3, 3), m, turned outward; `cubes` are a part of `every` cube.
    """
    solid, raw_share = inside(surface, cubes, "body", ON), shares(surface, cubes)
    share = np.clip(raw_share, 0.0, 1.0)
    off = np.abs(raw_share - share)
    if off.sum() > CROSSED * ((share > 0) & (share < FULL)).sum() + SLACK:
        place = ", ".join(f"{value:g}" for value in cubes.middles(np.argwhere(off == off.max())[:1])[0])
        raise SceneError(f"body: the surface crosses itself near ({place}) m; use the outside of one body")
    share[share > FULL] = 1.0  # whole cubes have one volume, to the last bit
    share[share < 1 - FULL] = 0.0
    is_node, is_lost = present & solid, present & ~solid & (share > 0)
    edge = np.zeros_like(is_node)
    around = np.pad(solid & (share > FULL), 1)
    for axis, way in itertools.product(range(3), (0, 2)):
        part = [slice(1, -1)] * 3
        part[axis] = slice(way, way + solid.shape[axis])
        edge |= ~around[tuple(part)]
    cube = cubes.spacing**3
    at, out = _places(is_node), _places(is_lost)
    node_index, thin = tuple(at.T), _thin(solid, cubes, every)
    level = Cubic(cubes, at, share[node_index] * cube, (edge | (share <= FULL))[node_index], thin[node_index])
    return level, (cubes.middles(out), share[tuple(out.T)] * cube)


def _places(cubes: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Which (k, 3) of the cubes (x, y, z) are in this mask, x fastest."""
    return np.argwhere(cubes.transpose())[:, ::-1]


def _thin(solid: NDArray[np.bool_], cubes: Cubes, every: Cubes) -> NDArray[np.bool_]:
    """Mask of a body's cubes that are not near a cube with three of them across; `solid` is on `cubes`, part of
    `every`."""
    from scipy.ndimage import binary_dilation, binary_erosion

    around = np.pad(solid, 1, mode="edge")
    first = np.rint((cubes.corner - every.corner) / cubes.spacing)
    for axis in range(3):  # beyond the box around the body there is none
        for end, outer in ((0, first[axis] == 0), (-1, first[axis] + cubes.size[axis] == every.size[axis])):
            if outer:
                around[(slice(None),) * axis + (end,)] = False
    block = np.ones((THINNEST,) * 3, dtype=bool)
    core = binary_erosion(around, block, border_value=1)
    near = binary_dilation(core, block, iterations=WEDGE)[1:-1, 1:-1, 1:-1]
    return np.asarray(solid & ~near)


def _given(body: Body, levels: list[Cubic], lost: list[tuple[NDArray[np.float64], NDArray[np.float64]]]) -> list[Cubic]:
    """Levels with the lost volumes added to the nearest nodes, and scaled to the body's.

    Raises SceneError if far off.
    """
    places, volumes = (np.concatenate(column) for column in zip(*lost, strict=True))
    volume = np.concatenate([level.volume for level in levels])
    full = np.concatenate([np.full(len(level.at), level.cubes.spacing**3) for level in levels])
    cut = volume < FULL * full
    if len(places):
        far, nearest = tree_of(np.concatenate([level.position for level in levels])).query(places, k=AROUND)
        alike = far <= far[:, :1] * (1 + ALIKE)  # all share, so that what is symmetric stays so
        added_volumes = np.broadcast_to((volumes / alike.sum(axis=1))[:, None], far.shape)
        np.add.at(volume, nearest[alike], added_volumes[alike])
        cut[nearest[alike]] = True
    missing, scaled = body.shell.volume - float(volume.sum()), float(volume[cut].sum())
    if abs(missing) > MISSED * max(scaled, 1e-9 * body.shell.volume):
        raise SceneError(
            f"body: its nodes fill {volume.sum():g} m^3 and its triangles enclose {body.shell.volume:g} m^3; use a"
            " surface that does not cross itself, or finer nodes"
        )
    if scaled > 0:
        volume[cut] *= 1 + missing / scaled
    parts = np.split(volume, np.cumsum([len(level.at) for level in levels])[:-1])
    return [level._replace(volume=part) for level, part in zip(levels, parts, strict=True)]


class Scattered(NamedTuple):
    """The n nodes of a body."""

    position: NDArray[np.float64]  # (n, 3) m
    delta: NDArray[np.float64]  # (n,) m
    volume: NDArray[np.float64]  # (n,) m^3
    border: NDArray[np.bool_]  # (n,) within a spacing of the surface

    @classmethod
    def of(cls, body: Body) -> Scattered:
        """The nodes that a body has. Raises SceneError for an adaptive method, whose nodes are on a lattice."""
        assert body.nodes is not None
        if body.run.adapt != "none":
            raise SceneError(f"run.adapt is {body.run.adapt}; use none for points on no lattice")
        position, delta = body.nodes.position, body.nodes.delta
        near = distances(position, body.shell.triangles, float(delta.max()))
        return cls(position, delta, body.nodes.volume, near < delta)

    def within(self, shell: Shell, place: str) -> NDArray[np.bool_]:
        """Mask (n,) of the nodes in a solid, or of rows of them; `place` is for other kinds of nodes."""
        if isinstance(shell, NodeSet):
            return np.isin(np.arange(len(self.position)), shell.rows)
        inside = np.zeros(len(self.position), dtype=bool)
        low, high = shell.bounds
        candidates = np.flatnonzero(((self.position >= low) & (self.position <= high)).all(axis=1))
        for rows in np.array_split(candidates, len(candidates) * len(shell.triangles) // AT_ONCE + 1):
            # the angle (k,) that the surface fills around each point (Van Oosterom and Strackee)
            a, b, c = (shell.triangles[None, :, corner] - self.position[rows][:, None] for corner in range(3))
            x, y, z = (np.linalg.norm(side, axis=2) for side in (a, b, c))
            over = np.einsum("ktd,ktd->kt", a, np.cross(b, c))
            under = x * y * z + x * np.einsum("ktd,ktd->kt", b, c)
            under += y * np.einsum("ktd,ktd->kt", a, c) + z * np.einsum("ktd,ktd->kt", a, b)
            inside[rows] = (
                np.abs(2 * np.arctan2(over, under).sum(axis=1)) > np.pi
            )  # 4 pi inside, 0 outside, on a face 2 pi
        return inside
