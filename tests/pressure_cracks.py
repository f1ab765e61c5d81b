"""A crack under pressure in a plate whose outer nodes move as in an infinite plate (I. N. Sneddon, 1946)."""

from __future__ import annotations

import msgspec
import numpy as np
import shapely
from numpy.typing import NDArray
from sneddon import displacements

from pdmesh import Body, Box, Material, Run, Scene, box, build
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

E, NU, P, A = 70e9, 1 / 3, 1e7, 0.01  # Pa, -, Pa, m: half the length of the crack, or its radius
MATERIAL = Material(E=E, rho=2500, G0=1e9, micromodulus="conical")
HALF = 3.0  # A: half the width of the plate
GRIPPED = 3.6  # spacings of it


def exact_of_line(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacements (n, 2) around a line crack in plane stress."""
    z, kappa, G = x + 1j * np.abs(y), (3 - NU) / (1 + NU), E / (2 * (1 + NU))
    root = np.sqrt(z - A) * np.sqrt(z + A)
    force, stress = P * (root - z), P * (z / root - 1)
    along = (kappa - 1) / 2 * force.real - np.abs(y) * stress.imag
    across = (kappa + 1) / 2 * force.imag - np.abs(y) * stress.real
    return np.column_stack([along, np.sign(y) * across]) / (2 * G)


def opening_of_line(position: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places along the crack (n,) and exact displacements (n, 2)."""
    return position[:, 0], exact_of_line(*position.T)


def line_crack(fineness: int, half: float = HALF) -> Scene:
    """A plate with so many spacings in half the crack."""
    h = A / fineness
    end = half * A + h / 2
    inside = end - GRIPPED * h
    frame = shapely.difference(box(-end, -end, end, end), box(-inside, -inside, inside, inside))
    plate = Scene(box(-end, -end, end, end), h, MATERIAL, run=Run(solver="static"))
    plate = plate.crack([(-A, 0), (A, 0)], "slit").load("crack slit", pressure=P)
    return plate.fix(frame, *(lambda x, y, k=k: float(exact_of_line(np.array(x), np.array(y))[0, k]) for k in (0, 1)))


def solved(scene: Scene | Body) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Places and displacements (n, d) of the nodes of a scene at rest."""
    built = build(scene)
    run = prepare(Model(built.grid, built.settings), Options(threads=1))
    run.advance(1, 1 + run.system.model.settings.run.steps)
    return built.grid.position, run.state.value


def exact_of_penny(position: NDArray[np.float64]) -> NDArray[np.float64]:
    """Displacements (n, 3) around a penny-shaped crack in z = 0 in a body of bonds, whose Poisson's ratio is 1/4."""
    off_axis = position + np.array([1e-9 * A, 0, 0])
    pulled = position * np.array([-0.25, -0.25, 1.0]) / E
    return P * (displacements(off_axis, A, E, 0.25) - pulled)


def penny(fineness: int, half: float) -> Body:
    """A cube of half-width `half` A with a disc of radius A, so many spacings, between its nodes."""
    h, around = A / fineness, np.linspace(0, 2 * np.pi, 97)
    end = half * A
    rim = A * np.column_stack([np.cos(around), np.sin(around), 0 * around])
    disc = np.array([(np.zeros(3), rim[k], rim[k + 1]) for k in range(96)])
    material = msgspec.structs.replace(MATERIAL, micromodulus="constant")
    body = Body(Box((-end, -end, -end), (end, end, end)), h, material, run=Run(solver="static"))
    body = body.crack(disc, "disc").load("crack disc", pressure=P)
    inner = end - GRIPPED * h
    outside = Box((-end, -end, -end), (end, end, end)) - Box((-inner, -inner, -inner), (inner, inner, inner))
    ways = [lambda *x, k=k: float(exact_of_penny(np.array([x]))[0, k]) for k in range(3)]
    return body.fix(outside, *ways)
