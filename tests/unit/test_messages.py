"""Messages are told apart by what they name."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from messages import mentions

from pdmesh.messages import listed, unfit

SAID = "plate.json: $.run.steps[1] is 61 and (0.5, 0) m; use 0 to 60.5 (--force ends it)"


def test_what_a_message_names_is_found_in_any_order() -> None:
    assert mentions(SAID, "$.run.steps[1]", "plate.json", found=(61, "(0.5, 0) m"), expected=("0", "60.5", "--force"))
    assert mentions(SAID, found=re.compile(r"6\d"))


@pytest.mark.parametrize("part", ["late.json", "plate.js", "$.run", "6", "run.step", "other.json"])
def test_a_part_of_a_word_or_a_number_is_not_named(part: str) -> None:
    assert not mentions(SAID, part)


def test_a_part_of_the_problem_or_of_the_remedy_is_missed() -> None:
    assert not mentions(SAID, found="60")
    assert not mentions(SAID, expected=62)


@pytest.mark.parametrize(
    ("value", "use", "words"),
    [
        ("5", "1 to 4", "$.a is 5; use 1 to 4"),
        ("none", "a number", "$.a is missing; give a number"),
        (None, "a number", "$.a is missing; give a number"),
        ("some", "none, as b is c", "$.a cannot be used, as b is c; leave it out"),
        ("pin", "none in a body", "$.a (pin) cannot be used in a body; leave it out"),
        ("hybrid", "none or split", "$.a is hybrid; use none or split"),
        ("2 materials", "one", "$.a has 2 materials; use one"),
    ],
)
def test_a_message_says_the_problem_and_what_to_do(value: object, use: str, words: str) -> None:
    assert unfit("$.a", value, use) == words


def test_a_choice_in_words() -> None:
    assert [listed("a"), listed("ab"), listed("abc", quote=True)] == ["a", "a or b", "'a', 'b' or 'c'"]


OLD = re.compile(r"\bfound\b[^\n]*(?:\n[^\n]*)?, expected\b")
PACKAGES = Path(__file__).parents[2]


def _texts(tree: ast.AST) -> Iterator[str]:
    """The strings of a program, with the fixed parts of those that have values, and without docstrings."""
    docs = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}
    for node in ast.walk(tree):
        if isinstance(node, ast.JoinedStr):
            yield "".join(str(part.value) for part in node.values if isinstance(part, ast.Constant))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in docs:
            yield node.value


@pytest.mark.parametrize("package", ["pdmesh", "pdsolve", "pdpost"])
def test_no_message_is_a_check_list(package: str) -> None:
    """ "found X, expected Y" is for its author; a reader is told the problem and what to do."""
    texts = {path: path.read_text("utf-8") for path in (PACKAGES / package).rglob("*.py")}
    doubtful = [path for path, text in texts.items() if OLD.search(text) and "state_based" not in path.parts]
    assert not [(path, said) for path in doubtful for said in _texts(ast.parse(texts[path])) if OLD.search(said)]
