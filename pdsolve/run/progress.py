"""Progress of a run: a bar in a terminal or a notebook, an occasional line elsewhere; and stopping it."""

from __future__ import annotations

import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable
from types import FrameType
from typing import TYPE_CHECKING, Any

from pdmesh import stopping
from pdmesh.commandline import STOPS
from pdmesh.plain_text import print_to_stderr

if TYPE_CHECKING:
    from pdsolve.run.simulation import Progress

LINE_EVERY = 10.0  # s between two lines of progress where there is no terminal


def is_in_notebook() -> bool:
    """Whether this process is a notebook's kernel."""
    kernels = sys.modules.get("ipykernel.kernelapp")  # others import it without being one
    return kernels is not None and bool(kernels.IPKernelApp.initialized())


def make_progress_bar(label: str, unit: str, **tqdm_options: Any) -> Any:
    """A progress bar (tqdm's), as a widget in notebooks that support it; None if nobody would see it."""
    if not (sys.stderr.isatty() or is_in_notebook()):
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a notebook without widgets: the bar is one of letters
        from tqdm.auto import tqdm
    return tqdm(desc=label, unit=unit, dynamic_ncols=True, leave=False, **tqdm_options)


class Watch:
    """Shows progress and turns Ctrl-C, a notebook's stop, SIGTERM and SIGHUP into a stop with a checkpoint.

        with Watch() as watch:
            simulate(model, path, watch=watch)

    A run that was stopped goes on by `resume(path, watch=watch)`. A run that is still being prepared has nothing to
    save: the signal raises KeyboardInterrupt there, and so does a second one at any time.
    """

    def __init__(self, quiet: bool = False) -> None:
        self._quiet = quiet
        self.signal: int | None = None  # that the run is to stop for
        self._before: dict[int, Any] = {}
        self._bar: Any = None
        self._said = time.monotonic()
        self._runs = False  # or is being prepared
        self._compiled = 0.0  # s that kernels were compiled for when progress was last shown
        self._patience: tuple[float, ...] = stopping.AT_ONCE  # before

    def __enter__(self) -> Callable[[Progress], bool]:
        if threading.current_thread() is threading.main_thread():
            for number in STOPS:
                if number == signal.SIGINT or signal.getsignal(number) is not signal.SIG_IGN:  # as under nohup
                    self._before[number] = signal.signal(number, self._request_stop)
        self._bar = None if self._quiet else make_progress_bar("preparing (the first run compiles)", " steps")
        return self._show_progress

    def __exit__(self, *_: object) -> None:
        if self._runs:
            stopping.set_patience(self._patience)
        for number, handler in self._before.items():
            signal.signal(number, handler)
        if self._bar is not None:
            self._bar.close()

    def _request_stop(self, signal_number: int, frame: FrameType | None) -> None:
        again, self.signal = self.signal is not None, self.signal or signal_number
        if again or not self._runs or stopping.has_nothing_to_save():  # asked twice, or prepared anew
            before = self._before[signal_number]
            if callable(before):
                before(signal_number, frame)
            raise KeyboardInterrupt

    def _show_progress(self, progress: Progress) -> bool:
        from pdsolve.codegen.compile_time import compile_seconds  # numba, which --help does not need

        compiled = compile_seconds()
        if not self._runs:
            self._patience = stopping.set_patience(stopping.SAVING)
            self._runs = True
            if self._bar is not None:
                self._bar.reset(progress.last_step)  # the speed, and what is left, are those of steps alone
        elif self._bar is not None:
            self._bar.start_t += compiled - self._compiled
            self._bar.last_print_t += compiled - self._compiled
        self._compiled = compiled
        text = progress.message
        load_step = progress.load_step_progress
        if load_step is not None:
            text = f"{load_step.iterations} iterations, residual {load_step.residual:.1e}, {text}"
        if self._bar is not None:
            self._bar.total = progress.last_step
            self._bar.set_description_str("solving", refresh=False)
            self._bar.set_postfix_str(text, refresh=False)
            self._bar.update(progress.step - self._bar.n)
        elif not self._quiet and time.monotonic() - self._said > LINE_EVERY:
            self._said = time.monotonic()
            print_to_stderr(f"step {progress.step} of {progress.last_step}, {text}")
        return self.signal is not None
