"""A fine zone that moves in single precision, beside double precision."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import msgspec
import numpy as np
import pytest
from database_contents import contents
from zoned_plates import struck

from pdsolve.options import Options
from pdsolve.results import Results
from pdsolve.run.simulation import prepare, resume, simulate

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module", params=["brittle", "bilinear", "cohesive"])
def solved(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> tuple[str, Path]:
    """A struck plate of each law in single precision."""
    path = tmp_path_factory.mktemp("single") / "whole.sqlite"
    simulate(struck("hybrid", law=request.param), path, Options(threads=1, precision="float32")).close()
    return request.param, path


@pytest.mark.parametrize("damping", [0.0, 1e4])
def test_each_bit_is_the_same_however_steps_are_divided(damping: float) -> None:
    """How many steps are taken at once follows from the time they take."""
    plate = struck("hybrid")
    run = msgspec.structs.replace(plate.settings.run, damping=damping)
    plate = dataclasses.replace(plate, settings=msgspec.structs.replace(plate.settings, run=run))
    motions = []
    for together in (8, 80):
        problem = prepare(plate, Options(threads=1, precision="float32"))
        for step in range(1, 161, together):
            problem.advance(step, step + together)
        zone = problem.system.operator.engine
        motions.append((zone.zone.fine.u[zone.displacement_buffer_index], zone.zone.coarse.v, zone.break_events().step))
    assert len(motions[0][2]) > 100
    for one, other in zip(*motions, strict=True):
        assert np.array_equal(one, other)


def test_the_same_plate_cracks(solved: tuple[str, Path]) -> None:
    """First break, energies and zone as in double precision; the books balance as well."""
    law, path = solved
    with simulate(struck("hybrid", law=law), None, Options(threads=1)) as double, Results.open(path) as single:
        one, other = single.summary(), double.summary()
        assert single.breaks().step[0] == double.breaks().step[0]
        assert one["broken_bonds"] == pytest.approx(other["broken_bonds"], rel=0.01)  # measured 0, 9e-4
        for name in ("work", "kinetic", "strain", "dissipated"):
            assert one["energy"][name] == pytest.approx(other["energy"][name], rel=0.01), name  # 4e-6, 2e-3
        assert one["balance"] == pytest.approx(other["balance"], abs=1e-4)  # 9e-7, 1.4e-5
        assert one["hybrid"]["fine_share"] == pytest.approx(other["hybrid"]["fine_share"], abs=0.01)
        last = single.frames()[0].tolist()[-1]
        assert np.abs(single.field("ux", last)).max() > 0


def test_a_stopped_run_goes_on_to_the_same_tables(solved: tuple[str, Path], tmp_path: Path) -> None:
    """On two threads too."""
    law, whole = solved
    path = tmp_path / "stopped.sqlite"
    single = Options(threads=2, precision="float32")
    simulate(struck("hybrid", law=law), path, single, lambda progress: progress.step > 80).close()
    resume(path, threads=1).close()
    assert contents(path) == contents(whole)
