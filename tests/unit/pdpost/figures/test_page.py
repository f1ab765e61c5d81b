"""Parts of the page: where conditions act, a GIF of all frames, text that cannot become markup."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from tampered_databases import tampered

from pdpost.figures.crack_figure import crack
from pdpost.figures.page import report
from pdpost.figures.scene_figure import acted_on, scene
from pdsolve.measures import crack_summary
from pdsolve.results import Results


def test_where_conditions_act(small_results: Path) -> None:
    with Results.open(small_results) as results:
        nodes, model = results.nodes(), json.loads(results.model())
        figure = scene(results, model)
    top = acted_on(nodes, model["conditions"][0])
    assert nodes.position[top, 1].min() > 4.4e-3
    assert top.sum() == 42
    assert np.flatnonzero(acted_on(nodes, {"nodes": [3, 5]})).tolist() == [2, 4]
    labels = [text.get_text() for text in figure.legends[0].get_texts()]
    assert labels == ["252 nodes, 1 mm apart", "condition 0 (load)", "condition 1 (load)"]


@pytest.mark.slow
def test_text_of_the_model_is_no_markup(small_results: Path) -> None:
    with Results.open(small_results) as results:
        model = json.loads(results.model())
    model["source"] = "<script>alert(1)</script>"
    model["conditions"][0]["name"] = 'a" onerror="b<i>'
    with tampered(small_results) as connection:
        connection.execute("UPDATE meta SET value = ? WHERE key = 'model'", (json.dumps(model),))
        connection.execute("INSERT OR REPLACE INTO meta VALUES ('provenance', 0, '<img src=x>')")
    with Results.open(small_results) as results:
        page = report(results, "plate & crack")
    assert "<script" not in page
    assert "&lt;script&gt;" in page
    assert "<i>" not in page
    assert "<img src=x>" not in page
    assert "<h1>plate &amp; crack</h1>" in page


@pytest.mark.quick_cases(1)
@pytest.mark.parametrize(("step", "panels", "title"), [(0, 1, "No crack has grown at 0 µs"), (60, 3, "at 3 µs")])
def test_a_plate_without_a_crack_has_no_speed(small_results: Path, step: int, panels: int, title: str) -> None:
    with Results.open(small_results) as results:
        figure = crack(results, crack_summary.crack(results, step))
    assert len(figure.axes) == panels
    assert figure.axes[0].get_title().endswith(title)


def test_plates_of_many_nodes_are_images(small_results: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same greys at the same places as node by node, within a step of the image's colours."""
    with Results.open(small_results) as results:
        model, found = json.loads(results.model()), crack_summary.crack(results, 60)
        for draw in (lambda: crack(results, found), lambda: scene(results, model)):
            one_by_one = draw().axes[0]
            with monkeypatch.context() as patch:
                patch.setattr("pdsolve.measures.plate_geometry.MANY", 100)
                image = draw().axes[0]
            assert len(one_by_one.images) == 0
            assert len(image.images) == 1
            assert image.get_xlim() == pytest.approx(one_by_one.get_xlim())
            assert image.get_ylim() == pytest.approx(one_by_one.get_ylim())
    shown = np.asarray(image.images[0].get_array())
    rows = np.unique(shown[:, shown.shape[1] // 2], axis=0)
    assert len(rows) >= 2  # the loaded edges have colours of their own
