"""Every package that a test may be skipped without is installed by a dependency group."""

from __future__ import annotations

import importlib.util
import re

from plates import ROOT

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
    assert not optional.needs_optional('pytest.importorskip("gmsh", exc_type=OSError)', modules)
