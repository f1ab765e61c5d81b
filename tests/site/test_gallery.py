"""The gallery: what is said of each scene, and the pictures above."""

from __future__ import annotations

import re

import matplotlib
import pytest

from benchmarks.gallery import (
    FRONT,
    FURTHER,
    PAGE,
    SHOWN,
    Shown,
    is_stale,
    picture_of,
    recorded,
    scene_mark,
    sections,
    shipped,
    texts,
)
from benchmarks.pages import read_block
from benchmarks.picture_outline import DRAWN_WITH

SHORT = "Acta|Appl|Basic|Comput|Div|Eng|Europhys|Fract|Int|Lett|Lond|Mater|Mech|Proc|Soc|Struct"


def test_the_page_is_as_written() -> None:
    assert read_block(PAGE, "scenes") == sections(shipped())
    assert {path.stem for path in picture_of(shipped()[0]).parent.glob("*.png")} == {path.stem for path in shipped()}


PICTURES = {SHOWN.get(path.name, Shown()).picture: path for path in shipped()}  # a scene of each command


def test_the_pictures_are_of_the_present_scenes() -> None:
    """Stale ones are drawn anew by `python -m benchmarks.gallery --stale`."""
    records = recorded()
    assert set(records) == {*FURTHER, *(path.stem for path in shipped())}
    assert [path.stem for path in shipped() if records[path.stem]["scene"] != scene_mark(path)] == []


@pytest.mark.skipif(matplotlib.__version__ != DRAWN_WITH, reason=f"records are of matplotlib {DRAWN_WITH}")
@pytest.mark.parametrize("command", PICTURES)
def test_the_pictures_are_of_the_present_drawing_code(command: str) -> None:
    """Each command draws for small results what it drew when the gallery was drawn."""
    assert not is_stale(PICTURES[command])
    alike = [record for record in recorded().values() if record["command"] == command]
    dimension = recorded()[PICTURES[command].stem]["dimension"]
    assert len({record["drawing"] for record in alike if record["dimension"] == dimension}) == 1


def test_twelve_pictures_stand_above_of_which_one_is_a_fork_in_a_plate() -> None:
    forks = {
        "duran50",
        "duran50_one_scale",
        "duran_metre",
        "soda_lime",
        "soda_lime_one_scale",
        "forked_crack",
        "v_notch",
    }
    assert len(set(FRONT)) == 12
    assert len({*forks, "branching_plate"} & set(FRONT)) == 1


@pytest.mark.parametrize("name", [path.stem for path in shipped()])
def test_a_scene_is_explained_in_short_with_an_equation_and_a_number(name: str) -> None:
    text = texts()[name]
    plain = re.sub(r"\$[^$]+\$", "x", re.sub(r"\]\([^)]*\)", "]", text))
    plain = re.sub(rf"\b({SHORT}|[A-Z])\. ", r"\1 ", plain)
    assert 5 <= len(re.findall(r"\.(?: |$)", plain)) <= 9
    assert "$" in text
    assert re.search(r"\d", plain)
