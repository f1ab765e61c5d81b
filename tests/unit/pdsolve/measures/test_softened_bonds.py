"""A node of a softening material is cracked once its bonds have dissipated enough of their energy."""

from __future__ import annotations

import dataclasses
import json
import re
from pathlib import Path

import numpy as np
import pytest
from new_databases import create_writer
from prescribed_results import plate

from pdmesh.model.cohesive_softening import critical_opening
from pdmesh.model.document import Material
from pdpost.__main__ import main as pdpost
from pdpost.figures import charts, crack_figure
from pdsolve.laws.pair_laws import bilinear, cohesive
from pdsolve.measures.crack_summary import crack, path_point_table, summary_sentences
from pdsolve.measures.cracked_nodes import damage_with_pre_cracks_at, first_cracked_step_of_nodes, separation_at
from pdsolve.measures.histories import node_history
from pdsolve.measures.softened_bonds import dissipated_share, separation_history
from pdsolve.results import Breaks, FrameRecord, Results

H = 1e-3
MORTAR = {"E": 20e9, "rho": 2100.0, "G0": 50.0, "law": "cohesive", "f_t": 3e6}
OPENING = float(critical_opening(Material(**MORTAR), 3.0, np.array([3 * H]))[0])  # type: ignore[arg-type]


def opened_plate(
    openings: list[float], material: dict[str, object], solver: str = "static", path: Path | None = None
) -> Results:
    """A plate of 13 x 13 nodes whose right half moves away in a frame of each step; no bond breaks."""
    nodes, families = plate(spacing=H)

    model = {"notch": [], "nodes": [], "material": material, "run": {"solver": solver, "time_step": 1.0}}
    meta = {"time_step": 1.0, "model": json.dumps(model)}
    writer = create_writer(path, nodes, lambda _first, _last: families, np.empty((0, 4)), meta)
    right, none = nodes.position[:, 0] > 6.5 * H, np.zeros(len(nodes.ids))
    for step, opening in enumerate(openings):
        fields = {"ux": np.where(right, opening, 0.0), "uy": none, "damage": none}
        writer.write(FrameRecord(step, float(step), fields, Breaks(*np.zeros((3, 0), dtype=np.int64)), [], [], {}))
    return Results(writer.connection, "memory")


@pytest.mark.parametrize("shape", ["linear", "bilinear", "exponential"])
def test_the_share_of_a_bond_is_that_of_its_law(shape: str) -> None:
    stretch, peak, limit = np.linspace(1.01e-4, 8.99e-4, 9), np.full(9, 1e-4), np.full(9, 9e-4)
    softening = cohesive.LAWS[shape].pair.softening  # type: ignore[union-attr]
    assert softening is not None
    expected = softening.dissipated_energy(None, 1.0, stretch, peak, limit)
    expected = expected / softening.total_dissipated_energy(None, 1.0, peak, limit)
    material = Material(**{**MORTAR, "shape": shape})  # type: ignore[arg-type]
    assert dissipated_share(material, stretch, peak, limit) == pytest.approx(expected)
    assert dissipated_share(material, np.array([0.0, 1e-2]), peak[:2], limit[:2]).tolist() == [0, 1]


def test_the_share_of_a_bilinear_bond_is_that_of_its_law() -> None:
    stretch, peak, limit = np.linspace(1e-4, 4e-4, 4), np.full(4, 1e-4), np.full(4, 4e-4)
    material = Material(E=1.0, rho=1.0, G0=1.0, law="bilinear", kr=4.0)
    expected = [bilinear.dissipated_share(*bond) for bond in zip(stretch, peak, limit, strict=True)]
    assert dissipated_share(material, stretch, peak, limit) == pytest.approx(expected)


def test_a_crack_of_softened_bonds_starts_before_one_breaks() -> None:
    """All bonds across the middle are gone at three times w_c; at a fifth of it, they have lost less than half."""
    results = opened_plate([0.0, 0.2 * OPENING, 3 * OPENING], MORTAR)
    since = first_cracked_step_of_nodes(results)
    columns = since.reshape(13, 13)
    assert (columns[2:-2, 6:8] == 2).all()
    assert (np.delete(columns, [6, 7], axis=1) == -1).all()
    assert damage_with_pre_cracks_at(results, 2).max() == 0
    middle = separation_at(results, 2).reshape(13, 13)[6]
    assert middle[[5, 6, 7, 8]] == pytest.approx([6 / 28, 11 / 28, 11 / 28, 6 / 28])
    assert 0 < separation_at(results, 1).max() < 0.35
    summary = crack(results)
    assert summary.events.start is not None
    assert summary.events.start.step == 2
    assert sum(branch.length for branch in summary.branches) > 8 * H
    title = crack_figure.crack(results, summary).axes[0].get_title()
    assert "No crack" not in title


def test_a_bond_that_closes_again_stays_separated() -> None:
    history = separation_history(opened_plate([0.0, 0.5 * OPENING, 0.0], MORTAR))
    assert history is not None
    assert history.separation[2].tolist() == history.separation[1].tolist()
    assert history.separation[1].max() > 0.1


def test_brittle_bonds_and_runs_in_motion_count_broken_bonds_alone() -> None:
    brittle = {"E": 20e9, "rho": 2100.0, "G0": 50.0}
    assert separation_history(opened_plate([0.0, OPENING], brittle)) is None
    assert separation_history(opened_plate([0.0, OPENING], MORTAR, "explicit")) is None


def test_the_damage_of_softened_bonds_names_the_field_that_shows_them(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "mortar.sqlite"
    opened_plate([0.0, 0.5 * OPENING], MORTAR, path=path).close()
    assert pdpost(["damage", str(path), "-o", str(tmp_path / "damage.png")]) == 0
    assert "pdpost separation" in capsys.readouterr().out


def test_a_run_in_load_steps_has_no_seconds() -> None:
    results = opened_plate([0.0, 0.2 * OPENING, 3 * OPENING], MORTAR)
    summary = crack(results)
    header, rows = path_point_table(summary)
    assert header[1] == "load step"
    assert rows[0][1] == 2
    assert not any(re.search(r"\d s\b", line) for line in summary_sentences(summary))
    axes = crack_figure.crack(results, summary).axes
    assert axes[0].get_title().endswith("load step 2")
    assert axes[1].get_xlabel() == "load step"
    in_motion = dataclasses.replace(summary, counts_load_steps=False)
    assert path_point_table(in_motion)[0][1] == "time, s"


def test_of_fatigue_the_points_of_a_path_have_their_cycles() -> None:
    summary = crack(opened_plate([0.0, 0.2 * OPENING, 3 * OPENING], MORTAR))
    cycles = tuple(1e3 * branch.passing_time for branch in summary.branches)
    header, rows = path_point_table(dataclasses.replace(summary, cycles=cycles))
    assert header[-1] == "cycles"
    assert rows[0][-1] == 2e3


def test_the_tables_and_axes_of_a_path_count_load_steps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "mortar.sqlite"
    opened_plate([0.0, 0.5 * OPENING], MORTAR, path=path).close()
    assert pdpost(["history", str(path), "--node", "3", "--csv", "-"]) == 0
    assert capsys.readouterr().out.splitlines()[0].split(",")[2] == "load step"
    with Results.open(path) as results:
        curve = node_history(results, 3, "displacement", "magnitude")
    for counts, label in ((True, "load step"), (False, "time, s")):
        assert charts.histories([curve], "displacement", counts).axes[0].get_xlabel() == label
