"""The site: its made pages have what they say, its links lead somewhere, and the tutorial works as it stands."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from plates import GEOMETRIES, ROOT

from pdmesh.__main__ import main as pdmesh
from pdpost.__main__ import main as pdpost
from pdsolve.__main__ import main as pdsolve

MAIN = {"pdmesh": pdmesh, "pdsolve": pdsolve, "pdpost": pdpost}
COARSE = ["--set", "W=0.03", "--set", "crack=0.015", "--set", "opening=2.5e-4"]  # smaller: 40 % of the nodes


@pytest.mark.slow
def test_the_tutorial_works(here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """Every command in its order, on a smaller specimen."""
    shutil.copy(GEOMETRIES / "compact_tension.py", here)
    (block,) = re.findall(r"```\n(.*?)```", (ROOT / "docs" / "tutorial.md").read_text(), re.DOTALL)
    commands = [shlex.split(line, comments=True) for line in block.splitlines()]
    assert len(commands) == 10
    for program, command, *words in commands:
        coarse = COARSE if program == "pdmesh" else ["--threads", "1"] if program == "pdsolve" else []
        assert MAIN[program]([command, *words, *coarse]) == 0, (program, command, capsys.readouterr().err)
    made = {path.name for path in here.iterdir()}
    assert made >= {"compact_tension.png", "figure.pdf", "compact_tension.damage.gif", "compact_tension.report.html"}


@pytest.mark.slow
def test_the_site_is_built_without_a_broken_link(tmp_path: Path) -> None:
    pytest.importorskip("material")
    words = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path / "site")]
    ran = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    pages = {path.parent.relative_to(tmp_path / "site").as_posix() for path in tmp_path.rglob("index.html")}
    assert {".", "tutorial", "reference/cli", "reference/schema", "guide/drawings", "where_methods_fail"} <= pages
    assert "pdpost tradeoff" in (tmp_path / "site" / "reference" / "cli" / "index.html").read_text()
