"""All settings of a model with their defaults and meanings, from the structs that declare them.

`python -m benchmarks.settings` writes docs/reference/settings.md. What a setting means is the comment behind its field.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from benchmarks.combinations import bounds
from pdmesh.model.material import DECLARED, Material

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "reference" / "settings.md"
ABOVE = """# Settings

Every keyword of a model with its default and meaning: `run` with `run.static` and its other parts, `material`,
`horizon`, `contact` and `medium`.

```bash
pdmesh build geometries/duran50.geo
pdsolve duran50.json --set run.steps=400 --set material.G0=150
```

On the command line a setting is `--set run.steps=400`, in a file of settings (`--settings`) `run = {steps = 400}`, in
Python `Run(steps=400)`; drawings have names of their own ([Drawing parameters](drawing_parameters.md)). Units are SI.
`python -m benchmarks.settings` writes this page.
"""
TABLES = (  # key of the file, module of pdmesh.model, class, page that explains it
    ("run", "document", "Run", "dynamic"),
    ("run.static", "document", "Static", "quasi_static"),
    ("run.fatigue", "fatigue", "Fatigue", "fatigue"),
    ("run.hybrid", "document", "Hybrid", "adaptivity"),
    ("run.collocation", "document", "Collocation", "adaptivity"),
    ("run.split", "document", "Split", "adaptivity"),
    ("run.particles", "document", "ParticleRules", "crack_particles"),
    ("run.gaps", "monitors", "Gap", "supports"),
    ("run.load_cells", "monitors", "LoadCell", "supports"),
    ("horizon", "document", "Horizon", "schemes"),
    ("contact", "contact", "Contact", "contact"),
    ("medium", "medium", "Medium", "diffusion"),
)


class Field(NamedTuple):
    """A field of a struct, as its source declares it."""

    name: str
    values: str
    default: str
    meaning: str


def fields(source: str, name: str) -> Iterator[Field]:
    """The fields of the class `name`, each with the comment behind it and in the lines below."""
    lines = source.splitlines()
    (declared,) = (item for item in ast.parse(source).body if isinstance(item, ast.ClassDef) and item.name == name)
    for item in declared.body:
        if isinstance(item, ast.AnnAssign) and isinstance(item.target, ast.Name):
            first, *below = lines[(item.end_lineno or item.lineno) - 1 :]
            comments = [first[item.end_col_offset or 0 :]]
            for line in below:
                if not line.strip().startswith("#"):
                    break
                comments.append(line)
            meaning = " ".join(comment.strip().removeprefix("#").strip() for comment in comments)
            words = re.findall(r'"([^"]+)"', ast.unparse(item.annotation).replace("'", '"'))
            yield Field(item.target.id, ", ".join(words), default_text(item.value), meaning)


def default_text(value: ast.expr | None) -> str:
    """A default as a file has it; empty where there is none, or where it is a struct of its own or a name."""
    if not isinstance(value, ast.Constant) or value.value is None:
        return ""
    return str(value.value).lower() if isinstance(value.value, bool) else str(value.value)


def table(key: str, module: str, name: str, page: str) -> str:
    """The section of one struct."""
    source = (ROOT / "pdmesh" / "model" / f"{module}.py").read_text(encoding="utf-8")
    lines = [f"## {key}", "", f"Explained in [the guide](../guide/{page}.md).", ""]
    lines += ["| key | values | default | meaning |", "|---|---|---|---|"]
    lines += [
        f"| `{field.name}` | {field.values} | {field.default} | {field.meaning.replace('|', ' or ')} |"
        for field in fields(source, name)
    ]
    return "\n".join([*lines, ""])


def materials() -> str:
    """The section on materials."""
    lines = [
        "## material",
        "",
        "Explained in [the guide](../guide/materials.md), with the models that each key is for.",
        "",
    ]
    lines += ["| key | unit | values | default |", "|---|---|---|---|"]
    usual = Material(E=1.0, rho=1.0, G0=1.0)
    needed = ("E", "rho", "G0")
    for name, declared in DECLARED.items():
        default = None if name in needed else getattr(usual, name)
        text = "" if default is None else str(default).lower() if isinstance(default, bool) else f"{default}"
        lines.append(f"| `{name}` | {declared.unit} | {bounds(name)} | {text} |")
    return "\n".join([*lines, ""])


def page() -> str:
    """The whole page."""
    return "\n".join(
        [ABOVE, *(table(*each) for each in TABLES[:9]), materials(), *(table(*each) for each in TABLES[9:])]
    )


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
