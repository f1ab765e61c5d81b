"""Parts of the page: where conditions act, a GIF of all frames, text that cannot become markup."""

from __future__ import annotations

import json
import sqlite3
from pathlib import Path

import numpy as np

from pdpost.report import report
from pdpost.scene_figure import acted_on, scene
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


def test_text_of_the_model_is_no_markup(small_results: Path) -> None:
    with Results.open(small_results) as results:
        model = json.loads(results.model())
    model["source"] = "<script>alert(1)</script>"
    model["conditions"][0]["name"] = 'a" onerror="b<i>'
    connection = sqlite3.connect(small_results)
    connection.execute("UPDATE meta SET value = ? WHERE key = 'model'", (json.dumps(model),))
    connection.execute("INSERT OR REPLACE INTO meta VALUES ('provenance', '<img src=x>')")
    connection.commit()
    connection.close()
    with Results.open(small_results) as results:
        page = report(results, "plate & crack")
    assert "<script" not in page
    assert "&lt;script&gt;" in page
    assert "<i>" not in page
    assert "<img src=x>" not in page
    assert "<h1>plate &amp; crack</h1>" in page
