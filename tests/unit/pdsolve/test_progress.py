"""Progress: a bar is moved by the steps since it was moved last, a line is said now and then; and the first signals."""

from __future__ import annotations

import signal
from types import SimpleNamespace as Part
from typing import Any

import pytest

from pdmesh import stopping
from pdsolve.run import progress
from pdsolve.run.progress import Watch
from pdsolve.run.simulation import Progress
from pdsolve.study import dispatch as of_studies
from pdsolve.study.dispatch import StudyProgress, StudyWatch


class Bar:
    """A bar of tqdm's, as far as it is moved."""

    def __init__(self, n: int = 0) -> None:
        self.n, self.total, self.texts = n, 0, list[str]()
        self.start_t = self.last_print_t = 0.0

    def reset(self, total: int) -> None:
        self.n, self.total = 0, total

    def update(self, more: int) -> None:
        self.n += more

    def set_postfix_str(self, text: str, refresh: bool) -> None:
        self.texts.append(text)

    def set_description_str(self, text: str, refresh: bool) -> None:
        self.texts.append(text)

    def close(self) -> None:
        self.texts.append("closed")


def at(step: int) -> Progress:
    """The progress after a step of 60."""
    return Progress(step, 60, 0, 0.0, "words")


def test_a_bar_stands_at_the_step(monkeypatch: pytest.MonkeyPatch) -> None:
    bar = Bar()
    monkeypatch.setattr(progress, "make_progress_bar", lambda *_: bar)
    with Watch() as watch:
        for step in (10, 25, 60):
            assert watch(at(step)) is False
            assert (bar.n, bar.total) == (step, 60)
    assert bar.texts == ["solving", "words"] * 3 + ["closed"]


def test_a_line_is_said_after_a_while_and_again(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    now = [1000.0]
    monkeypatch.setattr(progress, "time", Part(monotonic=lambda: now[0]))
    monkeypatch.setattr(progress, "make_progress_bar", lambda *_: None)
    with Watch() as watch, Watch(quiet=True) as silent:
        for seconds in (5.0, 10.0, 10.5, 15.0, 21.0):
            now[0] = 1000.0 + seconds
            watch(at(int(seconds)))
            silent(at(int(seconds)))
    assert capsys.readouterr().err == "step 10 of 60, words\nstep 21 of 60, words\n"


def test_a_study_counts_what_failed_as_done(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    bars: list[Bar] = []

    def new(*_: object, initial: int, **__: object) -> Bar:
        bars.append(Bar(initial))
        return bars[-1]

    monkeypatch.setattr(of_studies, "make_progress_bar", new)
    with StudyWatch() as watch:
        for finished, failed in ((3, 1), (5, 1), (5, 4)):
            watch(StudyProgress(20, finished, failed))
            assert bars[0].n == finished + failed
    assert bars[0].texts == ["1 failed", "1 failed", "4 failed", "closed"]
    now = [1000.0]
    monkeypatch.setattr(of_studies, "time", Part(monotonic=lambda: now[0]))
    monkeypatch.setattr(of_studies, "make_progress_bar", lambda *_, **__: None)
    with StudyWatch() as watch:
        for seconds, finished in ((9.0, 1), (11.0, 2), (12.0, 3), (22.0, 4)):
            now[0] = 1000.0 + seconds
            watch(StudyProgress(20, finished, 2))
    assert capsys.readouterr().err == "run 4 of 20, 2 failed\nrun 6 of 20, 2 failed\n"


@pytest.fixture
def came(monkeypatch: pytest.MonkeyPatch) -> Any:
    """The numbers of signals that the handler before got."""
    numbers: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: numbers.append(number))
    yield numbers
    signal.signal(signal.SIGINT, before)


def test_a_signal_ends_a_run_that_is_being_prepared_at_once(came: list[int]) -> None:
    watching = Watch(quiet=True)
    with watching, pytest.raises(KeyboardInterrupt):
        signal.raise_signal(signal.SIGINT)
    assert (came, watching.signal) == ([signal.SIGINT], signal.SIGINT)


def test_a_signal_is_noted_while_a_run_goes_and_the_second_ends_it(came: list[int]) -> None:
    with Watch(quiet=True) as watch:
        assert watch(at(1)) is False
        assert stopping.set_patience(stopping.SAVING) == stopping.SAVING
        signal.raise_signal(signal.SIGINT)
        assert watch(at(2)) is True
        assert came == []
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        assert came == [signal.SIGINT]
    assert stopping.set_patience(stopping.AT_ONCE) == stopping.AT_ONCE


def test_a_signal_ends_at_once_what_is_prepared_after_a_run(came: list[int]) -> None:
    """As a motion that follows a path."""
    with Watch(quiet=True) as watch:
        watch(at(1))
        with stopping.patience(stopping.AT_ONCE), pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert came == [signal.SIGINT]
