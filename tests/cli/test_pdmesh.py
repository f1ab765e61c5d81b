"""The command line: what it writes, says and refuses, and that a refusal leaves nothing behind."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import msgspec
import pytest
from messages import mentions
from plates import GEOMETRIES

from pdmesh.__main__ import main, parser
from pdmesh.model.document import read_file, write_file

DURAN = str(GEOMETRIES / "duran50.geo")
SCRIPT = str(GEOMETRIES / "duran50_one_scale.py")

pytestmark = pytest.mark.usefixtures("here")


def said(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    """The JSON that a command prints."""
    assert main([*words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_build_writes_the_model_and_says_so(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["build", DURAN]) == 0
    out, err = capsys.readouterr()
    assert out.splitlines() == [
        "duran50.json: 2732 nodes (2222 of 0.001 m, 510 of 0.002 m)",
        "lattice of 0.001 m: shifted by (0, 0.0005) m, off the cracks",
    ]
    (warning,) = err.splitlines()
    assert warning.startswith("warning: duran50.json: ")
    strength = ("0.002 m", "0.71", "0.001 m", "'top'", "'bottom'", "coarse")
    assert mentions(warning, found=strength, expected=("material.coarse", '"matched"', '"unbreakable"'))
    assert [path.name for path in here.iterdir()] == ["duran50.json"]


@pytest.mark.slow
def test_build_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    result = said(capsys, "build", DURAN, "-o", "plate.json")
    assert result["output"] == "plate.json"
    assert (result["nodes"], result["nodes_by_spacing"]) == (2732, {"0.001": 2222, "0.002": 510})
    assert result["shifts"] == {"0.001": [0, 0.0005]}
    assert result["loaded_nodes"] == {"top": 204, "bottom": 204}
    assert result["area"] == pytest.approx(0.004, rel=1e-12)


@pytest.mark.process
def test_a_dry_run_says_what_would_be_built_and_writes_nothing(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words = ["build", SCRIPT, "--trust", "--set", "spacing=4mm"]
    dry = said(capsys, *words, "--dry-run")
    assert list(here.iterdir()) == []
    assert said(capsys, *words) == dry | {"output": "duran50_one_scale.json"}
    (here / "duran50_one_scale.json").write_text("mine")
    assert main([*words, "--dry-run"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith(f"duran50_one_scale.json: {dry['nodes']} nodes")
    assert lines[-1] == "duran50_one_scale.json was not written (--dry-run); pdmesh info reports more"
    assert (here / "duran50_one_scale.json").read_text() == "mine"


@pytest.mark.slow
def test_an_output_is_kept_unless_forced(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (here / "duran50_one_scale.json").write_text("mine")
    assert main(["build", SCRIPT, "--trust"]) == 2
    assert mentions(capsys.readouterr().err, found="already exists", expected="--force")
    assert (here / "duran50_one_scale.json").read_text() == "mine"
    assert main(["build", SCRIPT, "--trust", "--force"]) == 0
    assert len(read_file(here / "duran50_one_scale.json").nodes) == 4242


@pytest.mark.slow
@pytest.mark.parametrize("scene", [DURAN, SCRIPT])
def test_a_model_builds_itself_again(scene: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    name = "Zones/coarse/Spacing" if scene == DURAN else "spacing"
    value = "4e-3" if scene == DURAN else "2e-3"
    changed = ["--set", f"{name}={value}", "--refine", "crack:2e-3"]
    assert main(["build", scene, "--trust", *changed, "-o", "first.json", "-q"]) == 0
    assert main(["build", "first.json", "--trust", "-o", "second.json", "-q"]) == 0
    assert (here / "second.json").read_bytes() == (here / "first.json").read_bytes()
    assert main(["build", "first.json", "--trust", "--set", f"{name}=1e-3", "-o", "third.json", "-q"]) == 0
    third = read_file(here / "third.json")
    assert third.parameters["Peridynamics/" * (scene == DURAN) + name] == 1e-3
    assert third.parameters["--refine crack:2e-3"] == "crack:2e-3"
    assert len(third.nodes) > len(read_file(here / "first.json").nodes)
    out, err = capsys.readouterr()
    assert out == ""
    assert all("act on coarse nodes" in line for line in err.splitlines())


@pytest.mark.slow
def test_a_model_with_a_program_in_it_is_not_run_untrusted(capsys: pytest.CaptureFixture[str], here: Path) -> None:
    assert main(["build", SCRIPT, "--trust", "-o", "model.json", "-q"]) == 0
    assert main(["build", "model.json", "-o", "again.json"]) == 2
    assert mentions(capsys.readouterr().err, found="Python", expected="--trust")
    assert not (here / "again.json").exists()


@pytest.mark.slow
def test_two_refinements_of_the_same_kind(here: Path) -> None:
    words = ["--refine", "crack:4e-3:5e-4", "--refine", "crack:1e-3:2.5e-4"]
    assert main(["build", SCRIPT, "--trust", *words, "-o", "a.json", "-q"]) == 0
    assert len(set(read_file(here / "a.json").nodes.delta[:, 0].tolist())) == 3
    assert main(["build", "a.json", "--trust", "-o", "b.json", "-q"]) == 0
    assert (here / "a.json").read_bytes() == (here / "b.json").read_bytes()


IN_MM = """
SetFactory("OpenCASCADE"); Rectangle(1) = {0, 0, 0, WIDTH, 10};
DefineConstant[ s = {1, Name "Peridynamics/Zones/plate/Spacing"} ];
Physical Surface("zone:plate") = {1};
"""


@pytest.mark.slow
@pytest.mark.parametrize(("width", "expected"), [("18", 18), ("2.1", 10), ("1800", None)])
def test_a_large_plate_is_said_to_be_in_metres(
    width: str, expected: float | None, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "plate.geo").write_text(IN_MM.replace("WIDTH", width))
    assert main(["build", "plate.geo"]) == (0 if expected else 2)
    out, err = capsys.readouterr()
    assert err.startswith("warning: the plate has") == bool(expected)
    assert mentions(out + err, '"mm"', "--unit")
    assert main(["build", "plate.geo", "--unit", "mm", "-o", "mm.json"]) == 0
    assert "the plate has" not in "".join(capsys.readouterr())
    position = read_file(here / "mm.json").nodes.position
    assert position[:, :2].max() == pytest.approx(max(float(width) // 1, 10) * 1e-3)
    assert main(["build", "plate.geo", "--unit", "m", "-o", "m.json"]) == 0
    assert "the plate has" not in "".join(capsys.readouterr())
    assert main(["build", "mm.json", "-o", "again.json"]) == 0
    assert (here / "again.json").read_bytes() == (here / "mm.json").read_bytes()


@pytest.mark.slow
def test_info(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["build", DURAN, "-q"]) == 0
    found = said(capsys, "info", "duran50.json")
    assert (found["nodes"], found["bonds_cut_by_cracks"], found["steps"]) == (2732, 1796, 1700)
    assert found["area_of_nodes"] == pytest.approx(found["area_of_shape"], rel=1e-10)
    assert main(["info", "duran50.json"]) == 0
    assert "load 'top': 204 nodes" in capsys.readouterr().out
    assert said(capsys, "info", DURAN)["bonds"] == found["bonds"]


@pytest.mark.slow
def test_plan(capsys: pytest.CaptureFixture[str], here: Path) -> None:
    found = said(capsys, "plan", DURAN, "-o", "plan.json")
    assert (found["scene"]["nodes"], found["one_scale"]["nodes"]) == (2732, 4040)
    assert found["scene"]["bonds"] < found["one_scale"]["bonds"]
    assert json.loads((here / "plan.json").read_text()) == found
    assert main(["plan", DURAN]) == 0
    assert "solve seconds" in capsys.readouterr().out


@pytest.mark.slow
def test_params(capsys: pytest.CaptureFixture[str]) -> None:
    found = said(capsys, "params", DURAN)
    assert found["Peridynamics/Material/E"] == {"value": 65e9, "unit": "Pa", "meaning": "Young's modulus"}
    assert said(capsys, "params", DURAN, "--set", "Material/E=7e10")["Peridynamics/Material/E"]["value"] == 7e10
    assert main(["params", SCRIPT, "--trust"]) == 0
    assert "spacing   0.001" in capsys.readouterr().out


@pytest.mark.slow
def test_preview(here: Path) -> None:
    assert main(["build", DURAN, "-q"]) == 0
    assert main(["preview", "duran50.json", "-q"]) == 0
    assert main(["preview", "duran50.json", "--bonds", "-o", "bonds.svg", "-q"]) == 0
    assert (here / "duran50.png").read_bytes().startswith(b"\x89PNG")
    assert (here / "bonds.svg").stat().st_size > 10_000


def test_schema(capsys: pytest.CaptureFixture[str], here: Path) -> None:
    assert main(["schema"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert "nodes" in printed["$defs"]["GridFile"]["required"]
    assert main(["schema", "-o", "schema.json"]) == 0
    assert json.loads((here / "schema.json").read_text()) == printed


def test_every_command_is_in_the_help(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as done:
        parser().parse_args(["--help"])
    assert done.value.code == 0
    text = capsys.readouterr().out
    for command in ("build", "info", "preview", "plan", "params", "schema"):
        assert command in text


REFUSED = {
    "no such scene": (["build", "missing.py"], "missing.py: cannot be read"),
    "no such model": (["info", "missing.json"], "missing.json: cannot be read"),
    "no such mesh": (["build", "missing.vtu"], "missing.vtu: cannot be read"),
    "unknown suffix": (["build", "plate.dxf"], "suffix '.dxf'"),
    "unknown zone": (["build", DURAN, "--set", "Zones/fin/Spacing=1"], "(or is Peridynamics/Zones/fine meant?)"),
    "unknown name": (["build", DURAN, "--set", "Fixs/a/Box=0 0 1 1"], "'Peridynamics/Fixes/a/Box'"),
    "unknown number": (["build", DURAN, "--set", "Plate/Lenth=1"], "did you mean 'Peridynamics/Plate/Length'?"),
    "unknown to list": (["params", DURAN, "--set", "Zone/fine/Spacing=1"], "'Peridynamics/Zones/fine/Spacing'"),
    "unknown constant": (["params", SCRIPT, "--trust", "--set", "spacin=1"], "'spacing'"),
    "unit of a script": (["build", SCRIPT, "--trust", "--unit", "mm"], "--unit is not for a Python scene"),
    "another unit": (["build", DURAN, "--set", "material.E=5mm"], "'5mm'; use a number, in Pa, or with one of the"),
    "no unit": (["build", DURAN, "--set", "Horizon ratio=5mm"], "'5mm'; use a number\n"),
    "misspelt setting": (["build", DURAN, "--set", "run.ledgr=5"], "run.ledger"),
    "by meaning": (["build", DURAN, "--set", "young=5"], "did you mean 'Peridynamics/Material/E'?"),
    "name of nothing": (["build", DURAN, "--set", "bogus=5"], "; pdmesh params lists"),
    "constant of nothing": (["params", SCRIPT, "--trust", "--set", "material.nu=0"], "is not in the drawing"),
    "unit of a constant": (["params", SCRIPT, "--trust", "--set", "spacing=5s"], "'5s'; use a number, in m, or with"),
    "dry run of nothing": (["build", DURAN, "--dry-run", "-o", "nowhere/plate.json"], "no folder"),
    "no number": (["build", DURAN, "--set", "Zones/fine/Spacing=x"], "'x'"),
    "wrong ratio": (["build", DURAN, "--set", "Zones/fine/Spacing=7e-4"], "over a power of 2"),
    "crack too long": (["build", DURAN, "--set", "Plate/Crack length=0.2"], "crack 'notch'"),
    "refine by nothing": (["build", DURAN, "--refine", "crack:1e-3:5e-324"], "crack: spacing is 4.94066e-324"),
    "refine too far": (["build", DURAN, "--refine", "crack:1e308"], "crack: distance is 1e+308 m"),
    "refine too finely": (["build", DURAN, "--refine", f"crack:1e-3:{2e-3 / 2**20}"], "about 3e+13 nodes"),
    "smallest spacing": (["build", SCRIPT, "--trust", "--set", "spacing=5e-324"], "about inf nodes on 0.1 x 0.04 m"),
    "largest horizon": (["build", DURAN, "--set", "Horizon ratio=12.5"], "a number from 2 to 12"),
    "horizon of a script": (["build", SCRIPT, "--trust", "--set", "horizon=1e18"], "horizon is 1e+18"),
    "crack of words": (["build", DURAN, "--crack", "a,b,c,d"], "'a,b,c,d'"),
    "crack along the edge": (["build", DURAN, "--crack", "0,0.02,0.05,0.02"], "along the plate's edge from"),
    "refine farther than the plate": (["build", DURAN, "--refine", "crack:4000"], "crack: distance is 4000 m; use"),
    "refine what": (["build", DURAN, "--refine", "edge:1"], "'edge:1'"),
    "refine how far": (["build", DURAN, "--refine", "crack"], "'crack'"),
    "refine no hole": (["build", DURAN, "--refine", "hole:1e-3"], "refine hole: the scene has none"),
    "refine by a third": (["build", DURAN, "--refine", "crack:1e-3:3e-4"], "over a power of 2"),
    "output in no folder": (["build", DURAN, "-o", "nowhere/plate.json"], "no folder"),
    "picture of no kind": (["preview", SCRIPT, "--trust", "-o", "plate.doc"], "suffix '.doc'"),
    "parameters of a mesh": (["params", "part.vtu"], "part.vtu: cannot be read: there is no such file"),
    "plan of a mesh": (["plan", "part.vtu"], "part.vtu: cannot be read: there is no such file"),
    "plan of nothing": (["plan", "missing.geo"], "missing.geo: cannot be read"),
}  # fmt: skip


@pytest.mark.process
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("name", REFUSED)
def test_refusals_are_one_line_and_leave_nothing(name: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    words, message = REFUSED[name]
    assert main(words) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.startswith("pdmesh: ")
    assert message in err
    assert err.count("\n") == 1
    assert list(here.iterdir()) == []


@pytest.mark.parametrize("words", [[], ["bild"], ["build"], ["build", DURAN, "--set", "novalue"]])
def test_wrong_usage(words: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as done:
        main(words)
    assert done.value.code == 2
    err = capsys.readouterr().err
    assert err.startswith("pdmesh")
    assert err.count("\n") == 1


@pytest.mark.process
def test_every_setting_of_the_solver_can_be_set_in_a_drawing_and_in_a_grid_without_one(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The model keeps them, also when it is built anew; those that its run does not use are refused as by pdsolve."""
    words = ["--set", "run.hybrid.kappa=0.4", "--set", "run.fields=ux,damage", "--adapt", "hybrid", "-q"]
    assert main(["build", DURAN, "-o", "a.json", *words]) == 0
    assert main(["build", "a.json", "-o", "b.json", "--set", "run.every=7", "-q"]) == 0
    runs = [read_file(here / name).run for name in ("a.json", "b.json")]
    assert [(run.hybrid.kappa, run.fields) for run in runs] == [(0.4, ("ux", "damage"))] * 2
    assert (runs[0].every != 7, runs[1].every) == (True, 7)
    document = msgspec.structs.replace(read_file(here / "a.json"), drawing="", source="", parameters={})
    write_file(document, here / "bare.json")
    assert main(["build", "bare.json", "-o", "c.json", "--set", "material.G0=50", "-q"]) == 0
    assert read_file(here / "c.json").material.G0 == 50
    for setting, parts in (
        ("run.hybrid.wake=1", ("run.hybrid.wake", "removed")),
        ("run.statc.load_steps=1", ("run.statc", "run.static")),
        ("run.static.load_steps=3", ("run.static.load_steps", "run.solver")),
    ):
        assert main(["build", DURAN, "-o", "d.json", "--set", setting]) == 2
        assert mentions(capsys.readouterr().err, *parts)
        assert not (here / "d.json").exists()


@pytest.mark.process
def test_settings_laid_over_a_model_are_checked_as_by_pdsolve(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In one line; of steps and duration the last counts, also when a model is built anew."""
    assert main(["build", DURAN, "-o", "a.json", "-q", "--set", "run.steps=100", "--set", "run.fields=+sxx"]) == 0
    assert main(["build", "a.json", "-o", "b.json", "-q", "--set", "run.duration=1us"]) == 0
    runs = [read_file(here / name).run for name in ("a.json", "b.json")]
    assert [run.steps for run in runs] == [100, runs[1].steps]
    assert runs[1].duration == 1e-6 or runs[1].steps < 100
    assert "sxx" in runs[1].fields
    capsys.readouterr()
    for words, parts in (
        (["info", "a.json", "--set", "material.E=abc"], ("material.E", "abc")),
        (["preview", "a.json", "--set", "material.Q=3"], ("material.Q",)),
        (["info", "a.json", "--set", "run.until=quiet"], ("run.quiet",)),
        (["build", DURAN, "-o", "c.json", "--set", "medium.D=1"], ("conditions", "diffusion")),
    ):
        assert main(words) == 2
        said = capsys.readouterr().err
        assert mentions(said, *parts)
        assert said.count("\n") == 1
        assert not (here / "c.json").exists()
