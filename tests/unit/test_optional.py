"""Every package that a test may be skipped without is installed by a dependency group."""

from __future__ import annotations

import importlib.util
import re
import sys
from types import SimpleNamespace
from unittest.mock import Mock

import pytest
from plates import ROOT

from pdsolve.device import runtime

spec = importlib.util.spec_from_file_location("optional", ROOT / ".ci" / "optional.py")
optional = importlib.util.module_from_spec(spec)
spec.loader.exec_module(optional)

# Of the groups test and docs, which CI installs before the tests, or of Python on some systems
OTHERS = {"fcntl", "gmsh", "markdown_it", "meshio", "nbclient", "nbformat", "pwd", "resource", "shtab", "sphinx"}


def test_no_package_is_tested_nowhere() -> None:
    sources = [path.read_text("utf-8") for path in (ROOT / "tests").rglob("test_*.py")]
    skips = {name for source in sources for name in re.findall(r'importorskip\("(\w+)"', source)}
    assert {"pyvista", "vtk", "rattler_build"} <= skips
    assert skips - OTHERS <= optional.modules()


def test_tests_are_chosen_by_what_they_ask_for() -> None:
    modules = optional.modules()
    assert {"h5py", "netCDF4"} <= modules
    assert optional.needs_optional('pytest.importorskip("vtk")', modules)
    assert optional.needs_optional("pytest.importorskip(NEEDS[suffix])", modules)
    assert optional.needs_optional("def test_page(chromium: Browser) -> None:", modules)
    assert not optional.needs_optional('pytest.importorskip("gmsh", exc_type=OSError)', modules)


@pytest.mark.parametrize(("module", "reason"), [(None, "pyopencl is missing"), (object(), "no device"), (object(), "")])
def test_it_is_said_whether_devices_are_tested(module: object, reason: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(optional, "find_spec", lambda _: module)
    monkeypatch.setitem(sys.modules, "devices", SimpleNamespace(missing=lambda: reason))
    monkeypatch.setattr(runtime, "devices", lambda: [SimpleNamespace(name="PoCL")])
    said = f"devices were not tested: {reason}" if reason else "devices are tested on: PoCL"
    assert optional.describe_devices() == said


def test_ci_runs_the_tests_of_optional_packages_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(optional, "describe_devices", lambda: "devices were not tested")
    steps = (ROOT / ".ci" / "run").read_text("utf-8").splitlines()
    assert any(step.split("#")[0].split() == ["step", "make", "optional"] for step in steps)
    terminal = SimpleNamespace(write_line=Mock())
    optional.pytest_terminal_summary(terminal)
    assert terminal.write_line.call_args.args == ("devices were not tested",)
