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

# Features that no sample has, and rows of two media
OTHERS = {"a number of load steps", "another area rule", "the area rule of the thesis (eq. 19)", "probes"}
OTHERS |= {"conductance of broken bonds"}
TWO_MEDIA = {("heat of deformation", "diffusion"), ("dissolution", "thermal stress")}
TWO_SPACINGS = {"diffusion", "dissolution"}  # which collocation needs of them; tests/unit/pdsolve/diffusion has it
PARTS = 16  # of the pairs, of which a quick test takes one


def options_of(case: Case) -> Options:
    """The options of a run, on one rank where it is on ranks."""
    if not case.ranks:
        return Options(case.mode, case.precision, threads=1)
    from mpi4py import MPI

    return Options(case.mode, case.precision, threads=1, team=Team(MPI.COMM_SELF))


def can_run_here(changes: Changes) -> bool:
    """Whether this machine has the device and the packages of a sample."""
    return not (("run.device" in changes and missing()) or ("ranks" in changes and find_spec("mpi4py") is None))


def wrong(changes: Changes) -> str:
    """What is wrong with a run of these changes, "" if nothing is."""
    grid, case = sample(changes)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            results = simulate(Model(grid, case.settings), None, options_of(case))
        except Exception as error:  # whatever it is, it is a combination that the table lacks
            return f"{type(error).__name__}: {error}"
    with results:
        last = int(results.frames()[0][-1])
        return " ".join(name for name in results.stored(last) if not np.isfinite(results.field(name, last)).all())


def test_every_row_of_the_table_is_met_by_a_pair() -> None:
    """Both features of a row are in a sample of two features, so that the test below is about all rows."""
    rows = [(feature, by) for feature, by, *_ in TABLE if not {feature.name, by.name} & OTHERS]
    for pair in pairs():
        case = case_of(together(*pair) or {})
        rows = [row for row in rows if not all(any(True for _ in feature.occurrences(case)) for feature in row)]
    assert {(feature.name, by.name) for feature, by in rows} == TWO_MEDIA


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
        grid, case = sample(changes)
        with pytest.raises(ModelError) as error:
            prepare(Model(grid, case.settings, "plate"), options_of(case))
        if str(error.value) != f"plate: {sentence}":
            differ.append((pair, sentence, str(error.value)))
    assert differ == []


def test_two_features_run() -> None:
    """One pair of those below."""
    changes = together("damping", "velocities")
    assert changes is not None
    assert refused(changes) == wrong(changes) == ""


@pytest.mark.slow
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("one", SAMPLES)
def test_what_it_does_not_refuse_runs(one: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A feature, alone and with each of those that come after it."""
    monkeypatch.setitem(LAWS, "own", LAWS["brittle"])
    alone = SAMPLES[one] | {"conditions": SAMPLES[one].get("conditions", ())}
    every = {one: alone} | {other: together(one, other) for first, other in pairs() if first == one}
    if one in TWO_SPACINGS:
        del every["collocation"]
    assert {
        other: said
        for other, changes in every.items()
        if changes is not None and can_run_here(changes) and not refused(changes) and (said := wrong(changes))
    } == {}
