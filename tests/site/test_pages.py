"""The site is whole, and what its pages show of a study is one."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from pages import DOCS, blocks
from plates import ROOT

from pdsolve.study.description import read_study


def test_a_study_that_is_shown_is_one(tmp_path: Path) -> None:
    (block,) = blocks(DOCS / "studies.md", "toml")
    (tmp_path / "study.toml").write_text(block.text)
    shutil.copy(ROOT / "geometries" / "duran50.geo", tmp_path)
    assert len(read_study(tmp_path / "study.toml").cases()) == 2 * 2 * 5


@pytest.mark.slow
def test_the_site_is_built_without_a_warning(tmp_path: Path) -> None:
    """References that lead nowhere are warnings too."""
    pytest.importorskip("sphinx")
    words = ["-m", "sphinx", "-W", "--keep-going", "-q", str(DOCS), str(tmp_path)]
    done = subprocess.run([sys.executable, *words], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "index.html").is_file()
