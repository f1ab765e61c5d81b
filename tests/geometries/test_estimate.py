"""What is said of a run before it is made, against the run: every shipped scene in the modes it has."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from plates import GEOMETRIES, GLASS
from shapely import box

from benchmarks.models import PLATES
from pdmesh import Scene
from pdmesh.grid.bodies_beside import build_scene
from pdmesh.grid.lattice import build_grid
from pdmesh.model.amounts import pair_count
from pdmesh.model.document import Run
from pdmesh.model.node_grid import document_of
from pdmesh.reports.report import info, plan
from pdsolve.diffusion import system as diffusion
from pdsolve.estimate import estimate_run as planned
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare

pytest.importorskip("gmsh", exc_type=(ImportError, OSError))
SCENES = [path.name for path in PLATES]
MODES = ("thesis", "conservative")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::pdsolve.model.ModelWarning")
@pytest.mark.parametrize("name", SCENES)
def test_bonds_and_steps_are_those_of_the_run(name: str) -> None:
    """One estimate, which `info`, `plan` and `--dry-run` show: to the bond."""
    from pdmesh.drawing.file_reading import read_scene

    grid, settings, _ = build_scene(read_scene(GEOMETRIES / name, [], [], True))
    if settings.physics == "diffusion":
        found, (flow, _) = planned(Model(grid, settings, name)), diffusion.prepare(Model(grid, settings, name))
        assert (found.bonds, found.time_step) == (int(flow.operator.count.sum()), flow.time_step)
        return
    one, moves = settings.material, settings.physics == "mechanics"
    springs = moves and one is not None and one.model == "bond" and one.law != "cohesive"
    run = settings.run
    bonded = run.fatigue is None and settings.contact is None
    everywhere = springs and bonded and run.adapt == "none" and run.cracks == "bonds"
    for mode in MODES if everywhere else MODES[1:]:
        found = planned(Model(grid, settings, name), Options(mode))
        system = prepare(Model(grid, settings, name), Options(mode)).system
        assert (found.bonds, found.time_step, found.stable_time_step) == (
            system.directed_bond_count,
            system.time_step,
            system.stable_time_step,
        )


@pytest.mark.slow
def test_plan_info_and_dry_run_say_the_same() -> None:
    from pdmesh.drawing.file_reading import read_scene

    scene = read_scene(GEOMETRIES / "duran50.geo", [], [], True)
    grid, settings, _ = build_grid(scene)
    for mode in MODES:
        found = planned(Model(grid, settings), Options(mode))
        for said in (info(document_of(grid, settings), "duran50", mode), plan(scene, mode)["scene"]):
            assert (said["bonds"], said["smallest_stable_step"]) == (pair_count(found.bonds), found.stable_time_step)
            assert (said["memory_bytes"], said["steps"]) == (found.memory, found.steps)


MEASURE = """
import sys
from pathlib import Path
from pdsolve.__main__ import main
assert main(sys.argv[1:]) == 0
print(next(line.split()[1] for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM")))
"""


@pytest.mark.skipif(sys.platform != "linux", reason="measured on Linux")
@pytest.mark.slow  # where nothing is compiled any more: that takes memory too
@pytest.mark.parametrize("mode", MODES)
def test_the_memory_of_the_process_is_known(mode: str, tmp_path: Path) -> None:
    """Measured: 133_036 nodes take 0.90 to 0.97 of what is said beyond a handful of nodes.

    What the libraries themselves take depends on how much of their files a system maps: between two of them 46 MB
    lay, a fifth of a small run. Some parts of them a handful of nodes does not use: with 43_621 nodes they make 1.04 to
    1.23 of what is said.
    """
    peaks, said = peaks_and_said(tmp_path, mode, lambda width: plate(width, 0.75), (20, 420))
    assert peaks[0] == pytest.approx(said[0], rel=0.35)
    assert peaks[1] - peaks[0] == pytest.approx(said[1] - said[0], rel=0.2)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="measured on Linux")
def test_the_memory_at_rest_is_known(tmp_path: Path) -> None:
    """The factors of a plate twice as long as wide: measured 0.99 of what is said beyond a handful of nodes, and 0.82
    for four times as many nodes; the shipped beam, specimen and strip take 1.03, 1.09 and 0.88 of it all in all."""

    def held(width: int) -> Scene:
        scene = plate(width, 0.5).fix("left").load("right", traction=(1e3, 0))
        return dataclasses.replace(scene, run=Run(solver="static"))

    peaks, said = peaks_and_said(tmp_path, "conservative", held, (20, 120))
    assert peaks[1] - peaks[0] == pytest.approx(said[1] - said[0], rel=0.2)


def plate(width: int, ratio: float) -> Scene:
    """So many mm wide, nodes 1 mm apart."""
    return Scene(box(0, 0, width * 1e-3, ratio * width * 1e-3), 1e-3, GLASS, 3, Run(steps=4, every=2))


def peaks_and_said(
    folder: Path, mode: str, scene: Callable[[int], Scene], widths: tuple[int, int]
) -> tuple[list[int], list[int]]:
    """Bytes at the peak of the processes that solve scenes of these widths, and what is said of them."""
    peaks: list[int] = []
    said: list[int] = []
    for width in widths:
        grid, settings, _ = build_grid(scene(width))
        (folder / "model.json").write_text(Model(grid, settings).to_json())
        words = [str(folder / "model.json"), "-o", str(folder / "r.sqlite"), "--mode", mode, "-q", "--force"]
        found = []
        for _ in range(3):  # compiling, which other tests may cause, takes memory, and so do frames that wait
            command = [sys.executable, "-c", MEASURE, *words]
            ran = subprocess.run(command, capture_output=True, text=True, check=True)
            found.append(1024 * int(ran.stdout))
        peaks.append(min(found))
        said.append(planned(Model(grid, settings), Options(mode)).memory)
    return peaks, said
