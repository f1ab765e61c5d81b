"""All settings of a model, as `pdsolve --help-settings` lists them: python -m benchmarks.settings

Writes the tables of docs/reference/settings.md.
"""

from __future__ import annotations

from benchmarks.pages import DOCS, write_block
from pdmesh.model.settings_table import markdown, settings

PAGE = DOCS / "reference" / "settings.md"


if __name__ == "__main__":
    write_block(PAGE, "settings", "\n".join(markdown(settings())))
