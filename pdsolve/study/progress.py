"""Progress of a study: one bar over all runs in a terminal or notebook; an occasional line elsewhere."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from pdmesh.plain_text import print_to_stderr
from pdsolve.run.progress import LINE_EVERY, make_progress_bar
from pdsolve.study.one_run import PATIENCE

if TYPE_CHECKING:
    from pdsolve.study.dispatch import StudyProgress


class StudyWatch:
    """Shows the progress of a study.

    with StudyWatch() as watch:
        solve_study(study, path, watch=watch)
    """

    def __init__(self, quiet: bool = False) -> None:
        self._quiet, self._said = quiet, time.monotonic()
        self._bar: Any = None

    def __enter__(self) -> StudyWatch:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.close()

    def __call__(self, progress: StudyProgress) -> None:
        done, text = progress.finished + progress.failed, f"{progress.failed} failed"
        for number, name in progress.held.items():
            print_to_stderr(
                f"pdsolve study: run {number} waits up to {PATIENCE:g} s for {name}, which writes to its database"
            )
        if self._quiet:
            return
        if self._bar is None:
            self._bar = make_progress_bar("solving", " runs", total=progress.runs, initial=done)
        if self._bar is not None:
            self._bar.set_postfix_str(text, refresh=False)
            self._bar.update(done - self._bar.n)
        elif time.monotonic() - self._said > LINE_EVERY:
            self._said = time.monotonic()
            print_to_stderr(f"run {done} of {progress.runs}, {text}")
