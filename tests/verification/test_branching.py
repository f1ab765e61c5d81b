"""A crack that branches under correspondence: a plate of 100 x 40 mm, notched to its middle, under a sudden traction.

E = 32 GPa, rho = 2450 kg/m^3, nu = 0.2, strength 3.08 MPa, 1 MPa on both edges; the deck of J.-H. Song, H. Wang, T.
Belytschko (2008) with the strength of X. Zhou, Y. Wang, Q. Qian (2016). Where a crack branches is chaotic: runs whose
nodes are moved by 10 nm differ by millimetres, so that it is their medians that are compared.
"""

from __future__ import annotations

import dataclasses
from typing import NamedTuple

import msgspec
import numpy as np
import pytest
from plates import GLASS, plate, square_grid

from pdmesh.model.document import Load, Run
from pdsolve.options import Options
from pdsolve.run.measures import compute_node_damage
from pdsolve.run.prepare import prepare

CRACKED, SHAKEN = 0.35, 1e-8  # damage; m
BRITTLE = msgspec.structs.replace(
    GLASS, E=32e9, rho=2450.0, G0=3.0, nu=0.2, model="correspondence", failure="stress", strength=3.08e6
)


class Branched(NamedTuple):
    """What became of a plate."""

    first: float  # us, the first broken bond
    branch: float  # mm, the least x that is cracked off the line of the notch
    far: float  # us, when the far edge cracks; not a number where it does not in 65
    away: float  # share of nodes that crack where no crack is
    mirrored: bool  # to the bit


def branched(delta: float, ratio: float, seed: int | None = None, **material: object) -> Branched:
    columns, rows = round(0.1 / delta), round(0.04 / delta)
    grid = square_grid(columns, rows, delta, x0=delta / 2, y0=-(rows - 1) / 2 * delta)
    moved = np.zeros_like(grid.position)
    if seed is not None:
        moved = np.random.default_rng(seed).uniform(-SHAKEN, SHAKEN, moved.shape)
    notch = np.array([[-1.0, 0.0, 0.05, 0.0]])
    grid = dataclasses.replace(grid, areas=np.full(len(grid), delta**2), cracks=notch, position=grid.position + moved)
    conditions = []
    for side in (1.0, -1.0):
        for deep, force, breakable in ((1, 1e6 / delta, True), (ratio, 0.0, False)):
            low, high = sorted((side * (0.02 - delta * (deep - 0.1)), side))
            box = (-1.0, low, 1.0, high)
            conditions.append(Load(box=box, body_force=(0.0, side * force), breakable=breakable))
    solid = msgspec.structs.replace(BRITTLE, **material)
    step = 0.25 * delta / np.sqrt(solid.E / (1 - 0.04) / solid.rho)
    model = plate(grid, ratio, material=solid, conditions=tuple(conditions), run=Run(time_step=float(step)))
    system, state = prepare(model, Options(threads=1))
    (x, y), done, far = grid.position.T, 0, np.nan
    while done * step < 65e-6:
        system.stepper.advance(state, done + 1, done + 21)
        done += 20
        cracked = compute_node_damage(system) > CRACKED
        if cracked.any() and x[cracked].max() > 0.1 - 1.6 * delta:
            far = done * step * 1e6
            break
    off = cracked & (y > 1.6 * delta) & (x > 0.05)
    picture = compute_node_damage(system).reshape(rows, columns)
    return Branched(
        first=float(system.operator.broken().step.min() * step * 1e6),
        branch=float(x[off].min(initial=np.inf) * 1e3),
        far=float(far),
        away=float(cracked[(x < 0.045) & (np.abs(y) > 3e-3)].mean()),
        mirrored=bool(np.array_equal(picture, picture[::-1])),
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("control", "first"),
    [
        ("silling", 6.71),
        ("wan", 6.98),
        ("none", 6.84),
        ("breitzman-dayal", 6.71),
    ],
)
def test_controls_keep_cracks_in_one_place(control: str, first: float) -> None:
    """Of 1 mm; the first break is an independent program's, and is not chaotic. Without a control, nodes crack where no
    crack is in an independent program (9.5 of some measure of damage); here none do, as torn nodes have no gradient."""
    found = branched(1e-3, 3, control=control)
    assert found.first == pytest.approx(first, abs=0.02)  # measured 6.71, 6.98, 6.85, 6.71
    assert found.mirrored
    assert found.away == 0
    if control == "none":
        return  # it branches at 50.5 mm already, and ends at 44.7
    assert 60 <= found.branch <= 90  # measured 69.5, 79.5, breitzman-dayal 72.5
    assert 42 <= found.far <= 60  # measured 58.3, 54.2, 54.2


@pytest.mark.slow
@pytest.mark.parametrize(
    ("ratio", "first", "place", "far"), [(3, 6.1, (58, 66), 48), (4, 6.2, (60, 90), 57)], ids=["m = 3", "m = 4"]
)
def test_a_crack_branches(ratio: float, first: float, place: tuple[float, float], far: float) -> None:
    """Of 0.5 mm, five plates; microseconds and millimetres of an independent program, one plate. With m = 4 its one
    plate branched at 78 mm; of these the first four did at 71, 70, 55, 72: no number to compare more closely than
    that cracks branch in the right half. Where the crack ends, the one plate is of the same scatter as the five."""
    runs = [branched(0.5e-3, ratio, seed) for seed in (None, 1, 2, 3, 4)]
    assert runs[0].mirrored
    assert max(run.away for run in runs) == 0
    assert [run.first for run in runs] == pytest.approx([first] * 5, abs=0.2)  # measured 6.10 to 6.13, 6.20 to 6.24
    assert place[0] <= np.median([run.branch for run in runs]) <= place[1]  # measured 63.7, 70
    ends = [run.far for run in runs]
    scatter = np.std(ends, ddof=1) * np.sqrt(1 + 1 / len(ends))  # of one plate about the mean of the others
    assert scatter < 3  # measured 1.7
    assert abs(np.mean(ends) - far) < 2.78 * scatter  # measured 2.1; nineteen of twenty (Student, 4 degrees of freedom)
