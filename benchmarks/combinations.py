"""What can be combined, and the settings of materials: python -m benchmarks.combinations.

From the table that messages come from (`pdmesh.model.possible`). Writes docs/guide/combinations.md and sections of
docs/guide/materials.md; and a section of docs/guide/3d.md: what programs refuse of a small body, each sentence tried.
"""

from __future__ import annotations

import contextlib
import io
import os
import shlex
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path

import msgspec

from benchmarks.features import GROUPS, MATERIALS, SAMPLES, Changes, places_of, refused, together
from benchmarks.pages import put_section
from pdmesh.__main__ import main as pdmesh
from pdmesh.model.material import DECLARED, Material, switch_of
from pdmesh.model.materials import KINDS
from pdmesh.model.possible import TABLE
from pdpost.__main__ import main as pdpost
from pdsolve.__main__ import main as pdsolve

GUIDE = Path(__file__).parents[1] / "docs" / "guide"
PAGE, ALL, SPACE = GUIDE / "materials.md", GUIDE / "combinations.md", GUIDE / "3d.md"
COLUMNS = ("3D", "load steps", "fatigue of bonds", "static start", "contact", "thermal stress", "hybrid", "collocation")
COLUMNS += ("split", "crack particles", "OpenCL", "thesis mode", "MPI ranks")
HEAD = """# Combinations of features

Features that exclude each other are refused before a run begins, in a sentence that names the setting:

```bash
pdmesh build geometries/duran50.geo
pdmesh info duran50.json                                           # lists what the model excludes
pdsolve duran50.json --set run.solver=static --set run.damping=1   # $.run.damping (1) cannot be used, ...
```

`make materials` writes this page from the table that these programs use, `pdmesh/model/possible.py`. A test tries every
pair of the features below: it runs to finite numbers, or is refused with its sentence.

The last column leaves out two values of one setting, such as two kinds of `run.adapt`, and what a feature named there
implies: what is not possible with *load steps* is not possible with *fatigue of bonds* either.
"""


def combinations() -> str:
    """The section on what materials go with."""
    lines = [
        "## What goes with what",
        "",
        "A number after *no* points to the list below the table: the setting that is refused, and the value that it"
        " must have.\n[Combinations of features](combinations.md) has all other features.",
        "",
        "| | " + " | ".join(COLUMNS) + " |",
        "|---|" + "---|" * len(COLUMNS),
    ]
    known: dict[str, int] = {}
    for name in MATERIALS:
        said = [_refused_pair(name, column) for column in COLUMNS]
        cells = [f"no ({known.setdefault(text, len(known) + 1)})" if text else "yes" for text in said]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    notes = ["", "### What is refused", "", *(f"{number}. {text}" for text, number in known.items())]
    return "\n".join([*lines, *notes]) + "\n"


def every_feature() -> str:
    """The page of all features."""
    parts = [HEAD]
    for group, samples in GROUPS.items():
        lines = [f"## {group}", "", "| feature | settings | not with |", "|---|---|---|"]
        for name, changes in samples.items():
            alone = [] if not refused(changes) else ["mechanics"]  # it needs a medium
            others = [other for other in SAMPLES if other != name and _refused_pair(name, other)]
            others = [other for other in others if not alone or "physics" in SAMPLES[other]]
            listed = alone + [other for other in others if not any(_implies(other, more) for more in others)]
            lines.append(f"| {name} | {settings_of(changes)} | {', '.join(listed)} |")
        parts.append("\n".join(lines) + "\n")
    parts.append("## What to use instead\n\nOf a feature below, with that of the heading.\n")
    for by in dict.fromkeys(exclusion.by for exclusion in TABLE):
        rows = (f"- {one.name}: {reason(use, because)}" for one, other, use, because in TABLE if other == by)
        parts.append(f"### With {by.name}\n\n" + "\n".join(dict.fromkeys(rows)) + "\n")
    return "\n".join(parts)


def _implies(one: str, other: str) -> bool:
    """Whether a model with one feature has the other too."""
    return SAMPLES[other].items() < SAMPLES[one].items()


@cache
def _refused_pair(one: str, other: str) -> str:
    """The sentence that refuses two features together, "" for none."""
    if one > other:
        return _refused_pair(other, one)
    changes = together(one, other)
    return "" if changes is None else refused(changes)


def settings_of(changes: Changes) -> str:
    """The settings of a feature, as a reader would write them."""
    words = []
    for name, value in changes.items():
        if name == "conditions":
            words += [f"condition `{make(places_of(2)).__struct_config__.tag}`" for make in value]
        elif name in OPTIONS:
            words.append(OPTIONS[name])
        else:
            plain = isinstance(value, str | bool | float | int)
            words.append(f"`{name} = {msgspec.json.encode(value).decode()}`" if plain else f"`{name}`")
    return ", ".join(words)


OPTIONS = {
    "mode": "`--mode thesis`",
    "precision": "`--precision float32`",
    "ranks": "`mpiexec`",
    "dimension": "a body in space",
    "rigid": "condition `rigid`",
    "regions": "`regions`",
    "gap": "`run.gaps`",
    "profile": "`profile` of a load",
}


def reason(use: str, because: str) -> str:
    """What to use instead of a feature, in words."""
    return ("leave it out" if use == "none" else f"use {use}") + because


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


PROGRAMS: dict[str, Callable[[list[str]], int]] = {"pdmesh": pdmesh, "pdsolve": pdsolve, "pdpost": pdpost}
SCENE = """
from pdmesh import Body, Box, Material
scene = (
    Body(Box((0, 0, 0), (1, 0.4, 0.4)), 0.1, Material(E=1e6, rho=1000.0, G0=1e9)).fix("left").load("right", (1e3, 0, 0))
)
"""
MADE = ("pdmesh build body.py --trust", "pdsolve body.json --set run.steps=4 --set run.every=2 --threads 1")
TRIED = (
    "pdmesh build body.py --trust --refine crack:1",
    "pdmesh plan body.py --trust --within 2%",
    "pdmesh plan body.py --trust --mode thesis",
    "pdmesh preview body.json --bonds",
    "pdsolve body.json --mode thesis",
    "pdsolve body.json --adapt collocation",
    "pdsolve body.json --adapt split",
    "pdsolve body.json --adapt hybrid --set physics=thermoelastic --set medium.D=1e-5 --set material.alpha=1e-5"
    " --set material.T0=300",
    "pdsolve body.json --cracks particles",
    "pdsolve body.json --set material.model=micropolar --set material.nu=0.2",
    "pdsolve body.json --set material.solid='neo hooke' --set material.model=correspondence --set material.nu=0.2",
    "pdpost bonds body.sqlite",
    "pdpost crack body.sqlite --along right",
    "pdpost crack body.sqlite --compare body.sqlite",
    "pdpost damage body.sqlite --scale auto",
    "pdpost damage body.sqlite --window 0,0,1,1",
    "pdpost damage body.sqlite --frames 0,1",
    "pdpost line body.sqlite --from 0,0,0 --to 1,0,0",
    "pdpost nodes body.sqlite",
    "pdpost strain body.sqlite",
)


def said(command: str) -> tuple[int, str]:
    """The exit code of a command in this process, and what it says on stderr."""
    program, *words = shlex.split(command)
    heard = io.StringIO()
    with contextlib.redirect_stderr(heard), contextlib.redirect_stdout(io.StringIO()):
        code = PROGRAMS[program]([*words, "--force"])
    return code, heard.getvalue()


def refused_of_bodies() -> dict[str, str]:
    """What is refused of all that is tried, and the sentence. Works in a folder of its own."""
    before, found = Path.cwd(), {}
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            Path("body.py").write_text(SCENE, encoding="utf-8")
            for command in MADE:
                assert said(command)[0] == 0, command
            for command in TRIED:
                code, sentence = said(command)
                if code == 2:
                    found[command] = sentence.strip().partition(": ")[2]
                elif code != 0:
                    raise RuntimeError(f"{command}: exit code is {code}, not 0 or 2: {sentence}")
        finally:
            os.chdir(before)
    return found


def bodies(found: dict[str, str]) -> str:
    """The section on what bodies do not have yet."""
    lines = [
        "## What bodies do not have yet",
        "",
        "`make materials` tries each command and writes this table.",
        "",
        "| command | what it says |",
        "|---|---|",
    ]
    lines += [f"| `{command}` | {sentence} |" for command, sentence in found.items()]
    return "\n".join([*lines, ""])


def main() -> int:
    """Write the page and the sections; returns the exit code."""
    ALL.write_text(every_feature(), encoding="utf-8")
    for section in (parameters(), combinations()):
        put_section(PAGE, section)
    put_section(SPACE, bodies(refused_of_bodies()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
