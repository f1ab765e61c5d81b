"""Text from files reaches figures, tables, pages and terminals by `plain_text` alone: no code goes around it."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("pdmesh", "pdsolve", "pdpost")
ROOMS = [
    *PACKAGES,
    *(f"{one}/{room.name}" for one in PACKAGES for room in sorted((ROOT / one).iterdir()) if room.is_dir()),
]
GATES = {  # modules that only these files may import
    "matplotlib.figure": ("pdmesh/plain_figure.py",),
    "matplotlib.pyplot": (),
    "csv": ("pdsolve/measures/measured_curve.py",),  # which reads
    "html": ("pdmesh/plain_text.py",),
}
STREAMS = ("sys.stdout", "sys.stderr", "sys.__stdout__", "sys.__stderr__")
CALLS = ("print", "write", "writelines", "get_supported_filetypes", "print_figure")
CALLS += tuple(f"set_{axis}tick{what}" for axis in "xyz" for what in ("s", "labels"))
SIGNS = re.compile(r"</?[a-z]+\d?[ >]")
IMPORTS = "|".join(sorted({name.partition(".")[0] for name in GATES}))
CONCERNED = re.compile(  # of most files no line is: to walk them all takes seconds
    rf"\b({'|'.join(CALLS)})\s*\(|^\s*(import|from)\s+({IMPORTS})\b|{SIGNS.pattern}", re.MULTILINE
)
XML = {  # files that write XML or SVG of numbers, and names that are safe in a page
    "pdmesh/model/svg_picture.py",
    "pdpost/exports/frame_files.py",
    "pdpost/exports/surface_files.py",
}
PARTS = {
    "STYLE",
    "VIEWPORT",
    "body",
    "cells",
    "head",
    "items",
    "kind",
    "more",
    "said",
    "text",
    "title",
}  # that are HTML by now


def offences(text: str, name: str) -> Iterator[str]:
    """Places of a module that go around `plain_text`."""
    if not CONCERNED.search(text):
        return
    for node in ast.walk(ast.parse(text)):
        where = f"{name}:{getattr(node, 'lineno', 0)}"
        if isinstance(node, ast.Import | ast.ImportFrom):
            names = [one.name for one in node.names]
            modules = names if isinstance(node, ast.Import) else [node.module or ""]
            modules += [f"{node.module}.{one}" for one in names] if isinstance(node, ast.ImportFrom) else []
            yield from (f"{where}: imports {one}" for one in modules if one in GATES and name not in GATES[one])
        elif isinstance(node, ast.Call):
            yield from (f"{where}: {one}" for one in _calls(node, name))
        elif isinstance(node, ast.JoinedStr) and name not in XML:
            yield from (f"{where}: {one} in HTML" for one in _in_html(node))


def _calls(node: ast.Call, name: str) -> Iterator[str]:
    called = ast.unparse(node.func) if getattr(node.func, "attr", getattr(node.func, "id", "")) in CALLS else ""
    if called == "print" or called in {f"{stream}.{verb}" for stream in STREAMS for verb in ("write", "writelines")}:
        yield f"{called}, not printing.print_text"
    if called.endswith((".get_supported_filetypes", ".print_figure")) and name not in GATES["matplotlib.figure"]:
        yield f"{called}, not plain_figure.formats"
    labels = re.search(r"\.set_[xyz]tick(s|labels)$", called)
    if labels and (labels[1] == "labels" or len(node.args) > 1 or "labels" in {one.arg for one in node.keywords}):
        plain = any(one.arg == "parse_math" and ast.unparse(one.value) == "False" for one in node.keywords)
        if not plain:
            yield f"{called} without parse_math=False"


def _in_html(node: ast.JoinedStr) -> Iterator[str]:
    """Values in an f-string with tags that have not gone through `for_html`."""
    if not SIGNS.search("".join(str(one.value) for one in node.values if isinstance(one, ast.Constant))):
        return
    for one in node.values:
        if isinstance(one, ast.FormattedValue):
            value = ast.unparse(one.value)
            counted = re.fullmatch(r"self\.rows - SHOWN|''\.join\(lines\)", value)
            if not (value.startswith("for_html(") or value in PARTS or counted):
                yield value


@pytest.mark.parametrize("room", [room for room in ROOMS if "__" not in room])
def test_no_text_goes_around_it(room: str) -> None:
    paths = (ROOT / room).glob("*.py") if room in PACKAGES else (ROOT / room).rglob("*.py")
    sources = {str(path.relative_to(ROOT)): path.read_text(encoding="utf-8") for path in paths}
    assert sources
    assert [one for name, text in sources.items() for one in offences(text, name)] == []


@pytest.mark.parametrize(
    "line",
    [
        "from matplotlib.figure import Figure",
        "from matplotlib import pyplot as plt",
        "import csv",
        "from html import escape",
        "print(name)",
        "sys.stderr.write(name)",
        "axes.set_xticks(places, names)",
        "axes.set_yticklabels(names)",
        "formats = figure.canvas.get_supported_filetypes()",
        "cell = f'<td>{name}</td>'",
    ],
)
def test_a_new_place_is_noticed(line: str) -> None:
    assert len(list(offences(line, "pdpost/new.py"))) == 1
