"""How the site is made: sphinx-build docs site."""

from __future__ import annotations

import json
from pathlib import Path

from pdmesh import VERSION
from pdmesh.model.document import schema

project, author, release = "pdsuite", "the authors of pdsuite", VERSION
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.mathjax", "sphinxarg.ext"]
exclude_patterns = ["schema"]
myst_enable_extensions = ["dollarmath", "deflist"]
myst_heading_anchors = 3
nb_execution_mode = "auto"
nb_execution_timeout, nb_execution_in_temp = 300, True
html_theme, html_title = "furo", f"pdsuite {release}"
html_copy_source = False
autodoc_typehints, autodoc_member_order = "description", "bysource"
html_extra_path = ["schema"]


# The JSON Schema of the grid file lies beside the pages.
SCHEMA = Path(__file__).parent / "schema"
SCHEMA.mkdir(exist_ok=True)
(SCHEMA / "grid.schema.json").write_text(json.dumps(schema(), indent=2))
