"""What bodies in space do not have yet, each with the sentence that refuses it: python -m benchmarks.plane_only.

Tries it on a small body and writes a section of docs/guide/3d.md.
"""

from __future__ import annotations

import contextlib
import io
import os
import shlex
import tempfile
from collections.abc import Callable
from pathlib import Path

from benchmarks.pages import put_section
from pdmesh.__main__ import main as pdmesh
from pdpost.__main__ import main as pdpost
from pdsolve.__main__ import main as pdsolve

PAGE = Path(__file__).parents[1] / "docs" / "guide" / "3d.md"
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


def refused() -> dict[str, str]:
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


def section(found: dict[str, str]) -> str:
    """The section of the page."""
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


if __name__ == "__main__":
    put_section(PAGE, section(refused()))
