"""How the site is made: sphinx-build docs site."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from docutils.nodes import SkipNode
from docutils.utils.math.latex2mathml import tex2mathml

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
smartquotes = False  # which would turn -- of options into a dash
html_math_renderer = "mathml"


def _inline(page: Any, formula: Any) -> None:
    page.body.append(tex2mathml(formula.astext(), as_block=False))
    raise SkipNode


def _displayed(page: Any, formula: Any) -> None:
    page.body.append(f"<div class='math'>{tex2mathml(formula.astext(), as_block=True)}</div>")
    raise SkipNode


def setup(app: Any) -> None:
    """Formulas as MathML, which browsers draw by themselves: no script, no network."""
    app.add_html_math_renderer("mathml", (_inline, None), (_displayed, None))


# The JSON Schema of the grid file lies beside the pages.
SCHEMA = Path(__file__).parent / "schema"
SCHEMA.mkdir(exist_ok=True)
(SCHEMA / "grid.schema.json").write_text(json.dumps(schema(), indent=2))
