"""What can be combined, and the settings of materials: python -m benchmarks.combinations.

From the table that messages come from (`pdmesh.model.possible`). Writes tables of docs/guide/combinations.md and of
docs/guide/materials.md; and one of docs/guide/3d.md: what programs refuse of a small body, each sentence tried.
"""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path

import msgspec

from benchmarks.features import GROUPS, MATERIALS, SAMPLES, Changes, physics_of, places_of, refused, together
from benchmarks.pages import DOCS, markdown_table, write_block
from pdmesh.__main__ import main as pdmesh
from pdmesh.model.material import DECLARED, Material, switch_of
from pdmesh.model.materials import KINDS
from pdmesh.model.possible import TABLE
from pdpost.__main__ import main as pdpost
from pdsolve.__main__ import main as pdsolve

GUIDE = DOCS / "guide"
PAGE, ALL, SPACE = GUIDE / "materials.md", GUIDE / "combinations.md", GUIDE / "3d.md"
COLUMNS = ("3D", "load steps", "fatigue of bonds", "static start", "contact", "thermal stress", "hybrid", "collocation")
COLUMNS += ("split", "crack particles", "OpenCL", "thesis mode", "MPI ranks")


def combinations() -> str:
    """What materials go with: a table, and a list of what is refused."""
    numbers: dict[str, int] = {}
    rows = []
    for name in MATERIALS:
        sentences = [_refused_pair(name, column) for column in COLUMNS]
        cells = [f"no ({numbers.setdefault(text, len(numbers) + 1)})" if text else "yes" for text in sentences]
        rows.append([name, *cells])
    parts: dict[str, list[str]] = {"### Refused laws": [], "### Refused models and solids": []}
    for text, number in numbers.items():
        of_laws = text.startswith(("$.material.law", "$.material.sight"))
        parts[list(parts)[not of_laws]].append(f"{number}. {text}")
    notes = "\n\n".join("\n".join([heading, "", *lines]) for heading, lines in parts.items())
    return f"{markdown_table(['', *COLUMNS], rows)}\n{notes}"


def every_feature() -> str:
    """What each feature cannot be combined with: a section with a table for each group."""
    parts = []
    for group, samples in GROUPS.items():
        rows = []
        for name, changes in samples.items():
            alone = [] if not refused(changes) else ["mechanics"]  # it needs a medium
            others = [other for other in SAMPLES if other != name and _excludes(name, other)]
            others = [other for other in others if not alone or physics_of(SAMPLES[other]) != "mechanics"]
            listed = alone + [other for other in others if not any(_implies(other, more) for more in others)]
            rows.append([name, settings_of(changes), ", ".join(listed)])
        parts.append(f"## {group}\n\n{markdown_table(['feature', 'settings', 'not with'], rows)}")
    return "\n".join(parts).strip("\n")


def instead() -> str:
    """What to use instead of a feature: a section for each that excludes it."""
    parts = []
    for by in dict.fromkeys(exclusion.by for exclusion in TABLE):
        rows = (f"- {out.name}: {reason(use, because)}" for out, excluder, use, because in TABLE if excluder == by)
        parts.append(f"### With {by.name}\n\n" + "\n".join(dict.fromkeys(rows)))
    return "\n\n".join(parts)


def _excludes(feature: str, excluded: str) -> bool:
    """Whether a feature, and not the mechanics of the plate alone, excludes another."""
    sentences = _refused_pair(feature, excluded), _refused_alone(excluded)
    pair, alone = (re.sub(r"\d", "", sentence) for sentence in sentences)  # but for numbers of conditions
    return pair not in ("", alone)


def _implies(feature: str, implied: str) -> bool:
    """Whether a model with a feature has the implied one too."""
    return SAMPLES[implied].items() < SAMPLES[feature].items()


@cache
def _refused_pair(first: str, second: str) -> str:
    """The sentence that refuses two features together, "" for none."""
    if first > second:
        return _refused_pair(second, first)
    changes = together(first, second)
    return "" if changes is None else refused(changes)


@cache
def _refused_alone(feature: str) -> str:
    """The sentence that refuses a feature in a plate of mechanics, "" for none."""
    return refused(SAMPLES[feature])


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
    "kernel": '`Options(kernel="blocks")`',
    "disturbances": "`repeat` of a study",
    "probe": "`run.probes`",
    "dimension": "a body in space",
    "rigid": "condition `rigid`",
    "regions": "`regions`",
    "fields": "`fields` of the grid file",
    "interfaces": "`interfaces`",
    "gap": "`run.gaps`",
    "profile": "`profile` of a load",
}


def reason(use: str, because: str) -> str:
    """What to use instead of a feature, in words."""
    words = f"leave it out{use.removeprefix('none')}" if use.startswith("none (") or use == "none" else f"use {use}"
    return words + because


def bounds(name: str) -> str:
    """The values that a setting of a material may have."""
    schema = msgspec.json.schema(Material)["$defs"]["Material"]["properties"][name]
    (kind,) = [kind for kind in schema.get("anyOf", [schema]) if kind.get("type") != "null"]
    if "enum" in kind:
        return ", ".join(str(value) for value in kind["enum"] if value is not None)
    words = {"exclusiveMinimum": "more than", "minimum": "at least", "maximum": "at most"}
    limits = [f"{word} {kind[key]:g}" for key, word in words.items() if key in kind]
    return ", ".join(limits) or {"boolean": "true, false", "string": "a name"}.get(kind["type"], "any")


def parameters() -> str:
    """The table of the settings of each model."""
    usual = Material(E=1.0, rho=1.0, G0=1.0)
    kinds: dict[str, list[str]] = {}
    for kind in KINDS.values():
        for parameter in kind.parameters:
            kinds.setdefault(parameter, []).append(kind.name)
    every = {name: struct for kind in KINDS.values() for struct in kind.structs for name in struct.__struct_fields__}
    rows = []
    for name, struct in every.items():
        switch, default = switch_of(struct), getattr(usual, name)
        used = "" if switch is None else f"`{switch[0]}` {switch[1]}"
        value = "" if default is None else str(default).lower() if isinstance(default, bool) else f"{default}"
        rows.append([f"`{name}`", DECLARED[name].unit, bounds(name), value, ", ".join(kinds[name]), used])
    return markdown_table(["setting", "unit", "values", "default", "models", "used with"], rows).strip("\n")


PROGRAMS: dict[str, Callable[[list[str]], int]] = {"pdmesh": pdmesh, "pdsolve": pdsolve, "pdpost": pdpost}
SCENE = """
from pdmesh import Body, Box, Material
scene = (
    Body(Box((0, 0, 0), (1, 0.4, 0.4)), 0.1, Material(E=1e6, rho=1000.0, G0=1e9)).fix("left").load("right", (1e3, 0, 0))
)
"""
PREPARING = ("pdmesh build body.py --trust", "pdsolve body.json --set run.steps=4 --set run.every=2 --threads 1")
TRIED = (
    "pdmesh build body.py --trust --refine crack:1",
    "pdmesh plan body.py --trust --within 2%",
    "pdmesh plan body.py --trust --mode thesis",
    "pdmesh preview body.json --bonds",
    "pdsolve body.json --mode thesis",
    "pdsolve body.json --adapt collocation",
    "pdsolve body.json --adapt split",
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


def run_command(command: str) -> tuple[int, str]:
    """The exit code of a command in this process, and what it writes on stderr."""
    program, *words = shlex.split(command)
    stderr = io.StringIO()
    with contextlib.redirect_stderr(stderr), contextlib.redirect_stdout(io.StringIO()):
        code = PROGRAMS[program]([*words, "--force"])
    return code, stderr.getvalue()


def refused_of_bodies() -> dict[str, str]:
    """What is refused of all that is tried, and the sentence. Works in a folder of its own."""
    sentences = {}
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        Path("body.py").write_text(SCENE, encoding="utf-8")
        for command in PREPARING:
            assert run_command(command)[0] == 0, command
        for command in TRIED:
            code, sentence = run_command(command)
            if code == 2:
                sentences[command] = sentence.strip().partition(": ")[2]
            elif code != 0:
                raise RuntimeError(f"{command}: exit code is {code}, not 0 or 2: {sentence}")
    return sentences


def bodies(sentences: dict[str, str]) -> str:
    """The table of what bodies do not have yet."""
    rows = [[f"`{command}`", sentence] for command, sentence in sentences.items()]
    return markdown_table(["command", "what it says"], rows).strip("\n")


def main() -> int:
    """Write the tables; returns the exit code."""
    write_block(ALL, "features", every_feature())
    write_block(ALL, "instead", instead())
    write_block(PAGE, "settings", parameters())
    write_block(PAGE, "combinations", combinations())
    write_block(SPACE, "bodies", bodies(refused_of_bodies()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
