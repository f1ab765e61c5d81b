"""Words that readers type into the site's search stand in the title, a heading or the beginning of the page they look
for."""

from __future__ import annotations

import ast
import itertools
import json
import re
import tomllib
from pathlib import Path

import pytest
from pages import DOCS, named

PAGES = tomllib.loads((DOCS / "search_words.toml").read_text(encoding="utf-8"))
WORDS = {  # the most important ones, and their pages
    "3D": "guide/3d",
    "adaptive": "guide/adaptivity",
    "absorbing boundary": "guide/absorbing_boundaries",
    "API": "reference/api/index",
    "benchmark": "verification/accuracy_and_cost",
    "boundary condition": "guide/boundary_conditions",
    "cohesive": "guide/cohesive",
    "compact tension": "tutorials/compact_tension",
    "contact": "guide/contact",
    "crack branching": "tutorials/branching_in_glass",
    "crack speed": "guide/measures",
    "critical stretch": "theory/bonds",
    "diffusion": "guide/diffusion",
    "did not converge": "how_to/troubleshooting",
    "equation of motion": "theory/motion",
    "exit code": "reference/cli",
    "explicit": "guide/dynamic",
    "fatigue": "guide/fatigue",
    "GPU": "how_to/gpu",
    "horizon": "getting_started/concepts",
    "J-integral": "guide/measures",
    "limitation": "verification/limitations",
    "load-displacement curve": "how_to/load_displacement",
    "mesh refinement": "how_to/refine",
    "micromodulus": "theory/bonds",
    "MPI": "how_to/clusters",
    "neo-Hookean": "tutorials/block_of_rubber",
    "ParaView": "how_to/paraview",
    "parameter sweep": "how_to/parameter_study",
    "Poisson's ratio": "guide/materials",
    "prescribed displacement": "guide/boundary_conditions",
    "quasi-static": "guide/quasi_static",
    "reaction force": "guide/measures",
    "rigid body": "guide/contact",
    "SQLite": "reference/database",
    "stress concentration": "tutorials/plate_with_a_hole",
    "stress intensity factor": "guide/measures",
    "surface correction": "guide/schemes",
    "thermal stress": "guide/thermal",
    "time step": "guide/dynamic",
    "traction": "guide/boundary_conditions",
    "units": "how_to/units",
    "unstable": "how_to/troubleshooting",
    "user material": "how_to/add_material",
}


def beginning(page: str) -> str:
    """The title, the headings and what stands above the second heading, in lower case, on one line."""
    path = DOCS / f"{page}.md"
    if path.is_file():
        text = path.read_text(encoding="utf-8")
    else:
        cells = json.loads(path.with_suffix(".ipynb").read_text(encoding="utf-8"))["cells"]
        text = "\n".join("".join(cell["source"]) for cell in cells[:1])
    headings = re.findall(r"^#+ .*$", text, re.MULTILINE)
    return " ".join("\n".join([*headings, text.partition("\n## ")[0]]).lower().split())


@pytest.mark.parametrize("page", PAGES)
def test_a_page_begins_with_its_words(page: str) -> None:
    text = beginning(page)
    assert not [word for word in PAGES[page] if word.lower() not in text]


def test_a_word_has_one_page() -> None:
    """The search ranks an index entry that is the word itself above all else; two such pages would be in any order."""
    words = [word.lower().replace("-", " ") for words in PAGES.values() for word in words]
    assert len(words) == len(set(words)) > 150


def test_important_words_have_their_pages() -> None:
    assert len(WORDS) >= 30
    assert {word: page for page, words in PAGES.items() for word in words if word in WORDS} == WORDS


def test_old_addresses_lead_to_pages() -> None:
    source = ast.parse((DOCS / "conf.py").read_text(encoding="utf-8"))
    (redirects,) = (
        ast.literal_eval(item.value)
        for item in source.body
        if isinstance(item, ast.Assign) and ast.unparse(item.targets[0]) == "REDIRECTS"
    )
    assert len(redirects) > 40
    for old, new in redirects.items():
        assert not [path for path in DOCS.glob(f"{old}.*") if path.suffix in (".md", ".ipynb")], old
        assert [path for path in DOCS.glob(f"{new}.*") if path.suffix in (".md", ".ipynb")], new


def test_a_page_of_the_guide_begins_with_a_sentence_and_has_headings() -> None:
    """The sentence stands below the title; an example and headings follow."""
    for path in sorted((DOCS / "guide").glob("*.md")):
        text = path.read_text(encoding="utf-8")
        first = text.splitlines()[2]
        assert re.match(r"[A-Z`]", first), path
        if path.name != "index.md":
            assert "```" in text.partition("\n## ")[0], path


@pytest.mark.parametrize("page", sorted(DOCS.rglob("*.md")), ids=named)
def test_a_page_has_a_heading_every_forty_lines(page: Path) -> None:
    """Readers skim by headings. Tables that a command writes stay whole, and do not count."""
    assert longest_section(page.read_text(encoding="utf-8")) <= 40


@pytest.mark.parametrize("page", sorted((DOCS / "guide").glob("*.md")), ids=named)
def test_a_page_of_the_guide_has_one_section_on_limits(page: Path) -> None:
    assert page.name in ("index.md", "combinations.md") or page.read_text(encoding="utf-8").count("\n## Limits\n") == 1


def longest_section(text: str) -> int:
    """The largest number of lines from one heading to the next, without what a command writes."""
    typed = re.sub(r"^<!-- .*: written by .*?^<!-- end -->$", "", text, flags=re.MULTILINE | re.DOTALL)
    lines = typed.splitlines()
    heads = [0, *(number for number, line in enumerate(lines) if re.match("##+ ", line)), len(lines)]
    return max(end - start for start, end in itertools.pairwise(heads))


def test_the_longest_section_is_seen() -> None:
    assert longest_section("# A\n\n## B\n1\n2\n3\n## C\n") == 4
    assert longest_section("# A\n<!-- t: written by x -->\n1\n2\n3\n<!-- end -->\n## C\n") == 2
