"""Runs on many ranks, as mpiexec starts them: the bits of one process, one line of what is wrong, no one left."""

from __future__ import annotations

import contextlib
import dataclasses
import os
import shlex
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import diffusion_models
import msgspec
import numpy as np
import pytest
from database_contents import contents
from messages import mentions
from plates import GLASS, STEEL, interface_grid, plate, square_grid, two_cubes

from pdmesh.model.document import Absorb, Contact, Displacement, Lattice, Load, Region, RigidBody, Run, Velocity
from pdmesh.model.interfaces import Interface
from pdmesh.model.material import Material
from pdmesh.model.node_grid import Bodies, Grid, whole_lattice
from pdsolve.model import Model, read_model
from pdsolve.results import Results, ResultsError
from pdsolve.run.simulation import resume, simulate

MPIEXEC = shutil.which("mpiexec", path=str(Path(sys.executable).parent)) or shutil.which("mpiexec")
pytestmark = pytest.mark.skipif(find_spec("mpi4py") is None or MPIEXEC is None, reason="needs mpi4py and mpiexec")
TESTS = Path(__file__).parent.parent
PULL = 6e10


@contextlib.contextmanager
def ranks(count: int, *words: str) -> Iterator[subprocess.Popen[str]]:
    """pdsolve with these words on so many ranks, which end with the context."""
    with started("-n", str(count), sys.executable, "-m", "pdsolve", *words) as child:
        yield child


@contextlib.contextmanager
def started(*words: str) -> Iterator[subprocess.Popen[str]]:
    """mpiexec with these words, which ends with the context."""
    every, place = [str(MPIEXEC), "-launcher", "fork", "-hosts", "localhost", *words], {"PYTHONPATH": str(TESTS)}
    pipes = {"stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
    with subprocess.Popen(every, text=True, env=os.environ | place, **pipes) as child:
        try:
            yield child
        finally:
            child.terminate()


def ran(count: int, *words: str) -> tuple[int, str]:
    """The exit code of pdsolve on so many ranks, and what it says on stderr."""
    with ranks(count, *words) as child:
        said = child.communicate(timeout=300)[1]
        return child.returncode, said


def torn(grid: Grid, **settings: object) -> Model:
    """A plate torn apart in 60 steps."""
    ends = (float(grid.position[:, 1].max()), PULL), (float(grid.position[:, 1].min()), -PULL)
    grows = ((0.0, 1.0), (2e-6, 1.5))
    loads = tuple(Load(box=(-1.0, y - 1e-3, 1.0, y + 1e-3), body_force=(0.0, pull), profile=grows) for y, pull in ends)
    run = Run(time_step=50e-9, steps=60, every=20, ledger=5, probes=((0.0, 0.0), (1e-2, 0.0)))
    return plate(grid, **{"conditions": loads, "run": run, **settings})


def struck(material: object = STEEL) -> Model:
    """A plate held at one end and struck at the other, whose bonds soften and break."""
    ends = (
        Displacement(box=(-1.0, -1.0, 1.0, 1e-4), x=0.0, y=0.0),
        Velocity(box=(-1.0, 38.9e-3, 4e-3, 1.0), y=-60.0, profile=((0.0, 1.0), (1e-6, 0.5))),
    )
    return plate(square_grid(13, 40), material=material, conditions=ends, run=Run(steps=80, every=20, ledger=10))


def pulled(**material: object) -> Model:
    """A bar in space with a crack across it, pulled at both ends."""
    crack = [[-1.0, -1.0, 0.02951, 4e-3, -1.0, 0.02951, 4e-3, 1.0, 0.02951]]
    grid = whole_lattice(Lattice((0.0, 0.0, 0.0), 1e-3, 10, 9, 60), cracks=np.array(crack))
    ends = (1.1e-3, -8e10), (57.9e-3, 8e10)
    loads = tuple(Load(box=(-1.0, -1.0, min(-z, z), 1.0, 1.0, z), body_force=(0.0, 0.0, pull)) for z, pull in ends[:1])
    loads += tuple(Load(box=(-1.0, -1.0, z, 1.0, 1.0, 1.0), body_force=(0.0, 0.0, pull)) for z, pull in ends[1:])
    glass = msgspec.structs.replace(GLASS, plane="space", **material)
    return plate(grid, material=glass, conditions=loads, run=Run(time_step=50e-9, steps=100, every=50, ledger=25))


def shaped(**material: object) -> Model:
    """A bar in space that is round and conical, listed node by node, with a crack across it, pulled at both ends."""
    bar = pulled(**material)
    x, y, z = (bar.grid.position - [4.5e-3, 4e-3, 0.0]).T
    rows = np.flatnonzero(x**2 + y**2 < (5.3e-3 - 0.02 * z) ** 2)
    names = "ids", "position", "delta", "border", "hole_id"
    grid = Grid(**{name: getattr(bar.grid, name)[rows] for name in names}, cracks=bar.grid.cracks)
    return Model(grid, bar.settings)


def absorbing() -> Model:
    """A plate on a lattice torn apart, with a layer at one end that absorbs, which reaches into one rank alone."""
    model = torn(whole_lattice(Lattice((0.0, 0.0), 1e-3, 20, 120), cracks=np.empty((0, 4))))
    layer = Absorb(box=(17.5e-3, 0.112, 1.0, 1.0))
    settings = msgspec.structs.replace(model.settings, conditions=(*model.settings.conditions, layer))
    return Model(model.grid, settings)


def partly_jittered() -> Grid:
    """A grid whose first rows lie on a lattice, and whose last ones do not: only some windows could be in blocks."""
    grid = square_grid(20, 120)
    off = np.random.default_rng(1).uniform(-2e-4, 2e-4, grid.position.shape)
    off[: 20 * 80] = 0
    return dataclasses.replace(grid, position=grid.position + off)


def pulled_cubes() -> Model:
    """A body of two spacings, pulled at both ends in 80 steps."""
    ends = (
        Load(box=(-1.0, -1.0, -1.0, 1.0, 1.0, 1e-3), body_force=(0.0, 0.0, -4e11)),
        Load(box=(-1.0, -1.0, 49e-3, 1.0, 1.0, 1.0), body_force=(0.0, 0.0, 4e11)),
    )
    glass = msgspec.structs.replace(GLASS, plane="space")
    return plate(two_cubes(), material=glass, conditions=ends, run=Run(time_step=50e-9, steps=80, every=40, ledger=20))


ORDINARY = msgspec.structs.replace(GLASS, model="ordinary", nu=0.2)
COHESIVE = msgspec.structs.replace(GLASS, law="cohesive", f_t=50e6)
NOTCHED = dataclasses.replace(square_grid(21, 12, y0=-5.5e-3), cracks=np.array([[-1.0, 0.0, 8e-3, 0.0]]))


def joined(material: Material = GLASS, **interface: float) -> Model:
    """A plate torn apart with an interface to a region on the right, and one along a drawn line that is oblique."""
    right = Region(name="right", box=(12.2e-3, -1.0, 1.0, 1.0), material=material)
    weak = {"G0": GLASS.G0 / 2, "stiffness": 0.9, **interface}
    interfaces = (
        Interface(between=("right", "rest"), **weak),
        Interface(faces=((0.0, -3.1e-3, 20e-3, 2.3e-3),), **weak),
    )
    return torn(NOTCHED, material=material, regions=(right,), interfaces=interfaces)


def changed_run(model: Model, **more: Any) -> Model:
    settings = msgspec.structs.replace(model.settings, run=msgspec.structs.replace(model.settings.run, **more))
    return Model(model.grid, settings)


CASES = {
    "brittle, struck": (struck(GLASS), 3),
    "a row of blocks a rank": (torn(NOTCHED), 3),
    "two spacings": (torn(interface_grid(24, 12, 12), run=Run(steps=60, every=20)), 5),
    "bilinear, struck": (struck(), 2),
    "damped": (torn(square_grid(20, 120), run=Run(time_step=50e-9, steps=60, every=20, damping=1e4)), 3),
    "damped, struck": (changed_run(struck(GLASS), damping=1e3), 3),
    "damped by stiffness, struck": (changed_run(struck(GLASS), damping_time=4e-9), 3),
    "a body damped by stiffness": (changed_run(pulled(), damping_time=4e-9), 2),
    "books in each step": (changed_run(struck(GLASS), ledger=1), 2),
    "a body until it is split": (changed_run(pulled(), until="split", steps=60, every=20), 2),
    "ordinary": (torn(square_grid(20, 120), material=ORDINARY), 3),
    "ordinary, two spacings": (torn(interface_grid(24, 12, 40), material=ORDINARY), 3),
    "half on a lattice": (torn(partly_jittered()), 3),
    "a body": (pulled(), 3),
    "until it is split": (torn(NOTCHED, run=Run(time_step=50e-9, steps=600, every=20, until="split")), 3),
    "a layer that absorbs": (absorbing(), 3),
    "a softening body": (pulled(law="bilinear", kr=2.0), 3),
    "cohesive": (torn(NOTCHED, material=COHESIVE), 3),
    "interfaces": (joined(), 3),
    "cohesive interfaces": (joined(COHESIVE, f_t=20e6), 2),
    "a cohesive body": (pulled(law="cohesive", f_t=50e6), 3),
    "a body of any shape": (shaped(), 3),
    **{f"a body of two spacings on {count} ranks": (pulled_cubes(), count) for count in (2, 3, 5)},
    "an ordinary body of any shape": (shaped(model="ordinary", nu=0.2), 2),
}


WET = {
    "a disc that dissolves": (diffusion_models.disc(0.1, 400), 3),
    "a solid of two states": (
        diffusion_models.disc(0.1, 400, msgspec.structs.replace(diffusion_models.CORRODING, dissolution="kinetic")),
        3,
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", WET)
def test_contents_are_those_of_one_process(here: Path, case: str) -> None:
    model, count = WET[case]
    (here / "wet.json").write_text(model.to_json())
    with simulate(model, here / "one.sqlite") as one:
        assert one.masses()["dissolved"][-1] > 0.1
    assert ran(count, "wet.json", "-o", "many.sqlite", "-q") == (0, "")
    expect_same(here / "one.sqlite", here / "many.sqlite")


@pytest.mark.slow
@pytest.mark.parametrize(
    "case", [pytest.param(case, marks=() if "brittle" in case else pytest.mark.slow) for case in CASES]
)
def test_bits_are_those_of_one_process(here: Path, case: str) -> None:
    model, count = CASES[case]
    (here / "plate.json").write_text(model.to_json())
    with simulate(model, here / "one.sqlite") as one:
        assert len(one.breaks().step) > 50
    assert ran(count, "plate.json", "-o", "many.sqlite")[0] == 0
    expect_same(here / "one.sqlite", here / "many.sqlite")


@pytest.mark.slow
def test_windows_of_which_some_have_one_spacing_are_solved(here: Path) -> None:
    """A fine block on a long coarse one: all bonds of one rank could be in tiles, those of the other could not."""
    nothing = np.empty((0, 9))
    parts = (
        whole_lattice(Lattice((0.0, 0.0, 0.0), 1e-3, 16, 16, 12), cracks=nothing),
        whole_lattice(Lattice((0.5e-3, 0.5e-3, 12.5e-3), 2e-3, 8, 8, 100), cracks=nothing),
    )
    nodes = sum(map(len, parts))
    grid = Grid(
        ids=np.arange(1, nodes + 1),
        position=np.vstack([one.position for one in parts]),
        delta=np.concatenate([one.delta for one in parts]),
        border=np.zeros(nodes, dtype=bool),
        hole_id=np.full(nodes, -1),
        cracks=nothing,
    )
    push = Load(box=(-1.0, -1.0, -1.0, 1.0, 1.0, 1e-3), body_force=(0.0, 0.0, -4e11))
    glass = msgspec.structs.replace(GLASS, plane="space")
    model = plate(grid, material=glass, conditions=(push,), run=Run(time_step=50e-9, steps=10, every=10, ledger=10))
    (here / "plate.json").write_text(model.to_json())
    simulate(model, here / "one.sqlite").close()
    assert ran(2, "plate.json", "-o", "many.sqlite")[0] == 0
    expect_same(here / "one.sqlite", here / "many.sqlite")


def long(folder: Path) -> Path:
    """A plate in a file, with so many steps that it can be stopped on the way."""
    model = CASES["bilinear, struck"][0]
    run = msgspec.structs.replace(model.settings.run, steps=4000, every=50, ledger=10, time_step=2e-8)
    slow = dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, run=run))
    (folder / "long.json").write_text(slow.to_json())
    return folder / "long.json"


def going(child: subprocess.Popen[str], path: Path) -> None:
    """Wait until a run has written frames to this file."""
    for _ in range(2000):
        time.sleep(0.02)
        with contextlib.suppress(ResultsError), Results.open(path) as results:
            if results.frames()[0].max(initial=0) >= 100:
                return
    pytest.fail(f"no frames, {child.poll()}")


@pytest.mark.endurance
@pytest.mark.parametrize(("number", "before", "after"), [("SIGTERM", 3, 2), ("SIGINT", 2, 3), ("SIGTERM", 2, 1)])
def test_a_stopped_run_goes_on_with_other_ranks_to_the_same_bits(
    here: Path, number: str, before: int, after: int
) -> None:
    path, output = long(here), here / "many.sqlite"
    with ranks(before, str(path), "-o", str(output)) as child:
        going(child, output)
        child.send_signal(getattr(signal, number))
        lines = own_lines(child.communicate(timeout=20)[1])
        assert child.returncode == 128 + getattr(signal, number)
    assert len(lines) == 1, lines
    assert f"pdsolve --resume {output}" in lines[0]
    with Results.open(output) as results:
        assert results.meta()["status"] == "interrupted"
    assert ran(after, "--resume", str(output), "-q") == (0, "")
    simulate(read_model(path), here / "one.sqlite").close()
    expect_same(here / "one.sqlite", output)


@pytest.mark.endurance
@pytest.mark.parametrize("rank", [0, 1])
def test_a_killed_rank_ends_all_and_the_run_goes_on_in_one_process(here: Path, rank: int) -> None:
    """All end within 2 s of the kill: measured 0.03 to 0.07 s."""
    path, output = long(here), here / "many.sqlite"
    with ranks(2, str(path), "-o", str(output), "-q") as child:
        going(child, output)
        every = numbers_of(child.pid)
        os.kill(every[rank], signal.SIGKILL)
        lines = own_lines(child.communicate(timeout=2)[1])
        assert child.returncode == signal.SIGKILL
    assert not any(Path(f"/proc/{number}").exists() for number in every.values())
    assert len(lines) == 1, lines
    assert mentions(lines[0], found="a rank was killed", expected="--resume")
    resume(output).close()
    simulate(read_model(path), here / "one.sqlite").close()
    expect_same(here / "one.sqlite", output)


def numbers_of(launcher: int) -> dict[int, int]:
    """The processes below a launcher by rank."""
    below = {launcher}
    for _ in range(3):
        for status in Path("/proc").glob("[0-9]*/stat"):
            with contextlib.suppress(OSError):
                words = status.read_text().rpartition(")")[2].split()
                below |= {int(status.parent.name)} if int(words[1]) in below else set()
    found = {}
    for process in below:
        words = Path(f"/proc/{process}/environ").read_bytes().split(b"\0")
        own = [word for word in words if word.startswith(b"PMI_RANK=")]
        if own and b"pdsolve" in Path(f"/proc/{process}/cmdline").read_bytes():
            found[int(own[0].partition(b"=")[2])] = process
    return found


def expect_same(known: Path, found: Path) -> None:
    """Both files hold the same, but for what says how the runs went."""
    one, other = contents(known), contents(found)
    for table, rows in one.items():
        if table not in ("meta", "checkpoint", "checksum"):
            assert other[table] == rows, table


@pytest.mark.endurance
def test_a_file_a_rank_is_read_as_one_and_goes_on_after_a_kill_with_other_ranks(here: Path) -> None:
    model = torn(square_grid(160, 160), run=Run(time_step=50e-9, steps=600, every=20, ledger=10, probes=((0.0, 0.0),)))
    (here / "plate.json").write_text(model.to_json())
    output = here / "many.sqlite"
    with ranks(2, "plate.json", "-o", str(output), "-q", "--one-file-up-to", "20000") as child:
        going(child, output)
        os.kill(numbers_of(child.pid)[1], signal.SIGKILL)
        assert child.wait(20) == signal.SIGKILL
    assert ran(3, "--resume", str(output), "-q") == (0, "")
    found = sorted(path.name for path in here.glob("many.sqlite*"))
    assert found == ["many.sqlite", *(f"many.sqlite.{name}" for name in ("0-0", "0-1", "1-0", "1-1", "1-2"))]
    with simulate(model, here / "one.sqlite") as one, Results.open(output) as many:
        many.verify()
        expect_same_read(one, many)
    (here / "many.sqlite.1-1").unlink()
    with pytest.raises(ResultsError) as missing:
        Results.open(output)
    assert mentions(missing, "many.sqlite", found="many.sqlite.1-1", expected="files of all its ranks")


def expect_same_read(one: Results, many: Results) -> None:
    """All that can be read of two runs is the same, but for how they went."""
    steps = one.frames()[0].tolist()
    assert many.frames()[0].tolist() == steps
    for step in steps:
        assert many.stored(step) == one.stored(step)
        for name in one.stored(step):
            assert many.field(name, step).tobytes() == one.field(name, step).tobytes(), (name, step)
    columns = [(*found.nodes(), *found.families(), *found.breaks()) for found in (one, many)]
    for known, found in zip(*columns, strict=True):
        assert found.tolist() == known.tolist()
    for name in ("history", "probes", "reactions"):
        assert getattr(many, name)().tolist() == getattr(one, name)().tolist()
    (step, known), (last, kept) = one.checkpoint(), many.checkpoint()
    assert (last, sorted(kept)) == (step, sorted(known))
    for name, values in known.items():
        assert kept[name].tobytes() == values.tobytes(), name


REFUSED = {
    "at rest": {"run": Run(solver="static", steps=1)},
    "hybrid": {"run": Run(steps=10, adapt="hybrid")},
    "particles": {"run": Run(steps=10, cracks="particles")},
    "damage of families": {"material": msgspec.structs.replace(ORDINARY, failure="energy"), "run": Run(steps=10)},
    "contact": {"contact": Contact(), "run": Run(steps=10)},
    "a rigid body": {
        "grid": dataclasses.replace(square_grid(21, 12), bodies=Bodies(np.arange(252) // 126, ("lower", "upper"))),
        "contact": Contact(),
        "conditions": (RigidBody(nodes=tuple(range(1, 127)), held=("x", "y", "spin")),),
        "run": Run(steps=10),
    },
    "correspondence": {
        "material": msgspec.structs.replace(GLASS, model="correspondence", nu=0.2),
        "run": Run(steps=10),
    },
}
PLACES = {
    "at rest": "$.run.solver",
    "hybrid": "$.run.adapt",
    "particles": "$.run.cracks",
    "damage of families": "$.material.failure",
    "contact": "$.contact",
    "a rigid body": "$.contact",  # which it needs
}


@pytest.mark.slow
@pytest.mark.endurance
@pytest.mark.parametrize("case", REFUSED)
def test_what_ranks_cannot_is_refused_in_one_line(here: Path, case: str) -> None:
    (here / "plate.json").write_text(plate(**{"grid": square_grid(21, 12), **REFUSED[case]}).to_json())
    code, said = ran(2, "plate.json")
    assert (code, len(said.splitlines())) == (2, 1), said
    assert PLACES.get(case, "$.material.model") in said
    assert not (here / "plate.sqlite").exists()


@pytest.mark.process
@pytest.mark.endurance
def test_a_plate_of_fewer_blocks_than_ranks_is_refused(here: Path) -> None:
    (here / "plate.json").write_text(plate(square_grid(8, 12), run=Run(steps=10)).to_json())
    code, said = ran(3, "plate.json")
    assert (code, len(said.splitlines())) == (2, 1), said
    assert mentions(said, "$.nodes", found=("96", "3 ranks"), expected=64)


@pytest.mark.endurance
def test_the_job_of_slurm_in_the_guide_solves_and_goes_on(here: Path) -> None:
    page = (TESTS.parent / "docs" / "how_to" / "clusters.md").read_text()
    line = next(line for line in page.splitlines() if line.startswith("if [ -s plate.sqlite ]"))
    for name, words in {
        "mpiexec": [str(MPIEXEC), "-launcher", "fork", "-hosts", "localhost"],
        "pdsolve": [sys.executable, "-m", "pdsolve"],
    }.items():
        (here / name).write_text(f'#!/bin/sh\nexec {shlex.join(words)} "$@"\n')
        (here / name).chmod(0o755)
    (here / "plate.json").write_text(torn(square_grid(20, 40)).to_json())
    place = os.environ | {"PATH": f"{here}:{os.environ['PATH']}"}
    for _ in range(2):  # it begins; it goes on
        subprocess.run(["bash", "-c", line], cwd=here, env=place, check=True, timeout=100, stdout=subprocess.DEVNULL)
        with Results.open(here / "plate.sqlite") as results:
            assert results.meta()["status"] == "finished"
            assert results.frames()[0][-1] == 60


def own_lines(said: str) -> list[str]:
    """What pdsolve says, without what its launcher and the system's library say."""
    return [line for line in said.splitlines() if line.startswith("pdsolve") or "Traceback" in line]


@pytest.mark.slow
@pytest.mark.endurance
@pytest.mark.parametrize(
    ("how", "failing", "code"),
    [
        ("between", "012", 2),
        ("within", "12", 2),
        ("memory", "2", 1),
        pytest.param("between", "1", 2, marks=pytest.mark.slow),
        pytest.param("within", "0", 2, marks=pytest.mark.slow),
    ],
)
def test_an_error_on_a_rank_is_one_line_and_ends_all(how: str, failing: str, code: int) -> None:
    with started("-n", "3", sys.executable, "-m", "failing_ranks", how, *failing) as child:
        lines = own_lines(child.communicate(timeout=100)[1])
    assert (child.returncode, len(lines)) == (code, 1), lines
    if how == "memory":
        assert mentions(lines[0], found="memory")
    else:
        assert mentions(lines[0], "plate.json", "$.nodes", found=1, expected=2)
    assert ("rank " in lines[0]) == (how != "between" and "0" not in failing)


@pytest.mark.endurance
@pytest.mark.parametrize("repetition", range(3))
def test_eight_ranks_in_error_tell_one(repetition: int) -> None:
    """The one that does takes longer to end the others than they wait for rank 0."""
    with started("-n", "8", sys.executable, "-m", "failing_ranks", "slowly", *"1234567") as child:
        lines = own_lines(child.communicate(timeout=100)[1])
    assert (child.returncode, len(lines)) == (2, 1), lines
    assert mentions(lines[0], "rank ", "plate.json", "$.nodes", found=1, expected=2)


@pytest.mark.slow
@pytest.mark.endurance
def test_a_study_on_many_ranks_is_refused_once(here: Path) -> None:
    code, said = ran(3, "study", "study.toml")
    assert (code, len(said.splitlines())) == (2, 1), said
    assert mentions(said, "pdsolve study", found="many ranks", expected="one process")


@pytest.mark.slow
@pytest.mark.endurance
def test_a_rank_that_may_use_too_little_memory_ends_all_with_one_line(here: Path) -> None:
    (here / "plate.json").write_text(plate(square_grid(21, 12), run=Run(steps=10)).to_json())
    solves = [sys.executable, "-m", "pdsolve", "plate.json"]
    narrow = ["sh", "-c", f"ulimit -v 700000; exec {shlex.join(solves)}"]
    with started("-n", "2", *solves, ":", "-n", "1", *narrow) as child:
        lines = own_lines(child.communicate(timeout=100)[1])
    assert (child.returncode, len(lines)) == (1, 1), lines
    assert mentions(lines[0], found="memory", expected="ulimit -v")
    assert not (here / "plate.sqlite").exists()


@pytest.mark.slow
@pytest.mark.endurance
@pytest.mark.parametrize(("how", "said"), [("pass", 1), ("one.dismiss()", 0), ("launch._silence(one.place)", 0)])
def test_a_witness_speaks_unless_all_is_said(how: str, said: int) -> None:
    words = f"from pdsolve.ranks import launch; one = launch.Witness(); {how}; import os; os._exit(0)"
    done = subprocess.run([sys.executable, "-c", words], capture_output=True, text=True, check=True)
    assert len(own_lines(done.stderr)) == said, done.stderr


@pytest.mark.process
@pytest.mark.endurance
def test_words_that_are_wrong_are_told_once(here: Path) -> None:
    code, said = ran(3, "plate.json", "--nothing")
    assert code == 2
    assert said.count("--nothing") == 1
