"""`pdpost sif` of bodies: picture, JSON, table, and one line for what is wrong."""

from __future__ import annotations

import csv
import io
import json
from pathlib import Path

import numpy as np
import pytest
from messages import mentions
from prescribed_results import block, results_of

from pdpost.__main__ import main
from pdsolve.fracture.fields import Elastic, front_field
from pdsolve.results import Families

E, NU = 70e9, 0.3
K1, K2, K3 = 2e6, -0.6e6, 0.9e6  # Pa m^0.5
MODEL = {
    "notch": [],
    "nodes": [],
    "version": 2,
    "horizon": {"ratio": 3.0},
    "run": {"solver": "static"},
    "material": {"E": E, "rho": 2000.0, "G0": 10.0, "plane": "space", "model": "ordinary", "nu": NU},
}
SIDES, H = (18, 18, 14), 1e-3
MIDDLE = 9e-3  # m, where the crack is along y and its front along x


@pytest.fixture(scope="module")
def block_of(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A block with a crack halfway through it, its front along z, displaced as the field of K1, K2 and K3 has it."""
    nodes, families = block(SIDES, H)
    x, y, _ = nodes.position.T
    own = np.repeat(np.arange(len(x)), np.diff(families.start))
    other = families.neighbour
    sides = (y[own] > MIDDLE) != (y[other] > MIDDLE)
    share = np.where(sides, (MIDDLE - y[own]) / np.where(sides, y[other] - y[own], 1.0), 0.0)
    kept = ~(sides & (x[own] + share * (x[other] - x[own]) <= MIDDLE))
    count = np.bincount(own[kept], minlength=len(x))
    families = Families(np.concatenate([[0], np.cumsum(count)]), other[kept])
    z = (x - MIDDLE) + 1j * (y - MIDDLE)
    u = front_field(z, Elastic(E, NU, "strain"), K1, K2, K3).u
    a, b, c, d = ((-1.0, MIDDLE, -1.0), (MIDDLE, MIDDLE, -1.0), (MIDDLE, MIDDLE, 1.0), (-1.0, MIDDLE, 1.0))
    cracks = np.array([[*a, *b, *c], [*a, *c, *d]])
    path = tmp_path_factory.mktemp("front") / "block.sqlite"
    nodes = nodes._replace(cut=nodes.family - count)
    results_of(nodes, families, u, [], MODEL, cracks, path).close()
    return path


@pytest.mark.slow
def test_intensities_along_a_front(block_of: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """At the points that are far enough from both sides of the block."""
    assert main(["sif", str(block_of), "--json"]) == 0
    (front,) = json.loads(capsys.readouterr().out)["fronts"]
    assert len(front["along"]) == 7
    known = [at for at, value in enumerate(front["J"]) if value is not None]
    assert known == [2, 3, 4]
    assert np.array(front["place"])[:, :2] == pytest.approx(MIDDLE, abs=1e-9)
    up = np.sign(np.array(front["normal"])[0, 1])
    along = np.sign(np.cross(front["growth"][0], front["normal"][0])[2])
    signed = {"K1": K1, "K2": up * K2, "K3": along * up * K3}
    for at in known:
        for name, exact in signed.items():
            assert front[name][at] / exact == pytest.approx(1.0, abs=0.02)
            assert front["at_least"][name][at] <= front[name][at] <= front["at_most"][name][at]
        assert front["growth"][at] == pytest.approx([1.0, 0.0, 0.0], abs=1e-6)
        assert front["J"][at] / front["of_K"][at] == pytest.approx(1.0, abs=0.02)
    assert front["left_out"][3] == ""
    assert mentions(front["left_out"][0], found="surface of the body", expected="2 horizons, 0.006 m")


@pytest.mark.slow
def test_a_front_in_a_body_that_yields_has_J_alone(
    block_of: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """J is by the work of the stress, which is 0 here; K has no meaning."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(
        "pdsolve.measures.intensities_3d.stress_work_if_yielded",
        lambda results, step: np.zeros(len(results.nodes(step).ids)),
    )
    assert main(["sif", str(block_of), "--json"]) == 0
    (front,) = json.loads(capsys.readouterr().out)["fronts"]
    assert [at for at, value in enumerate(front["J"]) if value is not None] == [2, 3, 4]
    assert {*front["K1"], *front["K2"], *front["K3"], *front["of_K"]} == {None}
    assert main(["sif", str(block_of)]) == 0
    said = capsys.readouterr().out
    assert mentions(said, "J", "K means nothing here", "yields")
    assert "K1" not in said


@pytest.mark.slow
def test_a_picture_and_a_table(
    block_of: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["sif", str(block_of), "-o", "front.png"]) == 0
    out, err = capsys.readouterr()
    assert Path("front.png").stat().st_size > 20_000
    assert mentions(out, "front 0", "3 of 7", "K1", "K3")
    assert mentions(err, "front 0", "4 of 7", "4 at the surface of the body")
    assert main(["sif", str(block_of), "--csv", "-"]) == 0
    header, *rows = csv.reader(io.StringIO(capsys.readouterr().out))
    assert header[:8] == ["front", "step", "time, s", "along, m", "x, m", "y, m", "z, m", "J, J/m^2"]
    assert [row[7] != "" for row in rows] == [False, False, True, True, True, False, False]


@pytest.mark.slow
def test_a_tube_of_ones_own(block_of: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sif", str(block_of), "--ring", "3e-3,8e-3", "--tip", "0,0,0", "--json"]) == 0
    (front,) = json.loads(capsys.readouterr().out)["fronts"]
    assert front["K1"][3] / K1 == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize(
    ("words", "found", "expected"),
    [
        (["--ring", "3e-3,9.5e-3"], "surface of the body", "0.0095 m"),
        (["--tip", "0,0"], "2 numbers", "3"),
        (["--window", "0,0,1,1"], "body", "plates"),
    ],
)
def test_what_is_wrong_is_one_line(
    block_of: Path, capsys: pytest.CaptureFixture[str], words: list[str], found: str, expected: str
) -> None:
    assert main(["sif", str(block_of), *words, "--json"]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert mentions(err, found=found, expected=expected)


def test_a_body_without_a_crack_has_no_front(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    nodes, families = block()
    results_of(nodes, families, 0 * nodes.position, [], MODEL, None, tmp_path / "whole.sqlite").close()
    assert main(["sif", str(tmp_path / "whole.sqlite"), "--json"]) == 2
    assert mentions(capsys.readouterr().err, found="no front", expected="one")
