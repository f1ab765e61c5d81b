"""Every block of every page works as it stands, in the order of its page, in a folder of its own.

`bash` is run here, `python` in tests/cli/test_readme.py, of a law in tests/contracts/test_page.py.
`toml` becomes the file that its first line names. `c++` is part of a drawing, which is read. `text` is no command.
What runs long has a coarse form, and what cannot be run here a reason.
"""

from __future__ import annotations

import importlib.util
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest
from devices import missing
from pages import DOCS, EVERY, Block, blocks, lines, named
from plates import ROOT

from pdmesh.__main__ import main as pdmesh
from pdpost.__main__ import main as pdpost
from pdsolve.__main__ import main as pdsolve

PROGRAMS: dict[str, Callable[[list[str]], int]] = {"pdmesh": pdmesh, "pdsolve": pdsolve, "pdpost": pdpost}
LANGUAGES = {"bash", "python", "toml", "diff", "c++", "text"}
DIRECTIVES = {"{argparse}", "{eval-rst}", "{literalinclude}", "{toctree}"}
COARSE = {  # what stands on a page, and what is run in its place
    "geometries/ball_through_glass.py": "geometries/ball_through_glass.py --set side=0.04 --set duration=1e-5",
    "geometries/branching_plate.py": "geometries/branching_plate.py --set spacing=2e-3",
    "geometries/brazilian_disc.py": "geometries/brazilian_disc.py --set load_steps=10",
    "geometries/brazilian_platens.py": "geometries/brazilian_platens.py --set spacing=5e-3",
    "geometries/nooru_mohamed.py": "geometries/nooru_mohamed.py --set spacing=0.01",
    "geometries/offset_notch.py": "geometries/offset_notch.py --set layers=9 --set load_steps=10",
    "geometries/l_panel.py": "geometries/l_panel.py --set spacing=0.025",
    "geometries/compact_tension.py": "geometries/compact_tension.py --set spacing=4e-3 --set fine=2e-3",
    "geometries/disc.geo": "geometries/disc.geo --set Zones/liquid/Spacing=0.2 --set 'Run/Duration=1000'",
    "geometries/double_edge_notch.py": "geometries/double_edge_notch.py --set load_steps=2",
    "geometries/forked_crack.py": "geometries/forked_crack.py --set spacing=1e-3",
    "--set Zones/fine/Spacing=5e-4 --set Zones/coarse/Spacing=1e-3": "--set Zones/fine/Spacing=2e-3",
    "geometries/kalthoff_winkler_steel.py": "geometries/kalthoff_winkler_steel.py --set spacing=2e-3",
    "--set spacing=2.5e-4": "--set spacing=1e-3",
    "--adapt hybrid --set spacing=5e-4": "--adapt hybrid",
    "build holes.py": "build holes.py --set steps=2",
    "build quench.py": "build quench.py --set rows=5 --set steps=4",
    "build hole.py": "build hole.py --set spacing=1e-3",
    "--set spacing=5e-4 --adapt hybrid": "--set spacing=1e-3 --adapt hybrid",
    "geometries/inclined_crack.py": "geometries/inclined_crack.py --set fine=1e-3 --set coarse=4e-3 --set most=4",
    "geometries/penny.geo": "geometries/penny.geo --set Zones/glass/Spacing=1.5e-3",
    '"Zones/fine/Spacing" = [1e-3, 5e-4]': '"Zones/fine/Spacing" = [1e-3]',
    "times = 5": "times = 2",
    'gap = "mouth" ': 'evaluations = 2\ngap = "mouth" ',
    "--threads 8": "--threads 1",
    "pdmesh build specimen.geo": "pdmesh build specimen.geo --set Zones/plate/Spacing=2 --set Zones/way/Spacing=1"
    " --set Zones/pins/Spacing=1 --set 'Fixes/upper pin/Box=-0.6 13.2 -0.4 13.3'"
    " --set 'Fixes/lower pin/Box=-0.6 -13.8 -0.4 -13.7'"
    " --set 'Fixes/upper pin/Displacement y=0.15' --set 'Fixes/lower pin/Displacement y=-0.15'",
    "geometries/cracking_disc.py": "geometries/cracking_disc.py --set duration=5",
    "geometries/quenched_slab.py": "geometries/quenched_slab.py --set spacing=5e-4",
    "geometries/drying_mud.py": "geometries/drying_mud.py --set spacing=4e-3",
    "--set Zones/near/Spacing=1.25e-4 --set Zones/far/Spacing=2.5e-4": "--set 'Run/Duration=500'",
    "geometries/screw.geo": "geometries/screw.geo --set Zones/near/Spacing=5e-4 --set Zones/far/Spacing=1e-3"
    " --set Run/Duration=500",
}
CI = ".ci/run types it"
NOT_RUN = {  # commands that no test can run, and why
    "make demo": CI,
    "make test": CI,
    "python -m pytest tests/contracts/test_laws.py tests/contracts/test_spent.py tests/contracts/test_kernels.py"
    " -k saturating": "done on a copy",
    "pip install .": ".ci/package types it",
    "pip install pdsuite-*.whl": "a wheel",
    "pip install 'pdsuite[completion]'": ".ci/package types it",
    "pip install 'pdsuite[study]'": "a package index",
    "pip install 'pdsuite[opencl]'": "a package index",
    "pip install 'pdsuite[mpi]'": "a package index",
    "mpiexec -n 8 pdsolve plate.json": "a cluster; see tests/cli/test_ranks.py",
    "pdpost view duran50.sqlite --open": "it serves until Ctrl-C; see tests/unit/pdpost/browser",
    "pdsolve study study.toml --scheduler tls://host:8786": "the address of a cluster",
}
NEEDS = {
    "pdpost render": "pyvista",
    "pdmesh --completion": "shtab",
}  # commands that take an extra
PART = """import gmsh
gmsh.initialize()
gmsh.option.setNumber("General.Terminal", 0)
plate = gmsh.model.occ.addRectangle(0, 0, 0, 100, 50)
gmsh.model.occ.synchronize()
gmsh.write("part.step")
gmsh.write("part.brep")
gmsh.model.addPhysicalGroup(2, [plate], name="material:steel")
gmsh.option.setNumber("Mesh.MeshSizeMax", 5)
gmsh.option.setNumber("Mesh.RecombineAll", 1)
gmsh.model.mesh.generate(2)
gmsh.write("mesh.msh")
"""
CARRIER = """SetFactory("OpenCASCADE");
DefineConstant[
  spacing = {1, Name "Peridynamics/Zones/plate/Spacing"}
];
Rectangle(1) = {0, 0, 0, 100, 50};
Rectangle(2) = {40, 5, 0, 4, 5};
BooleanFragments{ Surface{1}; Delete; }{ Surface{2}; Delete; }
Physical Surface("zone:plate") = {Surface{:}};
"""
PIN = 'DefineConstant[ pin = {2e9, Name "Peridynamics/Materials/pin/E"} ];\n'
GLASS = ["--set", "Material/E=65e9", "--set", "Material/rho=2235", "--set", "Material/G0=204"]
UNIT = 'DefineConstant[ u = {"mm", Name "Peridynamics/Units"} ];\n'


class Run(NamedTuple):
    """Blocks that belong together: those of a page, or of one scene of the gallery."""

    name: str
    blocks: list[Block]


def runs() -> list[Run]:
    """All that is run."""
    found = []
    for page in EVERY:
        told = blocks(page, "bash", "toml")
        if page.name == "gallery.md":
            found += [Run(f"gallery:{shlex.split(one.text)[2]}", [one]) for one in told]
        elif told:
            found.append(Run(named(page), told))
    return found


RUNS = runs()


@pytest.mark.parametrize("page", EVERY, ids=named)
def test_a_block_says_what_it_is(page: Path) -> None:
    """A block without a language, or a command that is called text, would be run by nobody."""
    text = page.read_text(encoding="utf-8")
    opened = re.findall(r"^ *```(.*)$", text, re.MULTILINE)[::2]
    assert {words.split()[0] if words else "" for words in opened} <= LANGUAGES | DIRECTIVES
    assert len(opened) == len(blocks(page))
    assert not blocks(page, "diff") or page.name == "add_material.md"
    for block in blocks(page, "text"):
        for line in lines(block.text):
            assert shutil.which(line.split()[0]) is None, line


def test_what_is_not_run_or_run_otherwise_is_on_a_page() -> None:
    """A coarse form of nothing would hide that a page has changed."""
    told = [line for run in RUNS for block in run.blocks for line in lines(block.text)]
    for text in (*COARSE, *NEEDS):
        assert any(text in line for line in told), text
    assert NOT_RUN.keys() <= {" ".join(bare(line)) for line in told}
    ci = {line.removeprefix("step ") for line in (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()}
    assert {line for line, reason in NOT_RUN.items() if reason == CI} <= ci


def bare(line: str) -> list[str]:
    """A command without the comment behind it, as it is typed."""
    return re.sub(r"\s+# .*", "", line).split()


@pytest.fixture(scope="module")
def given(tmp_path_factory: pytest.TempPathFactory, solved: Callable[[str], Path], duran_json: Path) -> Path:
    """What readers have of their own: drawings, a part from a CAD program, a mesh, a bare grid file, results."""
    pytest.importorskip("gmsh", exc_type=OSError)
    folder = tmp_path_factory.mktemp("given")
    for drawing in (
        path
        for part in ("getting_started/first_simulation", "tutorials", "how_to")
        for path in (DOCS / part).glob("*.*")
    ):
        if drawing.suffix in (".geo", ".py"):
            shutil.copy(drawing, folder)
    for name in ("plate", "duran50"):
        shutil.copy(ROOT / "geometries" / "duran50.geo", folder / f"{name}.geo")
    tutorials = Path(sysconfig.get_path("data")) / "share/doc/gmsh/tutorials"  # where Gmsh's wheel has them
    if tutorials.is_dir():
        shutil.copy(tutorials / "t1.geo", folder)
    (study,) = blocks(DOCS / "how_to" / "parameter_study.md", "toml")
    (folder / "study.toml").write_text(coarse(study.text))
    full = json.loads(duran_json.read_text())
    (folder / "bare.json").write_text(json.dumps({"notch": full["notch"], "nodes": full["nodes"]}))
    for name in ("plate", "other", "fine"):
        shutil.copy(solved("conservative"), folder / f"{name}.sqlite")
    subprocess.run([sys.executable, "-c", PART], cwd=folder, check=True, capture_output=True)
    return folder


@pytest.mark.slow
@pytest.mark.parametrize("run", RUNS, ids=lambda run: run.name)
def test_the_blocks_of_a_page(
    run: Run, given: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    kept = os.environ.get("XDG_CACHE_HOME", str(Path("~/.cache").expanduser()))
    monkeypatch.setenv("XDG_CACHE_HOME", kept)  # of compiled kernels
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("PATH", f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}")
    Path("geometries").symlink_to(ROOT / "geometries")
    told = "".join(block.text for block in run.blocks)
    for path in given.iterdir():
        if path.name in told:
            shutil.copy(path, tmp_path)
    for block in run.blocks:
        if block.language == "toml":
            (name,) = re.findall(r"^# (\w+\.toml)", block.text)
            Path(name).write_text(coarse(block.text), encoding="utf-8")
    for block in run.blocks:
        if block.language == "bash":
            for line in lines(block.text):
                if " ".join(bare(line)) not in NOT_RUN and not wanting(line):
                    status = typed(coarse(line))
                    assert status == 0, (line, capfd.readouterr().err)


def coarse(text: str) -> str:
    """A text of a page with the coarse form of what takes long."""
    for fine, instead in COARSE.items():
        text = text.replace(fine, instead)
    return text


def wanting(line: str) -> bool:
    """Whether a command takes what is not installed here, or a device that does not work."""
    if ("--device" in line and missing()) or ("build t1.geo" in line and not Path("t1.geo").exists()):
        return True
    return any(text in line and importlib.util.find_spec(package) is None for text, package in NEEDS.items())


def typed(line: str) -> int:
    """The exit status of a command: of one of the programs in this process, of any other in a shell."""
    words = shlex.split(line, comments=True)
    if words[0] not in PROGRAMS or re.search(r"[>;|]", line):
        return subprocess.run(["bash", "-e", "-c", line]).returncode
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        try:
            return PROGRAMS[words[0]](words[1:])
        except SystemExit as end:
            return int(end.code or 0)


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("page", [page for page in EVERY if blocks(page, "c++")], ids=named)
def test_a_part_of_a_drawing_is_read(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a plate of 100 x 50 mm with a square where the pin of the page is."""
    pytest.importorskip("gmsh", exc_type=OSError)
    monkeypatch.chdir(tmp_path)
    for block in blocks(page, "c++"):
        more = UNIT * ("Peridynamics/Units" not in block.text) + PIN * ("material:pin" in block.text)
        Path("part.geo").write_text(f"{more}{CARRIER}{block.text}")
        assert pdmesh(["build", "part.geo", *GLASS, "--force", "-q"]) == 0
