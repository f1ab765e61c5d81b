"""Edges that are held or loaded without a number of rows: as stiff as the lattice inside, at any length."""

from __future__ import annotations

from typing import Literal

import msgspec
import numpy as np
import pytest
import shapely
from messages import mentions

from pdmesh import Material, Run, Scene, box, build
from pdmesh.model.contradictions import Case
from pdmesh.model.document import Displacement, Settings
from pdmesh.model.possible import impossible
from pdmesh.scene.conditions import pulls_of, shares
from pdsolve import Model, Options, simulate

H, E = 1e-3, 70e9
Profile = Literal["conical", "constant"]


def bar(micromodulus: Profile, m: float, n: int, rows: int | None, loaded: bool) -> float:
    """Stretching in the middle of a bar of n spacings over that between its ends."""
    length, width = n * H, n * H / 2
    material = Material(E=E, rho=2500, G0=1e9, micromodulus=micromodulus)
    scene = Scene(box(0, 0, length, width), H, material, m, Run(solver="static"))
    if loaded:
        pull = 1e-6 / length * E
        scene = scene.load("right", traction=(pull, 0), rows=rows).load("left", traction=(-pull, 0), rows=rows)
        scene = scene.pin(length / 2, width / 2).roller(length / 2 - H, width / 2)
    else:
        scene = scene.fix("left", y=None, rows=rows, name="left").fix("right", x=1e-6, y=None, rows=rows)
        scene = scene.fix(shapely.Point(0, width / 2), x=None)
    built = build(scene)
    with simulate(Model(built.grid, built.settings), None, Options(threads=1)) as results:
        u = results.field("ux", int(results.frames()[0][-1])).astype(float)
    x = built.grid.position[:, 0]
    middle = np.abs(x - length / 2) < length / 6
    right, left = u[np.isclose(x, length)], u[np.isclose(x, 0)]
    gradient = float(np.polyfit(x[middle], u[middle], 1)[0]) * length
    return gradient / float(right.mean() - left.mean())


@pytest.mark.slow
@pytest.mark.parametrize("loaded", [False, True], ids=["grips", "loads"])
@pytest.mark.parametrize(
    ("micromodulus", "m", "one_row"),
    [("conical", 3.0, 0.957), ("conical", 4.0, 0.901), ("constant", 3.0, 0.888), ("constant", 4.0, 0.790)],
)
def test_short_bars_stretch_as_much_inside_as_between_their_ends(
    micromodulus: Profile, m: float, one_row: float, loaded: bool
) -> None:
    share = bar(micromodulus, m, 20, None, loaded)
    assert share == pytest.approx(1.0, abs=0.01)  # measured: .998 to 1.007
    soft = bar(micromodulus, m, 20, 1, loaded)
    assert soft == pytest.approx(one_row, abs=0.02)  # measured: as listed; loads .953, .891, .876, .771


@pytest.mark.slow
def test_a_grip_a_horizon_deep_needs_no_correction() -> None:
    """Bonds to what is farther inside have all that they would have."""
    from pdsolve.schemes import average_horizon
    from pdsolve.schemes.gripped_edges import gripped

    scene = Scene(box(0, 0, 0.02, 0.01), H, Material(E=E, rho=2500, G0=1e9), 3.0, Run(solver="static"))
    built = build(scene.fix("left", rows=4).fix("right", x=1e-6, y=None, rows=4))
    deep = tuple(msgspec.structs.replace(one, corrected=True) for one in built.settings.conditions)
    model = Model(built.grid, msgspec.structs.replace(built.settings, conditions=deep))
    plain = average_horizon.fill(model)
    assert np.array_equal(gripped(plain, model).whole().bonds.stiffness, plain.whole().bonds.stiffness)


def test_rows_share_a_traction_as_their_families_lack() -> None:
    pulls = pulls_of(Material(E=1.0, rho=1.0, G0=1.0), 3.0)
    assert sum(pulls) == pytest.approx(1.0)
    assert shares(pulls, np.array([0.0, 0.5, 1.0, 2.0, 3.0])) == pytest.approx([1.0, 1.0, 0.718, 0.218, 0.0], abs=1e-3)
    assert shares((), np.array([5.0])).tolist() == [1.0]


def test_a_traction_without_rows_adds_up_to_itself_times_its_length() -> None:
    scene = Scene(box(0, 0, 0.02, 0.01), H, Material(E=E, rho=2500, G0=1e9), 3.0)
    built = build(scene.load("top", traction=(0.0, 1e6)))
    model = Model(built.grid, built.settings)
    from pdsolve.conditions import drive

    loads = drive(model, model.grid.cells, True, np.float64).loads
    assert loads.value @ model.grid.cells[loads.node] == pytest.approx(1e6 * 0.02, rel=1e-12)
    assert len(np.unique(model.grid.position[loads.node, 1])) == 3
    thesis = drive(model, model.grid.cells, False, np.float64).loads  # whose one row has traction / delta, as ever
    assert np.unique(model.grid.position[thesis.node, 1]).tolist() == [0.01]
    assert thesis.value[thesis.axis == 1] == pytest.approx(1e6 / H, rel=0)


def test_corrected_grips_in_space_are_refused() -> None:
    grip = Displacement(box=(-1, -1, -1, 1, 1, 1), x=0.0, corrected=True)
    settings = Settings(material=Material(E=E, rho=2500, G0=1e9), conditions=(grip,))
    assert mentions(next(impossible(Case(settings, 3))), "$.conditions[0].corrected", found="true", expected="false")
