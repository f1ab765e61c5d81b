"""Grids that do not represent a plate."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable

import msgspec
import numpy as np
import pytest
from failure_cases import Said, saying
from messages import mentions
from plates import GLASS, plate, square_grid
from system_checks import bonds_of, matrix, sources

from pdmesh import Scene, box
from pdmesh.grid.lattice import build_grid
from pdmesh.model.document import Load, Material, Run
from pdmesh.model.lattice_calibration import hu_beta, offsets
from pdsolve.estimate import estimate_run
from pdsolve.model import ModelError
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import simulate
from pdsolve.run.system import PreparedRun

ONE = Options(threads=1)
ON_A_ROW = 9 * 1e-3  # m, the height of nodes to the last bit; 9e-3 is another number
CONSTANT = msgspec.structs.replace(GLASS, micromodulus="constant")


def warned(model: object) -> list[str]:
    """What the solver says of a model before it marches."""
    with saying() as lines:
        estimate_run(model, ONE)  # type: ignore[arg-type]
    return lines


def free_motions(problem: PreparedRun) -> int:
    """How many motions nothing resists: zero eigenvalues of K, three of them rigid."""
    values = np.abs(np.linalg.eigvals(matrix(problem).toarray()))
    return int((values < 1e-9 * values.max()).sum())


def modulus(columns: int, rows: int, ratio: float) -> float:
    """Stress over strain of a free plate pulled at its end columns, in the middle half, over E."""
    grid = square_grid(columns, rows)
    ends = ((1e-3 * (columns - 1.1), -1.0, 1.0, 1.0), (-1.0, -1.0, 1e-4, 1.0))
    loads = tuple(
        Load(box=end, traction=(pull, 0.0), rows=1, length=rows * 1e-3)
        for end, pull in zip(ends, (1.0, -1.0), strict=True)
    )
    problem = prepare(plate(grid, ratio, material=CONSTANT, conditions=loads), ONE)
    K = matrix(problem).toarray()
    u = (
        np.linalg.lstsq(K, problem.system.drive.force.ravel(), rcond=1e-10)[0]
        .reshape(rows, columns, 2)[..., 0]
        .mean(axis=0)
    )
    first, last = columns // 4, columns - 1 - columns // 4
    return float((last - first) * 1e-3 / (u[last] - u[first]) / GLASS.E)


def cut_energy(height: float) -> tuple[float, int]:
    """What the bonds that a crack at this height (m) cuts would take to break, over G0 times its length; and how many
    nodes it leaves without a bond."""
    grid = square_grid(30, 20)
    whole = prepare(plate(grid, 3, material=CONSTANT), ONE)
    cracked = plate(dataclasses.replace(grid, cracks=np.array([[-1.0, height, 1.0, height]])), 3, material=CONSTANT)
    left = prepare(cracked, ONE)
    bonds, i = bonds_of(whole), sources(bonds_of(whole))
    keys = [sources(own) * len(grid) + own.neighbour for own in (bonds, bonds_of(left))]
    middle = (grid.position[:, 0] > 9.5e-3) & (grid.position[:, 0] < 19.5e-3)
    cut = middle[i] & ~np.isin(*keys)
    spent = bonds.stiffness * np.hypot(*bonds.xi.T) * bonds.limit**2 / 4 * whole.system.area[i]
    lonely = int((left.system.initial_bond_counts == 0).sum())
    return float(spent[cut].sum()) / (GLASS.G0 * 10e-3), lonely


@pytest.mark.slow
def test_a_crack_through_nodes(failure: Callable[..., None]) -> None:
    """A crack that passes through nodes.

    Every bond of a node on the crack touches it, so all are cut: the crack becomes a slit two spacings wide with loose
    nodes in it. Where a crack misses the nodes by round-off, round-off decides on which side of it they are.
    """
    through, loose = cut_energy(ON_A_ROW)
    between, none = cut_energy(9.5e-3)
    assert (loose, none) == (30, 0)
    assert between == pytest.approx(1, abs=0.02)  # measured 0.994: calibrated to the mean of two directions
    xi = offsets(3.5)  # by counting: of the bonds k rows high, k cross a line between rows, and k + 1 meet a row
    spent = hu_beta(np.hypot(*xi.T), np.array(3.0), np.array(1.0)) * np.hypot(*xi.T)
    up, level = xi[:, 1] > 0, (xi[:, 1] == 0) & (xi[:, 0] > 0)
    counted = (spent[up] @ (xi[up, 1] + 1) + spent[level].sum()) / (spent[up] @ xi[up, 1])
    assert through / between == pytest.approx(counted, rel=1e-9)  # 1.68
    sides = [cut_energy(ON_A_ROW + nudge)[1] for nudge in (-1e-15, 1e-15)]
    assert sides == [0, 0]

    grid = dataclasses.replace(square_grid(30, 20), cracks=np.array([[0.0, 9e-3, 12e-3, 9e-3]]))
    says = warned(plate(grid, run=Run(steps=1)))
    assert len(says) == 1
    assert mentions(says[0], "$.notch[0]", found=("13 nodes", "node 271", "(0, 0.009) m"))
    scene = Scene(box(0, 0, 29e-3, 19e-3), 1e-3, GLASS, horizon=3).crack([(0, 9e-3), (12e-3, 9e-3)])
    built, settings, shifts = build_grid(scene)
    assert [shift.offset for shift in shifts] == [(0.0, 0.5e-3)]
    assert warned(plate(built, run=settings.run)) == []
    failure(
        fails=f"A crack along a row of nodes cuts bonds that would take {through:.2f} G0 per area "
        f"to break; between two rows it is {between:.2f} G0. Every node on the crack is left without a bond.",
        noticed="By a warning before the run that names the crack and its first node, also where it misses nodes by "
        "less than 1e-6 of a spacing.",
        says=says,
        cure=f"`pdmesh` builds the same plate with its lattice shifted by {1e3 * shifts[0].offset[1]:g} mm and reports "
        "the shift; the solver then has nothing to warn of.",
    )


def test_nodes_at_one_place(failure: Callable[..., None]) -> None:
    """Two nodes at one place.

    Merged meshes contain such pairs. The bond between the two nodes is infinitely stiff, or nearly so.
    """
    said = []
    steps = {}
    for apart in (0.0, 1e-12, 1e-5, 1e-3):
        grid = square_grid(12, 8)
        grid.position[5] = grid.position[6] - [apart, 0.0]
        try:
            model = plate(grid, run=Run(steps=1))
            steps[apart] = prepare(model, ONE).system.stable_time_step
            said += warned(model)
        except ModelError as error:
            said.append(str(error))
    assert [line.split(":")[:2] for line in said] == [["model", " $.nodes"]] * 3
    assert mentions(said[0], "same place")
    assert mentions(said[1], "node 6", "node 7", "1e-12 m")
    assert mentions(said[2], "node 6", "node 7", "0.01 spacings")
    assert steps[1e-3] / steps[1e-12] > 1e4  # measured 2.1e4
    assert steps[1e-3] / steps[1e-5] == pytest.approx(6.56, abs=0.5)
    failure(
        fails=f"Nodes 1e-12 m apart on a grid of 1 mm: the stable step is {steps[1e-12]:.2g} s instead of "
        f"{steps[1e-3]:.2g} "
        "s. For two nodes at the same place no step is stable.",
        noticed="By an error that names both nodes (exit code 2), also where they differ by round-off; below a tenth "
        "of a "
        "spacing by a warning.",
        says=said,
        cure=f"The nodes one spacing apart: {steps[1e-3]:.2g} s, and no warning.",
    )


def test_a_lonely_node(failure: Callable[..., None]) -> None:
    """A node without bonds.

    Nothing holds such a node: under a load it accelerates for ever. It may be far away, or just outside the outline.
    """
    grid = square_grid(12, 8)
    grid.position[0] -= 0.02
    force, steps = 1e9, 400
    model = plate(grid, conditions=(Load(nodes=(1,), body_force=(force, 0.0)),), run=Run(steps=steps, every=steps))
    with saying() as says, simulate(model, options=ONE) as results:
        gone, time = float(results.field("ux", steps)[0]), float(results.frames()[1][-1])
    assert gone == pytest.approx(force / GLASS.rho * time**2 / 2, rel=1e-6)  # measured 3e-8, stored as float32
    assert len(says) == 1
    assert mentions(says[0], found=("1", "node 1", "(-0.02, -0.02) m"))
    outside = square_grid(12, 8)
    outside.position[3, 1] -= 2e-6 * 1e-3
    ring = 1e-3 * np.array([[0.0, 0.0], [11.0, 0.0], [11.0, 7.0], [0.0, 7.0]])
    beside = warned(plate(dataclasses.replace(outside, outline=(ring,)), run=Run(steps=1)))
    assert len(beside) == 1
    assert mentions(beside[0], found=("1", "node 4"))
    held = plate(square_grid(12, 8), conditions=model.settings.conditions, run=model.settings.run)
    with saying() as silent, simulate(held, options=ONE) as results:
        stays = float(results.field("ux", steps)[0])
    assert silent == []
    assert gone > 20 * stays  # measured 28
    failure(
        fails=f"A loaded node 20 spacings from the plate flies {1e3 * gone:.2g} mm in {1e6 * time:.2g} us.",
        noticed="By a warning before the run that counts such nodes and names the first. The second node below lies "
        "outside "
        "the outline by 2e-6 of a spacing, so that all of its bonds leave the plate.",
        says=[*says, *beside],
        cure=f"The node in its place moves with the plate, {1e3 * stays:.2g} mm.",
    )


def test_one_row(failure: Callable[..., None]) -> None:
    """A strip of one row.

    Bonds act along themselves: in a single row, nothing resists motion across it. Energy corrections make the strip as
    stiff as a plate that cannot contract, 9/8 E.
    """
    says = warned(plate(square_grid(24, 1), run=Run(steps=1)))
    assert len(says) == 1
    assert mentions(says[0], found=("24", "one row"))
    loose = [free_motions(prepare(plate(square_grid(12, rows)), ONE)) for rows in (1, 2)]
    assert loose == [13, 3]
    found = {rows: modulus(24, rows, 3) for rows in (1, 2, 4, 8)}
    assert found == pytest.approx({1: 1.163, 2: 1.183, 4: 1.118, 8: 1.082}, abs=0.001)
    failure(
        fails=f"A row of 12 nodes has {loose[0]} zero-energy modes. Its Young's modulus is {found[1]:.2f} E.",
        noticed="By a warning before the run.",
        says=says,
        cure=f"Two rows have only the {loose[1]} rigid-body modes. The modulus needs more rows: {found[2]:.2f}, "
        f"{found[4]:.2f} and {found[8]:.2f} E with 2, 4 and 8 of them at m = 3.",
    )


@pytest.mark.slow
def test_a_horizon_larger_than_the_plate(failure: Callable[..., None]) -> None:
    """A horizon larger than the plate.

    No node has a full family. The surface correction is made for one surface, not for four.
    """
    found = {ratio: modulus(8, 8, ratio) for ratio in (2, 3, 4, 6, 16)}
    assert found == pytest.approx({2: 1.038, 3: 1.223, 4: 1.578, 6: 3.887, 16: 5.531}, abs=0.001)
    says = warned(plate(square_grid(8, 8), 16, run=Run(steps=1)))
    assert len(says) == 1
    assert mentions(says[0], "$.horizon", found=("0.016 m", "0.008 m"))
    assert len(warned(plate(square_grid(8, 8), 6, run=Run(steps=1)))) == 1
    assert warned(plate(square_grid(8, 8), 3, run=Run(steps=1))) == []
    wide = modulus(20, 20, 4)
    assert wide == pytest.approx(1.032, abs=0.001)
    failure(
        fails="A plate of 8 x 8 nodes in tension, m = 2, 3, 4, 6 and 16: Young's modulus is "
        f"{', '.join(f'{value:.2f}' for value in found.values())} times that of the material.",
        noticed="By a warning before the run if the horizon is half of the plate or more.",
        says=says,
        cure=f"More nodes: {wide:.2f} with 20 x 20 nodes and m = 4.",
    )


def test_too_few_neighbours(failure: Callable[..., None], pdsolve: Callable[..., Said]) -> None:
    """Too few neighbours to be solid.

    With the four nearest nodes alone nothing in a square lattice resists shear. With m = 1 all neighbours lie at the
    horizon, where the conical micromodulus is zero.
    """
    loose = {ratio: free_motions(prepare(plate(square_grid(8, 8), ratio), ONE)) for ratio in (1.2, 1.5)}
    assert loose == {1.2: 16, 1.5: 3}
    says = warned(plate(square_grid(8, 8), 1.2, run=Run(steps=1)))
    assert len(says) == 1
    said = pdsolve(plate(square_grid(8, 8), 1))
    assert said.code == 2
    assert len(said.err) == 1
    assert mentions(said.err[0], "plate.json", "$.horizon.ratio", "conical", found="1")
    assert warned(plate(square_grid(8, 8), 1.5, run=Run(steps=1))) == []
    failure(
        fails=f"8 x 8 nodes, m = 1.2: {loose[1.2]} motions that nothing resists; each row and each column slides by "
        "itself.",
        noticed="By a warning for m = 1.2, and by an error for m = 1 with the conical micromodulus (exit code 2).",
        says=[*says, *said.err],
        cure=f"m = 1.5 includes the diagonals: {loose[1.5]} free motions, the rigid ones.",
    )


def test_numbers_that_are_no_material(failure: Callable[..., None], pdsolve: Callable[..., Said]) -> None:
    """Zero density, and numbers that are not finite.

    A node without mass has no finite frequency, and neither has one of infinite stiffness.
    """
    model = plate(square_grid(8, 8), 3, run=Run(steps=1))
    said = [
        pdsolve(model, "--set", assignment)
        for assignment in ("material.rho=0", "material.rho=1e-300", "material.E=inf", "material.G0=nan")
    ]
    assert [one.code for one in said] == [2] * 4
    assert [len(one.err) for one in said] == [1] * 4
    for one, name in zip(said, ("rho", "rho", "E", "G0"), strict=True):
        assert f"$.material.{name}" in one.err[0]
    lightest = pdsolve(plate(square_grid(8, 8), 3, material=Material(E=1e-3, rho=1e-20, G0=1e-12), run=Run(steps=10)))
    assert (lightest.code, lightest.err) == (0, [])
    failure(
        fails="A density of 0 or 1e-300 makes the stable time step 0; with an infinite modulus it is not a number.",
        noticed="By an error (exit code 2) that names the setting.",
        says=[one.err[0] for one in said],
        cure="Any value from 1e-30 to 1e30: E = 1e-3, rho = 1e-20, G0 = 1e-12 runs without a warning.",
    )
