"""Which tier a test has, which cases of a test are quick, and that turns miss no test."""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

import pytest
import tiers

MARKS = {
    "tests/unit/test_a.py::test_it": [],
    "tests/laws/test_a.py::test_it": ["slow"],
    "tests/unit/verification/test_a.py::test_it[x/laws/y]": ["slow"],
    "tests/unit/test_a.py::test_it[tests/laws/y]": ["slow"],
    "tests/laws/test_b.py::test_it": ["slow", "endurance"],
}


class Item:
    """What a tier depends on."""

    def __init__(self, nodeid: str) -> None:
        self.nodeid = nodeid

    def get_closest_marker(self, name: str) -> bool | None:
        return True if name in MARKS[self.nodeid] else None


def test_the_tier_is_told_by_marker_and_folder() -> None:
    found = [tiers.tier_of(Item(nodeid)) for nodeid in MARKS]  # type: ignore[arg-type]
    assert found == ["quick", "slow", "slow", "breadth", "endurance"]


@pytest.mark.parametrize(("number", "chosen"), [(1, [0]), (2, [0, 9]), (3, [0, 4, 9]), (10, list(range(10)))])
def test_cases_are_spread(number: int, chosen: list[int]) -> None:
    assert tiers.choose_cases(list(range(10)), number) == chosen  # type: ignore[arg-type]


def test_turns_together_are_all_tests_once() -> None:
    """Four shares of a thousand names are about equal; the fifth turn is the first again."""
    names = [f"tests/test_a.py::test_it[{number}]" for number in range(1000)]
    shares = [{name for name in names if tiers.has_turn(name, *tiers.turn(f"{k}/4"))} for k in range(5)]
    assert sorted(name for share in shares[:4] for name in share) == sorted(names)
    assert all(200 < len(share) < 300 for share in shares)
    assert shares[4] == shares[0]


@pytest.mark.parametrize("text", ["", "1", "1/0", "1/x", "a/3", "1/-2"])
def test_what_is_no_turn_is_refused(text: str) -> None:
    with pytest.raises(argparse.ArgumentTypeError, match="expected K/N"):
        tiers.turn(text)


DEAF_TEST = """
import ctypes, signal
import pytest

@pytest.mark.timeout(1)
def test_deaf():
    signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGALRM])
    ctypes.PyDLL(None).sleep(60)
def test_next(): pass
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no signals of this kind here")
def test_a_hang_that_no_signal_ends_fails_and_the_next_test_runs(tmp_path: Path) -> None:
    (tmp_path / "test_deaf.py").write_text(DEAF_TEST)
    (tmp_path / "conftest.py").write_text(
        f"import sys\nsys.path.insert(0, {str(Path(tiers.__file__).parent)!r})\n"
        "import tiers\ntiers.DEAF = 1\npytest_plugins = ['tiers']\n"
    )
    words = [sys.executable, "-m", "pytest", "-q", "-n", "1", "-p", "no:cacheprovider"]
    said = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False, timeout=50).stdout
    assert "1 failed, 1 passed" in said
    assert "crashed while running 'test_deaf.py::test_deaf'" in said
