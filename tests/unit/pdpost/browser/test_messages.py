"""Messages to the page hold what the commands of pdpost show."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from page_messages import unpacked

from pdpost.browser import messages
from pdpost.figures import colours
from pdsolve.measures import balance, fields, forces, histories
from pdsolve.measures.paths import crack_paths
from pdsolve.results import Results


@pytest.fixture
def results(small_results: Path) -> Results:
    with Results.open(small_results) as opened:
        yield opened


def read(results: Results, address: str, most: int | None = None) -> dict:
    return unpacked(messages.answer(results, address, most))


def test_frames_and_fields_are_those_of_the_run(results: Results) -> None:
    run = read(results, "run")
    steps, times = results.frames()
    assert (run["steps"], run["times"]) == (steps.tolist(), times.tolist())
    assert run["moments"][-1] == colours.at(results, int(steps[-1]))
    assert [field["name"] for field in run["fields"][:2]] == ["damage", "separation"]
    assert {"strain", "stress", "velocity"} <= {field["name"] for field in run["fields"]}
    assert "temperature" not in {field["name"] for field in run["fields"]}
    assert (run["status"], run["dimension"]) == ("finished", 2)


def test_nodes_are_where_they_are(results: Results) -> None:
    there, nodes = results.nodes(), read(results, "nodes/0")
    place = nodes["position"].reshape(-1, 3)[:, :2].astype(float) + nodes["centre"][:2]
    assert place == pytest.approx(there.position, abs=1e-9)
    assert nodes["ids"].tolist() == there.ids.tolist()
    assert nodes["spacing"] == pytest.approx(there.delta, rel=1e-6)


@pytest.mark.parametrize(
    ("name", "part"),
    [("damage", ""), ("displacement", "y"), ("energy", ""), ("stress", "mises"), ("strain", "largest")],
)
def test_values_and_colours_are_those_of_pictures(results: Results, name: str, part: str) -> None:
    step = int(results.frames()[0][-1])
    shown = read(results, f"field/{name}/{part or messages.SCALAR}/{step}")
    values, torn = (
        fields.field_values(results, name, step, part or None),
        fields.find_unreliable_nodes(results, name, step),
    )
    assert np.array_equal(shown["value"], np.where(torn, np.inf, values).astype(np.float32), equal_nan=True)
    assert torn.any() == (name in ("stress", "strain"))
    range_of = colours.colours(name, part, values[~torn])
    assert (shown["low"], shown["high"], shown["label"]) == (range_of.low, range_of.high, range_of.label)
    assert len(shown["legend"]) == torn.any() + bool((np.isnan(values) & ~torn).any())


def test_curves_are_those_of_the_measures(results: Results) -> None:
    found = {chart["title"]: chart for chart in read(results, "charts")["charts"]}
    energy = {curve["name"]: curve for curve in found["Energy"]["curves"]}
    books = balance.energy_balance(results)
    for name in ("kinetic", "strain", "dissipated", "total"):
        assert energy[name]["y"] == getattr(books, name).tolist()
    assert energy["put in"]["y"] == books.work.tolist()
    reactions = forces.read_condition_force_histories(results)
    assert [curve["y"] for curve in found["Forces"]["curves"]] == [
        one.force[:, one.main_axis].tolist() for one in reactions
    ]
    (usual,) = histories.usual_history_nodes(results)
    for address in (messages.USUAL, f"history/{usual}"):
        (chart,) = read(results, address)["charts"]
        assert chart["curves"][0]["y"] == histories.node_history(results, usual).value.tolist()


def test_paths_of_cracks_are_those_of_pdpost_crack(results: Results) -> None:
    step = int(results.frames()[0][-1])
    found, nodes = read(results, f"cracks/{step}"), results.nodes()
    centre = (nodes.position.min(axis=0) + nodes.position.max(axis=0)) / 2
    points = found["points"].reshape(-1, 3)[:, :2] + centre
    paths = [*crack_paths(results, step), [(0.0, 0.0), (8e-3, 0.0)]]
    assert [kind for kind, _ in found["lines"]] == ["path"] * (len(paths) - 1) + ["pre-crack"]
    assert len(paths) > 1
    assert points == pytest.approx(np.concatenate(paths), abs=1e-9)


@pytest.mark.parametrize(
    "address", ["", "nodes", "nodes/x", "nodes/-1", "field/damage/0", "charts/1", "meta", "../run"]
)
def test_an_unknown_address_has_no_message(results: Results, address: str) -> None:
    assert messages.answer(results, address) is None


@pytest.mark.parametrize(
    ("address", "words"),
    [("field/temperature/value/60", "temperature"), ("field/x/y/60", "'x' is unknown"), ("history/99999", "99999")],
)
def test_what_a_run_lacks_is_said(results: Results, address: str, words: str) -> None:
    assert words in read(results, address)["error"]


def test_fewer_nodes_are_wider_and_have_their_own_values(results: Results) -> None:
    step, count = int(results.frames()[0][-1]), len(results.nodes().ids)
    few, all_nodes = read(results, "nodes/0", 50), read(results, "nodes/0")
    rows = messages.shown_rows(count, 50)
    assert (len(few["ids"]), few["count"]) == (50, count)
    assert few["ids"].tolist() == all_nodes["ids"][rows].tolist()
    assert few["spacing"] == pytest.approx(all_nodes["spacing"][rows] * (count / 50) ** 0.5, rel=1e-6)
    values = read(results, f"field/displacement/y/{step}")
    assert read(results, f"field/displacement/y/{step}", 50)["value"].tolist() == values["value"][rows].tolist()
    assert read(results, f"field/displacement/y/{step}", 50)["high"] == values["high"]


def test_a_long_curve_keeps_its_peaks() -> None:
    y = np.zeros(100_000)
    y[[12_345, 77_777]] = 1.0, -1.0
    rows = messages._outline(y)
    assert len(rows) <= messages.MOST_POINTS + 2
    assert {0, 12_345, 77_777, 99_999} <= set(rows.tolist())
