"""Films of a run."""

from __future__ import annotations

import io
import os
import stat
from pathlib import Path

import numpy as np
import pytest
from messages import naming
from numpy.typing import NDArray
from PIL import Image
from prescribed_results import block, results_of

from pdpost.figures import animation, field_figure, slice_figure
from pdpost.figures.colours import colours
from pdpost.figures.style import FigureError
from pdsolve.measures.slices import reliable_field_values
from pdsolve.results import Families, Results, ResultsError


@pytest.mark.slow
def test_a_gif_has_each_frame_and_the_same_bytes_each_time(small_results: Path) -> None:
    films = []
    for _ in range(2):
        with Results.open(small_results) as results:
            films.append(animation.gif(results, "damage", rate=5, dpi=60))
    assert films[0] == films[1]
    film = Image.open(io.BytesIO(films[0]))
    assert film.n_frames == 4
    pauses = []
    for number in range(4):
        film.seek(number)
        pauses.append(film.info["duration"])
    assert pauses == [200, 200, 200, 2200]


@pytest.mark.slow
def test_paper_is_white_and_ink_black(small_results: Path) -> None:
    with Results.open(small_results) as results:
        film = Image.open(io.BytesIO(animation.gif(results, "velocity", part="y", every=2)))
    shot = np.asarray(film.convert("RGB"))
    assert film.n_frames == 2
    assert shot[0, 0].tolist() == [255, 255, 255]
    assert shot.min() < 16


@pytest.mark.slow
def test_colours_are_the_same_in_all_frames(small_results: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A speed is drawn in the colour that the last frame's bar has for it."""
    drawn = []
    paint = animation.paint
    monkeypatch.setattr(
        animation,
        "paint",
        lambda on, where, values, colours, torn, cells: (
            drawn.append((values, colours.get_clim())) or paint(on, where, values, colours, torn, cells)
        ),
    )
    with Results.open(small_results) as results:
        shots = list(animation.frames(results, "velocity", dpi=50))
        fastest = [float(np.hypot(results.field("vx", s), results.field("vy", s)).max()) for s in (0, 20, 40, 60)]
    assert len({clim for _, clim in drawn}) == 1
    assert len({shot.shape for shot in shots}) == 1
    assert drawn[0][1][1] <= max(fastest) * 1.000001
    assert len({shot.tobytes() for shot in shots}) == 4


@pytest.mark.slow
def test_the_deformed_shape_stays_in_the_picture(small_results: Path) -> None:
    with Results.open(small_results) as results:
        shots = list(animation.frames(results, "damage", scale=5.0, dpi=50))
    assert len({shot.shape for shot in shots}) == 1


def test_a_film_needs_ffmpeg(small_results: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(FigureError, match=naming(found="ffmpeg", expected="PATH")):
        animation.check_format(Path("a.mp4"))
    assert animation.check_format(Path("a.gif")) == "gif"
    with pytest.raises(FigureError, match=naming("a.avi", found="suffix '.avi'", expected=".mp4")):
        animation.check_format(Path("a.avi"))


@pytest.mark.slow
def test_what_ffmpeg_is_given_and_what_it_says(
    small_results: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """A stand-in that keeps what comes in: as many bytes as the pictures have; its complaint is passed on."""
    program = tmp_path / "ffmpeg"
    program.write_text('#!/bin/sh\nfor last; do :; done\ncat > "$last"\n')
    program.chmod(program.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    with Results.open(small_results) as results:
        shots = list(animation.frames(results, dpi=40))
    assert animation.mp4(shots) == b"".join(shot.tobytes() for shot in shots)
    program.write_text("#!/bin/sh\necho no such codec >&2\nexit 3\n")
    with pytest.raises(FigureError, match=naming(found=("exit code 3", "no such codec"))):
        animation.mp4(shots)


@pytest.mark.slow
def test_lines_that_are_hidden_are_not_drawn(small_results: Path) -> None:
    with Results.open(small_results) as results:
        all_of, none_of = (field_figure.field(results, "damage", 60, hide=hide) for hide in ((), ("cracks",)))
        (film, *_), (bare, *_) = (animation.frames(results, "damage", dpi=50, hide=hide) for hide in ((), ("cracks",)))
    labels = [[line.get_label() for line in one.axes[0].collections] for one in (all_of, none_of)]
    assert "pre-crack" in labels[0]
    assert "pre-crack" not in labels[1]
    assert film.tobytes() != bare.tobytes()


def test_a_film_on_one_plane_counts_its_own_nodes_that_are_left_out() -> None:
    """Node 1 lies on the plane z = 0.5 mm, the last node in another layer; both have lost their bonds."""
    nodes, families = block()
    ends = [(int(node), int(nodes.ids[other])) for node, other in zip(*_pairs(families), strict=True)]
    broken = [(10, int(nodes.ids[a]), b) for a, b in ends if {int(nodes.ids[a]), b} & {1, len(nodes.ids)}]
    results = results_of(nodes, families, 1e-3 * nodes.position, broken)
    cut = ("z", 0.5e-3)
    drawing = slice_figure.Sections(results, "stress", "xx", colours("stress", "xx", np.ones(1), 1.0), cut)
    values = reliable_field_values(results, "stress", 10, "xx")
    (axes,) = (one for one in drawing.figure.axes if one.get_xlabel() or not one.get_ylabel())
    drawing.draw(10, values)
    (legend,) = drawing.figure.legends
    assert legend.get_texts()[0].get_text().endswith(": 1 nodes")
    assert "z = 0.5 mm" in axes.get_title()
    shots = list(animation.frames(results, "stress", part="xx", plane=cut, dpi=40))
    assert len(shots) == 1
    assert shots[0].shape[1] == 40 * 6
    with pytest.raises(ResultsError, match=r"z = 1 m"):
        list(animation.frames(results, "stress", part="xx", plane=("z", 1.0), dpi=40))


def _pairs(families: Families) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Rows of the two ends of each directed bond."""
    return np.repeat(np.arange(len(families.start) - 1), np.diff(families.start)), families.neighbour
