"""Bodies of bonds that soften, with a zone that moves."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest
from zoned_blocks import block

from pdsolve.model import Model
from pdsolve.numerics.thread_team import cores
from pdsolve.options import Options
from pdsolve.results import Results
from pdsolve.run.simulation import resume, simulate

LAWS: dict[str, dict[str, Any]] = {"bilinear": {"kr": 4.0}, "cohesive": {"f_t": 5e7, "shape": "exponential"}}


def softening(adapt: str, law: str) -> Model:
    """The cracked block of bonds that soften."""
    model = block(adapt)
    material = msgspec.structs.replace(model.settings.material, law=law, **LAWS[law])
    return dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, material=material))


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("law", LAWS)
def test_a_crack_of_softening_bonds_runs_as_on_the_fine_lattice(law: str, tmp_path: Path) -> None:
    """Energies, the first bond and the books; a run that is stopped goes on to the same bits, on two threads too."""
    books, first = [], []
    for adapt in ("none", "hybrid"):
        with simulate(softening(adapt, law), None, Options(threads=1)) as results:
            books.append(results.history())
            first.append(int(results.breaks().step.min()))
            last = results.frames()[0].max()
            fields = [results.field(name, last) for name in ("ux", "uz", "vz", "damage")]
            assert abs(results.summary()["balance"]) < 0.01
    uniform, zone = books
    assert abs(first[1] - first[0]) <= 1
    assert 0.1 < zone["fine_share"][0] < zone["fine_share"][-1] < 0.95  # measured 0.91
    assert zone["work"][-1] == pytest.approx(uniform["work"][-1], rel=0.005)  # measured 0.0018
    assert zone["dissipated"][-1] == pytest.approx(uniform["dissipated"][-1], rel=0.03)  # 0.006
    path, seen = tmp_path / "stopped.sqlite", list[int]()
    options = Options(threads=1)
    simulate(
        softening("hybrid", law), path, options, lambda now: bool(seen.append(now.step)) or now.step >= 120
    ).close()
    resume(path, threads=min(2, cores())).close()
    with Results.open(path) as results:
        for name, values in zip(("ux", "uz", "vz", "damage"), fields, strict=True):
            assert np.array_equal(results.field(name, last), values)
