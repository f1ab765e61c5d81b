"""Start and branching on cracks drawn by hand."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from damaged_results import alone, at, lattice, run
from new_databases import create_writer

from pdmesh.model.amounts import crack_energy
from pdpost.exports import csv_columns
from pdpost.reading.tables import queries
from pdsolve.measures.bond_pairs import read_bond_pairs
from pdsolve.measures.crack_summary import (
    CrackPathSummary,
    _energy_release_sentences,
    crack,
    summary_for_json,
    summary_sentences,
)
from pdsolve.measures.cracked_nodes import (
    damage_with_pre_cracks_at,
    damage_without_pre_cracks_at,
    first_cracked_step_of_nodes,
)
from pdsolve.measures.cracks import CrackEvents, cluster_nodes, find_crack_events, plate_is_split
from pdsolve.measures.fields import field_values
from pdsolve.measures.fragments import PlateFragment, PlateFragments
from pdsolve.measures.release import EnergyRelease
from pdsolve.results import Breaks, FrameRecord, Results
from pdsolve.study.run_measures import _crack_measures

PLATE = json.dumps({"material": {"E": 65e9, "rho": 2235.0, "G0": 204.0}})


def test_a_crack_starts_when_its_tip_is_one_and_a_half_spacings_on() -> None:
    found = find_crack_events(run(lattice(), [(3, 5, 0), (7, 6, 0), (9, 7, 0)]))
    assert found.initial_tip == pytest.approx(4e-3)
    assert found.start is not None
    assert (found.start.step, found.start.time, found.start.along) == pytest.approx((7, 7e-6, 6e-3))
    assert found.branching is None
    assert found.final_tip == pytest.approx(7e-3)


def test_a_crack_that_starts_elsewhere_has_started() -> None:
    """Below and behind the tip of the pre-crack, whichever direction is looked along."""
    steps = [(3, 2, -4), (5, 3, -4), (50, 5, 0), (60, 6, 0)]
    for direction in ((1.0, 0.0), (0.0, 1.0)):
        found = find_crack_events(run(lattice(), steps), direction)
        assert found.start is not None
        assert found.start.step == 3


def test_flanks_of_a_pre_crack_are_no_branch() -> None:
    """Nodes beside the pre-crack crack on both of its sides, linked around its tip."""
    flanks = [(10 + x, x, y) for x in range(6) for y in (-2, 2)] + [(9, 6, y) for y in (-1, 0, 1)]
    assert find_crack_events(run(lattice(), flanks)).branching is None


TRUNK = [(x, x, 0) for x in range(5, 16)]
ARMS = [(30 + 2 * k, 15 + k, side * k) for k in range(1, 14) for side in (-1, 1)]


def test_it_branches_once_at_the_place_and_time_of_its_first_fork() -> None:
    """A trunk from 5 to 15 mm, arms at 45 degrees: one place and one time, in numbers and in sentences."""
    found = crack(run(lattice(40, 41), TRUNK + ARMS, model=PLATE), along="right")
    (fork,), branching = found.forks, found.events.branching
    assert branching is not None
    assert (branching.time, branching.along) == (fork.time, fork.place[0])
    assert branching.along == pytest.approx(15e-3, abs=1e-3)
    said = summary_for_json(found)
    assert said["branching"]["step"] == said["forks"][0]["step"] == round(fork.time / 1e-6)  # type: ignore[call-overload,index]
    lines = summary_sentences(found)
    (first,), (second,) = ([line for line in lines if line.startswith(word)] for word in ("branching", "fork at"))
    assert first.split(", ")[1] == second.split(", ")[2].split(": ")[0]


@pytest.mark.parametrize("arms", [ARMS, ARMS[:6], []])
def test_studies_measure_branching_and_its_angle_of_one_fork(arms: list[tuple[int, int, int]]) -> None:
    """Both or neither, of arms that are long enough to be some, of shorter ones and of none."""
    measured = _crack_measures(crack(run(lattice(40, 41), TRUNK + arms, model=PLATE), along="right"))
    names = "branching", "branching_at", "fork_angle"
    assert [measured[name] is not None for name in names] == [arms is ARMS] * 3
    assert measured["branching_at"] == measured["fork_x"]
    assert measured["forks"] == (arms is ARMS)


def test_everything_is_of_the_step_that_is_asked_for() -> None:
    """Before the arms are five spacings long there is no fork, in no line of the output; and the tip is there."""
    results = run(lattice(40, 41), TRUNK + ARMS, model=PLATE)
    found = crack(results, 33, along="right")
    assert (found.forks, found.events.branching) == ([], None)
    assert found.events.final_tip == pytest.approx(16e-3)
    assert crack(results, 4).events.start is None
    assert crack(results, 4).events.first_break is None


def test_cracks_side_by_side_are_no_branch() -> None:
    """The same arms without the trunk that links them, and a branch behind the first tip."""
    assert find_crack_events(run(lattice(40, 41), [(5, 6, 3), *ARMS[4:]])).branching is None
    behind = [(5, 6, 0)] + [(10, x, y) for x in (1, 2, 3) for y in (1, 2, 3)]
    assert find_crack_events(run(lattice(), behind)).branching is None


def test_a_plate_that_does_not_break() -> None:
    found = find_crack_events(run(lattice(), []))
    assert (found.first_break, found.start, found.branching, found.split) == (None, None, None, None)
    assert (found.initial_tip, found.final_tip) == pytest.approx((4e-3, 4e-3))


def test_the_first_break_needs_no_cracked_node() -> None:
    nodes = lattice()
    writer = create_writer(None, nodes, alone, np.empty((0, 4)), {"time_step": 1e-6, "model": "{}"})
    writer.write(FrameRecord(9, 9e-6, None, Breaks(*np.array([[4], [50], [51]])), [], [], {}))
    found = find_crack_events(Results(writer.connection, "memory"))
    assert found.first_break is not None
    assert (found.first_break.step, found.start) == (4, None)


def test_a_crack_may_run_down() -> None:
    """Along -y, a plate without a crack at first: the first cracked node is the start."""
    nodes = lattice()._replace(cut=np.zeros(180, dtype=np.int64))
    found = find_crack_events(run(nodes, [(2, 9, 4), (3, 9, 3), (6, 9, 2)]), (0.0, -1.0))
    assert found.initial_tip is None
    assert found.start is not None
    assert (found.start.step, found.start.along) == (2, pytest.approx(-4e-3))
    assert found.final_tip == pytest.approx(-2e-3)


def test_a_chain_from_side_to_side_splits_the_plate_when_its_last_link_cracks() -> None:
    rest = [(3 + x, x, (x % 2)) for x in range(5, 19)]
    assert find_crack_events(run(lattice(), rest)).split is None
    found = find_crack_events(run(lattice(), [*rest, (30, 19, 0)])).split
    assert found is not None
    assert found.step == 30
    gap = [row for row in rest if row[1] != 12]
    assert find_crack_events(run(lattice(), [*gap, (30, 19, 0)])).split is None


def test_clusters_and_splits_of_nodes() -> None:
    nodes = lattice()
    marked = [at(nodes, x, 0) - 1 for x in (0, 1, 2, 5, 6)]
    cracked = np.isin(np.arange(180), marked)
    assert len(set(cluster_nodes(nodes.position[cracked], nodes.delta[cracked]).tolist())) == 2
    assert not plate_is_split(nodes, cracked)
    assert plate_is_split(nodes, nodes.position[:, 0] == nodes.position[3, 0])  # a column, top to bottom
    assert not plate_is_split(nodes, np.zeros(180, dtype=bool))


def test_separation_between_frames() -> None:
    results = run(lattice(), [(3, 5, 0), (7, 6, 0)])
    assert [int((damage_with_pre_cracks_at(results, step) > 0.35).sum()) for step in (0, 2, 3, 6, 7, 100)] == [
        5,
        5,
        6,
        6,
        7,
        7,
    ]


def test_a_pre_crack_is_not_damage(small_results: Path) -> None:
    """Damage is 0 at the start, and at the end the share of the bonds that pre-cracks left that broke."""
    with Results.open(small_results) as results:
        nodes, breaks = results.nodes(), results.breaks()
        broken = np.bincount(np.searchsorted(nodes.ids, breaks.node), minlength=len(nodes.ids))
        assert nodes.cut.max() > 0
        assert damage_with_pre_cracks_at(results, 0).max() == pytest.approx((nodes.cut / nodes.family).max())
        assert damage_without_pre_cracks_at(results, 0).max() == 0
        assert damage_without_pre_cracks_at(results, 60) == pytest.approx(broken / (nodes.family - nodes.cut))
        assert field_values(results, "damage", 0).max() == 0
        assert field_values(results, "separation", 0) == pytest.approx(results.field("damage", 0), abs=1e-7)
        assert csv_columns.of_frame(results, 0)["damage"].max() == 0
        (sql,) = (query.sql for query in queries(results) if "damaged" in query.asks)
        rows = {row[0]: row[3] for row in results.connection.execute(sql)}
        assert list(rows.values()) == pytest.approx(np.sort(damage_without_pre_cracks_at(results, 60))[::-1][:10])


def test_bonds_are_counted_in_pairs(small_results: Path) -> None:
    """By the run, by `pdpost bonds` and by the query that the database comes with, whose table has both directions."""
    with Results.open(small_results) as results:
        count = results.summary()["broken_bonds"]
        (sql,) = (query.sql for query in queries(results) if "broken" in query.asks)
        assert count > 0
        assert read_bond_pairs(results, 60).is_broken.sum() == count
        assert sum(bonds for _, bonds in results.connection.execute(sql)) == count
        assert len(results.breaks().step) == results.history()["broken"][-1] == 2 * count  # as the page on files says


def test_since_when_nodes_are_cracked(small_results: Path) -> None:
    """The same as separation step by step says, for thresholds that a share of the bonds meets exactly too."""
    with Results.open(small_results) as results:
        for threshold in (0.0, 0.25, 0.35, 0.5, 4 / 7):
            since = first_cracked_step_of_nodes(results, threshold)
            for step in (0, 20, 33, 60):
                cracked = damage_with_pre_cracks_at(results, step) > threshold
                assert np.array_equal(cracked, (since >= 0) & (since <= step))
        assert (first_cracked_step_of_nodes(results) > 0).sum() > 10


def test_a_ratio_to_G0_says_that_interfaces_have_others() -> None:
    joined = json.dumps(json.loads(PLATE) | {"interfaces": [{"faces": [[0.0, 0.0, 1.0, 0.0]], "G0": 1.0}]})
    said = [crack(run(lattice(40, 41), TRUNK + ARMS, model=model)).G0_remark for model in (PLATE, joined)]
    assert said[0] == ""
    assert "interfaces" in said[1]
    release = EnergyRelease(np.zeros(3), np.ones(3), np.array([50.0, 60.0, 70.0]), 100.0, 0.0, 60.0)
    (line,) = _energy_release_sentences(release, said[1])
    assert line.endswith(said[1])
    cracks = {"area": 1.0, "cost": 2.0, "spent": 1.0}
    assert "interfaces" not in crack_energy(cracks, "J/m")
    assert "interfaces" in crack_energy(cracks | {"interfaces": 1}, "J/m")


def test_pieces_beside_crumbs_are_said_to_be_few() -> None:
    """A plate of 100 mm^2: two pieces of 2 mm^2, and the rest in crumbs and cracked nodes."""
    piece = PlateFragment(2, 2e-6, (0.0, 0.0))
    crumbs = PlateFragments((piece, piece), 40, 60e-6, 36e-6)
    nothing, none = CrackEvents(None, None, None, None, None, None), np.zeros(0)
    summary = CrackPathSummary(
        0, 1e-8, "right", nothing, [], [], [], crumbs, 2000.0, EnergyRelease(none, none, none, 100.0)
    )
    pieces, said = summary_sentences(summary)
    assert pieces.startswith("2 pieces of 2, 2 mm^2")
    assert said.startswith("96% of the plate is in no piece")
    assert "60 mm^2 in 40 crumbs" in said
    whole = replace(summary, fragments=PlateFragments((piece, piece), 1, 1e-6, 1e-6))
    assert [line for line in summary_sentences(whole) if "no piece" in line] == []
    touching = replace(summary, fragments=crumbs._replace(body_count=3))
    pieces, said = summary_sentences(touching)
    assert pieces.startswith("2 pieces of all 3 bodies")
    assert said.startswith("96% of all bodies")
