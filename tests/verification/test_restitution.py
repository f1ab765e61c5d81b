"""What bodies that deform show of the restitution of contact: its springs have a share of the energy.

A disc that hits a wall comes back with v1 without a loss, as some of its motion stays in waves. Of its energy the share
S is in the springs at most, of which e^2 comes back: (v / v1)^2 = 1 - S (1 - e^2), with the same S for all e.
"""

from __future__ import annotations

import warnings

import msgspec
import numpy as np
import pytest
from contact_bars import UNIT
from shapely import Point

from pdmesh import Run, Scene, box, build
from pdmesh.model.document import InitialVelocity, RigidBody
from pdsolve.checks import warn_of_doubtful_conditions
from pdsolve.model import Model, ModelNote
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import simulate

R, H, V = 0.1, 0.01, 1e-3  # m, m, of the speed of waves
WALL = ("x", "y", "spin")


def disc_on_wall(e: float, run: Run) -> Model:
    scene = Scene(Point(2 * R, 0).buffer(R, 64), H, UNIT, run=run)
    scene = scene.rigid(box(R - 4 * H, -R, R, R), "wall", held=WALL).contact(restitution=e)
    built = build(scene)
    assert built.grid.bodies is not None
    own = tuple(built.grid.ids[built.grid.bodies.number == 0].tolist())
    start = InitialVelocity(nodes=own, x=-V)
    return Model(built.grid, msgspec.structs.replace(built.settings, conditions=(*built.settings.conditions, start)))


def rebound(e: float) -> float:
    """Speed of the middle of mass over that before."""
    system, state = motion = prepare(disc_on_wall(e, Run()), Options(threads=1))
    bodies = system.model.grid.bodies
    assert bodies is not None
    motion.advance(1, 1 + int(3 / system.time_step))
    assert system.contact is not None
    assert not system.contact.touching(state)
    own = bodies.number == 0
    return float(np.average(state.rate[own, 0], weights=system.area[own]) / V)


@pytest.mark.slow
def test_a_disc_rebounds_by_the_share_of_energy_in_contact() -> None:
    lossless = rebound(1.0)
    shown = {e: rebound(e) for e in (0.8, 0.6, 0.3)}
    assert lossless == pytest.approx(0.990, abs=0.005)
    assert list(shown.values()) == pytest.approx([0.913, 0.850, 0.789], abs=0.005)
    shares = [(1 - (v / lossless) ** 2) / (1 - e**2) for e, v in shown.items()]
    assert shares == pytest.approx([0.41] * 3, abs=0.015)  # .414, .410, .402


def test_a_restitution_that_bodies_do_not_show_is_said() -> None:
    with pytest.warns(ModelNote, match=r"\$.contact.restitution.*0.6 with bodies that deform, which usually"):
        simulate(disc_on_wall(0.6, Run(steps=1)), None, Options(threads=1)).close()


def test_bodies_that_are_all_rigid_show_their_restitution() -> None:
    model = disc_on_wall(0.6, Run(steps=1))
    grid, settings = model.grid, model.settings
    assert grid.bodies is not None
    wall = next(condition for condition in settings.conditions if isinstance(condition, RigidBody))
    disc = msgspec.structs.replace(wall, nodes=tuple(grid.ids[grid.bodies.number == 0].tolist()), name="disc")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_doubtful_conditions(Model(grid, msgspec.structs.replace(settings, conditions=(wall, disc))), 1.0)
