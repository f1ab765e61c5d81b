"""How the site is made: sphinx-build docs site."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path
from typing import Any

from docutils.nodes import SkipNode
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx import addnodes

from pdmesh import VERSION
from pdmesh.model.document import schema

project, author, release = "pdsuite", "the authors of pdsuite", VERSION
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinxarg.ext"]
exclude_patterns = ["schema"]
myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 3
nb_execution_mode = "auto"
nb_execution_timeout, nb_execution_in_temp = 300, True
html_theme, html_title = "furo", f"pdsuite {release}"
html_copy_source = False
autodoc_typehints, autodoc_member_order = "description", "bysource"
html_extra_path = ["schema"]
if tags.has("versioned"):  # type: ignore[name-defined]  # noqa: F821
    html_static_path, html_js_files = ["_static"], ["versions.js"]
REDIRECTS = {  # old addresses of pages and the new ones
    "adaptivity": "verification/adaptivity",
    "add_a_law": "how_to/add_material",
    "benchmarks/README": "developers/benchmarks",
    "bibliography": "theory/references",
    "collocation": "verification/collocation",
    "data/README": "verification/reproductions/data/index",
    "endurance": "developers/endurance",
    "guide/at_rest": "guide/quasi_static",
    "guide/bodies": "guide/3d",
    "guide/conditions": "guide/boundary_conditions",
    "guide/database": "reference/database",
    "guide/developers": "developers/contributing",
    "guide/drawings": "guide/geometry",
    "guide/grid_file": "reference/grid_file",
    "guide/models": "guide/materials",
    "guide/modes": "guide/schemes",
    "guide/numbers": "guide/measures",
    "guide/particles": "guide/crack_particles",
    "guide/pictures": "guide/figures",
    "guide/programs": "getting_started/overview",
    "guide/python": "reference/api/examples",
    "guide/softening": "guide/cohesive",
    "guide/speed": "verification/accuracy_and_cost",
    "guide/trust": "reference/security",
    "handbook": "verification/stress_intensity",
    "how_to/devices": "how_to/gpu",
    "how_to/own_drawing": "how_to/gmsh_geometry",
    "how_to/refinement": "how_to/refine",
    "notebooks/first_crack": "getting_started/first_simulation_in_python",
    "notebooks/study_with_scatter": "how_to/parameter_study_in_python",
    "notebooks/your_own_law": "how_to/add_material_in_python",
    "reference/commands": "reference/cli",
    "reference/python": "reference/api/index",
    "sources/correspondence/README": "verification/reproductions/correspondence/index",
    "sources/gradients/README": "verification/reproductions/gradients/index",
    "studies": "how_to/parameter_study",
    "theory": "theory/index",
    "thesis/README": "verification/reproductions/thesis/index",
    "tutorial": "getting_started/first_simulation",
    "tutorials/body_in_space": "tutorials/fragmenting_ring",
    "verification": "verification/index",
    "where_methods_fail": "verification/limitations",
}
smartquotes = False  # which would turn -- of options into a dash
html_math_renderer = "mathml"


def _inline(page: Any, formula: Any) -> None:
    page.body.append(tex2mathml(formula.astext(), as_block=False))
    raise SkipNode


def _displayed(page: Any, formula: Any) -> None:
    page.body.append(f"<div class='math'>{tex2mathml(formula.astext(), as_block=True)}</div>")
    raise SkipNode


def _redirect(app: Any, failure: Exception | None) -> None:
    """Write a page at each old address that leads to the new one."""
    if failure is None and app.builder.name == "html":
        for old, new in REDIRECTS.items():
            page = Path(app.outdir) / f"{old}.html"
            target = f"{'../' * old.count('/')}{new}.html"
            page.parent.mkdir(parents=True, exist_ok=True)
            page.write_text(
                f'<!doctype html><meta charset="utf-8"><title>Moved</title><meta name="robots" content="noindex">'
                f'<link rel="canonical" href="{target}"><meta http-equiv="refresh" content="0; url={target}">'
                f'<p>This page has moved to <a href="{target}">{new}</a>.</p>\n',
                encoding="utf-8",
            )


def _index_words(app: Any, doctree: Any) -> None:
    """Make the words of `search_words.toml` main index entries of their page, so that the search has it first; the
    search knows only what is written, so words with hyphens are entries with spaces too."""
    words = {spelling for word in WORDS.get(app.env.docname, ()) for spelling in (word, word.replace("-", " "))}
    if words:
        doctree.insert(0, addnodes.index(entries=[("single", word, "", "main", None) for word in sorted(words)]))


def setup(app: Any) -> None:
    """Formulas as MathML, which browsers draw by themselves: no script, no network. Old addresses redirect."""
    app.connect("doctree-read", _index_words)
    app.add_html_math_renderer("mathml", (_inline, None), (_displayed, None))
    app.connect("build-finished", _redirect)


WORDS = tomllib.loads((Path(__file__).parent / "search_words.toml").read_text(encoding="utf-8"))

# The JSON Schema of the grid file lies beside the pages.
SCHEMA = Path(__file__).parent / "schema"
SCHEMA.mkdir(exist_ok=True)
(SCHEMA / "grid.schema.json").write_text(json.dumps(schema(), indent=2))
