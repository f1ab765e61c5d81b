"""What kinds of materials say of themselves is whole, is what the page says, and is what solvers do."""

from __future__ import annotations

import dataclasses
from typing import get_args, get_type_hints

import msgspec
import numpy as np
import pytest
from devices import needs_opencl
from plates import GLASS, plate, square_grid

from benchmarks.combinations import MATERIALS, PAGE, RUNS, combinations, parameters, refusals
from benchmarks.pages import sections
from pdmesh.model.document import Displacement, Material
from pdmesh.model.materials import KINDS
from pdmesh.model.materials.solids import SOLIDS
from pdsolve.model import ModelError
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.static_start import start_in_static_equilibrium

SHARED = {"E", "rho", "G0", "critical_stretch", "nu", "alpha", "T0", "model", "micromodulus", "plane", "sight"}
SHARED |= {"gamma", "failure", "calibration", "coarse"}
CRACKED = dataclasses.replace(square_grid(60, 60, y0=-29.5e-3), cracks=np.array([[-1e-3, 0.0, 28e-3, 0.0]]))
ON_PLATES = (*RUNS, "thesis mode")
YES = [
    (name, where)
    for name, changes in MATERIALS.items()
    if name != "bond, your own law"
    for where, said in zip(ON_PLATES, list(refusals(msgspec.structs.replace(GLASS, **changes)))[1:-1], strict=True)
    if not said
]


def test_every_setting_is_shared_or_of_a_kind() -> None:
    own = {parameter for kind in KINDS.values() for parameter in kind.parameters}
    assert own | SHARED == set(Material.__struct_fields__)
    assert not own & SHARED


def test_every_word_of_the_file_is_a_kind_and_a_solid() -> None:
    hints = get_type_hints(Material)
    assert set(get_args(hints["model"])) == set(KINDS)
    assert set(get_args(hints["solid"])) == set(SOLIDS)
    assert set(get_args(hints["failure"])) == {word for kind in KINDS.values() for word in kind.failures}


@pytest.mark.parametrize("section", [parameters(), combinations()], ids=["settings", "combinations"])
def test_the_page_is_what_materials_say(section: str) -> None:
    parts = [part.strip("\n") for part in sections(PAGE.read_text(encoding="utf-8"))]
    assert section.strip("\n") in parts


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "where"), [pytest.param(*one, marks=needs_opencl) if one[1] == "OpenCL" else one for one in YES]
)
def test_what_goes_with_what_is_prepared(name: str, where: str) -> None:
    """All that the page says yes to, in a plate."""
    held = (
        Displacement(box=(-1.0, -1.0, 1e-4, 1.0), x=0.0, y=0.0),
        Displacement(box=(58.9e-3, -1.0, 1.0, 1.0), x=1e-7),
    )
    run = RUNS.get(where)
    material = msgspec.structs.replace(GLASS, **MATERIALS[name])
    model = plate(CRACKED, 3, material=material, conditions=held, **({} if run is None else {"run": run}))
    found = prepare(model, Options("thesis" if run is None else "conservative"))
    if where == "static start":
        start_in_static_equilibrium(found)
    assert found.system.directed_bond_count > 0


@pytest.mark.slow
def test_what_does_not_is_refused() -> None:
    """All that the page says no to, in a plate."""
    refused = 0
    for name, changes in MATERIALS.items():
        for where in ON_PLATES:
            if (name, where) in YES or name == "bond, your own law":
                continue
            run = RUNS.get(where)
            material = msgspec.structs.replace(GLASS, **changes)
            model = plate(CRACKED, 3, material=material, **({} if run is None else {"run": run}))
            with pytest.raises(ModelError):
                start_in_static_equilibrium(prepare(model, Options("thesis" if run is None else "conservative")))
            refused += 1
    assert refused > 40
