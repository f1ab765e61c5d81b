"""Chooses the tests of packages that users may leave out, and of a browser: `make optional`, or pytest -p optional.

Other commands skip these tests. Here a skipped one is a failure, as its package is then missing or new.
A last line says whether the tests of devices ran, which need an OpenCL runtime that knows this processor.
"""

from __future__ import annotations

import re
import tomllib
from importlib.util import find_spec
from inspect import getsource
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
MODULES = {"py-rattler-build": "rattler_build"}  # where the module is called otherwise than the package
SKIPS = re.compile(r"importorskip\((\"(\w+)\"|NEEDS\[\w+\])")
BROWSER = re.compile(r"\bchromium: Browser\b")  # the fixture of tests that are skipped without Chromium
skipped: list[str] = []


def modules() -> set[str]:
    """The modules of the dependency group `optional`."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    names = [re.split(r"[><=;\[]", package)[0].strip() for package in project["dependency-groups"]["optional"]]
    return {MODULES.get(name, name) for name in names}


def needs_optional(source: str, optional: set[str]) -> bool:
    """Whether a test, by its source, is skipped without an optional module or without a browser."""
    return bool(BROWSER.search(source)) or any(name in optional or not name for _, name in SKIPS.findall(source))


def pytest_ignore_collect(collection_path: Path) -> bool | None:
    """Import only the files of such tests."""
    if collection_path.suffix != ".py" or not collection_path.name.startswith("test_"):
        return None
    return True if not needs_optional(collection_path.read_text(encoding="utf-8"), modules()) else None


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep these tests alone."""
    optional = modules()
    chosen = [item for item in items if needs_optional(getsource(item.function), optional)]  # type: ignore[attr-defined]
    config.hook.pytest_deselected(items=[item for item in items if item not in chosen])
    items[:] = chosen


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Note skipped tests."""
    if report.skipped:
        skipped.append(report.nodeid)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Fail where a test was skipped."""
    if skipped and not hasattr(session.config, "workerinput"):
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter) -> None:
    """Say which tests were skipped, and whether devices can be tested."""
    for name in skipped:
        terminalreporter.write_line(f"skipped, expected to run: {name}")
    terminalreporter.write_line(describe_devices())


def describe_devices() -> str:
    """One line: the OpenCL device that tests use, or why they are skipped."""
    if find_spec("pyopencl") is None:
        return "devices were not tested: pyopencl is missing"
    from devices import missing

    from pdsolve.device.runtime import devices

    reason = missing()
    return f"devices were not tested: {reason}" if reason else f"devices are tested on: {devices()[0].name}"
