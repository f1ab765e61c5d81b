"""What is raised where a run stops being physics, or cannot go on."""

from __future__ import annotations


class CheckpointError(ValueError):
    """A checkpoint that no run has written; the message says what was found and what was expected, not where."""


class UnstableError(ArithmeticError):
    """A run whose state is no longer physics; the message says where, when, what was found and what was expected."""
