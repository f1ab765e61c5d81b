"""The notebooks of docs/ run from beginning to end, and what objects show there is what they are."""

from __future__ import annotations

import json
import re
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

import numpy as np
import pytest
from plates import ROOT

import pdpost
from pdmesh import Circle, Scene, box, build
from pdpost import crack_table
from pdpost.reading.studies import columns_of
from pdsolve import Model, Watch, resume, simulate
from pdsolve.results import Results, ResultsError

NOTEBOOKS = sorted((ROOT / "docs").rglob("*.ipynb"))


@pytest.mark.slow
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_and_warns_of_nothing(path: Path, tmp_path: Path) -> None:
    nbformat = pytest.importorskip("nbformat")
    nbclient = pytest.importorskip("nbclient")
    notebook = nbformat.read(path, 4)
    nbclient.NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(tmp_path)}}).execute()
    outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
    assert not [one.text for one in outputs if one.output_type == "stream" and "Warning" in one.text]
    assert any("image/png" in one.get("data", {}) for one in outputs)


def test_the_notebooks_are_five_and_hold_no_output() -> None:
    names = ["add_material", "load_displacement", "parameter_study", "stress_intensity"]
    assert [path.stem for path in NOTEBOOKS] == [f"{name}_in_python" for name in ("first_simulation", *names)]
    for path in NOTEBOOKS:
        cells = json.loads(path.read_text())["cells"]
        assert not any(cell.get("outputs") or cell.get("execution_count") for cell in cells)


def test_a_plate_shows_itself(small_plate: Model) -> None:
    scene = Scene(box(0, 0, 0.04, 0.02), 2e-3).hole(Circle(0.03, 0.01, 4e-3)).crack([(0, 0.01), (0.01, 0.01)])
    for shown, nodes in ((scene, 0), (build(scene), len(build(scene).grid)), (small_plate, len(small_plate.grid))):
        text = shown._repr_svg_()
        root = ElementTree.fromstring(text)
        paths = {}
        for one in root.iter("{http://www.w3.org/2000/svg}path"):
            paths.setdefault(one.attrib["class"], []).append(one.attrib["d"])
        assert sum(d.count("h0") for kind in ("node", "border") for d in paths.get(kind, [])) == nodes
        assert len(paths["crack"]) == 1
        if shown is not small_plate:
            assert len(re.findall("Z", paths["plate"][0])) == 2  # the outline and the hole
            assert float(root.attrib["width"]) / float(root.attrib["height"]) == pytest.approx(492 / 252)


@pytest.mark.slow
def test_results_show_their_last_damage_and_stand_for_themselves(small_results: Path) -> None:
    formatters = pytest.importorskip("IPython.core.formatters").DisplayFormatter()
    pdpost.load_ipython_extension(SimpleNamespace(display_formatter=formatters))
    with Results.open(small_results) as results:
        assert repr(results) == f"<Results {small_results}: 252 nodes, 4 frames, finished>"
        assert formatters.format(results)[0]["image/png"].startswith(b"\x89PNG")
    assert repr(results) == f"<Results {small_results}>"  # closed


def test_tables_are_columns_of_arrays(small_results: Path) -> None:
    with Results.open(small_results) as results:
        table = crack_table(results)
        assert set(results.history().dtype.names or ()) >= {"time", "dissipated"}  # pandas takes a structured array
    assert list(table)[:3] == ["branch", "time, s", "x, m"]
    assert all(isinstance(column, np.ndarray) and len(column) == table.rows for column in table.values())
    small = columns_of(("a", "b<", "c"), [(1, "x", 2.5), (2, None, None)])
    assert small["a"].dtype.kind == "i"
    assert small["b<"].tolist() == ["x", None]
    assert np.isnan(small["c"][1])
    assert "<th>b&lt;</th>" in small._repr_html_()
    assert "<td>2.5</td>" in small._repr_html_()


def test_a_frame_is_columns_of_arrays(small_results: Path) -> None:
    with Results.open(small_results) as results:
        steps = results.frames()[0].tolist()
        table, first = results.frame(), results.frame(steps[0])
        assert list(table) == ["node", "x", "y", *results.stored(steps[-1])]
        assert all(len(column) == 252 for column in table.values())
        assert np.array_equal(table["damage"], results.field("damage", steps[-1]))
        assert np.array_equal(first["ux"], results.field("ux", steps[0]))
        assert table["damage"].max() > first["damage"].max()
        with pytest.raises(ResultsError, match=str(steps[-1])):
            results.frame(steps[-1] + 1)


def test_a_run_is_stopped_and_goes_on_from_a_script(small_plate: Model, tmp_path: Path) -> None:
    path = tmp_path / "run.sqlite"
    with Watch(quiet=True) as watch:

        def stop(progress: object) -> bool:
            watch(progress)  # type: ignore[arg-type]
            return True

        with simulate(small_plate, path, watch=stop) as results:
            assert results.meta()["status"] == "interrupted"
    with Watch(quiet=True) as watch, resume(path, watch=watch) as results, simulate(small_plate) as whole:
        assert results.meta()["status"] == "finished"
        assert results.breaks().node.tolist() == whole.breaks().node.tolist()
