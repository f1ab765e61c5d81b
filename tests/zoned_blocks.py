"""Bodies with a fine zone of any shape, and a cracked block, to ask questions of."""

from __future__ import annotations

import warnings

import msgspec
import numpy as np
from numpy.typing import NDArray

import pdmesh
from pdmesh import Body, Box, Material, Run, ramp
from pdsolve.adaptivity.hybrid.space.layout import FullBody
from pdsolve.adaptivity.hybrid.space.operator import HybridBodyOperator
from pdsolve.adaptivity.hybrid.space.prepare import create_full_block, create_operator_of_cells
from pdsolve.laws.pair_laws.brittle import LAW
from pdsolve.model import Model
from pdsolve.run.system import PreparedRun
from pdsolve.zone.cells import COARSE, FINE, VOID, lattice_coordinates

SMALL = 1e-7  # strain
GLASS = Material(E=65e9, rho=2235, G0=204, micromodulus="constant")
LENGTH, WIDTH, HEIGHT, H = 0.024, 0.008, 0.02, 5e-4  # m


def blob(bonds: NDArray[np.float64], side: int, margin: int, tau: float) -> HybridBodyOperator:
    """A block of `side` cells along each edge; half of those `margin` off its faces are fine, at random."""
    return at_random(create_full_block(LAW, bonds, 1.0, (side, side, side)), margin, tau)


def at_random(whole: FullBody, margin: int, tau: float) -> HybridBodyOperator:
    """A body; half of its cells `margin` off the faces of its box are fine, at random."""
    numbering, some = whole.fine_lattice.numbering.cells, np.random.default_rng(1)
    cells = np.full(numbering.counts[::-1], COARSE, dtype=np.uint8)
    inner = cells[(slice(margin, -margin),) * 3]
    inner[:] = np.where(some.random(inner.shape) < 0.5, FINE, COARSE)
    return create_operator_of_cells(whole, np.pad(cells, numbering.margins[0], constant_values=VOID).ravel(), tau)


def zone_operator(problem: PreparedRun) -> HybridBodyOperator:
    """The operator of the body of a run."""
    assert isinstance(problem.system.operator, HybridBodyOperator)
    return problem.system.operator


def place(operator: HybridBodyOperator) -> NDArray[np.float64]:
    """Where nodes (n, 3) are, in spacings."""
    numbering = operator.engine.full_body.fine_lattice.numbering
    return np.column_stack(lattice_coordinates(numbering.fine, operator.places)).astype(float)


def block(adapt: str, steps: int = 168, other: Material | None = None) -> Model:
    """A block with a crack of two triangles from its left face, pulled apart by its upper and lower ones; its right
    half is of an `other` material, if there is one.

    Its nodes lie on its faces, however it is solved.
    """
    x, y, z = LENGTH / 2, WIDTH / 2, HEIGHT / 2
    corners = [(-1.1 * x, -1.1 * y), (-x / 3, -1.1 * y), (-x / 3, 1.1 * y), (-1.1 * x, 1.1 * y)]
    flat = [(a, b, 0.52 * H) for a, b in corners]
    run = Run(steps=steps, every=steps // 4, ledger=8, time_step=1.05e-7)
    body = Body(Box((-x, -y, -z), (x, y, z)), H, GLASS, run=run).adapt("hybrid")
    body = body.crack([[flat[0], flat[1], flat[2]], [flat[0], flat[2], flat[3]]])
    if other is not None:
        body = body.region(Box((0.0, -2 * y, -2 * z), (2 * x, 2 * y, 2 * z)), other, "other")
    for side, speed in (("top", 0.45), ("bottom", -0.45)):
        body = body.move(side, velocity=(None, None, speed), rows=3, profile=ramp(2e-6))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        built = pdmesh.build(body)
    settings = msgspec.structs.replace(built.settings, run=msgspec.structs.replace(run, adapt=adapt))
    return Model(built.grid, settings)
