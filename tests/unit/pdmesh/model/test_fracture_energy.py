"""A critical stretch in place of G0: the bonds of the finest nodes have it, in every way that a model is made."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest
from messages import naming
from plates import GLASS, plate, square_grid

from pdmesh import Body, Box, Material, Scene, SceneError, box, build
from pdmesh.model.document import read_document
from pdmesh.model.fracture_energy import stretch_of_lattice, with_fracture_energy
from pdmesh.reports.report import info, info_lines
from pdsolve.model import Model, ModelError, read_model
from pdsolve.schemes import average_horizon

STRETCH = 1e-3


def limits(model: Model) -> np.ndarray:
    """The limits of bonds between the finest nodes."""
    bonds = average_horizon.fill(model).whole().bonds
    fine = model.grid.delta < 1.5 * model.grid.delta.min()
    source = np.repeat(np.arange(len(model.grid)), np.diff(bonds.start))
    return np.asarray(bonds.limit[fine[source] & fine[bonds.neighbour]])


@pytest.mark.parametrize("micromodulus", ["conical", "constant"])
@pytest.mark.parametrize("plane", ["stress", "strain"])
def test_bonds_break_at_the_stretch_that_is_set(micromodulus: str, plane: str) -> None:
    words = {"micromodulus": micromodulus, "plane": plane}
    glass = Material(E=65e9, rho=2235, critical_stretch=STRETCH, **words)  # type: ignore[arg-type]
    model = plate(square_grid(9, 9), 4.0, material=glass)
    assert limits(model) == pytest.approx(STRETCH, rel=1e-12)
    assert model.settings.material is not None
    assert model.settings.material.critical_stretch is None  # files and results hold G0
    assert stretch_of_lattice(model.settings.material, 4.0, 1e-3, 2) == pytest.approx(STRETCH, rel=1e-12)


def test_a_body_in_space_has_it_too() -> None:
    glass = with_fracture_energy(Material(E=65e9, rho=2235, critical_stretch=STRETCH), 3.0, 1e-3, 3)
    assert stretch_of_lattice(glass, 3.0, 1e-3, 3) == pytest.approx(STRETCH, rel=1e-12)


def test_a_scene_with_a_zone_and_a_region(tmp_path: Path) -> None:
    """Of the finest nodes; the file has G0, and `info` prints the stretch of each spacing."""
    glass = Material(E=65e9, rho=2235, critical_stretch=STRETCH)
    scene = Scene(box(0, 0, 0.02, 0.01), 1e-3, glass).zone(box(0, 0, 0.01, 0.01), 5e-4)
    built = build(scene.region(box(0, 0, 0.005, 0.01), msgspec.structs.replace(glass, critical_stretch=2 * STRETCH)))
    found = limits(Model(built.grid, built.settings))
    assert found.max() == pytest.approx(2 * STRETCH)
    assert found.min() == pytest.approx(STRETCH)
    built.write(tmp_path / "plate.json")
    text = (tmp_path / "plate.json").read_text()
    assert '"G0"' in text
    assert "critical_stretch" not in text
    told = info(read_document(text, "plate.json"), "plate.json")
    assert told["critical_stretch"] == pytest.approx({"0.0005": STRETCH, "0.001": STRETCH / np.sqrt(2)})
    assert "critical stretch of brittle bonds: 0.001 of 0.0005 m, 0.0007071 of 0.001 m" in info_lines(told)
    above = read_model(tmp_path / "plate.json", assignments=[("material.critical_stretch", "3e-3")])
    assert limits(above).max() == pytest.approx(3 * STRETCH)


@pytest.mark.parametrize("dimension", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_a_body_beside_has_it_at_its_own_spacing(dimension: int) -> None:
    """Not at that of the finest body: G0 goes as the square of the stretch times the spacing."""
    glass = Material(E=65e9, rho=2235, critical_stretch=STRETCH)
    tough = msgspec.structs.replace(glass, critical_stretch=2 * STRETCH)
    scene: Scene | Body
    if dimension == 2:
        scene = Scene(box(0, 0, 0.02, 0.01), 1e-3, glass).body(box(0.03, 0, 0.05, 0.01), "b", 2e-3, tough)
    else:
        block = Body(Box((0, 0, 0), (0.01, 0.01, 0.01)), 1e-3, glass)
        scene = block.body(Box((0.02, 0, 0), (0.03, 0.01, 0.01)), "b", 2e-3, tough)
    settings = build(scene).settings
    own, (region,) = settings.material, settings.regions
    assert own is not None
    assert stretch_of_lattice(own, 3.0, 1e-3, dimension) == pytest.approx(STRETCH, rel=1e-12)
    assert stretch_of_lattice(region.material, 3.0, 2e-3, dimension) == pytest.approx(2 * STRETCH, rel=1e-12)
    times = region.material.G0 / own.G0
    assert times == pytest.approx(8, rel=1e-12)


def test_what_it_cannot_be_said_of() -> None:
    soft = {"law": "bilinear", "kr": 2.0}
    with pytest.raises(SceneError, match=naming("material", "critical_stretch", expected="G0")):
        build(Scene(box(0, 0, 0.02, 0.01), 1e-3, Material(E=1e9, rho=1e3, critical_stretch=1e-3, **soft)))  # type: ignore[arg-type]
    with pytest.raises(ModelError, match=naming("$.material.critical_stretch", expected="G0")):
        plate(square_grid(5, 5), material=Material(E=1e9, rho=1e3, nu=0.2, model="ordinary", critical_stretch=1e-3))
    for wrong, key in (({"G0": 1.0, "critical_stretch": 1e-3}, "critical_stretch"), ({}, "G0"), ({"G0": 0.0}, "G0")):
        with pytest.raises(ModelError, match=naming(f"$.material.{key}", "critical_stretch")):
            plate(square_grid(5, 5), material=Material(E=1e9, rho=1e3, **wrong))
        with pytest.raises(SceneError, match=naming("material", key)):
            Scene(box(0, 0, 0.02, 0.01), 1e-3, Material(E=1e9, rho=1e3, **wrong))
    assert stretch_of_lattice(msgspec.structs.replace(GLASS, law="bilinear", kr=2.0), 3.0, 1e-3, 2) is None
