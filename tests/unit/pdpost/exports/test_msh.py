"""Frames as Gmsh reads them: the same places, times and values, of nodes that come and go too."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pdpost.__main__ import main
from pdsolve.measures import fields
from pdsolve.results import Results


@pytest.fixture
def gmsh() -> Iterator[Any]:
    """Gmsh, quiet."""
    module = pytest.importorskip("gmsh", exc_type=OSError)
    module.initialize(interruptible=False)
    module.option.setNumber("General.Terminal", 0)
    yield module
    module.finalize()


@pytest.mark.slow
def test_gmsh_reads_what_was_stored(hybrid_results: Path, tmp_path: Path, gmsh: Any) -> None:
    path, corners = tmp_path / "views.msh", 4
    assert main(["export", str(hybrid_results), "-o", str(path), "-q", "--squares"]) == 0
    assert path.read_bytes().startswith(b"$MeshFormat\n2.2 1 8\n\1\0\0\0\n$EndMeshFormat\n")  # the order of bytes: 1
    gmsh.merge(str(path))
    tags, places, _ = gmsh.model.mesh.getNodes()
    place = dict(zip(tags.tolist(), places.reshape(-1, 3)[:, :2], strict=True))
    views = {}
    for tag in gmsh.view.getTags():
        name = gmsh.option.getString(f"View[{gmsh.view.getIndex(tag)}].Name")
        views[name] = tag
    set_of_a_condition = "velocity 0"
    assert set(views) == {"displacement", "velocity", "acceleration", "energy", "damage", set_of_a_condition}
    with Results.open(hybrid_results) as results:
        steps, times = results.frames()
        assert len(results.epochs()) > 1
        for frame in (0, len(steps) - 1):
            nodes, step = results.nodes(int(steps[frame])), int(steps[frame])
            for name, parts in (("damage", 1), ("displacement", 3)):
                _, points, data, time, count = gmsh.view.getModelData(views[name], frame)
                assert (time, count, len(points)) == (times[frame], parts, corners * len(nodes.ids))
                found = np.array([place[point] for point in points]).reshape(len(nodes.ids), corners, 2).mean(axis=1)
                assert np.allclose(found, nodes.position, atol=1e-12)
                values = np.array(data).reshape(-1, parts)[::corners]
                if name == "damage":
                    assert np.allclose(values[:, 0], fields.field_values(results, "damage", step), atol=1e-7)
                else:
                    assert np.array_equal(values[:, 0], results.field("ux", step).astype(float))
