"""Diffusion on an OpenCL device: the same bits as on the processor, with all that adds to rates."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import msgspec
import numpy as np
import pytest
from database_contents import contents
from devices import needs_opencl
from diffusion_models import CORRODING, disc, ids, lattice, model, row
from messages import naming

from pdmesh.model.document import Concentration, Exchange, MediumRegion, Run, Source
from pdmesh.model.medium import Medium
from pdsolve.model import Model, ModelError, on_device
from pdsolve.options import Options
from pdsolve.results import Results
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import resume, simulate

pytestmark = needs_opencl


def driven(dimension: int = 2, corrected: bool = True) -> Model:
    """Two media with a crack, a source and a content that change, and an edge that lets out."""
    position = lattice(1.0, 9.0 if dimension == 2 else 5.0, dimension)
    x = position[:, 0]
    ends = ids(x < x.min() + 1.1), ids(x > x.max() - 1.1), ids(np.abs(position[:, 1]) < 1.2)
    conditions = (
        Concentration(nodes=ends[0], value=1.0, profile=((0.0, 0.0), (1.0, 1.0), (2.0, 0.3))),
        Exchange(nodes=ends[1], coefficient=0.3, value=0.1, **{"length" if dimension == 2 else "surface": 5.0}),
        Source(nodes=ends[2], rate=0.05, profile=((0.0, 1.0), (1.5, 0.0))),
    )
    region = MediumRegion(box=(2.0, *[-99.0] * (dimension - 1), *[99.0] * dimension), D=0.4)
    medium = Medium(D=1.0, surface_correction=corrected)
    found = model(position, 1.0, medium, conditions=conditions, media=(region,), run=Run(steps=300))
    cracks = np.array([[-4.0, 0.0, 1.0, 0.0]]) if dimension == 2 else found.grid.cracks
    return dataclasses.replace(found, grid=dataclasses.replace(found.grid, cracks=cracks))


MODELS = {
    "corrected": driven,
    "not corrected": lambda: driven(corrected=False),
    "in space": lambda: driven(3),
    "dissolving": lambda: disc(0.25, 600),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", MODELS)
def test_steps(name: str) -> None:
    """In pieces, one of which is longer than factors of profiles are sent for at a time."""
    given = MODELS[name]()
    here, there = (prepare(one, Options(threads=1)) for one in (given, on_device(given, "opencl")))
    begin = here.state.value.copy()
    for problem in (here, there):
        for first, last in ((1, 2), (2, 5), (5, 280)):
            problem.advance(first, last)
    assert np.abs(here.state.value - begin).max() > 0.05
    assert all(map(np.array_equal, here.state, there.state))
    assert there.system.stepper.device_name != "cpu"


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(("first", "then"), [("cpu", "opencl"), ("opencl", "cpu")])
def test_an_interrupted_run_goes_on_elsewhere(
    first: str, then: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("pdsolve.run.simulation.PATIENCE", 1.0)
    given, stopped, whole = disc(0.25, 600, every=10), tmp_path / "stopped.sqlite", tmp_path / "whole.sqlite"
    simulate(on_device(given, first), stopped, Options(threads=1), lambda progress: progress.step >= 150).close()
    with Results.open(stopped) as results:
        assert 0 < results.checkpoint()[0] < 600
    resume(stopped, 1, device=then).close()
    simulate(given, whole, Options(threads=1)).close()
    found, expected = contents(stopped), contents(whole)
    assert {name: rows for name, rows in found.items() if name != "meta"} == {
        name: rows
        for name, rows in expected.items()
        if name != "meta"  # whose model names its device
    }


KINETIC = msgspec.structs.replace(CORRODING, dissolution="kinetic")
REFUSED = {
    "solver": lambda: model(row(80, 1.0), 1.0, Medium(D=1.0), run=Run(solver="implicit", time_step=1.0, steps=1)),
    "dissolution": lambda: disc(0.25, 600, KINETIC),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_no_device_has_is_refused(name: str) -> None:
    with pytest.raises(ModelError, match=naming(name, "opencl")):
        prepare(on_device(REFUSED[name](), "opencl"), Options())


def test_nodes_on_no_lattice_are_refused() -> None:
    given = disc(0.25, 600)
    moved = given.grid.position + 0.02 * np.random.default_rng(1).standard_normal(given.grid.position.shape)
    scattered = dataclasses.replace(given, grid=dataclasses.replace(given.grid, position=moved))
    with pytest.raises(ModelError, match=naming("device", found="lattice", expected="cpu")):
        prepare(on_device(scattered, "opencl"), Options())
