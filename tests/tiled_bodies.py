"""Bodies of cubic cells whose bonds are in tiles: whole and cracked, with voids, of two materials, that soften."""

from __future__ import annotations

import dataclasses

import msgspec
import numpy as np

from pdmesh import Body, Box, Cylinder, Material, Sphere
from pdmesh.drawing.building import meshed
from pdmesh.grid.building import build
from pdmesh.model.document import Displacement, Region
from pdsolve.model import Model

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
