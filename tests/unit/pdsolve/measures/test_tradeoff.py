"""Cost against error: known errors of made-up runs, the front, the cheapest."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from messages import mentions, naming
from new_databases import create_writer
from plates import plate, square_grid

from pdmesh.model.document import Load, Run
from pdpost.__main__ import main
from pdsolve.measures.tradeoff import cheapest_point, pareto_front, read_run_cost, relative_run_errors
from pdsolve.model import ModelWarning
from pdsolve.results import Breaks, Families, FrameRecord, Nodes, Results, ResultsError
from pdsolve.run.measures import EnergyBalanceRow
from pdsolve.run.simulation import simulate


def alone(first: int, last: int) -> Families:
    return Families(np.zeros(last - first + 1, dtype=np.int64), np.zeros(0, dtype=np.int64))


def run(
    path: Path,
    side: int,
    stretch: float,
    end: float = 1e-5,
    energy: float = 1.0,
    cracked: dict[int, float] | None = None,
    shift: float = 0.0,
) -> Results:
    """A square of 40 mm of side x side nodes that is stretched along x, evenly in time until 1e-5 s.

    `cracked` maps steps to the x (m) that a straight crack at the middle plus `shift` has come to.
    """
    delta = 0.04 / side
    grid = square_grid(side, side, delta, x0=delta / 2, y0=delta / 2)
    count = side * side
    nodes = Nodes(
        grid.ids,
        grid.position,
        grid.delta,
        grid.delta**2,
        np.full(count, 10, dtype=np.int64),
        np.zeros(count, dtype=np.int64),
    )
    time_step = 1e-7
    meta = {"time_step": time_step, "initial_energy": 0.0, "model": "{}"}
    writer = create_writer(path, nodes, alone, np.empty((0, 4)), meta)
    steps = round(end / time_step)
    x, y = grid.position.T
    last = -1.0
    for at in np.linspace(0, steps, 5).round().astype(int).tolist():
        rows: list[tuple[int, int, int]] = []
        for step, reach in (cracked or {}).items():
            if last < step <= at:
                newly = (np.abs(y - 0.02 - shift) < delta) & (x < reach) & ~(x < _reach(cracked, step))
                rows += [(step, int(node), 1) for node in grid.ids[newly] for _ in range(5)]
        last = at
        u = at / 100 * stretch * x
        breaks = Breaks(*np.array(sorted(rows), dtype=np.int64).reshape(-1, 3).T)
        fields = {"ux": u, "uy": 0 * u}
        books = [EnergyBalanceRow(at, at * time_step, energy * at / steps, *[0.0] * 5, 0)]
        writer.write(FrameRecord(at, at * time_step, fields, breaks, books, [], {}))
    writer.write_meta({"summary": json.dumps({"wall_time": 2.0, "bonds": 10 * count, "steps": steps})})
    writer.close("finished")
    return Results.open(path)


def _reach(cracked: dict[int, float] | None, step: int) -> float:
    return max((reach for other, reach in (cracked or {}).items() if other < step), default=-1.0)


@pytest.mark.slow
def test_displacements_are_compared_where_nodes_are_not_the_same(tmp_path: Path) -> None:
    """2 % more stretched; between nodes a linear field is exact. Frames at other times are interpolated."""
    with run(tmp_path / "a", 10, 1.02e-3) as coarse, run(tmp_path / "b", 40, 1e-3, end=2e-5) as fine:
        found = relative_run_errors(coarse, fine)
        back = relative_run_errors(fine, coarse)
    assert found.displacement == pytest.approx(0.02, rel=1e-5)  # float32
    assert back.displacement == pytest.approx(0.02 / 1.02, rel=1e-5)
    assert (found.path, found.start, found.branching) == (None, None, None)


def test_large_cells_weigh_more(tmp_path: Path) -> None:
    """Off by 2 % where cells are of 3 mm^2 and exact where they are of 1 mm^2: 2 % of the root of 3 in 4."""
    grid = square_grid(8, 8)
    left = grid.position[:, 0] < 3.6e-3
    area, none = np.where(left, 3e-6, 1e-6), np.zeros(64, dtype=np.int64)
    nodes = Nodes(grid.ids, grid.position, grid.delta, area, np.full(64, 10), none)
    for name, off in (("a", 0.02), ("b", 0.0)):
        meta = {"time_step": 1e-7, "initial_energy": 0.0, "model": "{}"}
        writer = create_writer(tmp_path / name, nodes, alone, np.empty((0, 4)), meta)
        u = np.where(left, 1 + off, 1.0) * 1e-6
        no_breaks = Breaks(*np.zeros((3, 0), dtype=np.int64))
        writer.write(
            FrameRecord(1, 1e-7, {"ux": u, "uy": 0 * u}, no_breaks, [EnergyBalanceRow(1, 1e-7, *[0.0] * 6, 0)], [], {})
        )
        writer.close("finished")
    with Results.open(tmp_path / "a") as one, Results.open(tmp_path / "b") as other:
        assert relative_run_errors(one, other).displacement == pytest.approx(
            0.02 * np.sqrt(3 / 4), rel=1e-3
        )  # unweighted: 0.0141


def test_energies_are_compared_at_the_common_time(tmp_path: Path) -> None:
    with run(tmp_path / "a", 10, 1e-3, energy=3.3) as one, run(tmp_path / "b", 10, 1e-3, end=2e-5, energy=6.0) as other:
        assert relative_run_errors(one, other).energy == pytest.approx(0.1)
        assert relative_run_errors(one, other).displacement == pytest.approx(0, abs=1e-6)


@pytest.mark.slow
def test_cracks_are_compared(tmp_path: Path) -> None:
    """A crack 4 mm beside another of 30 mm, 20 % later: 4/30 of its length, but for the ends."""
    straight = {50: 0.006, 60: 0.03}
    later = {60: 0.006, 72: 0.03}
    with (
        run(tmp_path / "a", 40, 1e-3, cracked=later, shift=4e-3) as one,
        run(tmp_path / "b", 40, 1e-3, cracked=straight) as other,
    ):
        found = relative_run_errors(one, other)
    assert found.start == pytest.approx(0.2)
    assert found.path == pytest.approx(4 / 28, rel=0.06)  # measured 0.1429: the path has points 1 mm inside the ends
    assert found.branching is None
    assert found.worst == pytest.approx(0.2)


@pytest.mark.slow
def test_what_did_not_happen_is_an_infinite_error(tmp_path: Path) -> None:
    with run(tmp_path / "a", 40, 1e-3) as one, run(tmp_path / "b", 40, 1e-3, cracked={50: 0.03}) as other:
        found = relative_run_errors(one, other)
    assert (found.path, found.start) == (np.inf, np.inf)


def test_cost(tmp_path: Path) -> None:
    with run(tmp_path / "a", 10, 1e-3) as results:
        found = read_run_cost(results, tmp_path / "a")
    assert found == (2.0, 10 * 100 * 100, (tmp_path / "a").stat().st_size)


def test_other_plates_are_refused(tmp_path: Path) -> None:
    grid = square_grid(5, 5)
    nodes = Nodes(grid.ids, grid.position, grid.delta, grid.delta**2, grid.ids, grid.ids)
    writer = create_writer(tmp_path / "b", nodes, alone, np.empty((0, 4)), {"time_step": 1e-7, "model": "{}"})
    writer.close("finished")
    with (
        run(tmp_path / "a", 10, 1e-3) as one,
        Results.open(tmp_path / "b") as other,
        pytest.raises(ResultsError, match=naming("a", found="(0, 0)", expected=("b", "differ"))),
    ):
        relative_run_errors(one, other)


def test_the_front_and_the_cheapest() -> None:
    cost, error = np.array([4.0, 1.0, 2.0, 3.0, 2.0, 5.0]), np.array([0.01, 0.2, 0.1, 0.1, 0.3, np.nan])
    assert pareto_front(cost, error) == [1, 2, 0]
    assert cheapest_point(cost, error, 0.15) == 2
    assert cheapest_point(cost, error, 0.001) is None


@pytest.mark.slow
def test_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """One picture, one JSON; the cheapest is named; what cannot be is one line and exit code 2."""
    monkeypatch.chdir(tmp_path)
    for name, side, stretch in (("coarse", 10, 1.05e-3), ("middle", 20, 1.01e-3), ("fine", 40, 1e-3)):
        run(tmp_path / f"{name}.sqlite", side, stretch).close()
    arguments = ["tradeoff", "coarse.sqlite", "middle.sqlite", "--reference", "fine.sqlite"]
    assert main([*arguments, "--within", "2%", "--cost", "bond_updates"]) == 0
    out = capsys.readouterr().out
    assert mentions(out, "cheapest", "0.02", "middle")
    found = json.loads((tmp_path / "tradeoff.json").read_text())
    assert found["front"] == ["coarse", "middle"]
    assert [point["displacement"] for point in found["points"]] == pytest.approx([0.05, 0.01], rel=1e-4)
    assert (tmp_path / "tradeoff.png").read_bytes()[:4] == b"\x89PNG"
    assert main(arguments) == 2
    assert mentions(capsys.readouterr().err, "tradeoff.png", found="already exists")
    assert main([*arguments, "--force", "--csv", "-"]) == 0
    assert capsys.readouterr().out.splitlines()[0].startswith("name,nodes,wall_time")
    assert main([*arguments, "--force", "--csv", "-", "--json"]) == 2
    assert mentions(capsys.readouterr().err, "--csv", found="--json")
    with pytest.raises(SystemExit) as stop:
        main([*arguments, "--within", "no"])
    assert stop.value.code == 2
    assert mentions(capsys.readouterr().err, found="'no'", expected=("2%", "0.02"))
    assert main(["tradeoff", "coarse.sqlite", "--reference", "none.sqlite", "--force"]) == 2
    assert mentions(capsys.readouterr().err, "none.sqlite", found="no such file")


def test_plates_too_small_to_compare(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """One row of nodes has no displacements between its nodes; an error that is nowhere is said to be."""
    monkeypatch.chdir(tmp_path)
    pull = Load(nodes=(1,), body_force=(1e9, 0.0))
    line = plate(square_grid(10, 1), conditions=(pull,), run=Run(time_step=1e-8, steps=2, every=1))
    with pytest.warns(ModelWarning), simulate(line, Path("row.sqlite")) as row:
        assert relative_run_errors(row, row).displacement is None
    run(tmp_path / "a.sqlite", 10, 1e-3).close()
    assert main(["tradeoff", "a.sqlite", "--reference", "a.sqlite", "--by", "path"]) == 2
    assert mentions(
        capsys.readouterr().err, "path", "--by", found=("nothing", "reference"), expected=("displacement", "energy")
    )


def test_nodes_without_bonds_have_no_strain(tmp_path: Path) -> None:
    from pdsolve.fracture.gradients import gradients_of

    with run(tmp_path / "a.sqlite", 10, 1e-3) as results:
        moved = np.column_stack([results.field("ux", 100), results.field("uy", 100)])
        nodes = results.nodes()
        assert np.isnan(gradients_of(nodes.position, nodes.area, moved.astype(float), *results.families())).all()
