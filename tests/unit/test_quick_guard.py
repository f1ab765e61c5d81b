"""The quick suite stays quick by rule: what a quick test may take."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
import quick_guard

TESTS = """
import subprocess, sys, time
import pytest

def work(seconds):
    end = time.process_time() + seconds
    while time.process_time() < end: pass

@pytest.fixture(scope="module")
def shared():
    work({long})

def test_short(shared): pass
def test_long(): work({long})
done = []
def test_long_at_first():
    if not done:
        done.append(True)
        work({long})
@pytest.mark.slow
def test_long_and_slow(): work({long})
def test_process(): subprocess.run([sys.executable, "-c", ""])
@pytest.mark.process
def test_process_that_says_so(): subprocess.run([sys.executable, "-c", ""])
@pytest.mark.quick_cases(2)
@pytest.mark.parametrize("number", range(5))
def test_cases(number): pass
"""
MARKERS = ["slow", "breadth", "endurance", "process", "quick_cases(number)", "timeout"]


@pytest.mark.slow
def test_quick_tests_that_are_not_quick_fail(tmp_path: Path) -> None:
    """A long test and one that starts a process fail; a shared fixture, marked tests and what is long once do not."""
    (tmp_path / "test_some.py").write_text(
        TESTS.format(long=3.0 * quick_guard.LIMIT * max(1.0, quick_guard.slowness()))
    )
    (tmp_path / "conftest.py").write_text(
        f"import sys\nsys.path.insert(0, {str(Path(quick_guard.__file__).parent)!r})\n"
        "pytest_plugins = ['tiers', 'quick_guard']\n"
    )
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers =\n" + "".join(f"    {name}: x\n" for name in MARKERS))
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-rfp", "--strict-markers"]
    said = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False).stdout
    assert {line.split("::")[1].split()[0] for line in said.splitlines() if line.startswith("FAILED")} == {
        "test_long",
        "test_process",
    }
    quick = subprocess.run(
        [*words, "-m", "not slow", "-k", "cases"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert [f"test_cases[{number}]" in quick.stdout for number in range(5)] == [True, False, False, False, True]
