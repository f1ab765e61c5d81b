"""Factors of profiles on a device, which the host computes for some steps at a time."""

from __future__ import annotations

import numpy as np

from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.conditions import Profiles, factor_at
from pdsolve.device.runtime import Session

AT_ONCE = 256  # steps


class Factors:
    """The factors of p profiles at r moments of each step, (AT_ONCE, r, p) in `buffer`."""

    def __init__(self, session: Session, profiles: Profiles, dt: float, moments: tuple[tuple[int, float], ...]) -> None:
        """Moments of a step from 0 on: after so many steps of `dt`, s, less so many s. Raises ModelError for a device
        with too little memory."""
        self.count = max(len(profiles.start) - 1, 1)
        self._session, self._profiles, self._dt = session, profiles, dt
        self._steps, self._less = (np.array(column) for column in zip(*moments, strict=True))
        self._shape = len(moments), self.count
        session.room_for(8 * AT_ONCE * len(moments) * self.count)
        self.buffer = session.put(np.zeros((AT_ONCE, *self._shape)))

    def write(self, step: int, steps: int) -> None:
        """Give the device the factors of so many steps from this one on, at most AT_ONCE."""
        table = np.zeros((steps, *self._shape))
        fill(self._profiles, step + self._steps, self._less, self._dt, table)
        self._session.write(self.buffer, table)


@cached_njit(error_model="numpy")
def fill(profiles, begin, less, dt, table):  # type: ignore[no-untyped-def]
    """Put the factors (steps, r, p) of profiles into a table: at begin[r] steps, less so many s, of the first step."""
    for k, r, p in np.ndindex(len(table), len(begin), len(profiles.start) - 1):
        table[k, r, p] = factor_at(profiles, p, (begin[r] + k) * dt - less[r])
