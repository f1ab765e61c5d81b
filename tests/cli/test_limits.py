"""The limits that `make check` keeps: what is over one is named, and nothing is spared without need."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import pytest
from plates import ROOT

PARAMETERS = ", ".join("abcdefghi")

FINE = {
    "450 lines": "x = 1\n" * 450,
    "60 lines": "def f():\n" + "    x = 1\n" * 59,
    "8 parameters": "def f(a, b, c, d, e, f, g, h, *, i=0, j=0): ...\n",
    "8 beside self": "class A:\n    def f(self, a, b, c, d, e, f, g, h): ...\n",
    "a kernel": f"@njit\ndef f({PARAMETERS}): ...\n@numba.njit(**INNER)\ndef g({PARAMETERS}): ...\n",
}
OVER = {
    "a file": ("x = 1\n" * 801, "a.py: found 801 lines, expected 800 at most"),
    "a function": ("def f():\n" + "    x = 1\n" * 60, "a.py:1: f: found 61 lines, expected 60 at most"),
    "a method": ("class A:\n    def f(self):\n" + "        x = 1\n" * 60, "a.py:2: f: found 61 lines, expected 60"),
    "parameters": (f"def f({PARAMETERS}): ...\n", "a.py:1: f: found 9 positional parameters, expected 8 at most"),
    "a method's": (f"class A:\n    def f(self, {PARAMETERS}): ...\n", "a.py:2: f: found 9 positional parameters"),
    "beside a kernel": (f"@cache\ndef f({PARAMETERS}): ...\n", "a.py:2: f: found 9 positional parameters"),
}


@pytest.fixture
def limits() -> ModuleType:
    """The script."""
    spec = importlib.util.spec_from_file_location("limits", ROOT / ".ci" / "limits.py")
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    return script


def test_what_is_within_the_limits(here: Path, limits: ModuleType, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "some").mkdir()
    for number, text in enumerate(FINE.values()):
        (here / "some" / f"{number}.py").write_text(text)
    assert limits.main(["some"]) == 0
    assert capsys.readouterr().out == "Files and functions are within their limits\n"


@pytest.mark.parametrize("name", OVER)
def test_what_is_over_a_limit(here: Path, limits: ModuleType, capsys: pytest.CaptureFixture[str], name: str) -> None:
    text, message = OVER[name]
    (here / "some").mkdir()
    (here / "some" / "a.py").write_text(text)
    assert limits.main(["some"]) == 1
    (said,) = capsys.readouterr().out.splitlines()
    assert said.startswith(f"some/{message}")
