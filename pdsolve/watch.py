"""How far a run is: a bar in a terminal or a notebook, a line now and then elsewhere; and how it is stopped."""

from __future__ import annotations

import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable
from types import FrameType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pdsolve.simulation import Progress

LINE_EVERY = 10.0  # s between two lines of progress where there is no terminal


def in_notebook() -> bool:
    """Whether this process is a notebook's kernel."""
    return "ipykernel" in sys.modules


def bar(what: str, unit: str, **more: Any) -> Any:
    """A bar of progress (tqdm's), as a widget in notebooks that have them; None where nobody would see it."""
    if not (sys.stderr.isatty() or in_notebook()):
        return None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a notebook without widgets: the bar is one of letters
        from tqdm.auto import tqdm
    return tqdm(desc=what, unit=unit, dynamic_ncols=True, leave=False, **more)


class Watch:
    """Shows progress and turns Ctrl-C, or a notebook's stop, into a stop with a checkpoint.

        with Watch() as watch:
            simulate(model, path, watch=watch)

    A run that was stopped goes on by `resume(path, watch=watch)`.
    """

    def __init__(self, quiet: bool = False) -> None:
        self._quiet = quiet
        self._stopped = False
        self._bar: Any = None
        self._said = time.monotonic()

    def __enter__(self) -> Callable[[Progress], bool]:
        self._listens = threading.current_thread() is threading.main_thread()
        if self._listens:
            self._before = signal.signal(signal.SIGINT, self._stop)
        self._bar = None if self._quiet else bar("preparing (the first run compiles)", " steps")
        return self._show

    def __exit__(self, *_: object) -> None:
        if self._listens:
            signal.signal(signal.SIGINT, self._before)
        if self._bar is not None:
            self._bar.close()

    def _stop(self, number: int, frame: FrameType | None) -> None:
        if self._stopped:  # asked twice: at once
            if callable(self._before):
                self._before(number, frame)
            raise KeyboardInterrupt
        self._stopped = True

    def _show(self, progress: Progress) -> bool:
        told = f"broken bonds {progress.broken}, balance {progress.balance:+.1e}"
        if progress.fine is not None:
            told += f", fine {progress.fine.fine_share:.1%}"
            told += f", clipped stretch {progress.fine.clipped_stretch:.2f}" if progress.fine.clipped_stretch else ""
        if progress.masses:
            told = progress.masses
        if progress.going is not None:
            told = f"{progress.going.iterations} iterations, residual {progress.going.residual:.1e}, {told}"
        if self._bar is not None:
            self._bar.total = progress.steps
            self._bar.set_description_str("solving", refresh=False)
            self._bar.set_postfix_str(told, refresh=False)
            self._bar.update(progress.step - self._bar.n)
        elif not self._quiet and time.monotonic() - self._said > LINE_EVERY:
            self._said = time.monotonic()
            print(f"step {progress.step} of {progress.steps}, {told}", file=sys.stderr, flush=True)
        return self._stopped
