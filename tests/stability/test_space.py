"""3D models."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from messages import mentions
from separated_blocks import parted
from system_checks import equilibrium

from pdmesh import Body, Box, Material, SceneError, build
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

H, LONG, NU = 1e-3, 24, 0.25  # m between nodes; nodes along a bar
GLASS = Material(E=65e9, rho=2235.0, G0=204.0, micromodulus="constant")


def bar(thick: int) -> Body:
    """A bar `thick` nodes wide and high."""
    return Body(Box((0, 0, 0), (LONG * H, thick * H, thick * H)), H, GLASS)


def stiffness(thick: int) -> tuple[float, float]:
    """What a bar holds pulled and bent, over what the continuum does, whose fields its ends have."""
    grid = build(bar(thick))
    problem = prepare(Model(grid.grid, grid.settings), Options(threads=1))
    side = thick * H
    x, y, z = (problem.system.model.grid.position - [0, side / 2, side / 2]).T
    ends = np.repeat(((x < 2.9 * H) | (x > (LONG - 2.9) * H))[:, None], 3, axis=1)
    k, found = 1e-3, []  # 1/m
    for field, exact in (
        ((x * H, -NU * y * H, -NU * z * H), (H * k) ** 2 * side**2),
        ((x * z, -NU * y * z, -(x**2) / 2 - NU * (z**2 - y**2) / 2), k**2 * side**4 / 12),
    ):
        rest = equilibrium(problem, ends, k * np.column_stack(field))
        held, _ = problem.system.operator.energies(problem.state._replace(value=rest))
        found.append(float((problem.system.area * held).sum()) / (GLASS.E * exact / 2 * LONG * H))
    return found[0], found[1]


@pytest.mark.slow
def test_thin_bodies_bend(failure: Callable[..., None]) -> None:
    """Bodies thinner than three horizons.

    Bonds beside a surface are corrected for a uniform strain. In bending the strain changes over a horizon. Besides,
    the layers of n nodes have 1 - 1 / n^2 of the section's second moment.
    """
    table = {thick: stiffness(thick) for thick in (3, 4, 6, 9)}
    assert [pulled for pulled, _ in table.values()] == pytest.approx([0.901, 1.011, 1.008, 1.010], abs=2e-3)
    assert [bent for _, bent in table.values()] == pytest.approx([0.589, 0.777, 0.876, 0.942], abs=2e-3)
    with pytest.raises(SceneError) as refused:
        build(bar(2))
    assert mentions(str(refused.value), "spacing", "0.001", "3")
    thin, thick = table[3], table[9]
    failure(
        fails=f"Bars of 3, 4, 6 and 9 nodes through their thickness, m = 3, resist bending with "
        f"{', '.join(f'{bent:.2f}' for _, bent in table.values())} of the continuum's stiffness. Pulled, the thinnest "
        "has "
        f"{thin[0]:.2f} of it, the others {table[4][0]:.2f}: their surfaces are corrected.",
        noticed="By an error for fewer than three nodes through the thickness. Not at all from three on.",
        says=[str(refused.value)],
        cure=f"Nine nodes through what bends: {thick[1]:.2f}. Four are enough for what is only pulled. A plate "
        "that stays flat is solved in the plane.",
    )


@pytest.mark.slow
def test_fronts_near_free_sides(failure: Callable[..., None]) -> None:
    """Fronts that end at free sides.

    At a side a crack cuts fewer bonds. Surface corrections give these bonds their stiffness, not their energy.
    """
    material = Material(E=65e9, rho=2235.0, G0=204.0, plane="space", micromodulus="constant")
    cost = {}
    for wide in (4, 8, 16):
        results, area = parted(material, wide, 16)
        cost[wide] = float(results.history()[-1]["dissipated"]) / (material.G0 * area)
    assert list(cost.values()) == pytest.approx([0.934, 0.950, 0.972], abs=1e-3)
    far = 2 * cost[16] - cost[8]
    failure(
        fails=f"A crack through blocks 4, 8 and 16 nodes wide costs {', '.join(f'{one:.3f}' for one in cost.values())} "
        "of G0.",
        noticed="Not at all.",
        cure="From 8 nodes on, the missing share falls as one over the width. Extrapolated to a block without sides, a "
        "crack costs "
        f"{far:.3f} of G0.",
    )
