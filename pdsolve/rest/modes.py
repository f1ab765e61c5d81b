"""Unsupported bodies: parts of a plate that can move rigidly, without a force from neighbours."""

from __future__ import annotations

from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.neighbours import connected

Pairs = tuple[NDArray[np.int64], NDArray[np.int64]]

LOOSE = 1e-9  # of the largest eigenvalue: a node whose bonds resist less than that in a direction may go there
FIXED = 1e-12  # of the largest, with turns scaled by the extent of what is held: less is round-off
BALANCED = 1e-6  # of the sum of all forces: a resultant less than that is none
FEW = 200  # directed bonds that break at once, beyond which a closer look takes no longer


class LooseBodies(NamedTuple):
    """Bodies and nodes that can move freely, of n nodes."""

    is_loose_node: NDArray[np.bool_]  # (n,) all that may
    description: str  # the largest of them in words: how many nodes, and where; empty where there is none
    body_number_of_node: NDArray[np.int64]  # (n,) number of the body that a node belongs to


def find_loose_bodies(
    position: NDArray[np.float64], ids: NDArray[np.int64], bonds: Pairs, constrained: NDArray[np.bool_]
) -> LooseBodies:
    """Bodies with too few supports, and nodes whose bonds lie in one line, in space in one plane.

    `position` (n, d) m, `bonds` the rows (b,) of both nodes of intact bonds, `constrained` (n, d) components. A body of
    one node needs no rotation held; in space, a row of nodes needs none about itself.
    """
    source, target = bonds
    nodes = len(position)
    part = connected(nodes, source, target)
    size = np.bincount(part)
    missing = _find_unsupported_bodies(position, part, size, constrained)
    swinging = (
        _find_nodes_with_collinear_or_coplanar_bonds(position[target] - position[source], source, constrained)
        & ~missing[part]
    )
    is_loose_node = missing[part] | swinging
    if not is_loose_node.any():
        return LooseBodies(is_loose_node, "", part)
    if missing.any():
        number = int(np.flatnonzero(missing)[size[missing].argmax()])
        body_nodes = part == number
        what = "the whole plate" if size[number] == nodes else f"a body of {size[number]} nodes"
        others = int(missing.sum()) - 1
        more = f", and {others} more" if others else ""
    else:
        body_nodes, what, more = swinging, f"{int(swinging.sum())} nodes that bonds hold in one direction only", ""
    unsupported_axes = [
        axis for axis, any_node in zip("xyz", constrained[body_nodes].any(axis=0), strict=False) if not any_node
    ]
    if missing.any() and not unsupported_axes:
        free = "turn"
    elif missing.any() and len(unsupported_axes) < position.shape[1]:
        free = f"move along {' and '.join(unsupported_axes)}"
    else:
        free = "move"
    return LooseBodies(
        is_loose_node,
        f"{what} around {_format_centre(position[body_nodes])} (node {ids[body_nodes][0]}) can {free}{more}",
        part,
    )


def _format_centre(position: NDArray[np.float64]) -> str:
    """Centre of some places (k, d), in words."""
    return f"({', '.join(f'{value:.4g}' for value in position.mean(axis=0))}) m"


def _rotation_modes(position_from_centre: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacements of places (n, d), relative to a centre, in a rotation about each axis (n, d, 1 in the plane or
    3)."""
    if position_from_centre.shape[1] == 2:
        return np.stack([-position_from_centre[:, 1], position_from_centre[:, 0]], axis=1)[:, :, None]
    return np.stack([np.cross(axis, position_from_centre) for axis in np.eye(3)], axis=2)


def _find_unsupported_bodies(
    position: NDArray[np.float64],
    body_number_of_node: NDArray[np.int64],
    body_size: NDArray[np.int64],
    constrained: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """Mask (p,) of bodies whose supports leave a rigid motion free: a translation, or a rotation.

    Rotations are about the centre of the supported nodes and scaled by their extent, so that a support counts by the
    number of its nodes and not by how far the body reaches from it.
    """
    count, supported = len(body_size), constrained.any(axis=1)
    # All nodes of bodies of which none is supported
    rows = supported | ~np.bincount(body_number_of_node, supported, count).astype(bool)[body_number_of_node]
    inside = np.maximum(np.bincount(body_number_of_node[rows], minlength=count), 1)
    centre = np.stack(
        [np.bincount(body_number_of_node[rows], column[rows], count) / inside for column in position.T], axis=1
    )
    arm = position - centre[body_number_of_node]
    square = (arm**2).sum(axis=1)
    extent, reach = (np.sqrt(np.bincount(body_number_of_node, square * mask, count) / inside) for mask in (rows, True))
    scale = np.where(extent > 0, extent, np.where(reach > 0, reach, 1.0))
    arm = arm / scale[body_number_of_node][:, None]
    n, d = arm.shape
    # Translations and rotations
    modes = np.concatenate([np.broadcast_to(np.eye(d), (n, d, d)), _rotation_modes(arm)], axis=2)
    resistance = _gram_matrices_of_bodies(modes, constrained, body_number_of_node, count)
    free = _are_singular(resistance)
    if free.any():  # unless the motion moves nothing: a turn of one node, or of a row of nodes about itself
        values, vectors = np.linalg.eigh(
            _gram_matrices_of_bodies(
                modes, free[body_number_of_node][:, None] & np.ones_like(constrained), body_number_of_node, count
            )
        )
        still = vectors * (values <= FIXED * values[:, -1:])[:, None, :]
        free &= _are_singular(resistance + still @ still.transpose(0, 2, 1))
    return free


def _gram_matrices_of_bodies(
    modes: NDArray[np.float64],
    is_counted_component: NDArray[np.bool_],
    body_number_of_node: NDArray[np.int64],
    body_count: int,
) -> NDArray[np.float64]:
    """Products (count, m, m) of the modes (n, d, m) of each body, summed over the counted components."""
    rows = is_counted_component.any(axis=1)
    body_of_row, row_modes = body_number_of_node[rows], modes[rows] * is_counted_component[rows][:, :, None]
    products = np.empty((body_count, modes.shape[2], modes.shape[2]))
    for a, b in combinations_with_replacement(range(modes.shape[2]), 2):
        products[:, a, b] = products[:, b, a] = np.bincount(
            body_of_row, (row_modes[:, :, a] * row_modes[:, :, b]).sum(axis=1), body_count
        )
    return products


def _are_singular(gram: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Mask (p,) of matrices (p, m, m), symmetric and not negative, that are singular but for round-off."""
    values = np.linalg.eigvalsh(gram)
    return np.asarray(values[:, 0] <= FIXED * np.maximum(values[:, -1], 1e-300))


def _find_nodes_with_collinear_or_coplanar_bonds(
    xi: NDArray[np.float64], source: NDArray[np.int64], constrained: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Mask (n,) of free nodes with all their bonds xi (b, d) in one line, in space in one plane."""
    nodes = len(constrained)
    n = xi / np.sqrt((xi**2).sum(axis=1))[:, None]
    if n.shape[1] == 3:
        sums = np.empty((nodes, 3, 3))
        for a, b in combinations_with_replacement(range(3), 2):
            sums[:, a, b] = sums[:, b, a] = np.bincount(source, n[:, a] * n[:, b], minlength=nodes)
        sums[:, range(3), range(3)] += constrained
        values = np.linalg.eigvalsh(sums)
        return np.asarray(values[:, 0] <= LOOSE * values[:, -1])
    xx, xy, yy = (
        np.bincount(source, terms, minlength=nodes) for terms in (n[:, 0] ** 2, n[:, 0] * n[:, 1], n[:, 1] ** 2)
    )
    xx, yy = xx + constrained[:, 0], yy + constrained[:, 1]
    middle, half = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    return np.asarray(middle - half <= LOOSE * (middle + half))


def describe_unbalanced_body(
    position: NDArray[np.float64], force: NDArray[np.float64], loose_bodies: LooseBodies
) -> str:
    """The first loose body whose forces (n, 2), N/m, have a resultant or a moment, in words; "" if all balance."""
    for number in np.unique(loose_bodies.body_number_of_node[loose_bodies.is_loose_node]).tolist():
        body_nodes = loose_bodies.body_number_of_node == number
        arm = position[body_nodes] - position[body_nodes].mean(axis=0)
        push, reach = force[body_nodes], float(np.sqrt((arm**2).sum(axis=1).max()))
        moment = float(np.abs(np.einsum("nij,ni->j", _rotation_modes(arm), push)).max())
        most = float(np.abs(push).sum())
        if np.abs(push.sum(axis=0)).max() > BALANCED * most or moment > BALANCED * most * reach:
            return f"a body of {int(body_nodes.sum())} nodes around {_format_centre(position[body_nodes])}"
    return ""


class SupportChecker:
    """Bonds (b,) of bodies that are supported, of which some break: those without which they surely stay so.

    A bond between nodes that are both joined to a third one parts no body, and a node whose other bonds resist in all
    directions does not swing.
    """

    def __init__(
        self, position: NDArray[np.float64], bonds: Pairs, constrained: NDArray[np.bool_], intact: NDArray[np.bool_]
    ) -> None:
        """`position` (n, d) m, `bonds` in the order of their source, `constrained` (n, d) components, `intact` (b,)."""
        self._position, self._held, self._intact = position, constrained, intact
        self._source, self._target = bonds
        self._start = np.searchsorted(self._source, np.arange(len(position) + 1))

    def update_bonds_if_bodies_stay_supported(self, intact: NDArray[np.bool_]) -> bool:
        """Whether bodies are surely supported with these `intact` (b,), as with those before; if not, or where that
        takes a closer look, nothing changes."""
        broken = np.flatnonzero(self._intact & ~intact)
        if len(broken) > FEW or (intact & ~self._intact).any():
            return False
        source, target = self._source[broken], self._target[broken]
        rows = np.union1d(source, target)
        bond_numbers = [np.arange(self._start[row], self._start[row + 1]) for row in rows.tolist()]
        intact_numbers = [numbers[intact[numbers]] for numbers in bond_numbers]
        near = {row: self._target[numbers] for row, numbers in zip(rows.tolist(), intact_numbers, strict=True)}
        if not all(np.isin(near[i], near[j]).any() for i, j in zip(source.tolist(), target.tolist(), strict=True)):
            return False
        numbers = np.concatenate([broken[:0], *intact_numbers])
        row_of_bond = np.repeat(np.arange(len(rows)), [len(row_numbers) for row_numbers in intact_numbers])
        xi = self._position[self._target[numbers]] - self._position[self._source[numbers]]
        if _find_nodes_with_collinear_or_coplanar_bonds(xi, row_of_bond, self._held[rows]).any():
            return False
        self._intact = intact
        return True
