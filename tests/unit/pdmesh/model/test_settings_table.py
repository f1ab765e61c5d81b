"""The table of settings is made from the structs that declare them."""

from __future__ import annotations

import re

import msgspec
import pytest

from pdmesh.model.document import Run, Settings
from pdmesh.model.material import Material
from pdmesh.model.settings_table import PARTS, Setting, markdown, settings, unit_of
from pdmesh.model.suggestions import dotted_names
from pdsolve.__main__ import main

ROWS = {row.name: row for row in settings()}


def test_every_setting_is_there_once() -> None:
    names = [name for name in dotted_names(Settings) if name.split(".")[0] in PARTS]
    assert list(ROWS) == sorted(names, key=lambda name: PARTS.index(name.split(".")[0]))
    assert {f"material.{name}" for name in Material.__struct_fields__} <= ROWS.keys()
    assert {f"run.{field.name}" for field in msgspec.structs.fields(Run)} <= {
        name if name.count(".") == 1 else name.rsplit(".", 1)[0] for name in ROWS
    }


@pytest.mark.parametrize(
    ("name", "unit", "default", "word"),
    [
        ("material.E", "Pa", "required", "Young"),
        ("material.rho", "kg/m^3", "required", "density"),
        ("material.alpha", "1/K", "none", "strain"),
        ("run.duration", "s", "none", "steps"),
        ("run.probes", "m", "none", "nearest"),
        ("run.fatigue.C", "m/cycle", "none", "growth"),
        ("run.steps", "", "1000", "time steps"),
        ("run.damping", "1/s", "0.0", "force"),
        ("run.static.opening", "m", "none", "gap"),
        ("run.hybrid.kappa", "", "0.7", "become fine"),
        ("medium.D", "m^2/s", "required", "diffusivity"),
    ],
)
def test_a_setting_has_its_unit_default_and_meaning(name: str, unit: str, default: str, word: str) -> None:
    assert (ROWS[name].unit, ROWS[name].default) == (unit, default)
    assert word in ROWS[name].meaning
    assert unit_of(name) == unit


@pytest.mark.parametrize("row", ROWS.values(), ids=lambda row: row.name)
def test_a_setting_says_what_it_may_be_and_what_it_means(row: Setting) -> None:
    assert row.values
    assert row.default
    assert re.match(r"(?!(of|as|from|that|the same|none|needed)\b)\w", row.meaning), "refers to what is elsewhere"


def test_a_setting_without_a_row_has_no_unit() -> None:
    assert unit_of("run.none") == unit_of("notch") == ""


def test_the_command_prints_tables_in_markdown(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["--help-settings"])
    assert stop.value.code == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines == markdown(settings())
    assert [line for line in lines if line.startswith("## ")] == [f"## {part}" for part in PARTS]
    assert all(line.count("|") == 6 for line in lines if line.startswith("|"))
