"""The page of settings is that of the structs that declare them."""

from __future__ import annotations

from benchmarks.settings import PAGE, fields, page


def test_the_page_is_as_written() -> None:
    assert PAGE.read_text(encoding="utf-8") == page()


def test_a_field_has_its_words_default_and_comment() -> None:
    source = """class A:
    x: Literal['a', 'b'] = 'a'  # one
    # and two
    y: float | None = None
    z: bool = False
"""
    assert [tuple(field) for field in fields(source, "A")] == [
        ("x", "a, b", "a", "one and two"),
        ("y", "", "", ""),
        ("z", "", "false", ""),
    ]
