"""Bonds of bodies in tiles, made without a list, against the list of the same bonds."""

from __future__ import annotations

import dataclasses

import msgspec
import numpy as np
import pytest

from pdmesh import Body, Box, Cylinder, Material, Sphere
from pdmesh.drawing.solids import meshed
from pdmesh.grid.building import build
from pdmesh.model.document import Displacement, Region
from pdsolve.bonds.assembly import stiffness_bound
from pdsolve.model import Model
from pdsolve.operators.space_lattice import layout
from pdsolve.schemes import average_horizon
from pdsolve.schemes.cubic_lattice_bonds import tiled

GLASS = Material(E=65e9, rho=2235.0, G0=204.0, micromodulus="constant", plane="space")
ALIKE = msgspec.structs.replace(GLASS, E=130e9, G0=408.0)  # twice as stiff; it breaks at the same stretch
TOUGH = msgspec.structs.replace(GLASS, E=40e9, G0=408.0)
SOFT = msgspec.structs.replace(GLASS, law="bilinear", kr=3.0)
BLOCK = Box((0, 0, 0), (1.4, 1.2, 1.1))
CRACK = [[-0.1, -0.1, 0.52, 0.7, -0.1, 0.52, 0.7, 1.3, 0.61], [-0.1, -0.1, 0.52, 0.7, 1.3, 0.61, -0.1, 1.3, 0.61]]


def body(solid: object, material: Material = GLASS, ratio: float = 3.0) -> Model:
    found = build(meshed(Body(solid, 0.1, material, horizon=ratio)))  # type: ignore[arg-type]
    return Model(found.grid, found.settings)


def cracked(model: Model) -> Model:
    return Model(dataclasses.replace(model.grid, cracks=np.array(CRACK)), model.settings)


def changed(model: Model, **more: object) -> Model:
    return Model(model.grid, msgspec.structs.replace(model.settings, **more))


def uneven(model: Model) -> Model:
    """Cells between half and all of a cube, in no order, and nodes that are."""
    rng = np.random.default_rng(5)
    order, grid = rng.permutation(len(model.grid)), model.grid
    areas = grid.delta**3 * rng.uniform(0.5, 1.0, len(grid))
    columns = {name: getattr(grid, name)[order] for name in ("ids", "position", "delta", "border", "hole_id")}
    return Model(dataclasses.replace(grid, areas=areas, **columns), model.settings)


CASES = {
    "whole": lambda: body(BLOCK),
    "conical": lambda: body(BLOCK, msgspec.structs.replace(GLASS, micromodulus="conical")),
    "m = 2.4": lambda: body(BLOCK, ratio=2.4),
    "crack": lambda: cracked(body(BLOCK)),
    "void": lambda: body(BLOCK - Sphere((0.6, 0.6, 0.6), 0.28)),
    "bore and crack": lambda: cracked(body(BLOCK - Cylinder((0.7, -1, 0.5), (0.7, 2, 0.5), 0.21))),
    "corner": lambda: body(BLOCK - Box((0.8, -1, 0.5), (2, 2, 2))),
    "partial cells in no order": lambda: uneven(cracked(body(BLOCK))),
    "two moduli": lambda: changed(body(BLOCK), regions=(Region(material=ALIKE, box=(0, 0, 0, 0.6, 9, 9)),)),
    "two limits": lambda: changed(body(BLOCK), regions=(Region(material=TOUGH, box=(0, 0, 0, 0.6, 9, 9)),)),
    "softening": lambda: body(BLOCK, SOFT),
    "held": lambda: changed(body(BLOCK), conditions=(Displacement(box=(0, 0, 0, 0.2, 9, 9), x=0.0, breakable=False),)),
}


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
    source, target, slot = layout.intact(found.sites, found.tiles.bits, rows)
    assert np.array_equal(source, np.repeat(rows, np.diff(bonds.start)))
    assert np.array_equal(target, bonds.neighbour)
    xi, stiffness = layout.springs(found.tiles, found.sites, source, target, slot)
    assert np.abs(xi - bonds.xi).max() < 1e-12
    assert np.abs(stiffness / bonds.stiffness - 1).max() < 1e-12
    for one, other in zip(found.counted, listed.counted, strict=True):
        assert np.array_equal(one, other)
    assert np.abs(found.stiffness_bound / stiffness_bound(bonds, bonds.stiffness, True) - 1).max() < 1e-12
    tiles = found.tiles
    held, number = tiles.held[source] | tiles.held[target], model.material_of
    pair = number[source] * len(model.materials) + number[target]
    for table, column in ((tiles.peak, bonds.peak), (tiles.limit, bonds.limit)):
        assert np.allclose(np.where(held, np.inf, table[pair, slot]), column, rtol=1e-12, atol=0)


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
