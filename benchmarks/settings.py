"""All settings of a model, as `pdsolve --help-settings` lists them: python -m benchmarks.settings

Writes docs/reference/settings.md.
"""

from __future__ import annotations

from pathlib import Path

from pdmesh.model.settings_table import markdown, settings

PAGE = Path(__file__).parents[1] / "docs" / "reference" / "settings.md"
ABOVE = """# Settings

Every keyword of a model with its unit, default and meaning: `material`, `horizon`, `run` with `run.static` and its
other parts, `contact` and `medium`. `pdsolve --help-settings` prints the same tables.

```bash
pdmesh build geometries/duran50.geo
pdsolve duran50.json --set run.steps=400 --set material.G0=150
```

On the command line a setting is `--set run.steps=400`, in a file of settings (`--settings`) `run = {steps = 400}`, in
Python `Run(steps=400)`; drawings have names of their own ([Drawing parameters](drawing_parameters.md)). Units are SI
where none is written.

These pages explain them: [materials](../guide/materials.md), [cohesive bonds](../guide/cohesive.md),
[schemes](../guide/schemes.md), [dynamic](../guide/dynamic.md) and [quasi-static analysis](../guide/quasi_static.md),
[fatigue](../guide/fatigue.md), [adaptivity](../guide/adaptivity.md), [contact](../guide/contact.md),
[diffusion](../guide/diffusion.md).
"""


def page() -> str:
    """The text of the page."""
    return ABOVE + "\n" + "\n".join(markdown(settings())).rstrip() + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
