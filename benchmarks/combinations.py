"""What materials go with and their settings, from what they say of themselves: python -m benchmarks.combinations.

Writes sections of docs/guide/materials.md. A row of a table is a material that solvers are asked for.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import msgspec

from benchmarks.pages import put_section
from pdmesh.model.document import Collocation, Material, Run, Settings
from pdmesh.model.material import DECLARED, switch_of
from pdmesh.model.materials import KINDS
from pdmesh.model.refusals import Impossible
from pdmesh.model.refused_settings import impossible, on_ranks

PAGE = Path(__file__).parents[1] / "docs" / "guide" / "materials.md"
SOLID: dict[str, Any] = {"model": "correspondence", "nu": 0.2}
MATERIALS: dict[str, dict[str, Any]] = {
    "bond, brittle": {},
    "bond, bilinear": {"law": "bilinear", "kr": 2.0},
    "bond, cohesive": {"law": "cohesive", "f_t": 1e6},
    "bond, your own law": {"law": "own"},
    "bond, sight diffraction": {"sight": "diffraction"},
    "ordinary": {"model": "ordinary", "nu": 0.2},
    "correspondence, linear": SOLID,
    "correspondence, svk": SOLID | {"solid": "svk"},
    "correspondence, neo hooke": SOLID | {"solid": "neo hooke"},
    "correspondence, j2": SOLID | {"solid": "j2", "yield_stress": 1e8},
    "correspondence, rate": SOLID | {"form": "rate"},
    "micropolar": {"model": "micropolar", "nu": 0.2},
    "micropolar, cohesive": {"model": "micropolar", "nu": 0.2, "law": "cohesive", "f_t": 1e6},
}
RUNS = {
    "load steps": Run(solver="static"),
    "static start": Run(start="static"),
    "hybrid": Run(adapt="hybrid"),
    "collocation": Run(adapt="collocation", collocation=Collocation(damped=True)),
    "split": Run(adapt="split"),
    "particles": Run(cracks="particles"),
    "OpenCL": Run(device="opencl"),
}


def refusals(material: Material) -> Iterator[str]:
    """What is refused of a material in 3D, in each run, in the thesis mode and on ranks; "" where nothing is."""
    for dimension, run in ((3, Run()), *((2, run) for run in RUNS.values())):
        yield note_of(next(impossible(Settings(material=material, run=run), dimension), None))
    wrong_name = next(KINDS[material.model].one_sided(material), None)
    yield "" if wrong_name is None else f"`material.{wrong_name.name}` must be {wrong_name.expected}"
    yield note_of(next(on_ranks(Settings(material=material)), None))


def note_of(wrong: Impossible | None) -> str:
    """The note on a refusal, "" for none: the words of its message, as a condition."""
    if wrong is None:
        return ""
    use = re.sub(r", as (run\.\w+) is", r" when `\1` is", str(wrong.use))
    use = use.replace(", as the solver is", " when the solver is")
    return f"`{wrong.place.removeprefix('$.')}` must be {use}"


def combinations() -> str:
    """The section on what goes with what."""
    lines = [
        "## What goes with what",
        "",
        "A number after *no* points to the list below the table: the setting that is refused, and the value that it"
        " must have.\n`make materials` writes this section and the one above from the declarations of the materials"
        " (`pdmesh/model/materials`).",
        "",
        "| | " + " | ".join(("3D", *RUNS, "thesis mode", "MPI ranks")) + " |",
        "|---|" + "---|" * (len(RUNS) + 3),
    ]
    known: dict[str, int] = {}
    for name, changes in MATERIALS.items():
        found = list(refusals(Material(E=1.0, rho=1.0, G0=1.0, **changes)))
        cells = [f"no ({known.setdefault(said, len(known) + 1)})" if said else "yes" for said in found]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join([*lines, "", *(f"{number}. {said}" for said, number in known.items())]) + "\n"


def bounds(name: str) -> str:
    """The values that a setting of a material may have."""
    schema = msgspec.json.schema(Material)["$defs"]["Material"]["properties"][name]
    every = [kind for kind in schema.get("anyOf", [schema]) if kind.get("type") != "null"]
    (found,) = every
    if "enum" in found:
        return ", ".join(str(value) for value in found["enum"] if value is not None)
    words = {"exclusiveMinimum": "more than", "minimum": "at least", "maximum": "at most"}
    said = [f"{word} {found[key]:g}" for key, word in words.items() if key in found]
    return ", ".join(said) or {"boolean": "true, false", "string": "a name"}.get(found["type"], "any")


def parameters() -> str:
    """The section on the settings of each model."""
    lines = [
        "## Settings of each model",
        "",
        "| setting | unit | values | default | of | used with |",
        "|---|---|---|---|---|---|",
    ]
    usual = Material(E=1.0, rho=1.0, G0=1.0)
    kinds: dict[str, list[str]] = {}
    for kind in KINDS.values():
        for one in kind.parameters:
            kinds.setdefault(one, []).append(kind.name)
    every = {name: struct for kind in KINDS.values() for struct in kind.structs for name in struct.__struct_fields__}
    for name, struct in every.items():
        switch = switch_of(struct)
        default, used = getattr(usual, name), "" if switch is None else f"`{switch[0]}` {switch[1]}"
        said = "" if default is None else str(default).lower() if isinstance(default, bool) else f"{default}"
        lines.append(
            f"| `{name}` | {DECLARED[name].unit} | {bounds(name)} | {said} | {', '.join(kinds[name])} | {used} |"
        )
    return "\n".join(lines) + "\n"


def main() -> int:
    """Write the sections; returns the exit code."""
    for section in (parameters(), combinations()):
        put_section(PAGE, section)
    return 0


if __name__ == "__main__":
    sys.exit(main())
