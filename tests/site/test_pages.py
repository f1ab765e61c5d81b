"""The commands on the pages of the site work as they stand, in their order, in a folder of their own."""

from __future__ import annotations

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from plates import ROOT

DOCS = ROOT / "docs"
PAGES = sorted(path for path in DOCS.rglob("*.md") if "```bash" in path.read_text(encoding="utf-8"))
COARSE = {  # what takes minutes, and its coarse form: pins that move half as far, before the crack grows
    "pdmesh build specimen.geo": "pdmesh build specimen.geo --set 'Fixes/upper pin/Displacement y=0.15'"
    " --set 'Fixes/lower pin/Displacement y=-0.15'",
}


def commands(page: Path) -> list[str]:
    """The lines of a page's bash blocks, in their order."""
    blocks = re.findall(r"```bash\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL)
    return [line for block in blocks for line in block.replace("\\\n", " ").splitlines() if line.strip()]


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(DOCS)))
def test_the_commands_of_a_page(page: Path, tmp_path: Path) -> None:
    """Drawings that the pages show lie beside them."""
    (tmp_path / "geometries").symlink_to(ROOT / "geometries")
    for drawing in (DOCS / "tutorial").glob("*.*"):
        if drawing.suffix in (".geo", ".py", ".toml"):
            shutil.copy(drawing, tmp_path)
    for line in commands(page):
        program, *options = shlex.split(COARSE.get(line, line), comments=True)
        assert program in ("pdmesh", "pdsolve", "pdpost"), line
        done = subprocess.run([sys.executable, "-m", program, *options], cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, (line, done.stderr)


def test_what_stands_for_a_command_is_on_a_page() -> None:
    """A coarse form of nothing would hide that a page has changed."""
    lines = {line for page in PAGES for line in commands(page)}
    assert lines
    assert COARSE.keys() <= lines


@pytest.mark.slow
def test_the_site_is_built_without_a_warning(tmp_path: Path) -> None:
    """References that lead nowhere are warnings too."""
    pytest.importorskip("sphinx")
    words = ["-m", "sphinx", "-W", "--keep-going", "-q", str(DOCS), str(tmp_path)]
    done = subprocess.run([sys.executable, *words], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "index.html").is_file()
