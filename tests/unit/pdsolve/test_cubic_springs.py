"""Bonds of bodies in tiles, made without a list, against the list of the same bonds."""

from __future__ import annotations

import dataclasses

import msgspec
import numpy as np
import pytest
from tiled_bodies import BLOCK, CASES, GLASS, body, changed, cracked

from pdmesh import Box
from pdmesh.model.document import Region
from pdsolve.bonds.assembly import stiffness_bound
from pdsolve.lattice import tile_bonds
from pdsolve.model import Model
from pdsolve.schemes import average_horizon
from pdsolve.schemes.cubic_lattice_bonds import tiled


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name == "void" else ()) for name in CASES]
)
def test_tiles_have_the_bonds_of_the_list(name: str) -> None:
    """Which there are, their stiffness, what is counted of them and the bound; measured 2e-14 and less."""
    model = CASES[name]()
    listed, found = average_horizon.fill(model).whole(), tiled(model, np.float64)
    assert found is not None
    bonds, rows = listed.bonds, np.arange(len(model.grid))
    source, target, slot = tile_bonds.list_bonds(found.sites, found.tiles.bits, rows)
    assert np.array_equal(source, np.repeat(rows, np.diff(bonds.start)))
    assert np.array_equal(target, bonds.neighbour)
    xi, stiffness = tile_bonds.springs_of_bonds(found.tiles, found.sites, source, target, slot)
    assert np.abs(xi - bonds.xi).max() < 1e-12
    assert np.abs(stiffness / bonds.stiffness - 1).max() < 1e-12
    for one, other in zip(found.counted, listed.counted, strict=True):
        assert np.array_equal(one, other)
    assert np.abs(found.stiffness_bound / stiffness_bound(bonds, bonds.stiffness, True) - 1).max() < 1e-12
    tiles = found.tiles
    held, number = tiles.unbreakable[source] | tiles.unbreakable[target], model.material_of
    pair = number[source] * len(model.materials) + number[target]
    for table, column in ((tiles.peak, bonds.peak), (tiles.limit, bonds.limit)):
        assert np.allclose(np.where(held, np.inf, table[pair, slot]), column, rtol=1e-12, atol=0)


@pytest.mark.process
def test_nodes_with_whole_families_are_not_corrected() -> None:
    """To the last bit, so that their tiles are those of the fast loop; all others are corrected."""
    model = body(Box((0, 0, 0), (1.2, 1.2, 1.2)))
    tiles, sites, *_ = tiled(model, np.float64)  # type: ignore[misc]
    is_whole = (np.abs(model.grid.position - 0.6) < 0.3).all(axis=1)
    is_corrected = (tiles.c[:, sites.site] != 1).any(axis=0)
    assert is_whole.sum() == 6**3
    assert np.array_equal(is_corrected, ~is_whole)


@pytest.mark.process
def test_what_tiles_cannot_have_is_listed() -> None:
    """Stiffnesses that fall differently with distance, a crack that bonds go round, two spacings."""
    block = body(BLOCK)
    conical = Region(material=msgspec.structs.replace(GLASS, micromodulus="conical"), box=(0, 0, 0, 0.6, 9, 9))
    assert tiled(changed(block, regions=(conical,)), np.float64) is None
    around = changed(cracked(block), material=msgspec.structs.replace(GLASS, sight="diffraction"))
    assert tiled(around, np.float64) is None
    delta = np.where(block.grid.position[:, 0] < 0.5, 0.1, 0.1001)
    assert tiled(Model(dataclasses.replace(block.grid, delta=delta), block.settings), np.float64) is None
