"""Gives each test its tier and its limit of wall time, and takes a share of the tests where they take turns.

Quick tests run in `make test`. Tests of the marker `slow` in the folders of `VERIFICATION` run in `make slow`, those of
other folders in `make breadth`: more cases of what quick tests sample. The marker `endurance` is for what depends on
races, ranks, kills, clocks or the speed of the machine, and for hundreds of forgeries.
"""

from __future__ import annotations

import argparse
import faulthandler
import sys
import zlib
from collections.abc import Iterator
from pathlib import Path

import pytest

VERIFICATION = frozenset({"verification", "geometries", "laws", "stability"})  # folders below tests
SECONDS = {"quick": 60, "slow": 900, "breadth": 900, "endurance": 900}  # of wall time, after which a test is a hang
DEAF = 60  # s more, after which it is one that no signal ends, as within SQLite: its process ends


def tier_of(item: pytest.Item) -> str:
    """The tier of a test: quick, slow, breadth or endurance."""
    if item.get_closest_marker("endurance"):
        return "endurance"
    if item.get_closest_marker("slow") is None:
        return "quick"
    return "breadth" if VERIFICATION.isdisjoint(item.nodeid.partition("::")[0].split("/")) else "slow"


def choose_cases(items: list[pytest.Item], number: int) -> list[pytest.Item]:
    """Choose cases of a parametrised test, spread evenly from the first to the last."""
    last = len(items) - 1
    steps = {round(last * i / max(number - 1, 1)) for i in range(number)}
    return [item for i, item in enumerate(items) if i in steps]


def turn(text: str) -> tuple[int, int]:
    """Two whole numbers K/N as an option's type: of N shares of the tests the one with the number K modulo N."""
    number, _, shares = text.partition("/")
    try:
        k, n = int(number), int(shares)
    except ValueError:
        n = 0
    if n < 1:
        raise argparse.ArgumentTypeError(f"found '{text}', expected K/N, such as 1/4")
    return k % n, n


def has_turn(nodeid: str, k: int, n: int) -> bool:
    """Whether a test belongs to share `k` of `n`."""
    return zlib.crc32(nodeid.encode()) % n == k


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the option that takes a share."""
    parser.addoption("--turn", type=turn, default=(0, 1), metavar="K/N", help="run the K-th of N shares of the tests")


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Give each test its tier: most cases of a test of `quick_cases` are slow. Bound its wall time by the tier."""
    limited: dict[tuple[Path, str], list[pytest.Item]] = {}
    for item in items:
        if item.get_closest_marker("quick_cases") and tier_of(item) == "quick":
            limited.setdefault((item.path, item.originalname), []).append(item)  # type: ignore[attr-defined]
    for cases in limited.values():
        chosen = choose_cases(cases, cases[0].get_closest_marker("quick_cases").args[0])  # type: ignore[union-attr]
        for item in cases:
            if item not in chosen:
                item.add_marker(pytest.mark.slow)
    for item in items:
        tier = tier_of(item)
        if tier == "breadth":
            item.add_marker(pytest.mark.breadth)
        if not item.get_closest_marker("timeout"):
            item.add_marker(pytest.mark.timeout(SECONDS[tier]))
    k, n = config.getoption("--turn")
    config.hook.pytest_deselected(items=[item for item in items if not has_turn(item.nodeid, k, n)])
    items[:] = [item for item in items if has_turn(item.nodeid, k, n)]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """End a process that hangs where no exception gets to, with the lines it is at."""
    limit = item.get_closest_marker("timeout")
    assert limit is not None
    faulthandler.dump_traceback_later(limit.args[0] + DEAF, exit=True, file=sys.__stderr__)
    try:
        return (yield)
    finally:
        faulthandler.cancel_dump_traceback_later()
