"""A screw that dissolves: built, solved, shown on a plane and as it looks."""

from __future__ import annotations

import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest
from messages import mentions, naming
from PIL import Image
from plates import GEOMETRIES

from pdmesh.__main__ import main as pdmesh
from pdpost.__main__ import main as pdpost
from pdsolve.__main__ import main as pdsolve


@pytest.fixture(scope="module")
def screw(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shipped screw, coarse and in a smaller ball, with collocation outside its cylinder."""
    path = tmp_path_factory.mktemp("screw") / "screw.json"
    changed = ("Zones/near/Spacing=5e-4", "Zones/far/Spacing=1e-3", "Plate/Ball=4e-3", "Run/Duration=500")
    words = [word for one in changed for word in ("--set", one)]
    assert pdmesh(["build", str(GEOMETRIES / "screw.geo"), *words, "-q", "-o", str(path)]) == 0
    results = path.with_suffix(".sqlite")
    assert pdsolve([str(path), "--adapt", "collocation", "--threads", "1", "-q", "-o", str(results)]) == 0
    return results


@pytest.mark.slow
def test_masses_of_a_body(screw: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert pdpost(["history", str(screw), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["units"] == "SI"
    assert 0.3 < found["last"]["left"] < 0.7
    assert abs(found["last"]["error"]) < 1e-12


@pytest.mark.slow
def test_a_plane_through_a_body(screw: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, table = tmp_path / "plane.png", tmp_path / "plane.csv"
    words = ["slice", str(screw), "--plane", "z=4e-4", "--frame", "0", "--json", "--csv", str(table), "-o", str(path)]
    assert pdpost(words) == 0
    found = json.loads(capsys.readouterr().out)
    assert (found["field"], found["largest"]) == ("content", pytest.approx(71600))
    rows = np.genfromtxt(table, delimiter=",", names=True)
    assert len(rows) == found["nodes"]
    assert set(np.round(rows["z"], 7)) == {2.5e-4, 5e-4}  # of fine and of coarse cells that reach there
    assert (rows["content"] > 1).sum() == 12  # of a circle two spacings in radius
    assert path.stat().st_size > 5000


@pytest.mark.slow
def test_how_a_body_looks(screw: Path, tmp_path: Path) -> None:
    pytest.importorskip("pyvista")
    path = tmp_path / "look.png"
    words = ["render", str(screw), "--frame", "0", "--field", "solid", "--level", "0.5", "-q", "-o", str(path)]
    assert pdpost(words) == 0
    seen = np.asarray(Image.open(path).convert("L")) < 250
    high, wide = np.ptp(np.flatnonzero(seen.any(axis=1))), np.ptp(np.flatnonzero(seen.any(axis=0)))
    assert 1.3 < high / wide < 3
    assert (
        pdpost(["render", str(screw), "--plane", "y=0", "--style", "savefig.dpi=60", "-q", "--force", "-o", str(path)])
        == 0
    )
    seen = np.asarray(Image.open(path).convert("RGB")).astype(int)
    assert seen.shape[1] < 400
    hues = seen.max(axis=2) - seen.min(axis=2)
    assert (hues[:, : seen.shape[1] * 3 // 4] > 60).mean() > 0.1  # of the body, and not only of the bar beside it


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["slice", "--plane", "z=1"], naming(found="z = 1 m", expected=("-0.008", "0.008 m"))),
        (["slice", "--field", "stress"], naming(found=("model", "diffusion"), expected=("mechanics", "concentration"))),
        (["slice", "--component", "x"], naming("content", found="component 'x'", expected=("none", "scalar"))),
        (["damage"], naming(found=("model", "diffusion"), expected=("mechanics", "concentration"))),
        (["history", "--node", "7"], naming(expected=("masses", "whole"))),
    ],
)
def test_bad_input_gets_one_line(screw: Path, words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert pdpost([words[0], str(screw), *words[1:]]) == 2
    found = capsys.readouterr().err
    assert re.search(said, found)
    assert found.count("\n") == 1


@pytest.mark.slow
def test_without_pyvista_a_body_is_not_drawn(
    screw: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(sys.modules, "pyvista", None)
    path = tmp_path / "never.png"
    assert pdpost(["render", str(screw), "-o", str(path)]) == 2
    assert mentions(capsys.readouterr().err, found="PyVista", expected="pip install 'pdsuite[render]'")
    assert not path.exists()
