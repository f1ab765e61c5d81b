"""State-based families of bodies in tiles, beside the same in a list."""

from __future__ import annotations

import warnings
from functools import cache
from typing import Any

import msgspec
import numpy as np
import pytest
from numpy.typing import NDArray

from pdmesh import Body, Box, Cylinder, Material, build
from pdmesh.model.document import InitialVelocity, Region, Run
from pdsolve.lattice.family_operator import FamilyLattice
from pdsolve.model import Model
from pdsolve.operators.bond_list import BondList
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun

H = 1e-3  # m
GLASS = Material(E=65e9, rho=2235.0, G0=2.0, micromodulus="constant", plane="space", model="ordinary", nu=0.2)
CORNERS = [(-H, -H, 4 * H), (6 * H, -H, 4 * H), (6 * H, 10 * H, 4 * H), (-H, 10 * H, 4 * H)]


@cache
def body(failure: str = "stretch") -> Model:
    """A block of 16 x 9 x 8 cells with a round hole, whose cells are partial, and a crack; its right is stiffer."""
    glass = msgspec.structs.replace(GLASS, failure=failure)
    shape = Box((0, 0, 0), (16 * H, 9 * H, 8 * H)) - Cylinder((10 * H, 4 * H, -H), (10 * H, 4 * H, 9 * H), 2.2 * H)
    scene = Body(shape, H, glass, 3.0, Run(steps=30, every=30))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        made = build(scene.crack([[CORNERS[0], *CORNERS[k : k + 2]] for k in (1, 2)]))
    stiff = Region(material=msgspec.structs.replace(glass, E=100e9, G0=4.0), box=(13 * H, -1, -1, 1, 1, 1))
    apart = tuple(InitialVelocity(box=(-1, -1, z, 5 * H, 1, z + 1), z=v) for z, v in ((4 * H, 4.0), (4 * H - 1, -4.0)))
    settings = msgspec.structs.replace(made.settings, regions=(stiff,), conditions=apart)
    return Model(made.grid, settings)


def prepared(kernel: str | None, precision: str = "float64", threads: int = 1, failure: str = "stretch") -> PreparedRun:
    """The body, in a list or in tiles."""
    found = prepare(body(failure), Options(kernel=kernel, precision=precision, threads=threads))
    assert type(found.system.operator) is (BondList if kernel == "listed" else FamilyLattice)
    return found


def forces(of: PreparedRun, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Force densities (n, 3) at displacements u (n, 3), N/m^3; nothing breaks."""
    kind, operator = of.state.value.dtype, of.system.operator
    out = np.zeros(u.shape, kind)
    operator.accumulate_force(of.state._replace(value=u.astype(kind)), out, 0, 0.0)
    return out.astype(float)


def shaken(size: float, of: PreparedRun) -> NDArray[np.float64]:
    """Displacements (n, 3) of nodes, m."""
    return np.asarray(size * H * np.random.default_rng(1).uniform(-1, 1, (len(of.system.area), 3)))


@pytest.fixture(scope="module")
def pair() -> tuple[PreparedRun, PreparedRun]:
    return prepared("listed"), prepared(None)


@pytest.mark.slow
@pytest.mark.parametrize("size", [1e-8, 1e-4, 0.05])
def test_forces_are_those_of_the_list(pair: tuple[PreparedRun, PreparedRun], size: float) -> None:
    """Measured: 5e-16, 4e-16 and 4e-16 of the largest; the last have bonds beyond the polynomials. Net: 1e-17."""
    listed, tiles = (forces(one, shaken(size, one)) for one in pair)
    assert np.abs(tiles - listed).max() < 1e-14 * np.abs(listed).max()
    volume = pair[1].system.area[:, None]
    assert np.abs((volume * tiles).sum(axis=0)).max() < 1e-15 * np.abs(volume * tiles).sum()


@pytest.mark.slow
def test_in_single_precision(pair: tuple[PreparedRun, PreparedRun]) -> None:
    """Measured: 2.5e-7 of the largest."""
    single, u = prepared(None, "float32"), shaken(1e-4, pair[0])
    listed = forces(pair[0], u.astype(np.float32).astype(float))
    assert np.abs(forces(single, u) - listed).max() < 1e-6 * np.abs(listed).max()


def marched(of: PreparedRun, steps: int) -> tuple[NDArray[np.int64], ...]:
    of.advance(1, steps + 1)
    return tuple(of.system.operator.broken())


@pytest.mark.slow
@pytest.mark.parametrize("failure", ["stretch", "energy"])
def test_the_same_bonds_break(failure: str) -> None:
    """The block tears from its crack. Measured: displacements within 5e-16, spent energies 1e-14 of the largest."""
    of = [prepared(kernel, failure=failure) for kernel in ("listed", None)]
    listed, tiles = (marched(one, 30) for one in of)
    assert len(listed[0]) > 10_000
    assert all(map(np.array_equal, listed, tiles))
    u, other = (one.state.value for one in of)
    assert np.abs(u - other).max() < 1e-13 * np.abs(u).max()
    spent = [one.state.dissipated for one in of]
    assert np.abs(spent[0] - spent[1]).max() < 1e-12 * spent[0].max()
    again: Any = prepared(None, failure=failure).system.operator
    again.restore(of[1].system.operator.checkpoint_arrays(), of[1].system.operator.broken())
    assert np.array_equal(again.layout.bonds.bits, of[1].system.operator.layout.bonds.bits)  # type: ignore[attr-defined]


@pytest.mark.slow
def test_threads_have_the_same_bits(pair: tuple[PreparedRun, PreparedRun]) -> None:
    u = shaken(1e-4, pair[0])
    assert np.array_equal(forces(pair[1], u), forces(prepared(None, threads=2), u))


@pytest.mark.slow
def test_rows_that_are_alike_are_stored_once() -> None:
    """The families of a box differ by how far three layers are on each side: 7 x 7 kinds of rows, and none."""
    made = build(Body(Box((0, 0, 0), (12 * H, 10 * H, 9 * H)), H, GLASS))
    operator: Any = prepare(Model(made.grid, made.settings), Options(threads=1)).system.operator
    tiles = operator.layout.bonds
    assert len(np.unique(tiles.lines)) == 7 * 7 + 1
    assert tiles.numbers.shape[1] == (7 * 7 + 1) * len(tiles.offsets) * tiles.wide
