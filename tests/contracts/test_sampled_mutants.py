"""Places that `make mutants` draws: what was recorded of them is found, and what becomes of them is counted rightly."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from benchmarks.mutants import executed, sample, trees
from benchmarks.mutants.__main__ import is_enough
from benchmarks.mutants.changes import Change, changes
from benchmarks.mutants.functions import functions
from benchmarks.mutants.sample import KILLED, SURVIVED, UNDECIDED, Drawn, Pair, fate, measured
from benchmarks.mutants.trees import NO_TESTS, TIMED_OUT, Ran

SOURCE = """
SMALL = 3


class Box:
    size: int = 4

    def grow(self, by):
        if by < 0:
            raise ValueError(by)
        return self.size + by


@cached_njit(**KERNEL)
def kernel(a):
    return a * SMALL


def caller(a):
    if a is not None:
        def inner(b):
            return -b

    if a:
        return inner(a)
    return kernel(a)
"""
FILE = "pdsolve/any.py"


@pytest.fixture
def recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A checkout of one file, and three tests that executed parts of it."""
    (tmp_path / "pdsolve").mkdir()
    (tmp_path / FILE).write_text(SOURCE)
    (tmp_path / "tests").mkdir()
    line = {text.strip(): number for number, text in enumerate(SOURCE.splitlines(), 1)}
    grown = [line["if by < 0:"], line["return self.size + by"]]
    refused = [line["if by < 0:"], line["raise ValueError(by)"]]
    called = [line["if a is not None:"], line["def inner(b):"], line["if a:"], line["return kernel(a)"]]
    tests = {"grows[1]": (grown, 2), "grows[2]": (grown, 1), "refused": (refused, 3), "calls": (called, 4)}
    lines = tmp_path / "lines"
    lines.write_text(
        "".join(
            json.dumps({"test": f"tests/t.py::{name}", "seconds": seconds, "lines": {FILE: seen}}) + "\n"
            for name, (seen, seconds) in tests.items()
        )
        + '{"test": "killed wh'
    )
    monkeypatch.setattr(executed, "KEPT", tmp_path / "executed.json.xz")
    executed.executed.cache_clear()
    executed.keep(tmp_path, lines)
    yield tmp_path
    executed.executed.cache_clear()


def names_of(root: Path, line: str) -> list[str]:
    text = (root / FILE).read_text()
    number = next(number for number, one in enumerate(text.splitlines(), 1) if one.strip() == line)
    change = next(one for one in changes(FILE, text) if one.line == number)
    return [name.removeprefix("tests/t.py::") for name in executed.those_of(root, FILE, change)]


@pytest.mark.parametrize(
    ("line", "tests"),
    [
        ("if by < 0:", ["grows[2]", "refused"]),  # the cheaper of two that differ by parameters
        ("raise ValueError(by)", ["refused"]),
        ("return self.size + by", ["grows[2]"]),
        ("return a * SMALL", ["calls"]),  # compiled: who calls it
        ("SMALL = 3", ["calls"]),  # a constant: who calls what names it
        ("return -b", []),  # nothing executed it
    ],
)
def test_a_statement_is_tested_by_what_executed_it(recorded: Path, line: str, tests: list[str]) -> None:
    assert names_of(recorded, line) == tests


def test_what_moved_is_found_and_of_what_changed_all_tests_count(recorded: Path) -> None:
    (recorded / FILE).write_text("import math\n" + SOURCE)
    assert names_of(recorded, "raise ValueError(by)") == ["refused"]
    (recorded / FILE).write_text(SOURCE.replace("if by < 0:", "if by <= -1:"))
    assert names_of(recorded, "raise ValueError(by)") == ["grows[2]", "refused"]


def test_a_statement_is_its_own_lines_alone() -> None:
    found = functions(SOURCE)
    assert set(found) == {"Box.grow", "kernel", "caller", "caller.inner"}
    line = {text.strip(): number for number, text in enumerate(SOURCE.splitlines(), 1)}
    caller = found["caller"].statements
    assert line["return -b"] not in caller
    assert len({caller[line[text]] for text in ("def inner(b):", "if a:", "return inner(a)", "return kernel(a)")}) == 4
    assert found["caller"].said["kernel"] == {caller[line["return kernel(a)"]]}


@pytest.mark.slow
def test_what_was_recorded_is_of_tests_and_functions_that_are_there() -> None:
    """Half of them at least: else it is time for `python -m benchmarks.mutants --record`."""
    known = executed.executed()
    there = [name for name in known.functions if is_there(*name.split(":"))]
    assert len(there) > len(known.functions) / 2 > 0
    found = [test for test in known.tests if (trees.ROOT / test.name.partition("::")[0]).is_file()]
    assert len(found) > len(known.tests) / 2


def is_there(file: str, name: str) -> bool:
    path = trees.ROOT / file
    return path.is_file() and name in functions(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    ("killed", "survived", "undecided", "enough"),
    [
        (90, 10, 0, True),
        (89, 11, 0, False),
        (45, 5, 0, True),
        (44, 6, 0, False),
        (25, 24, 0, True),
        (24, 25, 0, False),
        (6, 6, 40, True),
        (5, 7, 0, False),
        (0, 5, 0, False),
        (0, 4, 9, True),  # too few to say
    ],
)
def test_what_is_enough(killed: int, survived: int, undecided: int, enough: bool) -> None:
    assert is_enough(Counter({KILLED: killed, SURVIVED: survived, UNDECIDED: undecided})) is enough


Answer = Callable[[str, list[str], set[str]], Ran]  # tree, tests, those left out


@pytest.fixture
def fated(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[Answer], sample.Fate]:
    """What becomes of a mutant whose tests answer so; two tests execute it."""
    for name in ("broken", "right"):
        (tmp_path / name / "pdsolve").mkdir(parents=True)
        (tmp_path / name / FILE).write_text(SOURCE)
    monkeypatch.setattr(sample, "likely", lambda *_: ["tests/unit/u.py"])
    monkeypatch.setattr(sample, "those_of", lambda *_: ["tests/t.py::a", "tests/t.py::b[1]"])
    pair = Pair(tmp_path / "broken", tmp_path / "right", set(), set())

    def become(answer: Answer) -> sample.Fate:
        def run(tree: Path, tests: list[str], limit: float, **more: object) -> Ran:
            return answer(tree.name, tests, set(more.get("left_out", ())))  # type: ignore[call-overload]

        monkeypatch.setattr(trees, "run", run)
        return fate(pair, Drawn(FILE, Change(1, 10, "SMALL = 4", "", 2), "SMALL = 3"), 60.0)

    return become


def test_a_test_that_fails_anyway_neither_notices_nor_hides(fated: Callable[[Answer], sample.Fate]) -> None:
    def answer(tree: str, tests: list[str], left_out: set[str]) -> Ran:
        if tree == "right":
            return Ran(int(tests == ["tests/t.py::a"]), "", 1.0)
        failed = next((test for test in ("tests/t.py::a", "tests/t.py::c") if test not in left_out), None)
        return Ran(1, f"FAILED {failed} - E\n", 1.0)

    assert fated(answer)[:2] == (KILLED, "tests/t.py::c")


def test_what_takes_too_long_without_it_too_decides_nothing(fated: Callable[[Answer], sample.Fate]) -> None:
    def answer(tree: str, tests: list[str], left_out: set[str]) -> Ran:
        return Ran(TIMED_OUT if tree == "right" else 1, "FAILED tests/t.py::a - E\n", 1.0)

    assert fated(answer).what == UNDECIDED


@pytest.mark.parametrize(
    ("said", "ends", "fate_of_it"),
    [
        ("", True, UNDECIDED),  # not even imported
        ("tests/t.py::b[1] ", False, KILLED),  # it does not end, though it does where all is right
        ("tests/t.py::b[1] ", True, UNDECIDED),  # what executes it was not over: a slow machine
        ("tests/t.py::b[1] PASSED\ntests/t.py::b[2] ", True, SURVIVED),  # it was
    ],
)
def test_a_slow_machine_decides_nothing(
    fated: Callable[[Answer], sample.Fate], said: str, ends: bool, fate_of_it: str
) -> None:
    def answer(tree: str, tests: list[str], left_out: set[str]) -> Ran:
        if tree == "right" or (ends and tests != ["tests/unit/u.py", "tests/t.py"]):
            return Ran(0, "", 1.0)
        return Ran(TIMED_OUT, said, 60.0)

    assert fated(answer).what == fate_of_it


def test_what_no_test_notices_survives(fated: Callable[[Answer], sample.Fate]) -> None:
    assert fated(lambda *_: Ran(0, "", 1.0)).what == SURVIVED
    assert fated(lambda *_: Ran(NO_TESTS, "", 1.0)).what == SURVIVED


def test_what_is_undecided_is_drawn_anew(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr(trees, "copied", lambda folder: trees.ROOT)
    fates = iter([UNDECIDED, KILLED, SURVIVED, KILLED])
    monkeypatch.setattr(sample, "fate", lambda *_: sample.Fate(next(fates), "t", 1.0))
    assert measured(3, 0, 60.0, 1) == {UNDECIDED: 1, KILLED: 2, SURVIVED: 1}
    assert len(capsys.readouterr().out.splitlines()) == 4
    monkeypatch.setattr(sample, "fate", lambda *_: sample.Fate(UNDECIDED, "t", 1.0))
    assert measured(3, 0, 60.0, 1) == {UNDECIDED: 6}
    assert not measured(None, 0, 60.0, 1, minutes=0)


@pytest.mark.slow
def test_a_copy_has_all_tests_and_what_they_read(tmp_path: Path) -> None:
    copy = trees.copied(tmp_path / "copy")
    for folder in ("tests/site", "tests/formats", "geometries", "docs"):
        found, expected = (
            {path.relative_to(root) for path in (root / folder).rglob("*.[pgx]*") if "__pycache__" not in path.parts}
            for root in (copy, trees.ROOT)
        )
        assert found == expected != set()
    assert not (copy / ".git").exists()
