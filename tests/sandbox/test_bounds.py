"""Drawings of any size: looked through in a time that grows as they do, or refused in one line."""

from __future__ import annotations

import contextlib
from pathlib import Path

import pytest
from messages import naming

from pdmesh.drawing.sandbox import copies
from pdmesh.drawing.sandbox.scan import DEEPEST, Drawing, admitted, names
from pdmesh.drawing.sandbox.tokens import MOST_TOKENS, Refused, tokens_of
from pdmesh.scene.shapes import SceneError


@pytest.mark.quick_cases(2)
@pytest.mark.parametrize(
    "unit",
    [
        'DefineConstant[a = {1, Name "x"}];\n',
        "DefineConstant ",
        "DefineConstant[" * 40 + "a" + "]" * 40 + ";\n",
        "Point(1) = {0, 0, 0, 1};\n",
    ],
)
def test_twice_the_drawing_is_twice_the_work(unit: str, monkeypatch: pytest.MonkeyPatch) -> None:
    looks, text = [0], Drawing.text

    def counted(self: Drawing, place: int) -> str:
        looks[0] += 1
        return text(self, place)

    monkeypatch.setattr(Drawing, "text", counted)
    work = []
    for count in (200, 400):
        looks[0] = 0
        drawing = Drawing(tokens_of(unit * count))
        with contextlib.suppress(Refused):
            admitted(drawing, names(drawing))
        work.append(looks[0])
    assert 0 < work[1] < 2.2 * work[0]


def test_places_within_brackets() -> None:
    """Of each word, nested ones too; not of what stands in a statement of its own."""
    drawing = Drawing(tokens_of("A[b, A[c], d]; A = e; f[g]; A [h];"))
    inside = [drawing.text(place) for place in sorted(drawing.inside("A"))]
    assert inside == ["b", ",", "A", "[", "c", "]", ",", "d", "h"]


def test_brackets_inside_each_other_have_a_bound() -> None:
    Drawing(tokens_of("a = " + "(" * DEEPEST + "1" + ")" * DEEPEST + ";\n"))
    with pytest.raises(Refused, match=naming(found=DEEPEST + 1, expected=DEEPEST)):
        Drawing(tokens_of("a = " + "(" * (DEEPEST + 1) + "1" + ")" * (DEEPEST + 1) + ";\n"))


def test_drawings_that_are_too_large(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By themselves, and with all that they read."""
    path = tmp_path / "plate.geo"
    with path.open("wb") as file:
        file.truncate(2**26)
    with pytest.raises(SceneError, match=naming("read", "plate.geo", found="67108864 bytes", expected="16777216")):
        copies.drawing_copies(path)
    monkeypatch.setattr(copies, "LARGEST_DRAWING", 100)
    path.write_text('Include "more.geo";\n')
    (tmp_path / "more.geo").write_text("a = 1;\n" * 12)
    with pytest.raises(SceneError, match=naming("read", "more.geo", found="84 bytes", expected="80")):
        copies.drawing_copies(path)


def test_drawings_of_too_many_tokens(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """By themselves, and with all that they read."""
    assert len(tokens_of("a = 1;\n" * 5, 20)) == 20
    with pytest.raises(Refused, match=naming("line 6", found="20", expected=MOST_TOKENS)):
        tokens_of("a = 1;\n" * 6, 20)
    path = tmp_path / "plate.geo"
    path.write_text('Include "more.geo";\n')
    (tmp_path / "more.geo").write_text("a = 1;\n" * 5)
    monkeypatch.setattr(copies, "MOST_TOKENS", 23)
    assert len(copies.drawing_copies(path)) == 2
    monkeypatch.setattr(copies, "MOST_TOKENS", 22)
    with pytest.raises(SceneError, match=naming("more.geo", "line 5", found="19", expected=MOST_TOKENS)):
        copies.drawing_copies(path)
