"""Horizons in spacings."""

from __future__ import annotations

from collections.abc import Callable

import msgspec
import numpy as np
import pytest
from plates import GLASS, plate, square_grid
from system_checks import bonds_of, stiffness

from pdmesh.model.lattice_calibration import along_axes, calibration, full_family
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

CONSTANT = msgspec.structs.replace(GLASS, micromodulus="constant")
SIDE = 31


@pytest.mark.slow
def test_round_off_at_the_horizon(failure: Callable[..., None]) -> None:
    """m = 3.0 and 3.015: round-off at the horizon.

    The fourth ring of neighbours lies exactly on a horizon of three spacings, and in floating point 3 * 0.001 is not
    0.003.
    """
    grid = square_grid(40, 40)
    x, y = grid.position.T
    inner = (np.minimum(x, y) > 3.9e-3) & (np.maximum(x, y) < 35.1e-3)
    distance = np.hypot(*(grid.position[:, None] - grid.position[None]).transpose(2, 0, 1))
    naive = {m: np.unique(((distance <= m * 1e-3).sum(axis=1) - 1)[inner]).tolist() for m in (3.0, 3.015)}
    assert naive == {3.0: [24, 25, 26, 27, 28], 3.015: [28]}
    families = {}
    for mode in ("thesis", "conservative"):
        problems = [prepare(plate(grid, m, material=CONSTANT), Options(mode, threads=1)) for m in (3.0, 3.015)]
        counts = [np.unique(problem.system.initial_bond_counts[inner]).tolist() for problem in problems]
        assert counts[0] == counts[1]
        assert np.array_equal(*(bonds_of(problem).neighbour for problem in problems))
        families[mode] = counts[0]
    assert families == {"thesis": [28], "conservative": [36]}
    few = sum(1 for count in ((distance <= 3e-3).sum(axis=1) - 1)[inner] if count < 28) / inner.sum()
    failure(
        fails=f"|xi| <= 0.003 on a grid of 0.001: inner nodes have {min(naive[3.0])} to {max(naive[3.0])} neighbours, "
        f"{100 * few:.0f} % of them fewer than 28.",
        noticed="Does not occur in the program: it lengthens each horizon by 1e-9 of itself.",
        cure=f"With that slack all have {families['thesis'][0]} (in the conservative mode, whose families reach half a "
        f"spacing further, {families['conservative'][0]}), and m = 3.0 gives exactly the bonds of m = 3.015, in both "
        "modes.",
    )


@pytest.mark.slow
def test_few_neighbours_and_many(failure: Callable[..., None]) -> None:
    """m = 3 and m = 6.

    A lattice of few bonds is anisotropic. Many bonds take long and blur sharp fields.
    """
    table = {}
    for m in (2, 3, 4, 6):
        factor = calibration(m, CONSTANT)
        found = factor.ratios
        crack = factor.stiffness * factor.stretch**2
        problem = prepare(
            plate(square_grid(SIDE, SIDE), m, material=CONSTANT),
            Options(threads=1),
        )
        c11, c22, c66 = stiffness(bonds_of(problem), SIDE * SIDE // 2)
        assert c11 == pytest.approx(c22, rel=1e-12)
        assert c11 / (1.125 * GLASS.E) == pytest.approx(factor.stiffness * found.c11, rel=1e-12)
        ratio = c11 / c66 / 3  # 1 if isotropic
        table[m] = (full_family(m), ratio - 1, crack * found.diagonal / (crack * found.row) - 1)
    assert [row[0] for row in table.values()] == [12, 28, 48, 112]
    assert [row[1] for row in table.values()] == pytest.approx([0.0, 0.0511, 0.0121, 0.0084], abs=2e-4)
    assert [row[2] for row in table.values()] == pytest.approx([0.0060, 0.0151, 0.0068, 0.0036], abs=2e-4)
    two, three, six = table[2], table[3], table[6]
    young = [along_axes(CONSTANT, m).young for m in (3, 4, 6)]
    failure(
        fails=f"m = 3 (constant micromodulus, {three[0]} neighbours): C11 / C66 is {100 * three[1]:.1f} % off that of "
        f"an isotropic plate, and a crack at 45 degrees costs {100 * three[2]:.1f} % more than one along a row. A bar "
        f"along an axis has {young[0]:.3f} E, on any finer lattice too.",
        noticed="`pdmesh info` prints E and Poisson's ratio along the axes. Averaged over all directions, stiffness "
        "and fracture energy are those of the material.",
        cure='`calibration = "isotropic"` of the material makes the stiffness isotropic: 1.000 E. Lattices whose '
        f"anisotropy would be larger, such as m = 2, are made so in any case: {100 * abs(two[1]):.1f} and "
        f"{100 * two[2]:.1f} %. With m = 4 and 6 a bar has {young[1]:.3f} and {young[2]:.3f} E. m = 6 has {six[0]} "
        f"neighbours, {six[0] / three[0]:.0f} times the work of m = 3, and needs a plate of many horizons (see "
        '"A horizon larger than the plate").',
    )
