"""Materials that cannot be: one line that names file and place, exit code 2, and nothing written."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import msgspec
import numpy as np
import pytest
from messages import naming
from plates import GLASS, plate, square_grid

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh.model.document import Run, Velocity, write_file
from pdmesh.model.node_grid import document_of
from pdsolve.__main__ import main
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

FAMILY = ["material.model=correspondence", "material.nu=0.2"]
COHESIVE = ["material.law=cohesive", "material.f_t=30e6"]
FLOWS = [*FAMILY, "material.solid=j2", "material.failure=none", "material.yield_stress=1e8"]


@pytest.mark.quick_cases(8)
@pytest.mark.parametrize(
    ("said", "words"),
    [
        (
            ["material.model=ordinary", "material.nu=0.5"],
            naming("$.material.nu", found="0.5", expected=("Poisson's", "below 0.5")),
        ),
        (["material.model=micropolar", "material.nu=0.34"], naming("$.material.nu", found="0.34", expected="0.3333")),
        ([*FAMILY, "material.order=7"], naming("$.material.order", found="7", expected="4")),
        ([*FAMILY, "material.order=8"], re.escape("material.order")),
        (["material.law=bilinar"], naming("$.material.law", "'bilinar'", expected="mean 'bilinear'")),
        (["material.law=cohesive"], naming("$.material.f_t", found="missing", expected=("strength", "Pa"))),
        ([*COHESIVE, "material.shape=round"], re.escape("material.shape")),
        ([*COHESIVE, "material.nu=0.4"], naming("$.material.nu", found="0.4", expected="0.3333")),
        (
            [*COHESIVE, "material.f_t=120e6"],  # of a continuum 2 1.3^2 l_ch / (18 / 5 pi) = 2.716e-3 m
            naming("$.material.f_t", found=("0.0009208 m", "0.003 m"), expected="0.002737 m"),
        ),
        ([*FLOWS, "material.yield_stress=0"], re.escape("material.yield_stress")),
        ([*FLOWS, "material.hardening=-1e9"], naming("$.material.hardening", found="-1e+09", expected="0 Pa")),
    ],
)
def test_a_material_that_cannot_be(
    said: list[str], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "plate.json"
    made = plate(square_grid(21, 15), 3, run=Run(steps=10))
    write_file(document_of(made.grid, made.settings), path)
    settings = [part for each in said for part in ("--set", each)]
    assert main([str(path), *settings, "-o", str(tmp_path / "plate.sqlite")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("pdsolve: ")
    assert re.search(words, line)
    assert "; " in line.lower()
    assert [file.name for file in tmp_path.iterdir()] == ["plate.json"]


@pytest.mark.slow
@pytest.mark.parametrize("control", ["silling", "none"])
def test_families_that_become_singular_hold_nothing(control: str) -> None:
    """A plate torn to pieces, down to nodes without a bond: nothing is but a number, and momentum is kept."""
    solid = {"model": "correspondence", "nu": 0.3, "failure": "stretch", "G0": 0.5, "control": control}
    ends = tuple(
        Velocity(box=(-1.0, low, 1.0, high), y=speed, breakable=True)
        for low, high, speed in ((-1.0, 1e-4, -20.0), (8.9e-3, 1.0, 20.0))
    )
    grid = square_grid(15, 10)
    grid = dataclasses.replace(grid, cracks=np.array([[-1.0, 4.5e-3, 5e-3, 4.5e-3]]))
    model = plate(grid, 2, material=msgspec.structs.replace(GLASS, **solid), conditions=ends)
    system, state = prepare(model, Options(threads=1))
    system.stepper.advance(state, 1, 300)
    left = system.initial_bond_counts - np.bincount(system.operator.broken().source, minlength=len(grid))
    assert left.min() <= 2 < system.initial_bond_counts.min()
    assert all(np.isfinite(column).all() for column in state)
    assert np.isfinite(compute_energy_balance_row(system, state, 299)).all()
    assert all(np.isfinite(values).all() for values in system.operator.fields(state).values())
