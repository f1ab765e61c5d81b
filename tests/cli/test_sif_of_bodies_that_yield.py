"""`pdpost sif` of a body that has yielded: J alone, by the work of its stress."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import msgspec
import numpy as np
import pytest
from messages import mentions
from plates import GLASS, plate, square_grid

from pdmesh.model.document import Displacement, Load, Run, Static
from pdpost.__main__ import main
from pdsolve.run.simulation import Options, simulate

STEEL = msgspec.structs.replace(GLASS, E=200e9, nu=0.3, plane="strain", model="correspondence", failure="none")


def pulled(path: Path, **solid: object) -> Path:
    """The results of a plate of 32 x 32 nodes with an edge crack, pulled by 60 MPa in two load steps."""
    grid = dataclasses.replace(square_grid(32, 32), cracks=np.array([[-1e-3, 15.5e-3, 10.5e-3, 15.5e-3]]))
    ramp = ((0.0, 0.0), (1.0, 1.0))
    pulls = tuple(
        Load(box=(-1.0, y - 1e-4, 1.0, y + 1e-4), body_force=(0.0, 60e9 * sign), profile=ramp)
        for y, sign in ((0.0, -1), (31e-3, 1))
    )
    still = Displacement(nodes=(512,), x=0.0, y=0.0), Displacement(nodes=(511,), y=0.0)
    material, run = msgspec.structs.replace(STEEL, **solid), Run(solver="static", static=Static(load_steps=2))
    simulate(plate(grid, 3, material=material, conditions=(*pulls, *still), run=run), path, Options(threads=1)).close()
    return path


@pytest.mark.slow
def test_a_body_that_yields_has_J_alone(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Ten nodes at the tip flow: J is 4 % above that of an elastic plate (2417 J/m^2), and K means nothing."""
    elastic = pulled(here / "elastic.sqlite", solid="linear")
    steel = pulled(here / "steel.sqlite", solid="j2", yield_stress=250e6)
    J = []
    for path in (elastic, steel):
        assert main(["sif", str(path), "--json"]) == 0
        (tip,) = json.loads(capsys.readouterr().out)["tips"]
        J.append(tip["J"][2])
        assert (tip["K1"][2] is None) == (path == steel)
    assert J[1] / J[0] == pytest.approx(1.04, abs=0.02)  # measured 1.043
    assert main(["sif", str(steel), "-o", "steel.png"]) == 0
    said = capsys.readouterr().out
    assert mentions(said, "J", "K means nothing here", "yields")
    assert "K1" not in said
    assert "turns" not in said
