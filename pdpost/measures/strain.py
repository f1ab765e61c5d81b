"""Strain and stress of the nodes: the gradient of the displacement fitted to each family's intact bonds.

The gradient H of a node is the weighted least squares fit of eta = H xi to its bonds, xi the bond and eta the
difference of the displacements, weighted by the neighbour's area over |xi|: exact where the displacement is affine,
at edges too. Strain is Green's, 1/2 (H + H^T + H^T H), which a piece that turns does not feel; stress is Hooke's with
it, for the Poisson's ratio that the model has. Cut and broken bonds do not count; a node whose bonds lie on a line, or
are all gone, has no strain: NaN.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.continuum import poisson
from pdmesh.model.document import Material, Region
from pdmesh.model.selection import selected
from pdmesh.model.trees import tree_of
from pdpost.reading.embedded import read
from pdpost.reading.stored import vector
from pdsolve.results import Families, Nodes, Results

BLOCK = 1 << 15  # nodes at a time, so that memory stays small
FLAT = 1e-6  # det / trace^2 of a family's shape below which its bonds lie on a line; a full family has 0.25


class _Materials(msgspec.Struct):
    """What is read of the grid file."""

    material: Material
    regions: tuple[Region, ...] = ()


def gradients(results: Results, step: int) -> NDArray[np.float64]:
    """The gradient (n, 2, 2) of the displacement of a frame, H[i, a, b] = du_a / dx_b; NaN where there is none.

    Raises ResultsError if the frame does not hold ux and uy.
    """
    families = intact(results, results.families(step), step)
    return fitted(results.nodes(step), vector(results, "displacement", step), families)


def fitted(nodes: Nodes, values: NDArray[np.float64], families: Families) -> NDArray[np.float64]:
    """The gradient (n, k, 2) of values (n, k) at the nodes, fitted to the bonds of `families`."""
    position, area = nodes.position, nodes.area
    start, neighbour = families
    found = np.full((len(position), values.shape[1], 2), np.nan)
    for first, last in _blocks(len(position)):
        near = neighbour[start[first] : start[last]]
        count = np.diff(start[first : last + 1])
        own = np.repeat(np.arange(last - first), count)
        x, y = (position[near] - np.repeat(position[first:last], count, axis=0)).T
        weight = area[near] / np.hypot(x, y)

        def total(product: NDArray[np.float64], own: NDArray[np.int64] = own, nodes: int = last - first) -> NDArray:  # type: ignore[type-arg]
            return np.bincount(own, product, minlength=nodes).astype(float)  # of none, bincount makes integers

        xx, xy, yy = total(weight * x * x), total(weight * x * y), total(weight * y * y)
        det = xx * yy - xy * xy
        flat = det <= FLAT * (xx + yy) ** 2
        det[flat] = np.nan
        for k in range(values.shape[1]):
            eta = weight * (values[near, k] - np.repeat(values[first:last, k], count))
            with_x, with_y = total(eta * x), total(eta * y)
            found[first:last, k, 0] = (with_x * yy - with_y * xy) / det
            found[first:last, k, 1] = (with_y * xx - with_x * xy) / det
    return found


def intact(results: Results, families: Families, step: int) -> Families:
    """The bonds of `families` that are not broken after `step`."""
    kept = ~broken(results, families, step)
    count = len(families.start) - 1
    row = np.repeat(np.arange(count), np.diff(families.start))
    start = np.concatenate([[0], np.cumsum(np.bincount(row[kept], minlength=count))])
    return Families(start, families.neighbour[kept])


def broken(results: Results, families: Families, step: int) -> NDArray[np.bool_]:
    """Whether each bond (b,) of `families` is broken after `step`, from its own node's side."""
    node, neighbour, _ = broken_ends(results, step)
    count = len(families.start) - 1
    torn = np.zeros(count, dtype=bool)
    torn[node] = True
    bonds = np.flatnonzero(np.repeat(torn, np.diff(families.start)))
    own = np.searchsorted(families.start, bonds, side="right") - 1
    gone = np.zeros(len(families.neighbour), dtype=bool)
    gone[bonds] = np.isin(own * count + families.neighbour[bonds], node * count + neighbour)
    return gone


def broken_ends(
    results: Results, step: int, earlier: bool = False
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Places (b,) among the nodes at `step` of both ends of the bonds broken until then, and their steps.

    Bonds that broke before the node they were of was born are in nobody's family any more: left out, unless `earlier`.
    """
    breaks, lives, rows = results.breaks(), results.lives(), results.rows(step)
    here = lives.at(breaks.node, step)
    there = lives.at(breaks.neighbour, step)
    found = (breaks.step <= step) & (here >= 0) & (there >= 0)
    if not earlier:
        found &= breaks.step >= lives.birth[here]
    return np.searchsorted(rows, here[found]), np.searchsorted(rows, there[found]), breaks.step[found]


def green(gradient: NDArray[np.float64]) -> NDArray[np.float64]:
    """Green's strain (n, 3), xx, yy, xy, of gradients (n, 2, 2) of the displacement."""
    (a, b), (c, d) = gradient.transpose(1, 2, 0)
    return np.column_stack(
        [a + (a * a + c * c) / 2, d + (b * b + d * d) / 2, (b + c + a * b + c * d) / 2],
    )


class Stiffness(NamedTuple):
    """What nodes are made of."""

    E: NDArray[np.float64]  # (n,) Young's modulus, Pa
    nu: NDArray[np.float64]  # (n,) Poisson's ratio of the material's model
    plane: str  # stress or strain


def hooke(strain: NDArray[np.float64], elastic: Stiffness) -> NDArray[np.float64]:
    """Stress (n, 4), xx, yy, xy, zz, Pa, of strains (n, 3)."""
    modulus, nu, plane = elastic
    xx, yy, xy = strain.T
    if plane == "stress":
        factor, out = modulus / (1 - nu**2), 0 * nu
        sxx, syy = factor * (xx + nu * yy), factor * (yy + nu * xx)
    else:
        factor, out = modulus / ((1 + nu) * (1 - 2 * nu)), nu
        sxx, syy = factor * ((1 - nu) * xx + nu * yy), factor * ((1 - nu) * yy + nu * xx)
    return np.column_stack([sxx, syy, modulus / (1 + nu) * xy, out * (sxx + syy)])


def thinning(strain: NDArray[np.float64], elastic: Stiffness) -> NDArray[np.float64]:
    """The strain (n,) across the plane, zz, that goes with strains (n, 3) in it."""
    nu = elastic.nu
    return (strain[:, 0] + strain[:, 1]) * (-nu / (1 - nu) if elastic.plane == "stress" else 0.0)


def stiffness(results: Results, step: int) -> Stiffness:
    """What the nodes at `step` are made of. Raises ResultsError.

    Nodes that were born later are of the material of the node of the start that is nearest.
    """
    model = read(results, _Materials)
    nodes = results.nodes(0)
    which = np.zeros(len(nodes.ids), dtype=np.int64)
    for number, region in enumerate(model.regions):
        which[selected(nodes, region.nodes, region.box)] = number + 1
    if results.epoch(step):
        which = which[tree_of(nodes.position).query(results.nodes(step).position)[1]]
    materials = (model.material, *(region.material for region in model.regions))
    E, nu = (np.array(each)[which] for each in zip(*((m.E, poisson(m)) for m in materials), strict=True))
    return Stiffness(E, nu, model.material.plane)


def _blocks(count: int) -> Iterator[tuple[int, int]]:
    for first in range(0, count, BLOCK):
        yield first, min(first + BLOCK, count)
