"""A run as a moving picture of a field: GIF by itself, MP4 where ffmpeg is found."""

from __future__ import annotations

import io
import itertools
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path

import matplotlib
import numpy as np
from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from numpy.typing import NDArray
from PIL import Image

from pdpost import fields, figures
from pdpost.figures import FigureError
from pdpost.sheets import UNKNOWN, box_of, paint, shape, sheet
from pdsolve.results import Results, ResultsError

DPI = 110
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
    dpi: float = DPI,
    progress: Progress = iter,
) -> Iterator[Pixels]:
    """Pictures of the field `name` of every so many frames of a run, all of one size, with the same colours.

    `part`, `scale`, `largest` as in `figures.draw`; colours end at the usual largest value of all the pictures.
    Raises FieldError, and ResultsError, naming what there is.
    """
    part = fields.component(name, part)
    steps = results.frames()[0][::every].tolist()
    if not steps:
        raise ResultsError(f"{results.name}: found no frame yet, expected at least one")
    box = box_of(results, [shape(results, step, scale) for step in (steps if scale else steps[:1])])
    if largest is None and name != "damage":
        most = (figures.usual(_known(fields.values(results, name, step, part or None))) for step in steps)
        largest = max(most) or None
    on = sheet(box)
    canvas = FigureCanvasAgg(on.figure)
    on.figure.set_dpi(dpi)
    extremes = np.array([0.0]) if largest is None else np.array([-largest, largest])
    shown = figures.colours(name, part, extremes, largest)
    mappable = figures.bar(on, shown)
    for step in progress(steps):
        values = fields.values(results, name, step, part or None)
        with matplotlib.rc_context({"savefig.dpi": dpi}):
            cells = paint(on, shape(results, step, scale), values * shown.factor, mappable)
        on.axes.set_title(figures.title(results, name, part, step, scale))
        canvas.draw()
        yield np.asarray(canvas.buffer_rgba())[:, :, :3].copy()
        cells.remove()


def gif(
    results: Results,
    name: str = "damage",
    *,
    part: str | None = None,
    scale: float = 0.0,
    largest: float | None = None,
    every: int = 1,
    rate: float = RATE,
    dpi: float = DPI,
    progress: Progress = iter,
) -> bytes:
    """The frames of a run as a GIF that starts again, `rate` of them a second; see `frames`. The same bytes each
    time. Raises FieldError and ResultsError."""
    palette = _palette(name, fields.component(name, part))
    shots = frames(results, name, part=part, scale=scale, largest=largest, every=every, dpi=dpi, progress=progress)
    pictures = [Image.fromarray(shot).quantize(palette=palette, dither=Image.Dither.NONE) for shot in shots]
    pause = max(round(1000 / rate), 20)  # ms; viewers do not go below
    pauses = [pause] * (len(pictures) - 1) + [pause + round(1000 * REST)]
    file = io.BytesIO()
    pictures[0].save(
        file, "GIF", save_all=True, append_images=pictures[1:], duration=pauses, loop=0, optimize=False, disposal=1
    )
    return file.getvalue()


def mp4(shots: Iterable[Pixels], rate: float = RATE) -> bytes:
    """Pictures as an MP4 film, by ffmpeg. Raises FigureError if there is none, or if it fails."""
    program = ffmpeg()
    shots = iter(shots)
    first = next(shots)
    rows, columns, _ = first.shape
    # most players want even sizes and half the colours
    even = ["-vf", "pad=ceil(iw/2)*2:ceil(ih/2)*2:color=white", "-pix_fmt", "yuv420p"]
    given = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{columns}x{rows}", "-r", f"{rate:g}", "-i", "-"]
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryFile() as said:
        film = Path(folder) / "film.mp4"
        command = [program, "-v", "error", "-y", *given, *even, "-movflags", "+faststart", "-bitexact", str(film)]
        with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=said, stderr=said) as process:
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
            raise FigureError(f"{program}: found exit code {process.returncode} ({words}), expected a film")
        return film.read_bytes()


def ffmpeg() -> str:
    """Where ffmpeg is. Raises FigureError if it is nowhere."""
    program = shutil.which("ffmpeg")
    if program is None:
        raise FigureError("found no ffmpeg, expected it on the PATH for .mp4 (a .gif needs none)")
    return program


def check_format(path: Path) -> str:
    """ "gif" or "mp4", by the suffix of `path`. Raises FigureError if it is neither, or cannot be made here."""
    kind = path.suffix.lower().removeprefix(".")
    if kind not in ("gif", "mp4"):
        raise FigureError(f"{path}: found suffix '{path.suffix}', expected .gif or .mp4")
    if kind == "mp4":
        ffmpeg()
    return kind


def _palette(name: str, part: str) -> Image.Image:
    """256 colours: those of the field, then greys for what is written."""
    shown = figures.colours(name, part, np.zeros(1), 1.0)
    field = colormaps[shown.cmap](np.linspace(0, 1, SHADES))[:, :3]
    unknown = np.array([matplotlib.colors.to_rgb(UNKNOWN)])
    greys = np.repeat(np.linspace(0, 1, 255 - SHADES)[:, None], 3, axis=1)
    palette = Image.new("P", (1, 1))
    palette.putpalette((np.concatenate([field, unknown, greys]) * 255).round().astype(int).ravel().tolist())
    return palette


def _known(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return values[np.isfinite(values)]
