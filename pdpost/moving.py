"""A field of a run as a moving picture."""

from __future__ import annotations

import io

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from PIL import Image

from pdpost import figures
from pdsolve.results import Results

FRAMES = 24
PAUSE = 1.5  # s on the last frame
PACE = 0.12  # s a frame


def gif(results: Results, name: str, dpi: float = 80) -> bytes:
    """An endless GIF of the field called `name`, of no more than 24 frames. Raises ResultsError without a frame."""
    steps, _ = results.frames()
    chosen = steps[np.unique(np.linspace(0, len(steps) - 1, min(FRAMES, len(steps))).round().astype(int))]
    pictures = []
    for step in chosen:
        figure = figures.draw(results, name, int(step))
        figure.set_dpi(dpi)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        pictures.append(Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy()).quantize(64))
    moving = io.BytesIO()
    pace = [int(1000 * PACE)] * (len(pictures) - 1) + [int(1000 * PAUSE)]
    pictures[0].save(moving, format="GIF", save_all=True, append_images=pictures[1:], duration=pace, loop=0)
    return moving.getvalue()
