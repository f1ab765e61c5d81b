"""What is raised where a run stops being physics."""

from __future__ import annotations


class UnstableError(ArithmeticError):
    """A run whose state is no longer physics; the message says where, when, what was found and what was expected."""
