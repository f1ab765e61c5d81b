"""What the README and the guide show works as it stands."""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Callable
from pathlib import Path

import pytest
from pages import TEXTS, text_of
from plates import ROOT

from pdsolve.__main__ import main, parser
from pdsolve.results import Results


@pytest.mark.slow
def test_a_bare_thesis_file_with_the_settings_of_the_readme_is_the_shipped_scene(
    duran_json: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """notch and nodes alone, the rest in the TOML shown: the same bits as the file with everything inside."""
    monkeypatch.chdir(tmp_path)
    full = json.loads(duran_json.read_text())
    Path("bare.json").write_text(json.dumps({"notch": full["notch"], "nodes": full["nodes"]}))
    (settings,) = re.findall(r"```toml\n(.*?)```", text_of("reference/grid_file"), re.DOTALL)
    Path("settings.toml").write_text(settings)
    common = ["--mode", "thesis", "--set", "run.steps=450", "--every", "450", "-q"]
    assert main(["bare.json", "--settings", "settings.toml", *common]) == 0
    assert main([str(duran_json), *common]) == 0
    with Results.open(Path("bare.sqlite")) as bare, Results.open(Path("duran50.sqlite")) as whole:
        assert whole.breaks().step.size > 0
        assert bare.field("uy", 450).tobytes() == whole.field("uy", 450).tobytes()
        assert bare.breaks().node.tolist() == whole.breaks().node.tolist()


def options(parser: argparse.ArgumentParser) -> set[str]:
    """All options of a program and of its commands."""
    commands = [command() for command in getattr(parser, "others", {}).values()]
    return set(parser._option_string_actions).union(*(options(command) for command in commands))


def test_every_scene_and_option_it_names_exists() -> None:
    told = "\n".join(TEXTS.values())
    for scene in re.findall(r"(?<!/)geometries/(?!test_)\w+\.(?:geo|py)", told):
        assert (ROOT / scene).is_file()
    words = set(re.findall(r"pdsolve [^\n`]*?(--[a-z-]+)", told))
    assert len(words) > 10
    assert words <= options(parser())


@pytest.mark.slow
def test_the_python_it_shows_runs(
    solved: Callable[[str], Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Every block as it stands, in a folder with the database of the Duran plate."""
    monkeypatch.chdir(tmp_path)
    Path("duran50.sqlite").symlink_to(solved("conservative"))
    blocks = re.findall(r"```python\n(.*?)```", "\n".join(TEXTS.values()), re.DOTALL)
    for program in ("pdmesh", "pdsolve", "pdpost"):
        assert any(f"from {program} import" in block for block in blocks)
    for block in blocks:
        exec(compile(block, "guide", "exec"), {})
    assert Path("damage.png").stat().st_size > 10_000
    printed = capsys.readouterr().out.splitlines()
    (broken,) = (text for text in printed if text.endswith(" bonds broken"))
    (speed,) = (text for text in printed if text.endswith(" m/s"))
    assert int(broken.removesuffix(" bonds broken")) > 100  # measured 1414
    speed, unit = speed.split()
    assert float(speed) == pytest.approx(1467, rel=0.1)  # measured 1467 m/s, to a horizon from the edge
    assert unit == "m/s"
