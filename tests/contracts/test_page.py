"""docs/how_to/add_material.md, done word for word on a copy of the packages."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from devices import missing
from plates import ROOT

PAGE = (ROOT / "docs" / "how_to" / "add_material.md").read_text()


@pytest.fixture(scope="module")
def copy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The packages and the tests with the page's file and its entry."""
    folder = tmp_path_factory.mktemp("copy")
    for name in ("pdmesh", "pdsolve", "tests"):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", folder)
    (name,) = re.findall(r"^`(pdsolve/laws/pair_laws/\w+\.py)`", PAGE, re.MULTILINE)
    (folder / name).write_text(blocks("python")[0])
    (entry,) = blocks("diff")
    table = folder / "pdsolve" / "laws" / "__init__.py"
    text = table.read_text()
    changes = re.findall(r"((?:^-.*\n)+)((?:^\+.*\n)+)", entry, re.MULTILINE)
    assert "".join(map("".join, changes)) == entry
    for change in changes:
        old, new = (re.sub(r"^[-+]", "", lines, flags=re.MULTILINE) for lines in change)
        assert text.count(old) == 1
        text = text.replace(old, new)
    table.write_text(text)
    return folder


def blocks(language: str) -> list[str]:
    """The page's blocks of code in a language."""
    return re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)


def python(folder: Path, *arguments: str) -> str:
    """What Python says in this folder, which has to go well."""
    environment = {**os.environ, "PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    ran = subprocess.run([sys.executable, *arguments], cwd=folder, capture_output=True, text=True, env=environment)
    assert ran.returncode == 0, ran.stdout + ran.stderr
    return ran.stdout


@pytest.mark.slow
def test_the_page_adds_a_law(copy: Path) -> None:
    """It is found by its name, and a bond that is gone has spent as much as a brittle one."""
    said = python(
        copy,
        "-W",
        "error",
        "-c",
        "from pdmesh import Material\nfrom pdsolve.laws import LAWS\nfrom pdsolve.laws.pair_laws import saturating\n"
        "from pdsolve.laws.law import Sizes\n"
        "assert LAWS['saturating'] is saturating.LAW\n"
        "glass = Material(E=65e9, rho=2235, G0=204, law='saturating', kr=2)\n"
        "print(*saturating.limits(glass, Sizes(1e-3, 1e-3, 3e-3, 3.0)))",
    )
    peak, limit = map(float, said.split())
    assert limit == pytest.approx(1.27202e-3, rel=1e-6)  # s_c sqrt((sqrt 5 + 1) / 2)
    assert peak == pytest.approx(limit / 2, rel=1e-12)


@pytest.mark.slow
def test_the_run_breaks_bonds_and_keeps_energy(copy: Path) -> None:
    said = python(copy, "-W", "error", "-c", blocks("python")[1])
    bonds, balance = re.findall(r"(\d+) bonds broken, energy kept to (\S+)", said)[0]
    assert int(bonds) > 100  # measured 6450
    assert abs(float(balance)) < 1e-3  # measured 6e-5


@pytest.mark.slow
def test_the_contracts_hold(copy: Path) -> None:
    """In all its cases: the page's law is no worse than those that are there."""
    said = python(
        copy,
        "-m",
        "pytest",
        "-q",
        "-p",
        "no:cacheprovider",
        "-m",
        "slow or not slow",
        "tests/contracts/test_laws.py",
        "-k",
        "saturating",
    )
    assert "80 passed" in said  # 8 cells, of which 4 in double precision have two tests more


@pytest.mark.slow
@pytest.mark.parametrize("dimension", [2, 3])
@pytest.mark.parametrize("precision", ["float64", "float32"])
def test_each_kernel_has_the_forces_of_the_list(copy: Path, dimension: int, precision: str) -> None:
    """On lattices, graded grids and devices, and in zones."""
    words = "-m", "pytest", "-q", "-p", "no:cacheprovider", "-m", "slow or not slow", "tests/contracts/test_kernels.py"
    said = python(copy, *words, "-k", f"saturating and {dimension}D and {precision}")
    assert ("3 passed, 1 skipped" if missing() else "4 passed") in said


@pytest.mark.slow
def test_both_kernels_are_measured(copy: Path) -> None:
    said = python(copy, "-W", "error", "-c", "".join(blocks("python")[1:]))
    measured = re.findall(r"(brittle|saturating), (blocks|listed): (\S+) ns a bond and step", said)
    assert len(measured) == 4
    assert all(float(time) > 0 for _, _, time in measured)


@pytest.mark.slow
def test_a_crack_costs_G0(copy: Path) -> None:
    """In the plane and in space, in both precisions."""
    words = "-m", "pytest", "-q", "-p", "no:cacheprovider", "-m", "slow or not slow", "tests/contracts/test_spent.py"
    assert "14 passed" in python(copy, *words, "-k", "saturating")
