"""What a run with a fine zone that moves refuses, and what it says of itself."""

from __future__ import annotations

import dataclasses
import json
import warnings
from pathlib import Path
from typing import Any

import meshio
import msgspec
import numpy as np
import pytest
from messages import mentions, naming
from numpy.typing import NDArray
from plates import GLASS, plate, square_grid
from zoned_plates import rectangle

from benchmarks.balance_rows import compute_energy_balance_row
from pdmesh import Medium, Scene, SceneError, box, build
from pdmesh.__main__ import main as build_command
from pdmesh.drawing.file_reading import build_file, read_scene
from pdmesh.drawing.parameters import Parameters, run
from pdmesh.model.contradictions import Case
from pdmesh.model.document import (
    InitialVelocity,
    Lattice,
    Load,
    Material,
    Pin,
    Region,
    Run,
    Velocity,
    read_file,
    write_file,
)
from pdmesh.model.node_grid import Grid, document_of, whole_lattice
from pdmesh.model.possible import impossible
from pdmesh.quantities import UNITS
from pdsolve.__main__ import main as solve_command
from pdsolve.adaptivity.hybrid.coarse_cells import create_hybrid_plate, initial_cell_kinds
from pdsolve.adaptivity.hybrid.prepare import rows_with_content_jumps
from pdsolve.checks import warn_of_created_energy
from pdsolve.model import Model, ModelError, ModelWarning
from pdsolve.options import Options
from pdsolve.run.prepare import prepare, select_scheme
from pdsolve.run.simulation import simulate
from pdsolve.zone.bond_parts import BondPartsInCells, divide_bonds_at_cell_borders
from pdsolve.zone.cells import AROUND, COARSE, FINE
from pdsolve.zone.springs import coarse_springs, create_fine_springs

GEOMETRIES = Path(__file__).parents[3] / "geometries"
HYBRID = Run(adapt="hybrid", steps=20)
LASTING = Material(E=65e9, rho=2235.0, G0=1e9)


def cracked(**changes: Any) -> Grid:
    """A plate of 40 by 24 spacings with an edge crack."""
    return dataclasses.replace(square_grid(41, 25), cracks=1e-3 * np.array([[0, 11.5, 12.5, 11.5]]), **changes)


def off_lattice() -> Grid:
    """The same with a node out of line."""
    grid = square_grid(41, 25)
    grid.position[500] += 1e-4
    return grid


STATE_BASED = {
    "correspondence": "bond (or --adapt none), as run.adapt is hybrid",
    "micropolar": "bond (or --adapt none), as run.adapt is hybrid",
    "ordinary": "bond (or --adapt none; version 1.0.0 was the last with zones of ordinary solids),"
    " as run.adapt is hybrid",
}
CONSTANT = msgspec.structs.replace(GLASS, micromodulus="constant")
PIN = Pin(box=(0.0, 0.0, 0.01, 0.01))


@pytest.mark.parametrize(
    ("model", "words"),
    [
        (plate(cracked(), 4, run=Run(solver="static")), naming("run.solver", found="static", expected="explicit")),
        (plate(cracked(), 4, run=Run(start="static")), naming("run.start", found="static", expected="unloaded")),
        (plate(off_lattice(), 4), "on no lattice"),
        (plate(cracked(), 4, conditions=(PIN,)), r"conditions\[0\].*pin"),
        (plate(cracked(), 8), naming("ratio", found="8", expected="6")),
        (plate(cracked(), 6, material=CONSTANT), naming("ratio", found="6", expected="5.5")),
        (plate(cracked(), 4, area_rule="square"), naming("area_rule", found="square")),
        (plate(dataclasses.replace(cracked(), cracks=1e-3 * np.array([[0.0, 3, 9, 3]])), 4), naming(found="node")),
        (plate(dataclasses.replace(cracked(), delta=np.linspace(1e-3, 2e-3, 1025)), 4), "several spacings"),
    ],
)
def test_what_cannot_be_solved_so_is_refused(model: Model, words: str) -> None:
    """In one sentence that names the place."""
    run = msgspec.structs.replace(model.settings.run, adapt="hybrid")
    model = dataclasses.replace(model, settings=msgspec.structs.replace(model.settings, run=run))
    with pytest.raises(ModelError, match=words) as error:
        _ = select_scheme(model, Options()), create_hybrid_plate(model)
    assert str(error.value).endswith("as run.adapt is hybrid")


@pytest.mark.parametrize(
    ("adapt", "plane", "refuses"), [("hybrid", "stress", 0), ("hybrid", "space", 1), ("collocation", "stress", 1)]
)
def test_materials_of_two_micromoduli_have_one_family_in_the_plane(adapt: str, plane: str, refuses: int) -> None:
    """Zones in space and collocation refuse them in one sentence."""
    glass, constant = (msgspec.structs.replace(one, plane=plane) for one in (GLASS, CONSTANT))
    found = plate(cracked(), 4).settings
    run, region = msgspec.structs.replace(found.run, adapt=adapt), Region(nodes=(1,), material=constant)
    settings = msgspec.structs.replace(found, run=run, material=glass, regions=(region,))
    words = [str(one) for one in impossible(Case(settings, 3 if plane == "space" else 2)) if "micromodulus" in str(one)]
    assert len(words) == refuses
    assert all("constant" in one and "conical" in one for one in words)


def test_the_mode_of_the_thesis_is_refused() -> None:
    """Its bonds are one-sided."""
    with pytest.raises(ModelError, match=naming("mode", found="thesis", expected="conservative")):
        select_scheme(plate(cracked(), 4, run=Run(adapt="hybrid")), Options("thesis"))


def test_the_compact_lattice_is_as_stiff_as_the_fine_one() -> None:
    """C11 and C66 of a cell's springs, at m = 3 and 4, are those of a fine family; stretches of a bond fill it."""
    for m in (3.0, 4.0):
        fine = create_fine_springs(GLASS, m, 1e-3)
        coarse = coarse_springs(fine, 1e-3)
        for power in ((4, 0), (2, 2)):
            sums = []
            for springs, area in ((fine, 1e-6), (coarse, 4e-6)):
                x, y, stiffness = springs.spring_table[:, 0], springs.spring_table[:, 1], springs.spring_table[:, 5]
                length = np.hypot(x, y)
                n = (x / length) ** power[0] * (y / length) ** power[1]
                sums.append((stiffness * length**2 * n).sum() / 2 / area)
            assert sums[0] == pytest.approx(sums[1], rel=1e-13)
        cut = divide_bonds_at_cell_borders(np.column_stack([fine.family_dx, fine.family_dy]))
        first, last = cut.part_bounds_of_sides[:, :, 0].ravel(), cut.part_bounds_of_sides[:, :, 1].ravel()
        for one, other in zip(first, last, strict=True):
            assert np.diff(cut.begin_and_end_shares[one:other], axis=1).sum() == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("how", ["temperature", "exchange", "supply"])
def test_cells_beside_an_edge_where_a_content_leaps_are_fine(how: str) -> None:
    """They reach a family and a ring of cells into the plate; all others are coarse."""
    exchange = {"coefficient": 1.0, "outside": 300.0}
    settings = {"temperature": {"T": 300.0}, "exchange": exchange, "supply": {"flux": 1.0}}
    glass = msgspec.structs.replace(GLASS, alpha=9e-6, T0=293.0)
    scene = Scene(box(0, 0, 0.04, 0.02), 1e-3, glass, 4.0, HYBRID, medium=Medium(D=1e-3))
    built = build(getattr(scene, how)("left", **settings[how]))
    model = Model(built.grid, built.settings)
    steep = rows_with_content_jumps(model)
    x = model.grid.position[:, 0]
    assert set(steep) == set(np.flatnonzero(x == x.min()))
    whole = create_hybrid_plate(model.moving_part())
    cells = initial_cell_kinds(whole, 4, steep).reshape(-1, whole.numbering.cells.strides[1])
    across = cells[len(cells) // 2]
    assert across[AROUND : AROUND + 20].tolist() == 5 * [FINE] + 15 * [COARSE]
    assert not (initial_cell_kinds(whole, 4) == FINE).any()


def test_bits_of_cells_are_those_of_the_stretches_of_bonds() -> None:
    """At the largest horizon too; seen from its other end, a bond has the same cells."""
    fine = create_fine_springs(GLASS, 6.0, 1e-3)
    cut, half = (
        divide_bonds_at_cell_borders(np.column_stack([fine.family_dx, fine.family_dy])),
        len(fine.family_dx) // 2,
    )
    for place in range(4):
        for k in range(half):
            for side in range(2):
                cells = cut.cell_offset[
                    cut.part_bounds_of_sides[place, k, side] : cut.part_bounds_of_sides[place, k, side + 1]
                ]
                there = [place % 2 + fine.family_dx[k], place // 2 + fine.family_dy[k]]
                parity = there[0] % 2 + 2 * (there[1] % 2)
                away = cells - np.array(there) // 2
                assert int(cut.side_cell_bits[place, k, side, 0]) == _bits(cut, place, cells)
                assert int(cut.side_cell_bits[parity, k + half, side, 0]) == _bits(cut, parity, away)


def _bits(cut: BondPartsInCells, position: int, cells: NDArray[np.int64]) -> int:
    """A bit for each of these cells (k, 2), of those around that of a node at this position in it."""
    steps = cells - cut.lowest_cell_offset[[position % 2, position // 2]]
    assert ((steps >= 0) & (steps < cut.cells_around_per_axis)).all()
    return sum(1 << int(cut.cells_around_per_axis * y + x) for x, y in {(int(x), int(y)) for x, y in steps})


@pytest.mark.parametrize(("model", "expected"), STATE_BASED.items(), ids=STATE_BASED)
def test_other_models_are_refused(
    model: str, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """By the command too, in one line that names the file and the place, before anything is written."""
    material = msgspec.structs.replace(GLASS, model=model, nu=0.2)
    whole = document_of(cracked(), msgspec.structs.replace(plate(cracked(), 4).settings, material=material))
    path = tmp_path / "plate.json"
    write_file(whole, path)
    assert solve_command([str(path), "--adapt", "hybrid", "-o", str(tmp_path / "plate.sqlite")]) == 2
    words = f"$.material.model is '{model}'"
    said = capsys.readouterr().err
    assert said.startswith(f"pdsolve: {path}: {words}; use ")
    assert said.count("\n") == 1
    assert [file.name for file in tmp_path.iterdir()] == ["plate.json"]


def test_scenes_and_drawings_may_ask_for_it() -> None:
    """In Python, and by a parameter of a drawing, which a file keeps; by default none."""
    scene = Scene(box(0, 0, 0.04, 0.024), 1e-3, GLASS)
    assert scene.run.adapt == "none"
    assert scene.adapt().run.adapt == "hybrid"
    assert scene.adapt().adapt("none").run.adapt == "none"
    for word in ("none", "hybrid"):
        assert run(Parameters({"Peridynamics/Run/Adapt": word}, UNITS["m"])).adapt == word
    with pytest.raises(SceneError, match=naming(found="'static'", expected=("none", "hybrid"))):
        run(Parameters({"Peridynamics/Run/Adapt": "static"}, UNITS["m"]))


@pytest.mark.slow
def test_a_drawing_is_built_for_it(tmp_path: Path) -> None:
    """One lattice of the finest spacing, which the model keeps; a mesh is refused."""
    path = tmp_path / "plate.json"
    assert build_command(["build", str(GEOMETRIES / "soda_lime.geo"), "--adapt", "hybrid", "-o", str(path), "-q"]) == 0
    document = read_file(path)
    assert (document.run.adapt, len(document.nodes), document.parameters["--adapt"]) == ("hybrid", 4141, "hybrid")
    again = read_scene(path)
    assert again.run.adapt == "hybrid"
    mesh = tmp_path / "plate.msh"
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]) * 1e-2
    meshio.Mesh(square, [("triangle", [[0, 1, 2], [0, 2, 3]])]).write(mesh, file_format="gmsh22")
    with pytest.raises(
        SceneError, match=naming("plate.msh", "--adapt", found="mesh", expected=("drawings", "leave it out"))
    ):
        build_file(mesh, [("--adapt", "hybrid")])


@pytest.mark.slow
def test_the_command_says_how_much_is_fine(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A run by `--adapt hybrid`, its summary and what it prints; a model it cannot solve leaves one line."""
    model, path = plate(cracked(), 4, run=msgspec.structs.replace(HYBRID, adapt="none")), tmp_path / "plate.json"
    write_file(document_of(model.grid, model.settings), path)
    words = [str(path), "--adapt", "hybrid", "-o", str(tmp_path / "plate.sqlite")]
    assert solve_command([*words, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["hybrid"]
    assert 0.1 < told["fine_share"] < 0.9
    assert solve_command([*words, "--force", "--mode", "thesis"]) == 2
    said = capsys.readouterr().err
    assert mentions(said, "mode", found="thesis", expected=("conservative", "run.adapt", "hybrid"))
    assert said.count("\n") == 1


@pytest.mark.slow
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(
    "condition",
    [
        Velocity(box=(-1.0, 6.9e-3, 1.0, 7.1e-3), y=1.0),
        Velocity(box=(-1.0, -1e-5, 1.0, 1.1e-3), y=1.0),
        InitialVelocity(box=(-1.0, -1.0, 1.0, 7.1e-3), y=1.0),
        InitialVelocity(box=(-1.0, -1.0, 1.0, 8.1e-3), y=1.0),
        Velocity(box=(-1.0, -1.0, 1.0, 8.1e-3), y="1 + cos(pi * x / 1e-3) / 2"),
    ],
    ids=["row between coarse nodes", "two rows", "half, from between them", "half, from one of them", "of the place"],
)
def test_motion_may_be_prescribed_anywhere(condition: Velocity | InitialVelocity) -> None:
    """Where coarse nodes do not have it, cells are fine: momentum and work are those of fine nodes everywhere."""
    momentum, work = [], []
    for adapt in ("none", "hybrid"):
        model = plate(
            rectangle(60, 40, 1e-3, []), 4.0, material=LASTING, conditions=(condition,), run=Run(steps=40, adapt=adapt)
        )
        system, state = prepare(model, Options())
        momentum.append(float((state.rate[:, 1] * system.model.rho * system.area).sum()))
        system.stepper.advance(state, 1, 41)
        work.append(compute_energy_balance_row(system, state, 40).work)
    np.testing.assert_allclose(*momentum, rtol=1e-12)
    np.testing.assert_allclose(*work, rtol=0.02)  # 0.009 at most


@pytest.mark.slow
def test_a_lattice_is_solved_as_its_listed_nodes_without_arrays_of_them(tmp_path: Path) -> None:
    """Bit by bit, loads, held nodes and a pre-crack included."""
    lattice, crack = Lattice((0.0, 0.0), 1e-3, 61, 41), 1e-3 * np.array([[0, 19.5, 20.5, 19.5]])
    ring = 1e-3 * np.array([[0, 0], [60, 0], [60, 40], [0, 40]])
    held, listed = (whole_lattice(lattice, cracks=crack, outline=(ring,)) for _ in range(2))
    given = {field.name: getattr(listed, field.name) for field in dataclasses.fields(Grid)} | {"lattice": None}
    conditions = (
        Load(nodes=tuple(range(2441, 2502)), traction=(0.0, 12e6), rows=1, length=0.06),
        Velocity(box=(0.0, 0.0, 0.06, 0.0), y=-1.0),
    )
    runs = []
    for number, grid in enumerate((held, Grid(**given))):
        model = plate(grid, 4.0, run=HYBRID, conditions=conditions)
        with simulate(model, tmp_path / f"{number}.sqlite") as results:
            runs.append([results.field(name, 20) for name in ("ux", "uy", "vy", "ay", "damage")])
            runs[-1] += [results.history()["work"], results.nodes(20).area, results.nodes(20).cut]
    assert all(np.array_equal(one, other) for one, other in zip(*runs, strict=True))
    assert {"ids", "position", "border", "areas"}.isdisjoint(vars(held))


def test_a_run_warns_of_much_energy_made_by_changes_of_cells() -> None:
    """Once it is more than a twentieth of the energy put in, with what helps."""
    model = plate(cracked(), 4, run=Run(adapt="hybrid"))
    with pytest.warns(ModelWarning, match=r"changes of cells made \+6 % .* run\.hybrid\.kappa"):
        warn_of_created_energy(model, 6.0, 100.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warn_of_created_energy(model, -4.9, 100.0)
        warn_of_created_energy(model, 1e-30, 0.0)
        warn_of_created_energy(plate(cracked(), 4, run=Run(adapt="split")), -50.0, 100.0)
