"""A line of the packages that is broken on purpose."""

from __future__ import annotations

from typing import NamedTuple

UNIT, CONTRACTS = "tests/unit/pdsolve", "tests/contracts/test_laws.py"


class Mutant(NamedTuple):
    """A line of the packages, what it becomes, and tests of which one has to fail then."""

    file: str
    line: str  # part of it, there once
    becomes: str
    tests: str  # for pytest, separated by blanks
