"""The bonds of the patch that a family's cost in space is measured on."""

from __future__ import annotations

import numpy as np
from plates import GLASS

from pdsolve.schemes.separation_energy import bonds_in_space, patch_in_space

BESIDE = np.vstack([np.eye(3), -np.eye(3), [[1.0, 1.0, 0.0], [-1.0, 0.0, 1.0]]])


def test_bonds_go_round_along_the_crack_and_end_across_it() -> None:
    """Three nodes a side along the plane, four layers: a bond leads where its vector says, a period away or not."""
    model = patch_in_space(GLASS, 1.0)
    position = model.grid.position
    assert (len(position), np.ptp(position, axis=0).tolist()) == (3 * 3 * 4, [2, 2, 3])
    weight = np.arange(1.0, 1 + len(BESIDE))
    bonds = bonds_in_space(model, BESIDE, weight, 0.5)
    source = np.repeat(np.arange(len(position)), np.diff(bonds.start))
    beyond = position[source] + bonds.xi - position[bonds.neighbour]
    assert np.isin(beyond[:, :2], (-3, 0, 3)).all()
    assert (beyond[:, 2] == 0).all()
    stays, climbs = BESIDE[:, 2] == 0, BESIDE[:, 2] != 0
    assert len(source) == 36 * stays.sum() + 27 * climbs.sum()
    assert len(set(zip(source.tolist(), bonds.neighbour.tolist(), strict=True))) == len(source)
    for xi, one in zip(BESIDE, weight, strict=True):
        assert set(bonds.weight[(bonds.xi == xi).all(axis=1)]) == {one}
    assert set(bonds.limit) == {0.5}
