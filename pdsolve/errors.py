"""Errors raised if a run becomes unphysical or cannot continue."""

from __future__ import annotations


class CheckpointError(ValueError):
    """An invalid checkpoint; the message says what was found and what was expected, not where."""


class UnstableError(ArithmeticError):
    """A run whose state is no longer physical; the message says where, when, what was found and what was expected."""


class FineZoneTooLateError(UnstableError):
    """A moving fine zone that came too late: a clipped bond would have broken in this step."""

    def __init__(self, words: str, step: int = 0) -> None:
        super().__init__(words)
        self.step = step


class DeviceLostError(RuntimeError):
    """A device that stopped working during a run; the message says which and how."""
