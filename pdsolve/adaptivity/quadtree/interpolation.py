"""Initial values of new nodes by linear interpolation, and the change of energy.

A field f of a node that splits becomes f_p + grad f . d in its quarters, at distance d. For velocities and
accelerations, d is measured from the quarters' centre of mass, so that momentum is conserved to round-off; in a whole
cell this is its centre. Quarters that merge keep the sum of their momenta. With mass m, spacing D and velocity v

    a node that splits gains   m D^2 |grad v|^2 / 32   of kinetic energy
    quarters that merge lose   sum m_i |v_i - v|^2 / 2

Gradients are least-squares fits to the family's unbroken bonds, dominated by the nearest neighbours (weight: the
neighbour's cell over the fourth power of the distance).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdsolve.adaptivity.quadtree.leaf_mapping import LeafOrigins
from pdsolve.bonds.assembly import Bonds
from pdsolve.state import State

FLAT = 1e-6  # of the largest possible determinant: neighbours in one line give no gradient


def field_gradients(
    bonds: Bonds, intact: NDArray[np.bool_], rows: NDArray[np.int64], *fields: NDArray[np.float64]
) -> list[NDArray[np.float64]]:
    """Gradient (k, w, 2) of each field (n, w) at these rows (k,); 0 if a node has too few neighbours."""
    row_number, number = bonds.of_rows(rows)
    row_number, number = row_number[intact[number]], number[intact[number]]
    xi, neighbour = bonds.xi[number], bonds.neighbour[number]
    weight = bonds.weight[number] / (xi**2).sum(axis=1) ** 2

    def total(bond_values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.bincount(row_number, bond_values, minlength=len(rows)), dtype=np.float64)

    xx, xy, yy = (total(weight * xi[:, a] * xi[:, b]) for a, b in ((0, 0), (0, 1), (1, 1)))
    determinant = xx * yy - xy * xy
    enough = determinant > FLAT * (xx + yy) ** 2
    scale = np.where(enough, 1 / np.where(enough, determinant, 1.0), 0.0)
    field_gradients = []
    for field in fields:
        gradient = np.zeros((len(rows), field.shape[1], 2))
        for w in range(field.shape[1]):
            rise = weight * (field[neighbour, w] - field[rows[row_number], w])
            x, y = total(rise * xi[:, 0]), total(rise * xi[:, 1])
            gradient[:, w, 0], gradient[:, w, 1] = scale * (yy * x - xy * y), scale * (xx * y - xy * x)
        field_gradients.append(gradient)
    return field_gradients


def interpolate_state(state: State, origins: LeafOrigins, bonds: Bonds, intact: NDArray[np.bool_]) -> State:
    """The state of the new nodes, from that of the old nodes with these bonds."""
    fields = (state.value, state.rate, state.second)
    means = [(origins.mass_shares[..., None] * field[origins.origin_rows]).sum(axis=1) for field in fields]
    stays = origins.is_unchanged
    for mean, field in zip(means, fields, strict=True):
        mean[stays] = field[origins.origin_rows[stays, 0]]
    split, merged = (
        (origins.mass_shift, origins.quarter_offset, origins.quarter_offset),
        (origins.mass_shift, None, None),
    )
    for which, ways in ((origins.is_quarter, split), (origins.is_merged, merged)):
        new_rows = np.flatnonzero(which & origins.mass_shift.any(axis=1))
        rows, at = np.unique(origins.origin_rows[new_rows], return_inverse=True)
        gradients = field_gradients(bonds, intact, rows, *fields)
        for mean, gradient, way in zip(means, gradients, ways, strict=True):
            if way is not None:
                share = origins.mass_shares[new_rows][..., None, None] * gradient[at.reshape(len(new_rows), 4)]
                mean[new_rows] += np.einsum("kwa,ka->kw", share.sum(axis=1), way[new_rows])
    sums = (
        np.where(
            stays, energy[origins.origin_rows[:, 0]], (origins.mass_shares * energy[origins.origin_rows]).sum(axis=1)
        )
        for energy in (state.dissipated, state.work, state.damped)
    )
    u, v, a = means
    return State(u, v, a, *sums)
