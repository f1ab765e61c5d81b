"""What a publisher completes, and what the release checklist, the wheels and the versions of the site say."""

from __future__ import annotations

import importlib.util
import json
import re
import subprocess
import tomllib
from pathlib import Path
from types import ModuleType

import pytest
from plates import ROOT

from pdmesh.drawing.sandbox.child import SYSTEM_LIBRARIES

RELEASE = (ROOT / "docs" / "developers" / "release.md").read_text(encoding="utf-8")
MARK = re.compile(r"\b(?:CONTACT|HOST|DOI)-OF-PUBLISHER\b")


def script(name: str) -> ModuleType:
    """A script of the folder .ci as a module."""
    spec = importlib.util.spec_from_file_location(name, ROOT / ".ci" / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_release_page_lists_every_place_that_is_left_to_the_publisher() -> None:
    rows = [line for line in RELEASE.splitlines() if line.startswith("| `") and MARK.search(line)]
    listed = {
        (name, mark)
        for row in rows
        for name in re.findall(r"`([\w./]+)`", row)
        for mark in MARK.findall(row)
        if (ROOT / name).is_file()
    }
    named = {name for name, _ in listed}
    places = [ROOT / name for name in named]
    places += [path for path in ROOT.iterdir() if path.suffix in (".md", ".toml", ".cff") or path.name == "Dockerfile"]
    places += [*(ROOT / ".github").rglob("*.*"), *(ROOT / "conda").iterdir()]
    found = {
        (str(path.relative_to(ROOT)), mark)
        for path in places
        for mark in MARK.findall(path.read_text(encoding="utf-8"))
    }
    assert found == listed


def test_the_addresses_are_ready_to_be_uncommented() -> None:
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    lines = [
        line.removeprefix("# ")
        for line in text.splitlines()
        if line.startswith(("# [project.urls]", "# Source", "# Doc", "# Iss", "# Chan"))
    ]
    urls = tomllib.loads("\n".join(lines))["project"]["urls"]
    assert list(urls) == ["Source", "Documentation", "Issues", "Changelog"]


def test_the_commands_of_the_release_page_exist() -> None:
    targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE))
    asked = set(re.findall(r"make ([\w-]+)", RELEASE))
    assert len(asked) > 8
    assert asked <= targets


def test_the_container_has_the_libraries_of_gmsh() -> None:
    text = (ROOT / "Dockerfile").read_text(encoding="utf-8")
    assert set(SYSTEM_LIBRARIES.split()) <= set(text.split())
    assert "RUN make demo" in text


def test_the_wheels_that_are_looked_for_are_those_of_the_project(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    wheels = script("wheels")

    def has_wheels(requirements: str, platform: str, python: str) -> bool:
        return not ("gmsh" in requirements and "windows" in platform and python == "3.14")

    monkeypatch.setattr(wheels, "has_wheels", has_wheels)
    assert wheels.main(["numpy", "mpich"]) == 0
    assert capsys.readouterr().out.splitlines()[4:] == [
        "| numpy>=1.26 |  | all | all | all | all | all |",
        "| mpich>=4 | mpi | all | all | all | all | all |",
    ]
    assert wheels.main([]) == 1
    rows = capsys.readouterr().out.splitlines()[4:]
    assert "| gmsh>=4.12 |  | all | all | 3.11, 3.12, 3.13 | all | all |" in rows
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert len(rows) == len(project["dependencies"]) + sum(map(len, project["optional-dependencies"].values()))


def test_an_index_that_cannot_be_asked_is_no_missing_wheel(monkeypatch: pytest.MonkeyPatch) -> None:
    wheels = script("wheels")
    for said, status in (("", 0), ("error: No solution found when resolving", 1), ("error: Failed to fetch", 2)):
        monkeypatch.setattr(
            wheels.subprocess,
            "run",
            lambda *_, said=said, status=status, **__: subprocess.CompletedProcess([], status, "", said),
        )
        if status == 2:
            with pytest.raises(OSError, match="Failed to fetch"):
                wheels.has_wheels("numpy", "x86_64-pc-windows-msvc", "3.14")
        else:
            assert wheels.has_wheels("numpy", "x86_64-pc-windows-msvc", "3.14") == (status == 0)


def test_the_newest_version_of_the_site_comes_first(tmp_path: Path) -> None:
    for name in ("1.9.0", "1.10.0", "_static"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "index.html").touch()
    script("versions").main(tmp_path)
    assert json.loads((tmp_path / "versions.json").read_text()) == ["1.10.0", "1.9.0"]
    assert "url=1.10.0/index.html" in (tmp_path / "index.html").read_text()
