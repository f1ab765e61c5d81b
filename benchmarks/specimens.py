"""Cracked plates whose stress intensity a handbook has: models of unit width W and stiffness, with the formula.

Loads are tractions in plane stress: the classical intensities then do not depend on Poisson's ratio, and that of bonds
is as good as any. Cracks run between two rows of nodes and end between two columns.

Formulas: H. Tada, P. C. Paris, G. R. Irwin, The Stress Analysis of Cracks Handbook, 3rd edition, ASME 2000 (Tada);
ASTM E399, Standard Test Method for Plane-Strain Fracture Toughness (ASTM).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import msgspec
import numpy as np

from benchmarks.griffith import Griffith
from benchmarks.models import model_of
from pdmesh import Circle, Material, Run, Scene, Static, box
from pdmesh.model.document import Displacement
from pdmesh.model.material_constants import BONDS_NU
from pdsolve.fracture.fields import Elastic
from pdsolve.model import Model

WIDE = 80  # spacings of the width
HORIZON = 4.0  # spacings; with 3 the lattice is 5 % stiffer to stretch than to shear
RATIO = 0.5  # crack over width, but for a part of a spacing
STATIC = Run(solver="static", static=Static(load_steps=1, floating=True))
UNIT = Material(E=1.0, rho=1.0, G0=1e9)
PULL = 1e-6  # Pa: so small that nothing turns


class Case(NamedTuple):
    """A plate, and what the handbook says of its tips."""

    model: Model
    K1: float  # Pa m^0.5
    K2: float = 0.0


class Specimen(NamedTuple):
    """A kind of plate."""

    name: str
    source: str  # of the formula, and how good it is
    case: Callable[[int], Case]  # of so many spacings of width


def _length(wide: int, ratio: float = RATIO) -> float:
    """The crack nearest to a share of the width that ends half-way between two columns, in widths."""
    return (np.floor(ratio * wide) - 0.5) / wide


def _plate(wide: int, x0: float, x1: float, height: float) -> Scene:
    """A plate from x0 to x1, about `height` tall: an odd number of spacings, so that y = 0 is between two rows."""
    half = (np.floor(height * wide / 2) + 0.5) / wide
    return Scene(box(x0, -half, x1, half), 1 / wide, UNIT, HORIZON, STATIC)


def _pulled(scene: Scene, crack: float, shape: float) -> Case:
    """A plate pulled apart, its intensity that of its crack's length times a shape."""
    pulled = scene.load("top", traction=(0, PULL)).load("bottom", traction=(0, -PULL))
    return Case(model_of(pulled), PULL * np.sqrt(np.pi * crack) * shape)


def edge_shape(part: float) -> float:
    """K1 over sigma sqrt(pi a) of an edge crack that is a part of the width (Tada, 0.5 %)."""
    angle = np.pi * part / 2
    bent = (0.752 + 2.02 * part + 0.37 * (1 - np.sin(angle)) ** 3) / np.cos(angle)
    return float(np.sqrt(np.tan(angle) / angle) * bent)


def centre_shape(part: float) -> float:
    """K1 over sigma sqrt(pi a) of a centre crack that is a part of the width (Tada: secant, improved, 0.1 %)."""
    return float((1 - 0.025 * part**2 + 0.06 * part**4) / np.sqrt(np.cos(np.pi * part / 2)))


def edge(wide: int) -> Case:
    """A crack from one edge, pulled; the plate is three times as tall as wide."""
    a = _length(wide)
    return _pulled(_plate(wide, 0, 1, 3).crack([(0, 0), (a, 0)]), a, edge_shape(a))


def centre(wide: int) -> Case:
    """A crack in the middle, pulled."""
    a = _length(wide, RATIO / 2)  # half of it
    return _pulled(_plate(wide, -0.5, 0.5, 3).crack([(-a, 0), (a, 0)]), a, centre_shape(2 * a))


def double_edge(wide: int) -> Case:
    """Cracks from both edges, pulled."""
    a = _length(wide, RATIO / 2)
    part = 2 * a
    shape = (1.122 - 0.561 * part - 0.205 * part**2 + 0.471 * part**3 - 0.190 * part**4) / np.sqrt(1 - part)
    return _pulled(_plate(wide, 0, 1, 3).crack([(0, 0), (a, 0)]).crack([(1 - a, 0), (1, 0)]), a, shape)


def slanted(wide: int) -> Case:
    """A crack at 45 degrees, half as long as the plate is wide; around it, two horizons deep, the displacements of an
    infinite plate that is pulled are held."""
    exact, half = Griffith(Elastic(UNIT.E, BONDS_NU["stress"], "stress"), 45.0, syy=PULL), (wide - 1) / wide / 2
    a = RATIO / 2
    scene = Scene(box(-half, -half, half, half), 1 / wide, UNIT, HORIZON, STATIC)
    model = model_of(scene.crack([tuple(-a * exact.way), tuple(a * exact.way)]))
    grid = model.grid
    u = a * exact.displacement(grid.position / a)
    outer = np.abs(grid.position).max(axis=1) > half - 2 * HORIZON / wide
    prescribed = tuple(
        Displacement(nodes=(int(grid.ids[row]),), x=float(u[row, 0]), y=float(u[row, 1]))
        for row in np.flatnonzero(outer)
    )
    tip = exact.tip
    settings = msgspec.structs.replace(model.settings, conditions=prescribed)
    return Case(Model(grid, settings), float(np.sqrt(a) * tip.K1), float(np.sqrt(a) * tip.K2))


def compact_tension(wide: int) -> Case:
    """W is from the load line to the back; stiff discs are pulled at their middle, where the specimen has holes."""
    a = _length(wide)
    shape = (2 + a) * (0.886 + 4.64 * a - 13.32 * a**2 + 14.72 * a**3 - 5.6 * a**4) / (1 - a) ** 1.5
    scene = _plate(wide, -0.25, 1, 1.2).crack([(-0.25, 0), (a, 0)])
    steel = msgspec.structs.replace(UNIT, E=100.0)
    pin, small = (np.floor(0.275 * wide) + 0.5) / wide, 0.25 / wide
    for side in (1, -1):
        node = box(-small, side * pin - small, small, side * pin + small)
        force = (0, side * PULL * wide**2)  # over the cell of one node: PULL in N/m
        scene = scene.region(Circle(0, side * pin, 0.125), steel).load(node, body_force=force)
    return Case(model_of(scene), PULL * shape)


def three_point_bend(wide: int) -> Case:
    """A beam four times as long between its supports as it is deep; the crack comes from below."""
    a = _length(wide)
    shape = 3 * np.sqrt(a) * (1.99 - a * (1 - a) * (2.15 - 3.93 * a + 2.7 * a**2)) / (2 * (1 + 2 * a) * (1 - a) ** 1.5)
    half, width = (np.floor(2.1 * wide) + 0.5) / wide, 0.1
    scene = Scene(box(-half, 0, half, 1), 1 / wide, UNIT, HORIZON, STATIC).crack([(0, 0), (0, a)])
    for middle, y, push in ((0.0, 1.0, -PULL), (2.0, 0.0, PULL / 2), (-2.0, 0.0, PULL / 2)):
        line = [(middle - width / 2, y), (middle + width / 2, y)]
        scene = scene.load(line, traction=(0, push / width))
    return Case(model_of(scene), 4 * PULL * shape)


SPECIMENS = (
    Specimen("edge crack in tension", "Tada, 0.5 %", edge),
    Specimen("centre crack in tension", "Tada (secant, improved), 0.1 %", centre),
    Specimen("double-edge crack in tension", "Tada, 0.5 %", double_edge),
    Specimen("slanted crack, 45 degrees", "Tada, exact", slanted),
    Specimen("compact tension", "ASTM, 0.5 %", compact_tension),
    Specimen("three-point bend, span 4 W", "ASTM, 0.5 %", three_point_bend),
)
