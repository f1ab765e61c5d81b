"""Bodies in contact.

Contact pushes by springs between nodes, with normals from the nodes around them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from contact_bars import UNIT, bar, grid_of, moving
from failure_cases import Said
from messages import mentions
from shapely import Point

from pdmesh import Scene, box, build
from pdmesh.model.document import Run
from pdmesh.model.mechanical_conditions import Contact
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.system import PreparedRun

H, V = 0.01, 0.02


def bars(stiffness: float, run: Run) -> Model:
    """Two short bars of a plane, of which one moves against the other."""
    parts = [bar(0, 0.2, H, 6), bar(0.2, 0.2, H, 6)]
    return moving(grid_of(parts, H), (V, 0.0), Contact(stiffness=stiffness), run)


def passed(stiffness: float) -> float:
    """Mean velocity of the struck bar after two seconds over that of the striking one."""
    prepared = prepare(bars(stiffness, Run()), Options(threads=1))
    prepared.advance(1, 1 + int(4 / prepared.system.time_step))
    struck = prepared.system.model.grid.bodies.number == 1  # type: ignore[union-attr]
    return float(prepared.state.rate[struck, 0].mean() / V)


@pytest.mark.slow
def test_a_penalty_that_is_too_soft(failure: Callable[..., None]) -> None:
    """A contact that is too soft.

    A pair of nodes pushes until one is past the other. Soft springs take up the motion over a depth of more than a
    spacing, and let it go there.
    """
    soft, usual = passed(0.01), passed(15.0)
    assert soft < 0.3
    assert usual > 0.9
    failure(
        fails=f"A bar hits an equal bar at 0.02 sqrt(E / rho), `contact.stiffness` 0.01. It passes through, and"
        f" the struck bar then has {soft:.2f} of the speed of the impact.",
        noticed="Not at all: energy balances.",
        says=[],
        cure=f"The default stiffness of 15: the struck bar then has {usual:.2f} of the speed of the impact.",
    )


def test_a_penalty_that_is_too_stiff_for_the_step(failure: Callable[..., None], pdsolve: Callable[..., Said]) -> None:
    """A contact that is too stiff for the time step.

    Springs between nodes bound the step as bonds do.
    """
    steps = [prepare(bars(stiffness, Run()), Options()).system.time_step for stiffness in (15.0, 1500.0)]
    said = pdsolve(bars(1500.0, Run(time_step=steps[0])))
    assert said.code == 2
    assert mentions(said.err[0], "$.contact.stiffness", found="1500", expected="steps")
    failure(
        fails=f"The bars with `contact.stiffness` 1500 and the time step that 15 allows: the stable one is"
        f" {steps[0] / steps[1]:.1f} times shorter.",
        noticed="By an error before the run (exit code 2).",
        says=said.err,
        cure="Leave the time step out of the model. The solver then chooses a stable one.",
    )


def shear(slope: float, outlined: bool = False) -> float:
    """Force along two parallel faces over the mean one across, the largest while one slides two spacings, no friction.

    The faces have this slope to the rows of the nodes; the upper one is .05 of a spacing deep in the lower one.
    """
    x, y = (each.ravel() for each in np.meshgrid(H * (np.arange(48) + 0.5), H * (np.arange(40) + 0.5)))
    above = y - slope * (x - 0.24) - 0.2
    upper = (above > 0) & (above < 0.08) & (np.abs(x - 0.24) < 0.1)
    grid = grid_of([np.column_stack([x, y])[some] for some in (above < 0, upper)], H)
    if outlined:
        line = np.array([[x, 0.2 + slope * (x - 0.24)] for x in (-0.1, 0.14, 0.34, 1.1)])
        low, up = np.array([[1.1, -0.1], [-0.1, -0.1]]), line[1:3] + np.array([0.0, 0.08])
        grid = replace(grid, outline=(np.concatenate([line, low]), np.concatenate([line[1:3], up[::-1]])))
    system, state = prepare(moving(grid, (0.0, 0.0), Contact()), Options(threads=1))
    assert system.contact is not None
    own = grid.bodies.number == 1  # type: ignore[union-attr]
    along = np.array([1.0, slope]) / np.hypot(1, slope)
    across, found = np.array([-along[1], along[0]]), []
    for way in np.linspace(0, 2, 21):
        out = np.zeros_like(state.value)
        state.value[own] = H * (way * along - 0.05 * across)
        system.contact.accumulate_force(state, out, 1, 1e-9)
        found.append((out * system.area[:, None])[own].sum(axis=0) @ np.column_stack([along, across]))
    drag, normal = np.abs(found).T
    return float(drag.max() / normal.mean())


@pytest.mark.slow
def test_faces_that_interlock(failure: Callable[..., None]) -> None:
    """Inclined faces that interlock.

    A face that is inclined to the rows of nodes is a stair. Without its outline, normals from the nodes around smooth
    its steps, but not wholly: two such faces catch each other like teeth.
    """
    along, inclined, drawn = shear(0.0), shear(0.2), shear(0.2, outlined=True)
    assert along < 0.01
    assert 0.3 < inclined < 3
    assert drawn < 0.1  # .02
    failure(
        fails=f"Two faces slide on each other without friction. Along a row of nodes the largest tangential force is"
        f" {along:.3f} of the mean normal force. On faces that rise by 1 in 5 it is {inclined:.1f} of it.",
        noticed="Not at all: energy balances, and the force is equal and opposite.",
        says=[],
        cure=f"Draw the bodies: contact then has the faces from their outlines, and it is {drawn:.2f}. In a grid file"
        " without outlines, lay faces that slide along x or y; a finer lattice has smaller teeth, not fewer.",
    )


def spun(shape: object, radius: float | None = None, outlined: bool = True) -> float:
    """Spin, over that at the start, of a rigid body that hits a plate askew without friction."""
    scene = Scene(box(0, 0, 1, 0.1), H, UNIT)
    scene = scene.rigid(box(0, -0.1, 1, 0), "anvil", held=("x", "y", "spin"))
    scene = scene.rigid(shape, "striker", 0.03, (5e-3, -5e-3), 0.05, radius=radius)  # type: ignore[arg-type]
    built = build(scene)
    grid = built.grid if outlined else replace(built.grid, outline=())
    system, state = prepare(Model(grid, built.settings), Options(threads=1))
    PreparedRun(system, state).advance(1, 1201)
    own = system.model.grid.bodies.number == 2  # type: ignore[union-attr]
    place, rate = system.model.grid.position[own] + state.value[own], state.rate[own]
    assert rate[:, 1].mean() > 0  # it has bounced
    arm, way = place - place.mean(axis=0), rate - rate.mean(axis=0)
    return float((arm[:, 0] @ way[:, 1] - arm[:, 1] @ way[:, 0]) / (arm**2).sum() / 0.05)


@pytest.mark.slow
def test_a_round_body_on_a_lattice(failure: Callable[..., None]) -> None:
    """Round bodies without an outline.

    The nodes of a disc are those of a lattice: its edge has steps, and the normals of their corners are not those of
    the circle. Contact has the circle from the outlines of the drawing; a grid file without them has steps.
    """
    disc = Point(0.3, 0.2 + 0.1 * H).buffer(0.1, 64)
    kept, drawn, by_radius = spun(disc, outlined=False), spun(disc), spun(disc, 0.1)
    assert by_radius == pytest.approx(1, abs=1e-6)  # 4e-8
    assert drawn == pytest.approx(1, abs=0.05)  # 1.03
    assert kept < 0.6
    assert np.isfinite(kept)
    failure(
        fails=f"A spinning rigid disc of radius ten spacings, in a grid file without outlines, hits a plate without"
        f" friction. It keeps {kept:.2f} of its spin, and should keep all of it.",
        noticed="Not at all: momentum and energy balance.",
        says=[],
        cure=f"The key `outline` of the grid file, which holds what was drawn: it keeps {drawn:.2f}. Or the `radius`"
        f" of a rigid body, whose surface is a circle then: it keeps {by_radius:.2f}.",
    )
