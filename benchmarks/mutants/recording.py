"""For pytest, with Python 3.12 or newer: which lines of functions of the packages each test executes.

Each test that passes adds a line of JSON to the file that `VARIABLE` names: its name, seconds, and the lines of each
file. Neither what is compiled nor what other processes do is seen.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Iterator
from importlib.machinery import SourceFileLoader
from pathlib import Path
from types import CodeType
from typing import Any

import pytest

VARIABLE = "EXECUTED_BY_TESTS"  # the file that is written
PACKAGES = tuple(str(Path(__file__).parent.parent.parent / name) + os.sep for name in ("pdmesh", "pdsolve", "pdpost"))

_lines: set[tuple[str, int]] = set()  # of the test that runs
_read_code = SourceFileLoader.get_code


def _all_in(code: CodeType) -> Iterator[CodeType]:
    """The code of the functions in some code, at any depth; not itself."""
    for one in code.co_consts:
        if isinstance(one, CodeType):
            yield one
            yield from _all_in(one)


@pytest.hookimpl(tryfirst=True)
def pytest_load_initial_conftests() -> None:
    """See the lines of all that is imported of the packages from now on: what all tests share imports some itself."""
    seen = sys.monitoring
    tool, event = seen.COVERAGE_ID, seen.events.LINE

    def passed(code: CodeType, line: int) -> Any:
        _lines.add((code.co_filename, line))
        return seen.DISABLE

    def get_code(self: SourceFileLoader, name: str) -> CodeType | None:
        code = _read_code(self, name)
        if code is not None and code.co_filename.startswith(PACKAGES):
            for one in _all_in(code):
                seen.set_local_events(tool, one, event)
        return code

    seen.use_tool_id(tool, "executed")
    seen.register_callback(tool, event, passed)
    SourceFileLoader.get_code = get_code  # type: ignore[method-assign,assignment]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Iterator[None]:
    """Write what a test executed, its fixtures included."""
    _lines.clear()
    sys.monitoring.restart_events()
    _failed.clear()
    began = time.perf_counter()
    result = yield
    seconds = time.perf_counter() - began
    files: dict[str, list[int]] = {}
    for file, line in sorted(_lines):
        files.setdefault(file, []).append(line)
    if files and not _failed:
        root = Path(__file__).parent.parent.parent
        named = {Path(file).relative_to(root).as_posix(): lines for file, lines in files.items()}
        with open(os.environ[VARIABLE], "a", encoding="utf-8") as out:
            json.dump({"test": item.nodeid, "seconds": round(seconds, 3), "lines": named}, out, separators=(",", ":"))
            out.write("\n")
    return result


_failed: list[str] = []


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Note what did not pass: a test that fails anyway notices nothing, nor does one that is skipped."""
    if report.outcome != "passed":
        _failed.append(report.nodeid)
