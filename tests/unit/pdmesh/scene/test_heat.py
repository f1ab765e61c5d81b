"""Heat beside mechanics in scenes: the conditions of the grid file that it becomes, and half of it refused."""

from __future__ import annotations

import msgspec
import numpy as np
import pytest
from messages import naming

from pdmesh import Body, Box, Heat, Material, Medium, Scene, SceneError, box, build
from pdmesh.drawing.building import meshed
from pdmesh.grid.lattice import build_grid
from pdmesh.model.document import Concentration, Displacement, Exchange, InitialConcentration, Source
from pdmesh.reports.report import info, info_lines
from pdmesh.scene.solids import Sheet

GLASS = Material(E=70e9, rho=2500.0, G0=8.0, micromodulus="constant", alpha=9e-6, T0=300.0)
COLD = msgspec.structs.replace(GLASS, alpha=None, T0=None)
HEAT = Heat(k=1.0, c=800.0)  # with rho: D = 5e-7 m^2/s, 2e6 J/(m^3 K)
PLATE = box(0, 0, 0.02, 0.01)


def plate() -> Scene:
    return (
        Scene(PLATE, 1e-3, GLASS, medium=HEAT)
        .temperature("left", 350.0, profile=((0.0, 1.0), (1.0, 2.0)))
        .convection("right", h=1000.0, outside=280.0)
        .heat("top", flux=1e4)
        .heat(box(0.005, 0, 0.01, 0.005), rate=4e6, name="core")
        .initial_temperature(box(0, 0, 0.005, 0.01), 320.0)
        .fix("left")
    )


def test_watts_become_rates_of_temperature() -> None:
    """Heat in watts is divided by rho c = 2e6 J/(m^3 K)."""
    _, settings, _ = build_grid(plate())
    assert settings.physics == "thermoelastic"
    assert settings.medium == Medium(D=5e-7, heat_capacity=2e6, carries="heat")
    held, cooled, flux, rate, began, fixed = settings.conditions
    assert isinstance(held, Concentration)
    assert (held.value, held.profile, len(held.nodes or ())) == (350.0, ((0.0, 1.0), (1.0, 2.0)), 11)
    assert isinstance(cooled, Exchange)
    assert (cooled.coefficient, cooled.value, cooled.length) == (pytest.approx(5e-4), 280.0, 0.01)
    assert isinstance(flux, Source)
    assert (flux.flux, flux.rate, flux.length) == (pytest.approx(5e-3), None, 0.02)
    assert isinstance(rate, Source)
    assert (rate.flux, rate.rate, rate.name) == (None, pytest.approx(2.0), "core")
    assert isinstance(began, InitialConcentration)
    assert began.value == 320.0
    assert isinstance(fixed, Displacement)


def test_info_says_what_there_is_in_the_words_of_heat() -> None:
    found = build(plate())
    lines = info_lines(info(found.document, "plate"))
    assert "physics: thermoelastic" in lines
    kinds = [line.split(" '")[0] for line in lines if "'" in line]
    assert kinds == [
        "temperature", "convection", "heat source", "heat source", "initial temperature", "displacement"
    ]  # fmt: skip
    assert not any("edge" in line for line in lines)
    told = {line.split("':")[0]: line for line in lines if "'" in line}
    assert "value = 350 K" in told["temperature 'left"]
    assert "coefficient = 1000 W/(m^2 K)" in told["convection 'right"]
    assert "flux = 10000 W/m^2" in told["heat source 'top"]
    assert "rate = 4e+06 W/m^3" in told["heat source 'core"]


@pytest.mark.parametrize(("medium", "unit"), [(Medium(D=5e-7, carries="heat"), "K/s"), (Medium(D=5e-7), "mol/(m^3 s)")])
def test_info_says_rates_in_what_the_medium_knows(medium: Medium, unit: str) -> None:
    found = build(Scene(PLATE, 1e-3, medium=medium).supply(PLATE, rate=2.0, name="core"))
    assert any("'core'" in line and f"rate = 2 {unit}" in line for line in info_lines(info(found.document, "plate")))


@pytest.mark.slow
def test_a_body_takes_heat_through_its_sheets() -> None:
    corners = np.array([(0.02, 0, 0), (0.02, 0.01, 0), (0.02, 0.01, 0.01), (0.02, 0, 0.01)])
    end = Sheet(corners[[[0, 1, 2], [0, 2, 3]]])
    body = (
        Body(Box((0, 0, 0), (0.02, 0.01, 0.01)), 1e-3, GLASS, medium=HEAT)
        .temperature("left", 350.0)
        .convection(end, h=1000.0, outside=280.0)
        .heat(end, flux=1e4)
        .initial_temperature(Box((0, 0, 0), (0.005, 0.01, 0.01)), 320.0)
        .fix("left")
    )
    settings = build(meshed(body)).settings
    held, cooled, flux, began, _ = settings.conditions
    assert (settings.physics, settings.medium) == ("thermoelastic", Medium(D=5e-7, heat_capacity=2e6, carries="heat"))
    assert isinstance(held, Concentration)
    assert held.value == 350.0
    assert isinstance(cooled, Exchange)
    assert (cooled.coefficient, cooled.value) == (pytest.approx(5e-4), 280.0)
    assert cooled.surface == pytest.approx(1e-4)
    assert isinstance(flux, Source)
    assert flux.flux == pytest.approx(5e-3)
    assert isinstance(began, InitialConcentration)
    assert began.value == 320.0


def test_a_medium_without_alpha_is_diffusion_alone() -> None:
    assert Scene(PLATE, 1e-3, COLD, medium=HEAT).physics == "diffusion"
    assert Scene(PLATE, 1e-3, medium=Medium(D=1e-9)).physics == "diffusion"
    assert Scene(PLATE, 1e-3, COLD).physics == "mechanics"


HALF = {
    "alpha without a medium": (
        lambda: Scene(PLATE, 1e-3, GLASS),
        naming("medium", "material.alpha", "9e-06", found="missing"),
    ),
    "alpha without a medium in space": (
        lambda: Body(Box((0, 0, 0), (1, 1, 1)), 0.1, GLASS),
        naming("medium", "material.alpha", found="missing"),
    ),
    "alpha without T0": (
        lambda: Scene(PLATE, 1e-3, msgspec.structs.replace(GLASS, T0=None), medium=HEAT),
        naming("material", "T0", "9e-06", found="missing"),
    ),
    "T0 without alpha": (
        lambda: Scene(PLATE, 1e-3, msgspec.structs.replace(GLASS, alpha=None), medium=HEAT),
        naming("material", "alpha", "300", found="missing"),
    ),
    "a region that does not expand": (
        lambda: Scene(PLATE, 1e-3, GLASS, medium=HEAT).region(box(0, 0, 0.01, 0.01), COLD, "cold"),
        naming("material 'cold'", "alpha", found="missing"),
    ),
    "a region of another density": (
        lambda: Scene(PLATE, 1e-3, GLASS, medium=HEAT).region(
            box(0, 0, 0.01, 0.01), msgspec.structs.replace(GLASS, rho=7800.0), "steel"
        ),
        naming("material 'steel'", "rho", found="7800", expected="2500"),
    ),
    "watts into a medium of which D alone is known": (
        lambda: Scene(PLATE, 1e-3, GLASS, medium=Medium(D=5e-7)).convection("left", 1.0, 300.0),
        naming("exchange 'left'", "medium", found="5e-07", expected=("k", "c")),
    ),
    "convection without h": (
        lambda: plate().convection("left", outside=300.0),
        naming("exchange 'left'", "h", found="missing", expected="W"),
    ),
    "convection to nothing": (
        lambda: plate().convection("left", 10.0),
        naming("exchange 'left'", "outside", found="missing", expected="K"),
    ),
    "no density": (lambda: build(Scene(PLATE, 1e-3, medium=HEAT)), naming("medium", "material", found="missing")),
    "no conductivity": (lambda: Heat(k=0.0, c=800.0), naming("k", found="0.0")),
}  # fmt: skip


@pytest.mark.parametrize("name", HALF)
def test_half_of_heat_and_mechanics_is_refused_in_one_line(name: str) -> None:
    made, message = HALF[name]
    with pytest.raises(SceneError, match=message) as refused:
        made()
    assert "\n" not in str(refused.value)
