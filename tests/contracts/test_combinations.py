"""Any two features of a model run to finite numbers, or are refused with the sentence of the table."""

from __future__ import annotations

import warnings
from importlib.util import find_spec
from itertools import islice

import numpy as np
import pytest
from devices import missing

from benchmarks.features import SAMPLES, Changes, case_of, pairs, refused, sample, together
from pdmesh.model.contradictions import Case
from pdmesh.model.possible import TABLE
from pdsolve.laws import LAWS
from pdsolve.model import Model, ModelError
from pdsolve.numerics.team import Team
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.run.simulation import simulate
from pdsolve.study.description import Repeat
from pdsolve.study.run_model import disturbed

# Rows of what belongs to the physics itself, which no other has; tests/unit/pdsolve/diffusion/test_runs.py has them
OF_ONE_PHYSICS = {("materials", "diffusion"), ("media", "mechanics"), ("fields of the material by node", "diffusion")}
OF_ONE_PHYSICS |= {("interfaces", "diffusion")}
# What nodes decide: collocation of contents needs two spacings, and blocks a lattice; tests of their rooms have them
OF_NODES = {("diffusion", "collocation"), ("dissolution", "collocation")}
OF_NODES |= {("kernels of blocks", "repeated runs with shifted nodes")}
PARTS = 32  # of the pairs, of which a quick test takes one


def options_of(case: Case) -> Options:
    """The options of a run, on one rank where it is on ranks."""
    if not case.ranks:
        return Options(case.mode, case.precision, threads=1, kernel=case.kernel)
    from mpi4py import MPI

    return Options(case.mode, case.precision, threads=1, kernel=case.kernel, team=Team(MPI.COMM_SELF))


def model_of(changes: Changes, name: str = "plate") -> Model:
    """The model of a sample, as a study repeats it. Raises ModelError."""
    grid, case = sample(changes)
    model, repeat = Model(grid, case.settings, name), Repeat(**dict.fromkeys(case.disturbances, 0.1))
    step = case.settings.run.time_step or 1e-8
    return disturbed(model, repeat, 1, step) if case.disturbances else model


def can_run_here(changes: Changes) -> bool:
    """Whether this machine has the device and the packages of a sample."""
    return not (("run.device" in changes and missing()) or ("ranks" in changes and find_spec("mpi4py") is None))


def wrong(changes: Changes) -> str:
    """What is wrong with a run of these changes, "" if nothing is."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            results = simulate(model_of(changes), None, options_of(case_of(changes)))
        except Exception as error:  # whatever it is, it is a combination that the table lacks
            return f"{type(error).__name__}: {error}"
    with results:
        last = int(results.frames()[0][-1])
        return " ".join(name for name in results.stored(last) if not np.isfinite(results.field(name, last)).all())


def test_every_row_of_the_table_is_met_by_a_pair() -> None:
    """Both features of a row are in a sample of two features, so that the test below is about all rows."""
    rows = [(feature, by) for feature, by, *_ in TABLE]
    for pair in pairs():
        case = case_of(together(*pair) or {})
        rows = [row for row in rows if not all(any(True for _ in feature.occurrences(case)) for feature in row)]
    assert {(feature.name, by.name) for feature, by in rows} == OF_ONE_PHYSICS


@pytest.mark.parametrize("part", [0, *(pytest.param(part, marks=pytest.mark.slow) for part in range(1, PARTS))])
def test_what_the_table_refuses_is_refused_with_its_sentence(part: int) -> None:
    """Before anything is compiled or solved."""
    differ = []
    for pair in islice(pairs(), part, None, PARTS):
        changes = together(*pair)
        assert changes is not None
        sentence = refused(changes)
        if not sentence or not can_run_here(changes):
            continue
        with pytest.raises(ModelError) as error:
            prepare(model_of(changes), options_of(case_of(changes)))
        if str(error.value) != f"plate: {sentence}":
            differ.append((pair, sentence, str(error.value)))
    assert differ == []


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ("damping", "velocities"),
        ("accelerations", "initial velocities"),
        ("profiles of loads", "probes"),
        ("absorbing layers", "repeated runs with shifted cracks"),
    ],
)
def test_two_features_run(one: str, other: str) -> None:
    """Pairs of those below, with the kernel that most tests use."""
    changes = together(one, other)
    assert changes is not None
    assert refused(changes) == wrong(changes) == ""


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("one", SAMPLES)
def test_what_it_does_not_refuse_runs(one: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A feature, alone and with each of those that come after it."""
    monkeypatch.setitem(LAWS, "own", LAWS["brittle"])
    alone = SAMPLES[one] | {"conditions": SAMPLES[one].get("conditions", ())}
    others = [other for first, other in pairs() if first == one and (one, other) not in OF_NODES]
    every = {one: alone} | {other: together(one, other) for other in others}
    assert {
        other: said
        for other, changes in every.items()
        if changes is not None and can_run_here(changes) and not refused(changes) and (said := wrong(changes))
    } == {}
