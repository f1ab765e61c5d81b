"""For pytest: some tests come first, and some are left out, as are slow ones that are not among the first."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

VARIABLE = "ORDER_OF_TESTS"  # a file of JSON: the names of the first and of those left out, whether all slow ones run


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put first what is named, then the same tests with other parameters, then the rest as it is."""
    first, left_out, slow = json.loads(Path(os.environ[VARIABLE]).read_text(encoding="utf-8"))
    exact = {name: place for place, name in enumerate(first)}
    alike = {name.partition("[")[0]: len(first) + place for place, name in reversed(list(enumerate(first)))}

    def rank(item: pytest.Item) -> int:
        return exact.get(item.nodeid, alike.get(item.nodeid.partition("[")[0], 2 * len(first)))

    def runs(item: pytest.Item) -> bool:
        is_wanted = slow or item.nodeid in exact or item.get_closest_marker("slow") is None
        return is_wanted and item.nodeid not in left_out

    items[:] = sorted(filter(runs, items), key=rank)
