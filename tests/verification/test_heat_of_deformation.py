"""Stretching cools a body, compression heats it: dT = -alpha T0 tr(stress) / (rho c), W. Thomson (Lord Kelvin) 1853."""

from __future__ import annotations

from pathlib import Path

import msgspec
import numpy as np
import pytest
from database_contents import contents
from diffusion_models import grid, ids
from messages import naming

from pdmesh import Heat, Scene, box, build
from pdmesh.model.document import Displacement, Horizon, Load, Material, Run, Settings
from pdmesh.model.medium import Medium
from pdsolve.model import Model, ModelError
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import Options, resume, simulate

H, E, ALPHA, T0, CAPACITY = 1e-3, 200e9, 1e-5, 300.0, 4e6  # m, Pa, 1/K, K, J/(m^3 K)
STEEL = Material(E=E, rho=8000.0, G0=1e12, micromodulus="constant", alpha=ALPHA, T0=T0)
ONE = Options(threads=1)


def body(*conditions: object, counts: tuple[int, ...], material: Material = STEEL, **run: object) -> Model:
    """A body that conducts next to nothing."""
    axes = np.meshgrid(*[H * (np.arange(count) + 0.5) for count in counts], indexing="ij")
    place = np.column_stack([axis.ravel(order="F") for axis in axes])
    settings = Settings(
        physics="thermoelastic", material=material,
        medium=Medium(D=1e-12, heat_capacity=CAPACITY, deformation=True, carries="heat"),
        horizon=Horizon(3.0), conditions=conditions, run=Run(**run),  # type: ignore[arg-type]
    )  # fmt: skip
    return Model(grid(place, H), settings)


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(
    ("counts", "kernel", "plane"),
    [
        ((20, 20), "listed", "stress"),
        ((20, 20), "blocks", "stress"),
        ((20, 20), None, "strain"),
        ((12, 12, 12), None, "stress"),
    ],
)
def test_a_stretched_body_is_colder(counts: tuple[int, ...], kernel: str | None, plane: str) -> None:
    """Inside of a uniform stretch along all axes: tr(stress) = 3 K tr(strain), in plane stress 2 E e / (1 - nu)."""
    stretch, middle = 1e-4, tuple(count // 2 for count in counts[::-1])
    material = msgspec.structs.replace(STEEL, plane=plane) if len(counts) == 2 else STEEL
    found = prepare(
        body(counts=counts, material=material, time_step=1e-10, steps=10, every=50), ONE._replace(kernel=kernel)
    )
    found.state.value[:] = stretch * found.system.model.grid.position
    found.advance(1, 12)
    T = found.system.coupled_runs[0].state.value[:, 0].reshape(counts[::-1])[middle]
    trace = {"stress": 2 * E / (1 - 1 / 3), "strain": 2 * E * (1 + 1 / 4) / ((1 + 1 / 4) * (1 - 2 / 4))}[plane]
    trace = 3 * E / (1 - 2 / 4) if len(counts) == 3 else trace
    colder = -ALPHA * T0 * trace * stretch / CAPACITY
    assert (T - T0) / colder == pytest.approx(1, rel=0.025)  # measured 2.1, 2.1, 2.1 and 1.5 % more


@pytest.mark.slow
def test_a_bar_that_is_pulled_at_rest_is_colder(tmp_path: Path) -> None:
    """By alpha T0 stress / (rho c), which a stop in the middle does not change; a step later than it is pulled."""
    cells, rows, pull = 60, 16, 100e6
    x = np.tile(H * (np.arange(cells) + 0.5), rows)
    left, right = ids(x < H), ids(x > (cells - 1) * H)
    load = Load(nodes=right, traction=(pull, 0.0), profile=((0.0, 0.0), (3.0, 1.0)))
    holds = Displacement(nodes=left, x=0.0), Displacement(nodes=(1,), y=0.0)
    run = {"solver": "static", "time_step": 1.0, "steps": 4, "every": 2}
    whole, path = tmp_path / "whole.sqlite", tmp_path / "stopped.sqlite"
    with simulate(model := body(load, *holds, counts=(cells, rows), **run), whole, ONE) as results:
        T = results.field("T", 4).astype(float).reshape(rows, cells)[rows // 2, cells // 2]
        masses = results.summary()["diffusion"]["balance"]
    assert (T0 - T) * CAPACITY / (ALPHA * T0 * pull) == pytest.approx(1, rel=0.03)  # measured 1.7 % less
    assert abs(masses) < 1e-9
    simulate(model, path, ONE, watch=lambda progress: progress.step >= 2).close()
    resume(path, 1).close()
    assert contents(path) == contents(whole)


def test_scenes_say_whether_deformation_heats() -> None:
    scene = Scene(box(0, 0, 0.02, 0.01), 1e-3, STEEL, medium=Heat(k=50.0, c=500.0, deformation=True))
    assert build(scene).settings.medium == Medium(D=1.25e-5, heat_capacity=4e6, deformation=True, carries="heat")


def test_diffusion_alone_deforms_nothing() -> None:
    settings = msgspec.structs.replace(body(counts=(8, 8)).settings, physics="diffusion", material=None)
    with pytest.raises(ModelError, match=naming("medium.deformation", found="true", expected="false")):
        prepare(Model(body(counts=(8, 8)).grid, settings), ONE)
