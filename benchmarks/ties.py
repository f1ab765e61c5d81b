"""What a crack feels whose tip lies where bonds cross: these are ties, cut, or not, or those alone that lean one way.

Plates of unit width, nodes in the middle of their cells, m = 3; the crack is between two rows and ends between two
columns, half-way across. The tip is then on a bond and its mirror image, and on longer ones. That, and what a law does
at faces, are a part of a spacing of crack more or less.
"""

from __future__ import annotations

import dataclasses
import functools
from typing import NamedTuple
from unittest import mock

import msgspec
import numpy as np

from benchmarks.models import grid_of_nodes
from benchmarks.pages import markdown_table
from benchmarks.specimens import PULL, STATIC, UNIT, centre_shape, edge_shape
from pdmesh.model.document import Horizon, Load, Material, Settings
from pdmesh.model.lattice_calibration import calibration, lattice_ratios
from pdsolve.fracture.domain_integrals import Ring
from pdsolve.laws import MODELS, ordinary
from pdsolve.laws.law import Law
from pdsolve.measures.stress_intensities import follow_tip_intensities
from pdsolve.model import Model
from pdsolve.run.simulation import Options, simulate

SHORT = 3.0  # spacings: the horizon
ONE_WAY = "cut that lean one way"
TIES = {"cut": (0.0, 0.0), ONE_WAY: (1e-3, 0.0), "left": (0.0, 1e-3)}  # spacings by which the tip is across, and back
RING = Ring(0.2, 0.45)  # widths
BONDS = msgspec.structs.replace(UNIT, micromodulus="constant")
C11 = lattice_ratios(SHORT, "constant", "stress", True).c11 * calibration(SHORT, BONDS).stiffness  # over its mean
SOLID = msgspec.structs.replace(UNIT, plane="strain", nu=0.3, failure="none")
ORDINARY = msgspec.structs.replace(SOLID, model="ordinary", influence="constant")
LAWS = {
    "bonds": BONDS,
    "bonds, of C11": BONDS,
    "ordinary": ORDINARY,
    "ordinary, as published": ORDINARY,
    "correspondence, Breitzman-Dayal": msgspec.structs.replace(
        SOLID, model="correspondence", control="breitzman-dayal"
    ),
}
INDEPENDENT = {  # K1 of another code, in which round-off decides ties; in the order of LAWS
    ("edge", 40): (None, 1.0247, None, 1.0051, 1.0431),
    ("edge", 80): (None, 1.0157, None, 0.9990, 1.0197),
    ("centre", 40): (None, 1.0023, None, 0.9746, None),
}
SHOWN = {("edge", 40): tuple(TIES), ("edge", 80): ("cut", ONE_WAY), ("centre", 40): (ONE_WAY,)}


class Felt(NamedTuple):
    """K1 over the handbook's, K2 over K1."""

    K1: float
    leans: float


def published() -> Law:
    """The ordinary solid without what makes it exact at surfaces and on lattices."""
    return dataclasses.replace(ordinary.LAW, columns=functools.partial(ordinary.columns, corrected=False))


def felt(law: str, ties: str = "cut", kind: str = "edge", wide: int = 40) -> Felt:
    """A plate with a crack half-way across, pulled at its end rows."""
    model = _model(LAWS[law], ties, kind, wide)
    chosen = {"ordinary": published()} if "as published" in law else {}
    with mock.patch.dict(MODELS, chosen), simulate(model, None, Options(threads=1)) as results:
        (tip,) = follow_tip_intensities(results, [1], (0.5, 0.0), RING)
    K1, K2 = (float(tip.value[name][0]) for name in ("K1", "K2"))
    expected = PULL * np.sqrt(np.pi / 2) * {"edge": edge_shape, "centre": centre_shape}[kind](0.5)
    share = C11 if law == "bonds, of C11" else 1.0
    return Felt(float(share * K1 / expected), K2 / K1)


def table() -> str:
    """The table of docs/verification/stress_intensity.md on ties."""
    rows = []
    for (kind, wide), every in SHOWN.items():
        plate = f"{kind} crack, {wide} spacings"
        rows += [[plate, ties, *(f"{felt(law, ties, kind, wide).K1:.4f}" for law in LAWS)] for ties in every]
        rows.append([plate, "*another code*", *("" if K1 is None else f"{K1:.4f}" for K1 in INDEPENDENT[kind, wide])])
    return markdown_table(["plate", "ties", *LAWS], rows)


def _model(material: Material, ties: str, kind: str, wide: int) -> Model:
    """Three widths tall with an edge crack, four half widths with a centre crack, half a width being the unit then."""
    columns, rows = (wide, 3 * wide) if kind == "edge" else (2 * wide, 4 * wide)
    x, y = np.meshgrid(np.arange(columns) + 0.5, np.arange(rows) + 0.5 - rows / 2)
    position = np.column_stack([x.ravel() - (0 if kind == "edge" else wide), y.ravel()]) / wide
    half = rows / 2 / wide
    left = 0.0 if kind == "edge" else -1.0
    across, back = (part / wide for part in TIES[ties])
    end = 0.5 - back
    outline = np.array([[left, -half], [1.0, -half], [1.0, half], [left, half]])
    crack = (0.0 if kind == "edge" else -end, across, end, across)
    grid = grid_of_nodes(position, 1 / wide, [crack], outline=(outline,), areas=np.full(len(position), 1 / wide**2))
    inner = half - 1 / wide
    loads = (
        Load(box=(-2.0, inner, 2.0, half), body_force=(0.0, PULL * wide)),
        Load(box=(-2.0, -half, 2.0, -inner), body_force=(0.0, -PULL * wide)),
    )
    return Model(grid, Settings(material=material, horizon=Horizon(SHORT), conditions=loads, run=STATIC))
