"""Bodies whose fine zone moves, damped, with layers that absorb, and in single precision."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from zoned_blocks import LENGTH, block

from pdmesh.model.document import Absorb, InitialVelocity
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.results import Results
from pdsolve.run.simulation import resume, simulate

LAYER = Absorb(box=(LENGTH / 4, -1.0, -1.0, 1.0, 1.0, 1.0))  # a quarter of the block, where cells are coarse


def with_conditions(model: Model, *conditions: Any, damping: float = 2e4) -> Model:
    """A model that is damped, 1/s, with these conditions alone."""
    settings, run = model.settings, msgspec.structs.replace(model.settings.run, damping=damping)
    return dataclasses.replace(model, settings=msgspec.structs.replace(settings, run=run, conditions=conditions))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*took .* of the work")
@pytest.mark.parametrize(("layers", "tolerance"), [((), 1e-12), ((LAYER,), 0.01)])  # measured 4e-16, 0.008
def test_free_flight_is_damped_as_on_the_fine_lattice(layers: tuple[Absorb, ...], tolerance: float) -> None:
    """With a layer, in which cells are coarse, and without one: the energy taken, in each row of the books."""
    taken, flight = [], InitialVelocity(box=(-1.0, -1.0, -1.0, 1.0, 1.0, 1.0), x=0.1, z=0.1)
    for adapt in ("none", "hybrid"):
        with simulate(with_conditions(block(adapt, 40), flight, *layers), None, Options(threads=1)) as results:
            books = results.history()
            taken.append(books["damped"][1:] / books["kinetic"][0])
    assert taken[0][-1] > 0.1
    np.testing.assert_allclose(taken[1], taken[0], rtol=tolerance)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*took .* of the work")
def test_books_of_a_damped_zone_that_grows(tmp_path: Path) -> None:
    """The energy is all there, and a run that is stopped goes on to the same books."""
    model = block("hybrid")
    model = with_conditions(model, *model.settings.conditions, LAYER)
    with simulate(model, None, Options(threads=1)) as results:
        books = results.history()
        assert abs(results.summary()["balance"]) < 0.01
    assert books["damped"][-1] > 0.05 * books["work"][-1]
    assert books["fine_share"][-1] > books["fine_share"][0]
    path, seen = tmp_path / "stopped.sqlite", list[int]()
    simulate(model, path, Options(threads=1), lambda now: bool(seen.append(now.step)) or now.step >= 130).close()
    resume(path, threads=1).close()
    with Results.open(path) as results:
        assert np.array_equal(results.history()["damped"], books["damped"])


@pytest.mark.slow
def test_single_precision_is_near_double() -> None:
    """Before bonds break: displacements, and the books; after that the same number of bonds but for some per cent."""
    found = []
    for precision in ("float64", "float32"):
        with simulate(block("hybrid"), None, Options(precision=precision, threads=1)) as results:
            first = int(results.frames()[0][2])
            found.append((results.field("uz", first), results.history(), results.breaks().step))
    (u, books, breaks), (single_u, single_books, single_breaks) = found
    assert np.abs(single_u - u).max() < 1e-4 * np.abs(u).max()
    assert single_books["work"][-1] == pytest.approx(books["work"][-1], rel=1e-3)
    assert single_books["fine_share"][-1] == pytest.approx(books["fine_share"][-1], rel=0.05)
    assert abs(int(single_breaks.min()) - int(breaks.min())) <= 1
