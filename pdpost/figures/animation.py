"""Films of a field: GIF directly, MP4 if ffmpeg is installed."""

from __future__ import annotations

import io
import itertools
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Collection, Iterable, Iterator
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from numpy.typing import NDArray
from PIL import Image

from pdmesh import trust
from pdmesh.plain_figure import FigureError
from pdpost.figures import colours, crack_render, field_figure, slice_figure
from pdpost.figures.raster import Box
from pdpost.figures.sheets import border, box_of, grown, hidden, legend, mark, paint, painted_cells, seen, shape, sheet
from pdpost.figures.style import EDGE, TORN, UNKNOWN
from pdsolve.measures import fields
from pdsolve.measures.frame_steps import chosen
from pdsolve.measures.slices import expect_3d_body
from pdsolve.results import Results

DPI = 110
LINE = 0.18  # inches of a line of the legend
RATE = 10.0  # frames a second
REST = 2.0  # s: how long a GIF stays at its end
SHADES = 223  # of the 256 colours of a GIF, for the field; the others are greys, far enough apart for Pillow

Pixels = NDArray[np.uint8]  # (rows, columns, 3)
Progress = Callable[[list[int]], Iterable[int]]  # hands on what it is given and may count it


def frames(
    results: Results,
    name: str = "damage",
    *,
    part: str | None = None,
    scale: float = 0.0,
    largest: float | None = None,
    every: int = 1,
    window: Box | None = None,
    dpi: float = DPI,
    progress: Progress = iter,
    hide: Collection[str] = (),
    clip: tuple[str, float] | None = None,
    plane: tuple[str, float] | None = None,
) -> Iterator[Pixels]:
    """Pictures of the field `name`, one for every `every`-th frame of a run, all of one size and colour range.

    `part`, `scale`, `largest` (usually the usual one of all frames), `window` and `hide` are those of
    `field_figure.field`. A body in space is shown undeformed: on three planes, on the plane `plane` (axis, m), or cut
    open by the plane `clip`, with its cracks. Raises FieldError, ResultsError.
    """
    part = fields.choose_component(name, part, results.dimension)
    if results.dimension == 3 or clip is not None or plane is not None:
        yield from _in_space(results, name, part, every, dpi, largest, progress, clip=clip, plane=plane)
        return
    steps = chosen(results, every)
    still = hidden(shape(results, steps[0], 0.0), hide)
    box = window or box_of([shape(results, step, scale, still) for step in (steps if scale else steps[:1])])
    extremes = np.zeros(1) if largest is None else np.array([-largest, largest])
    if largest is None:
        ranges = [_range(results, name, step, part, box) for step in steps]
        extremes = np.ravel([ends for _, *ends in ranges])
        largest = None if name in colours.SHARES else max(usual for usual, *_ in ranges) or None
    shot = field_figure.values_of(results, name, steps[-1], part)  # where most is torn
    words = [(colour, words.split(":")[0]) for colour, words in field_figure.explained(shot)]
    last = still._replace(grown=hidden(shape(results, steps[-1], 0.0), hide).grown)
    lines = bool(len(still.plate.pre_cracks)) + bool(len(last.grown)) + still.plate.has_moving_zone
    on = sheet(box, room=LINE * (len(words) + lines))
    canvas, on.figure.dpi = FigureCanvasAgg(on.figure), dpi
    range_of = colours.colours(name, part, extremes, largest)
    mappable = field_figure.bar(on, range_of)
    mark(on, still._replace(scale=scale))
    edge = border(on, still) + ([] if len(still.grown) else grown(on, last))
    legend(on, *words, columns=1)
    for artist in edge:
        artist.remove()
    before = painted = None
    for step in progress(steps):
        shot = field_figure.values_of(results, name, step, part)
        with matplotlib.rc_context({"savefig.dpi": dpi}):
            still = hidden(shape(results, step, scale, still), hide)
            if scale or still.cells is not before:  # cells that do not move are laid out once
                before, painted = still.cells, painted_cells(on, still)
            cells = paint(on, still, shot.values * range_of.factor, mappable, shot.torn, painted)
            cells += border(on, still) + grown(on, still)
        on.axes.set_title(colours.title(results, name, part, step, scale))
        canvas.draw()
        yield np.asarray(canvas.buffer_rgba())[:, :, :3].copy()
        for artist in cells:
            artist.remove()


def _in_space(
    results: Results,
    name: str,
    part: str,
    every: int,
    dpi: float,
    largest: float | None,
    progress: Progress,
    *,
    clip: tuple[str, float] | None,
    plane: tuple[str, float] | None,
) -> Iterator[Pixels]:
    """Pictures of a body: cut open by a plane, or on one plane or three."""
    expect_3d_body(results)
    if clip is None:
        yield from slice_figure.film(results, name, part, every, dpi, largest, progress, plane)
        return
    steps = chosen(results, every)
    if largest is None:
        largest, *_ = slice_figure.field_range(results, name, part, steps)
    yield from crack_render.film(results, name, part, progress(steps), clip, dpi, largest)


def gif(
    results: Results,
    name: str = "damage",
    *,
    part: str | None = None,
    scale: float = 0.0,
    largest: float | None = None,
    every: int = 1,
    rate: float = RATE,
    window: Box | None = None,
    dpi: float = DPI,
    progress: Progress = iter,
    hide: Collection[str] = (),
    clip: tuple[str, float] | None = None,
    plane: tuple[str, float] | None = None,
) -> bytes:
    """The `frames` of a run as a GIF that repeats, at `rate` frames a second.

    The same run gives the same bytes. Raises FieldError and ResultsError.
    """
    how: dict[str, Any] = {"part": part, "scale": scale, "largest": largest, "every": every, "window": window}
    shots: Iterable[Pixels] = frames(
        results, name, dpi=dpi, progress=progress, hide=hide, clip=clip, plane=plane, **how
    )
    if clip is None:
        # the colours of the field, then greys for text
        shown = colours.colours(name, fields.choose_component(name, part, results.dimension), np.zeros(1), 1.0)
        field = colormaps[shown.cmap](np.linspace(0, 1, SHADES))[:, :3]
        unknown = np.array([matplotlib.colors.to_rgb(colour) for colour in (UNKNOWN, TORN, EDGE)])
        greys = np.repeat(np.linspace(0, 1, 253 - SHADES)[:, None], 3, axis=1)
        palette = Image.new("P", (1, 1))
        palette.putpalette((np.concatenate([field, unknown, greys]) * 255).round().astype(int).ravel().tolist())
    else:  # shades, and the colours of cracks
        shots = list(shots)
        palette = Image.fromarray(shots[-1]).quantize(256)
    pictures = [Image.fromarray(shot).quantize(palette=palette, dither=Image.Dither.NONE) for shot in shots]
    pause = max(round(1000 / rate), 20)  # ms; viewers do not go below
    pauses = [pause] * (len(pictures) - 1) + [pause + round(1000 * REST)]
    file = io.BytesIO()
    pictures[0].save(
        file, "GIF", save_all=True, append_images=pictures[1:], duration=pauses, loop=0, optimize=False, disposal=1
    )
    return file.getvalue()


def mp4(shots: Iterable[Pixels], rate: float = RATE) -> bytes:
    """Pictures as an MP4 film, encoded by ffmpeg. Raises FigureError if ffmpeg is missing or fails."""
    program = ffmpeg()
    shots = iter(shots)
    first = next(shots)
    rows, columns, _ = first.shape
    # most players want even sizes and half the colours
    even = ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2:color=white", "-pix_fmt", "yuv420p"]
    input_options = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{columns}x{rows}", "-r", f"{rate:g}", "-i", "-"]
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryFile() as said:
        film = Path(folder) / "film.mp4"
        command = [
            program,
            "-v",
            "error",
            "-y",
            *input_options,
            *even,
            "-movflags",
            "+faststart",
            "-bitexact",
            str(film),
        ]
        with subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=said, stderr=said, env=trust.environment()
        ) as process:
            assert process.stdin is not None
            try:
                for shot in itertools.chain([first], shots):
                    process.stdin.write(shot.tobytes())
                process.stdin.close()
            except BrokenPipeError:
                pass
            except BaseException:
                process.kill()
                raise
        said.seek(0)
        words = " ".join(said.read().decode(errors="replace").split())
        if process.returncode or not film.exists():
            raise FigureError(
                f"{program} failed with exit code {process.returncode} ({words}); check the film's size and format"
            )
        return film.read_bytes()


def ffmpeg() -> str:
    """Path of ffmpeg. Raises FigureError if it is not installed."""
    program = shutil.which("ffmpeg", path=trust.environment().get("PATH", os.defpath))
    if program is None:
        raise FigureError("ffmpeg is missing, which .mp4 needs; install it on the PATH, or use .gif, which needs none")
    return program


def check_format(path: Path) -> str:
    """The format of the suffix of `path`: "gif" or "mp4". Raises FigureError for others, and for MP4 without ffmpeg."""
    kind = path.suffix.lower().removeprefix(".")
    if kind not in ("gif", "mp4"):
        raise FigureError(f"{path}: suffix '{path.suffix}' is not known; use .gif or .mp4")
    if kind == "mp4":
        ffmpeg()
    return kind


def _range(results: Results, name: str, step: int, part: str, box: Box) -> tuple[float, float, float]:
    """End of the colour range of a frame, and its smallest and largest value, over the nodes in an undeformed box."""
    shot = field_figure.values_of(results, name, step, part)
    values = shot.values[seen(results.nodes(step).position, box) & ~shot.torn]
    finite = values[np.isfinite(values)]
    ends = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)
    return colours.usual(finite), *ends
