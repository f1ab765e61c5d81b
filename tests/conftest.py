"""What tests share: the Duran plate as a model, solved once, and a small plate to ask questions of."""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before numpy: threads of two workers spin on the same cores

import dataclasses
import shutil
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import HealthCheck
from hypothesis import settings as hypothesis_settings
from plates import GEOMETRIES, plate, square_grid

from pdmesh.model.document import Load, Run, write_file
from pdmesh.model.node_grid import document_of
from pdsolve.model import Model, read_model
from pdsolve.results import Results

pytest_plugins = ["tiers", "quick_guard"]

CLOCKS = [HealthCheck.too_slow]  # a busy machine is no fault
hypothesis_settings.register_profile(
    "same", derandomize=True, deadline=None, database=None, suppress_health_check=CLOCKS
)
hypothesis_settings.register_profile("random", deadline=None, suppress_health_check=CLOCKS)  # for make endurance
hypothesis_settings.load_profile("same")


@pytest.fixture(autouse=True)
def _closed_pipes() -> Iterator[None]:
    """A pipe that is closed stays an error: Gmsh, once loaded by a test, makes it the end of the process."""
    yield
    signal.signal(signal.SIGPIPE, signal.SIG_IGN)


@pytest.fixture(autouse=True, scope="session")
def _silent_compiling() -> None:
    """Whether kernels are compiled, and for how long, depends on which test comes first: commands do not say it."""
    from pdsolve.codegen import compile_time

    compile_time.PATIENCE = 600.0


@pytest.fixture(scope="session")
def duran_json(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The shipped Duran plate as a grid file."""
    pytest.importorskip("gmsh", exc_type=OSError)
    from pdmesh.drawing.geo import read_geo
    from pdmesh.grid.lattice import build_grid

    grid, settings, _ = build_grid(read_geo(GEOMETRIES / "duran50.geo"))
    path = tmp_path_factory.mktemp("duran") / "duran50.json"
    write_file(document_of(grid, settings), path)
    return path


@pytest.fixture(scope="session")
def solved(duran_json: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """The database of the whole Duran run in a mode, solved once a session."""
    from quick_guard import shared

    from pdsolve.run.simulation import Options, simulate

    folder = tmp_path_factory.mktemp("solved")

    def database(mode: str) -> Path:
        path = folder / f"{mode}.sqlite"
        if not path.exists():
            with shared():
                simulate(read_model(duran_json), path, Options(mode)).close()
        return path

    return database


@pytest.fixture(scope="session")
def small_plate() -> Model:
    """A cracked plate of 21 x 12 nodes torn apart in 60 steps, bonds breaking."""
    grid = dataclasses.replace(square_grid(21, 12, y0=-5.5e-3), cracks=np.array([[0.0, 0.0, 8e-3, 0.0]]))
    pull = 6e10
    return plate(
        grid,
        conditions=(
            Load(box=(0.0, 4.4e-3, 20e-3, 6e-3), body_force=(0.0, pull)),
            Load(box=(0.0, -6e-3, 20e-3, -4.4e-3), body_force=(0.0, -pull)),
        ),
        run=Run(time_step=50e-9, steps=60, every=20),
    )


@pytest.fixture(scope="session")
def probed(small_plate: Model) -> Model:
    """The small plate with something in every table of its results."""
    run = msgspec.structs.replace(small_plate.settings.run, every=10, ledger=5, probes=((0.0, 0.0), (1e-2, 0.0)))
    return dataclasses.replace(small_plate, settings=msgspec.structs.replace(small_plate.settings, run=run))


@pytest.fixture(scope="session")
def few_results_once(small_plate: Model, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The database that `few_results` is a copy of."""
    from pdsolve.run.simulation import simulate

    run = msgspec.structs.replace(small_plate.settings.run, fields=("ux", "uy", "vx", "vy", "damage"))
    settings = msgspec.structs.replace(small_plate.settings, run=run)
    path = tmp_path_factory.mktemp("few") / "few.sqlite"
    simulate(dataclasses.replace(small_plate, settings=settings), path).close()
    return path


@pytest.fixture
def few_results(few_results_once: Path, tmp_path: Path) -> Path:
    """The database of the small plate without energies and accelerations."""
    return Path(shutil.copy(few_results_once, tmp_path / "few.sqlite"))


@pytest.fixture(scope="session")
def small_results_once(small_plate: Model, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The database that `small_results` is a copy of."""
    from pdsolve.run.simulation import simulate

    path = tmp_path_factory.mktemp("small") / "small.sqlite"
    simulate(small_plate, path).close()
    with Results.open(path) as results:
        assert results.breaks().step.size > 0
    return path


@pytest.fixture
def small_results(small_results_once: Path, tmp_path: Path) -> Path:
    """The database of the small plate."""
    return Path(shutil.copy(small_results_once, tmp_path / "small.sqlite"))


@pytest.fixture(scope="session")
def hybrid_results(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The database of a struck plate that is peridynamic near its cracks alone, solved once a session."""
    from zoned_plates import struck

    from pdsolve.run.simulation import Options, simulate

    path = tmp_path_factory.mktemp("hybrid") / "hybrid.sqlite"
    simulate(struck("hybrid"), path, Options(threads=1)).close()
    return path


@pytest.fixture(scope="session")
def moving(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The database of a cracked plate with a fine zone that moves, solved once a session."""
    from splitting_clouds import Moving, torn_plate

    from pdsolve.run.simulation import Options, simulate

    path = tmp_path_factory.mktemp("moving") / "moving.sqlite"
    model = torn_plate()
    simulate(model, path, Options(threads=1), adapt=Moving(model.grid)).close()
    return path


@pytest.fixture
def listens() -> Iterator[None]:
    """Ctrl-C is heard: whoever runs the tests in the background has them ignore it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)
