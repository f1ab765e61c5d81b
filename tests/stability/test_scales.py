"""Very small plates and very large ones."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Literal

import msgspec
import numpy as np
import pytest
from failure_cases import saying
from messages import mentions
from numpy.typing import NDArray
from plates import GLASS, plate, square_grid
from system_checks import broken

from pdmesh import Circle, Scene, SceneError, box
from pdmesh.grid.lattice import build_grid
from pdmesh.model.document import Load, Run
from pdsolve.estimate import estimate_run
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.state import Broken

SIZES = (1e-9, 1e-3, 1e3)
CONSTANT = msgspec.structs.replace(GLASS, micromodulus="constant")


def cracked(delta: float) -> Model:
    """A cracked plate of 30 x 30 nodes, torn apart. With G0 in proportion to the spacing all stretches are the same."""
    size = delta / 1e-3
    grid = square_grid(30, 30, delta, y0=-14.5 * delta)
    grid = dataclasses.replace(grid, cracks=np.array([[-delta, 0.0, 12.2 * delta, 0.0]]))
    pull = 3e10 / size
    loads = (
        Load(box=(-size, 13.4 * delta, size, size), body_force=(0.0, pull)),
        Load(box=(-size, -size, size, -13.4 * delta), body_force=(0.0, -pull)),
    )
    material = msgspec.structs.replace(GLASS, G0=GLASS.G0 * size)
    return plate(grid, 3, material=material, conditions=loads, run=Run(time_step=4e-8 * size))


def torn(delta: float) -> tuple[NDArray[np.float64], Broken, float]:
    """Displacements over the spacing, bonds that broke, and the stable step over the spacing."""
    problem = prepare(cracked(delta), Options(threads=1))
    problem.advance(1, 301)
    return problem.state.value / delta, broken(problem), problem.system.stable_time_step / delta


def counts(x: NDArray[np.float64], slack: float) -> list[int]:
    """Numbers of neighbours within three spacings and a slack of the inner nodes of a 12 x 12 grid."""
    distance = np.hypot(*(x[:, None] - x[None]).transpose(2, 0, 1))
    near = ((distance <= 3 * (x[1, 0] - x[0, 0]) + slack).sum(axis=1) - 1).reshape(12, 12)[4:-4, 4:-4]
    return np.unique(near).tolist()


def test_from_nanometres_to_kilometres(failure: Callable[..., None]) -> None:
    """Spacings of 1e-9 m and of 1e3 m.

    A tolerance with a fixed length, such as a slack in metres, works at one size only.
    """
    (small, small_broken, small_bound), (u, middle, bound), (large, large_broken, large_bound) = map(torn, SIZES)
    assert len(middle.step) > 500  # 810 directed bonds
    differ = max(np.abs(small - u).max(), np.abs(large - u).max()) / np.abs(u).max()
    assert differ < 1e-12  # measured 1.4e-15
    for other in (small_broken, large_broken):
        assert all(map(np.array_equal, other, middle))
    assert (small_bound, large_bound) == pytest.approx((bound, bound), rel=1e-12)
    wrong = {delta: counts(square_grid(12, 12, delta).position, 1e-9) for delta in SIZES}
    assert (wrong[1e-9][-1], wrong[1e-3], wrong[1e3]) == (48, [28], [28])
    for delta in SIZES:
        with saying() as lines:
            estimate_run(cracked(delta), Options(threads=1))
        assert lines == []
    failure(
        fails=f"A slack of 1e-9 m at the horizon: nodes 1e-9 m apart have {wrong[1e-9][-1]} neighbours at m = 3, "
        f"others {wrong[1e-3][0]}.",
        noticed="Does not occur in the program: each of its tolerances is relative to a spacing or a horizon.",
        cure="The same plate with spacings of 1e-9, 1e-3 and 1e3 m breaks the same bonds in the same steps; "
        "displacements over the spacing agree to better than 1e-12.",
    )


def test_far_from_the_origin(failure: Callable[..., None]) -> None:
    """A small plate far from the origin.

    Coordinates have 16 digits. If too many of them are spent on the distance from the origin, round-off decides which
    nodes are within a horizon.
    """
    found = {}
    for away in (0.0, 1.0):
        grid = square_grid(30, 30, 1e-9, x0=away)
        model = plate(grid, 3, material=CONSTANT, run=Run(steps=1))
        families = prepare(model, Options("thesis", threads=1)).system.initial_bond_counts.reshape(30, 30)[4:-4, 4:-4]
        with saying() as says:
            estimate_run(model, Options(threads=1))
        found[away] = (np.unique(families).tolist(), says)
    assert found[0.0] == ([28], [])
    assert min(found[1.0][0]) < 28
    assert len(found[1.0][1]) == 1
    assert mentions(found[1.0][1][0], found=("coordinates", "1 m", "2.2e-16 m"))
    failure(
        fails=f"Spacings of 1e-9 m, 1 m from the origin: inner nodes have {' or '.join(map(str, found[1.0][0]))} "
        "neighbours, "
        "not 28.",
        noticed="By a warning before the run.",
        says=found[1.0][1],
        cure=f"The same plate at the origin: {found[0.0][0][0]}.",
    )


def scene(size: float, units: Literal["m"] | None = None) -> Scene:
    """A plate with a hole, a crack and a finer zone, `size` times 20 x 10 m."""
    material = msgspec.structs.replace(GLASS, G0=GLASS.G0 * size)
    whole = Scene(box(0, 0, 20 * size, 10 * size), size, material, horizon=3, units=units)
    return (
        whole.hole(Circle(14 * size, 5 * size, 2 * size))
        .crack([(0, 5.25 * size), (6 * size, 5.25 * size)])
        .zone(box(2 * size, 3 * size, 9 * size, 7 * size), size / 2)
        .load("top", traction=(0, 1e6))
    )


def test_millimetres_taken_for_metres(failure: Callable[..., None]) -> None:
    """Millimetres taken for metres.

    A plate of 20 000 m is most likely one of 20 m, drawn in millimetres.
    """
    with pytest.raises(SceneError) as refused:
        build_grid(scene(1e3))
    built = {size: build_grid(scene(size, "m"))[0] for size in SIZES}
    middle = built[1e-3]
    for size, grid in built.items():
        assert len(grid) == len(middle)
        assert np.abs(grid.position / size - middle.position / 1e-3).max() < 1e-9
        assert grid.areas is not None
        assert middle.areas is not None
        assert grid.areas / size**2 == pytest.approx(middle.areas / 1e-6, rel=1e-9)
    failure(
        fails="A drawing in millimetres becomes a plate a thousand times too large, in which waves take a thousand "
        "times as "
        "long.",
        noticed="`pdmesh` refuses plates of more than 20 m without a unit (exit code 2), and warns of those of more "
        "than "
        "2 m.",
        says=[str(refused.value)],
        cure='`Units = "mm"`, or `--unit mm`; `"m"` if metres are meant. Plates of 2e-8, 0.02 and '
        "2e4 m then have the same "
        f"{len(middle)} nodes and areas but for their size, to 1e-9.",
    )
