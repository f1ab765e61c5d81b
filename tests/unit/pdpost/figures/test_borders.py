"""The edge of a fine zone that moves, in pictures."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from numpy.typing import NDArray
from zoned_plates import struck

from pdpost.figures import animation, field_figure
from pdsolve.results import Results
from pdsolve.run.simulation import Options, simulate

LABEL = "zone of finer nodes"
MM = 1e3  # the pictures' unit


@pytest.fixture(scope="module")
def solved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run whose zone moves."""
    path = tmp_path_factory.mktemp("borders") / "struck.sqlite"
    simulate(struck("hybrid"), path, Options(threads=1)).close()
    return path


def lines(figure: Figure) -> list[NDArray[np.float64]]:
    """The sides (k, 2, 2) of the zone in a picture, m; none without one."""
    drawn = [found for found in figure.axes[0].collections if found.get_label() == LABEL]
    return [np.array(found.get_segments()) / MM for found in drawn if isinstance(found, LineCollection)]


@pytest.mark.slow
def test_it_is_around_the_finer_nodes(solved: Path) -> None:
    """All finer nodes are within it; of the others those alone that are on the zone's edge."""
    with Results.open(solved) as results:
        for step in (0, 170):
            (sides,) = lines(field_figure.field(results, "damage", step))
            zone = shapely.union_all(list(shapely.polygonize(list(shapely.linestrings(sides))).geoms))
            nodes = results.nodes(step)
            finer = nodes.delta < 3e-3
            apart = shapely.distance(shapely.points(nodes.position), zone)
            assert apart[finer].max() <= 1e-9
            within = zone.area
            assert within == pytest.approx(nodes.area[finer].sum(), rel=0.2)  # with coarse ones on its edge
            among = shapely.distance(shapely.points(nodes.position[~finer]), shapely.multipoints(nodes.position[finer]))
            assert np.all(among[apart[~finer] == 0] < 2.1e-3)


@pytest.mark.slow
def test_it_moves_and_opens_with_the_plate(solved: Path) -> None:
    """Longer in the end; deformed, no side is drawn across a crack."""
    with Results.open(solved) as results:
        begun, ended, moved = (
            lines(field_figure.field(results, "velocity", step, scale=scale))[0]
            for step, scale in ((0, 0.0), (170, 0.0), (170, 20.0))
        )
        assert len(ended) > 1.1 * len(begun)
        assert np.hypot(*(moved[:, 1] - moved[:, 0]).T).max() < 8e-3
        assert 0.9 * len(ended) < len(moved) < len(ended)
        shots = list(animation.frames(results, "damage", dpi=40))
        assert len({shot.tobytes() for shot in shots}) == len(shots)


def test_other_plates_have_none(small_results: Path) -> None:
    with Results.open(small_results) as results:
        assert not lines(field_figure.field(results))
