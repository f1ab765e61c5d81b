"""The frames of a run: steps, times in words, and stored fields with the option that stores a missing one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.output_fields import of_dimension
from pdsolve.results import Results, ResultsError

SLOW, LONG = 9.9995e-3, 0.1  # s: from here on a time is told in milliseconds, in seconds
HOURS = 9999.5  # s: from here on in whole seconds, as four digits would be a power of ten
OF_DIFFUSION = ("concentration", "content", "solid", "temperature")


def frames(results: Results) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Steps (t,) and times (t,), s, of the frames. Raises ResultsError if there is none yet."""
    steps, times = results.frames()
    if not len(steps):
        raise ResultsError(f"{results.name} has no frame yet; wait for the first")
    return steps, times


def chosen(results: Results, every: int) -> list[int]:
    """Steps of every `every`-th frame, beginning with the first. Raises ResultsError if there is no frame yet."""
    steps: list[int] = frames(results)[0][::every].tolist()
    return steps


def last_frame(results: Results) -> int:
    """Step of the last frame. Raises ResultsError if there is none yet."""
    return int(frames(results)[0][-1])


def last_step(results: Results) -> int:
    """The last step of the ledger, which may follow the last frame. Raises ResultsError if there is no frame yet."""
    steps = results.history()["step"]
    return int(steps[-1]) if len(steps) else last_frame(results)


def time_text(seconds: float, form: str = ".4g", micro: str = "us") -> str:
    """A time (s) as text in microseconds, or in milliseconds or seconds if it is long."""
    if abs(seconds) >= HOURS:
        return f"{seconds:.0f} s"
    if abs(seconds) >= LONG:
        return f"{seconds:{form}} s"
    return f"{seconds * 1e3:{form}} ms" if abs(seconds) >= SLOW else f"{seconds * 1e6:{form}} {micro}"


def moment_text(time: float, counts_load_steps: bool, micro: str = "us") -> str:
    """A time (s) as text, or the number of a load step where times are those of load steps."""
    return f"load step {time:.4g}" if counts_load_steps else time_text(time, micro=micro)


def scalar(results: Results, name: str, step: int) -> NDArray[np.float64]:
    """A field (n,) of the frame at `step`, SI. Raises ResultsError naming the stored fields."""
    return _columns(results, name, step)[0]


def vector(results: Results, name: str, step: int) -> NDArray[np.float64]:
    """Components (n, c) of a field of the frame at `step`, SI: x and y, in a body also z.

    Raises ResultsError naming the stored fields.
    """
    return np.column_stack(_columns(results, name, step))


def has_diffusion_only(results: Results) -> bool:
    """Whether the model is one of diffusion alone."""
    return len(results.masses()) > 0 and not len(results.history())  # both are noted from the start on


def _columns(results: Results, name: str, step: int) -> list[NDArray[np.float64]]:
    columns = of_dimension(name, results.dimension)
    stored = results.stored(step)
    missing = [column for column in columns if column not in stored]
    if missing and stored:
        expect_physics_of(results, name)
        expected = f"one of {', '.join(stored)} (pdsolve --fields +{','.join(missing)} stores it)"
        raise ResultsError(f"{results.name} has no field '{missing[0]}'; use {expected}")
    return [results.field(column, step).astype(float) for column in columns]


def expect_physics_of(results: Results, name: str) -> None:
    """Raise ResultsError if the model has no field of this name, whatever is stored."""
    if (name in OF_DIFFUSION) != has_diffusion_only(results):
        physics, needed_physics = ("diffusion", "mechanics")[:: 1 - 2 * (name in OF_DIFFUSION)]
        shown = f" (this has {', '.join(OF_DIFFUSION)})" if physics == "diffusion" else ""
        raise ResultsError(f"{results.name} is of a model of {physics}; {name} needs one of {needed_physics}{shown}")
