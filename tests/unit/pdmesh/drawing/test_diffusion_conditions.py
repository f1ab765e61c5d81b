"""Heat and mechanics in one drawing: parameters and groups as conditions of a scene."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import pytest
from messages import naming

from pdmesh import SceneError
from pdmesh.drawing.file_reading import build_file
from pdmesh.drawing.plate_of_groups import Group, scene_of
from pdmesh.model.document import Concentration, Displacement, Exchange, InitialConcentration, Settings, Source
from pdmesh.model.medium import Medium
from pdsolve import read_study
from pdsolve.study.run_model import model_of_run

CORNERS = [[0, 0, 0], [0.02, 0, 0], [0.02, 0.01, 0], [0, 0.01, 0]]
FACE = tuple([CORNERS[i], CORNERS[(i + 1) % 4]] for i in range(4))
SIDES = {name: [FACE[i]] for i, name in enumerate(("bottom", "right", "top", "left"))}
GROUPS = (
    Group("zone:plate", 2, surfaces=(FACE,)),
    Group("hold:left", 1, curves=tuple(SIDES["left"])),
    Group("exchange:right", 1, curves=tuple(SIDES["right"])),
    Group("supply:top", 1, curves=tuple(SIDES["top"])),
)
VALUES: dict[str, float | str] = {
    "Zones/plate/Spacing": 1e-3,
    "Material/E": 70e9,
    "Material/rho": 2500.0,
    "Material/G0": 8.0,
    "Material/alpha": 9e-6,
    "Material/T0": 300.0,
    "Medium/k": 1.0,
    "Medium/c": 800.0,
    "Holds/left/Temperature": 350.0,
    "Holds/left/Profile": "ramp 2",
    "Exchanges/right/h": 1000.0,
    "Exchanges/right/Outside": 280.0,
    "Supplies/top/Heat flux": 1e4,
    "Supplies/core/Heat rate": 4e6,
    "Supplies/core/Box": "0.005 0 0.01 0.005",
    "Begins/warm/Temperature": 320.0,
    "Begins/warm/Box": "0 0 0.005 0.01",
    "Fixes/foot/Box": "0 0 0.02 0.0015",
}
conducting = partial(Medium, D=5e-7, heat_capacity=2e6, carries="heat")


def settings(values: dict[str, float | str | None]) -> Settings:
    given = {f"Peridynamics/{name}": value for name, value in (VALUES | values).items() if value is not None}
    from pdmesh.grid.lattice import build_grid

    return build_grid(scene_of(GROUPS, given, "glass.geo"))[1]


def test_a_drawing_has_both_kinds_of_conditions() -> None:
    found = settings({})
    assert (found.physics, found.medium) == ("thermoelastic", conducting())
    assert found.material is not None
    assert (found.material.alpha, found.material.T0) == (9e-6, 300.0)
    by_name = {condition.name: condition for condition in found.conditions}
    left, right, top, core, warm, foot = (by_name[n] for n in ("left", "right", "top", "core", "warm", "foot"))
    assert isinstance(left, Concentration)
    assert (left.value, left.profile) == (350.0, ((0.0, 0.0), (2.0, 1.0)))
    assert len(left.nodes or ()) == 11  # one row
    assert isinstance(right, Exchange)
    assert (right.coefficient, right.value) == (pytest.approx(5e-4), 280.0)
    assert isinstance(top, Source)
    assert (top.flux, top.rate) == (pytest.approx(5e-3), None)
    assert isinstance(core, Source)
    assert (core.flux, core.rate) == (None, pytest.approx(2.0))
    assert isinstance(warm, InitialConcentration)
    assert warm.value == 320.0
    assert isinstance(foot, Displacement)
    assert settings({"Medium/Broken": 0.2}).medium == conducting(broken=0.2)
    assert settings({"Medium/Deformation": 1.0}).medium == conducting(deformation=True)
    of_D: dict[str, float | str | None] = {"Medium/k": None, "Medium/c": None, "Medium/D": 1e-7, "Medium/Broken": 0.3}
    gone: dict[str, float | str | None] = {"Exchanges/right/h": None, "Exchanges/right/Coefficient": 1.0}
    gone |= {"Supplies/top/Heat flux": None, "Supplies/top/Flux": 1.0}
    gone |= {"Supplies/core/Heat rate": None, "Supplies/core/Rate": 1.0}
    assert settings(of_D | gone).medium == Medium(D=1e-7, broken=0.3)


REFUSED: dict[str, tuple[dict[str, float | str | None], str]] = {
    "no T0": ({"Material/T0": None}, naming("material", "T0", found="missing")),
    "no c": ({"Medium/c": None}, naming("Peridynamics/Medium/c", found="missing")),
    "D beside k": ({"Medium/D": 1e-7}, naming("Peridynamics/Medium/D", expected="leave it out")),
    "both of two": (
        {"Holds/left/Concentration": 1.0},
        naming("Peridynamics/Holds/left/Concentration", found=("Concentration", "Temperature"), expected="one"),
    ),
    "neither of two": (
        {"Exchanges/right/h": None},
        naming("Peridynamics/Exchanges/right/Coefficient", expected=("Coefficient", "h")),
    ),
    "convection to no temperature": (
        {"Exchanges/right/Outside": None},
        naming("Peridynamics/Exchanges/right/Outside", found="missing"),
    ),
    "watts without c": (
        {"Medium/k": None, "Medium/c": None, "Medium/D": 1e-7},
        naming("source 'top'", "medium", found="1e-07", expected=("k", "c")),
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_half_of_it_is_refused_in_one_line(name: str) -> None:
    values, message = REFUSED[name]
    with pytest.raises(SceneError, match=message) as refused:
        settings(values)
    assert "\n" not in str(refused.value)


BLOCK = """
SetFactory("OpenCASCADE");
DefineConstant[
  h = {1, Name "Peridynamics/Zones/block/Spacing"}
  u = {"mm", Name "Peridynamics/Units"}
  E = {70e9, Name "Peridynamics/Material/E"}
  r = {2500, Name "Peridynamics/Material/rho"}
  G = {8, Name "Peridynamics/Material/G0"}
  a = {9e-6, Name "Peridynamics/Material/alpha"}
  T = {300, Name "Peridynamics/Material/T0"}
  k = {1, Name "Peridynamics/Medium/k"}
  c = {800, Name "Peridynamics/Medium/c"}
  t = {350, Name "Peridynamics/Begins/warm/Temperature"}
  b = {"-1 -1 -1 5 11 11", Name "Peridynamics/Begins/warm/Box"}
  o = {280, Name "Peridynamics/Exchanges/end/Outside"}
  w = {1000, Name "Peridynamics/Exchanges/end/h"}
];
Box(1) = {0, 0, 0, 20, 10, 10};
Physical Volume("zone:block") = {1};
Physical Surface("exchange:end") = {2};
"""


@pytest.mark.process
def test_a_drawing_in_space_has_them_too(tmp_path: Path) -> None:
    path = tmp_path / "block.geo"
    path.write_text(BLOCK)
    found = build_file(path).settings
    began, cooled = found.conditions
    assert found.physics == "thermoelastic"
    assert isinstance(began, InitialConcentration)
    assert (began.value, len(began.nodes or ())) == (350.0, 5 * 10 * 10)
    assert isinstance(cooled, Exchange)
    assert (cooled.coefficient, cooled.value) == (pytest.approx(5e-4), 280.0)
    assert cooled.surface == pytest.approx(1e-4)


@pytest.mark.slow
def test_what_heats_is_set_by_its_name(tmp_path: Path) -> None:
    """h, the temperature outside and the one at the start, as `--set` and the axes of a study give them."""
    path = tmp_path / "block.geo"
    path.write_text(BLOCK)
    given = {"Exchanges/end/h": "2000", "Exchanges/end/Outside": "290", "Begins/warm/Temperature": "400"}
    began, cooled = build_file(path, list(given.items())).settings.conditions
    assert isinstance(began, InitialConcentration)
    assert began.value == 400.0
    assert isinstance(cooled, Exchange)
    assert (cooled.coefficient, cooled.value) == (pytest.approx(1e-3), 290.0)
    assert build_file(path, [("Medium/c", "1600")]).settings.conditions[1].coefficient == pytest.approx(2.5e-4)  # type: ignore[union-attr]


@pytest.mark.slow
def test_a_study_varies_convection(tmp_path: Path) -> None:
    """By its word in the drawing; the model of each run has h over rho c."""
    (tmp_path / "block.geo").write_text(BLOCK)
    text = (
        'drawing = "block.geo"\n[vary.drawing]\n"Exchanges/end/h" = [1000, 2000]\n'
        '"Exchanges/end/Outside" = [280, 290]\n'
    )
    (tmp_path / "study.toml").write_text(text)
    study = read_study(tmp_path / "study.toml")
    found = []
    for case in study.cases():
        cooled = model_of_run(study.drawing, case).settings.conditions[1]
        assert isinstance(cooled, Exchange)
        found.append((round(cooled.coefficient, 9), cooled.value))
    assert found == [(5e-4, 280.0), (5e-4, 290.0), (1e-3, 280.0), (1e-3, 290.0)]
