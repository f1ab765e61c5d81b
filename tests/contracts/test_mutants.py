"""The mutants of `make mutants` are of the code that is there; whether tests kill them, that says itself."""

from __future__ import annotations

import ast
from itertools import islice
from pathlib import Path

import pytest

from benchmarks.mutants.changes import changes
from benchmarks.mutants.equivalent import EQUIVALENT
from benchmarks.mutants.likely import cheapest_first, likely, product
from benchmarks.mutants.sample import drawn
from benchmarks.mutants.table import MUTANTS
from benchmarks.mutants.trees import same_kernels

ROOT = Path(__file__).parent.parent.parent


@pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: f"{mutant.file}: {mutant.line[:40]}")
def test_none_is_out_of_date(mutant: object) -> None:
    assert (ROOT / mutant.file).read_text(encoding="utf-8").count(mutant.line) == 1  # type: ignore[attr-defined]
    for name in mutant.tests.split():  # type: ignore[attr-defined]
        path, _, test = name.partition("::")
        assert test.partition("[")[0] in (ROOT / path).read_text(encoding="utf-8")


@pytest.mark.slow
def test_a_sample_goes_round_the_folders_and_is_drawn_again_from_its_seed() -> None:
    folders = {path.parent for path in product(ROOT).values()}
    first = list(islice(drawn(ROOT, 0), 4 * len(folders)))
    again, other = (list(islice(drawn(ROOT, seed), 6)) for seed in (0, 1))
    assert first[:6] == again
    assert first[:6] != other
    places = [(ROOT / one.file).parent for one in first]
    assert len(set(places)) >= len(folders) - 1  # one may hold nothing but names
    for one in first:
        text = (ROOT / one.file).read_text(encoding="utf-8")
        assert ast.dump(ast.parse(one.change.applied(text))) != ast.dump(ast.parse(text))
    for one in first[::3]:
        assert all((ROOT / file).is_file() for file in likely(ROOT, one.file, one.change.name))


@pytest.mark.parametrize(
    ("text", "becomes"),
    [
        ("def f(a):\n    return a < 3", {"a <= 3", "4"}),
        ("def f(a):\n    return -a * True", {"-a / True", "a", "False"}),
        ("def f(a):\n    if not a and a.b:\n        a.c()", {"not a or a.b", "a", "pass"}),
        ('def f(a: int = 1) -> "x < 2":\n    """1 < 2."""\n    raise ValueError(f"{a + 1}" + "x")', {"2", "pass"}),
        ("@njit(cache=True)\ndef f(a):\n    a *= 2.5", {"a /= 2.5", "5.0"}),
        ("x = 'h\u00f6he'; y = 1 in x", {"1 not in x", "2"}),
    ],
)
def test_what_a_line_may_become(text: str, becomes: set[str]) -> None:
    """An operator, a number or a statement; neither types and messages nor how a function is compiled."""
    found = changes("pdsolve/any.py", text)
    assert {one.becomes.removeprefix("(").removesuffix(")") for one in found} == becomes
    assert all(ast.parse(one.applied(text)) for one in found)


@pytest.mark.slow
def test_a_method_is_tested_by_who_knows_it() -> None:
    assert "tests/unit/pdsolve/test_lock.py" in likely(ROOT, "pdsolve/results/lock.py", "writing_to")
    assert likely(ROOT, "pdpost/measures/tips.py", "")[0] == "tests/unit/pdpost/measures/test_tips.py"


def test_what_is_equivalent_is_there() -> None:
    for file, line, becomes in EQUIVALENT:
        text = (ROOT / file).read_text(encoding="utf-8")
        found = {(text.splitlines()[one.line - 1].strip(), one.becomes) for one in changes(file, text)}
        assert (line, becomes) in found


def test_the_tests_of_each_folder_have_their_place_among_the_cheap_and_the_dear() -> None:
    every = [path.relative_to(ROOT).as_posix() for path in sorted((ROOT / "tests").rglob("test_*.py"))]
    ordered = cheapest_first(every)
    assert sorted(ordered) == sorted(every)
    assert ordered[0].startswith("tests/unit/")
    assert ordered[-1].startswith("tests/stability/")


@pytest.mark.parametrize(
    ("file", "line", "becomes", "same"),
    [
        ("pdpost/measures/diffused_amounts.py", "+ through", "- through", True),
        ("pdsolve/laws/pair.py", "* bond.stretch\n", "/ bond.stretch\n", False),  # compiled, and unmarked
        ("pdsolve/operators/bond_list_loops.py", "m[i] = 0", "m[i] = 1", False),
        (
            "pdsolve/operators/simd_lattice/kernel.py",
            "row_of(worst, slot, lane)",
            "row_of(worst, lane, slot)",
            False,
        ),  # an overload returns it
        ("pdsolve/codegen/jit_cache.py", "now - used >", "now + used >", True),
        ("pdsolve/codegen/jit_cache.py", "KEPT, DAY, UNUSED = 8", "KEPT, DAY, UNUSED = 9", False),
    ],
)
def test_kernels_are_kept_where_what_is_broken_is_in_none(file: str, line: str, becomes: str, same: bool) -> None:
    text = (ROOT / file).read_text(encoding="utf-8")
    assert line in text
    assert same_kernels(file, text, text.replace(line, becomes)) is same
