"""How long kernels are compiled in a command: said while it lasts, as nothing else happens."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from numba.core import event

PATIENCE = 1.0  # s of compiling that nobody hears of


class _Listener(event.Listener):
    """Sums the time of compilations, s; those inside another one are part of it."""

    def __init__(self, say: Callable[[str], None]) -> None:
        self.total = 0.0
        self.said = False
        self._say = say
        self._depth = 0
        self._begun = 0.0
        self._timer = threading.Timer(PATIENCE, self._tell)

    def on_start(self, event: Any) -> None:
        self._depth += 1
        if self._depth == 1:
            self._begun = time.monotonic()
            if not self.said:
                self._timer = threading.Timer(PATIENCE, self._tell)
                self._timer.daemon = True
                self._timer.start()

    def on_end(self, event: Any) -> None:
        self._depth -= 1
        if self._depth == 0:
            self._timer.cancel()
            self.total += time.monotonic() - self._begun

    def _tell(self) -> None:
        self.said = True
        self._say("compiling for this processor, once")


@contextmanager
def compile_time_said(say: Callable[[str], None]) -> Iterator[None]:
    """A context that says that kernels are compiled, if that takes more than a second, and at its end how long."""
    listener = _Listener(say)
    with event.install_listener("numba:compile", listener):
        yield
    if listener.said:
        say(f"compiling for this processor, once: {listener.total:.0f} s")
