"""The site is whole, and what its pages show of a study is one."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
from pages import DOCS, EVERY, blocks, named
from plates import ROOT

from pdsolve.study.description import read_study


def test_a_study_that_is_shown_is_one(tmp_path: Path) -> None:
    (block,) = blocks(DOCS / "how_to" / "parameter_study.md", "toml")
    (tmp_path / "study.toml").write_text(block.text)
    shutil.copy(ROOT / "geometries" / "duran50.geo", tmp_path)
    assert len(read_study(tmp_path / "study.toml").cases()) == 2 * 2 * 5


@pytest.mark.parametrize("page", EVERY, ids=named)
def test_a_picture_is_described_in_words(page: Path) -> None:
    for words, picture in re.findall(r"!\[([^\]]*)\]\(([^)]+)\)", page.read_text(encoding="utf-8")):
        assert len(words.split()) >= 3, picture


def test_the_same_bits_are_promised_on_one_kind_of_processor() -> None:
    """Another kind rounds elsewhere, as it multiplies and adds in one step or sums more numbers at once."""
    promises = 0
    for page in EVERY:
        for part in re.split(r"\n\s*\n|\n(?=[-|#] ?)", page.read_text(encoding="utf-8")):
            for sentence in re.split(r"(?<=[.;])\s", part):
                if "developers" not in page.parts and re.search(r"bit-identical|\bto the bit\b|bit by bit", sentence):
                    promises += 1
                    assert re.search(r"kind\s+of\s+processor|of\s+one\s+kind", sentence), (page.name, sentence)
    assert promises > 5


def test_formulas_are_drawn_without_a_script() -> None:
    """Each of them is one that the site's own converter knows."""
    math = pytest.importorskip("docutils.utils.math.latex2mathml")
    markdown = pytest.importorskip("markdown_it").MarkdownIt()
    markdown.use(pytest.importorskip("mdit_py_plugins.dollarmath").dollarmath_plugin)
    count = 0
    for page in DOCS.rglob("*.md"):
        for token in markdown.parse(page.read_text(encoding="utf-8")):
            for part in (token, *(token.children or ())):
                if part.type.startswith("math"):
                    assert math.tex2mathml(part.content, as_block=part.type == "math_block").startswith("<math"), page
                    count += 1
    assert count > 200


@pytest.mark.slow
def test_the_site_is_built_without_a_warning(tmp_path: Path) -> None:
    """References that lead nowhere are warnings too."""
    pytest.importorskip("sphinx")
    words = ["-m", "sphinx", "-W", "--keep-going", "-q", str(DOCS), str(tmp_path)]
    done = subprocess.run([sys.executable, *words], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "index.html").is_file()
    assert "url=../guide/quasi_static.html" in (tmp_path / "guide" / "at_rest.html").read_text(encoding="utf-8")
    assert_words_lead_to_their_pages(tmp_path / "searchindex.js")
    for page in tmp_path.rglob("*.html"):
        text = page.read_text(encoding="utf-8")
        assert not re.search(r"<(script|img|iframe)[^>]*src=\"(https?:)?//", text), page
        assert not re.search(r"<link[^>]*rel=\"(stylesheet|preload)\"[^>]*href=\"(https?:)?//", text), page
        assert "\N{EN DASH}-" not in text, page  # an option whose dashes were made one


def assert_words_lead_to_their_pages(searchindex: Path) -> None:
    """The search gives a main index entry that equals what is typed 100 points, and anything else less."""
    index = json.loads(searchindex.read_text(encoding="utf-8").removeprefix("Search.setIndex(").rstrip().rstrip(";)"))
    pages = tomllib.loads((DOCS / "search_words.toml").read_text(encoding="utf-8"))
    expected = {word.lower(): page for page, words in pages.items() for word in words}
    expected |= {word.replace("-", " "): page for word, page in expected.items()}
    first = {
        word: [index["docnames"][number] for number, _, is_main in index["indexentries"].get(word, []) if is_main]
        for word in expected
    }
    assert first == {word: [page] for word, page in expected.items()}
