"""Many materials as arrays: the same constants as material by material, in as few calls as there are kinds."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from plates import GLASS, plate, square_grid

from pdmesh import Body, Box, Scene, box
from pdmesh.model.document import Material, Region
from pdmesh.model.material_constants import MaterialColumns, critical_stretch, micromodulus
from pdmesh.model.selection import last_selecting
from pdmesh.scene import checks
from pdsolve.schemes import average_horizon, one_sided

MATERIALS = (
    GLASS,
    Material(E=30e9, rho=2000.0, G0=100.0),
    Material(E=30e9, rho=2000.0, G0=120.0, micromodulus="constant"),
    Material(E=40e9, rho=2000, G0=120.0, micromodulus="constant", nu=0.3),
    Material(E=50e9, rho=2100.0, G0=90.0),
)


def test_constants_are_those_of_each_material() -> None:
    numbers = np.array([4, 0, 2, 1, 3, 3, 0])
    length, horizon = np.linspace(1e-3, 2.9e-3, 7), np.full(7, 3e-3)
    modulus, stretch = np.zeros(7), np.zeros(7)
    groups = list(MaterialColumns(MATERIALS).of(numbers))
    for some, material in groups:
        modulus[some] = micromodulus(material, length[some], horizon[some])
        stretch[some] = critical_stretch(material, horizon[some])
    assert len(groups) == 3  # conical, constant, constant with a ratio of its own
    for at, number in enumerate(numbers):
        one = slice(at, at + 1)
        assert modulus[one] == micromodulus(MATERIALS[number], length[one], horizon[one])
        assert stretch[one] == critical_stretch(MATERIALS[number], horizon[one])


def test_a_single_material_stays_itself() -> None:
    ((some, material),) = MaterialColumns([GLASS, GLASS]).of(np.array([1, 0]))
    assert some == slice(None)
    assert material is GLASS


def test_the_last_selection_counts() -> None:
    grid = square_grid(4, 3)
    regions = (
        Region(material=GLASS, nodes=(1, 2, 5)),
        Region(material=GLASS, box=(0.5e-3, -1.0, 1.5e-3, 1.0)),
        Region(material=GLASS, nodes=(2, 12)),
    )
    one_by_one = np.zeros(12, dtype=np.int64)
    for number, region in enumerate(regions):
        one_by_one[grid.chosen(region.nodes, region.box)] = number + 1
    assert last_selecting(regions, grid).tolist() == one_by_one.tolist()
    window = grid.window(4, 9)  # ids that are not in it are left out
    assert last_selecting(regions, window).tolist() == one_by_one[4:9].tolist()


@pytest.mark.parametrize("scheme", [average_horizon, one_sided])
def test_a_material_for_each_node_costs_no_more_calls(scheme: object, monkeypatch: pytest.MonkeyPatch) -> None:
    """10 000 regions of a node took 45 ms each; they take 0.8 s together, of which 0.3 s are reading."""
    calls = {2: 0, 143: 0}
    for count in calls:
        regions = tuple(
            Region(material=Material(E=66e9 + number * 1e6, rho=2235.0, G0=200.0 - number), nodes=(number + 1,))
            for number in range(count - 1)
        )
        model = plate(square_grid(13, 11), 3, regions=regions)

        def counted(*arguments: object, number: int = count) -> object:
            calls[number] += 1
            return micromodulus(*arguments)  # type: ignore[arg-type]

        monkeypatch.setattr(scheme, "micromodulus", counted)
        bonds = scheme.fill(model).whole().bonds  # type: ignore[attr-defined]
        assert len(np.unique(bonds.limit)) >= count
    assert calls[143] == calls[2]


@pytest.mark.parametrize("kind", ["plate", "body"])
def test_a_region_more_checks_itself_alone(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Scenes check all their parts when they are made: n regions that were added so took n^2 checks."""
    checked = 0
    usual = checks.composed

    def counted(*arguments: object) -> None:
        nonlocal checked
        checked += 1
        usual(*arguments)  # type: ignore[arg-type]

    monkeypatch.setattr("pdmesh.scene.checks.composed", counted)
    monkeypatch.setattr("pdmesh.scene.body.composed", counted)
    scene: Any = Scene(box(0, 0, 1, 1), 0.1, GLASS) if kind == "plate" else Body(Box((0, 0, 0), (1, 1, 1)), 0.1, GLASS)
    of_start = checked
    for number in range(8):
        low = number / 10
        part = box(low, 0, low + 0.1, 1) if kind == "plate" else Box((low, 0, 0), (low + 0.1, 1, 1))
        scene = scene.region(part, MATERIALS[1])
    assert checked - of_start == 8
    assert len(scene.regions) == 8
