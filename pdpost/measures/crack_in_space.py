"""A summary of the cracks of a body: their surface, its area and energy, its front, and the fragments."""

from __future__ import annotations

from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.material import Material
from pdmesh.model.output_fields import CRACKED
from pdpost.measures.crack_faces import Surface, opened, surface
from pdpost.measures.crack_fronts import Polyline, fronts, length, speeds
from pdpost.measures.fragments_in_space import Fragments, fragments
from pdpost.measures.waves import rayleigh_of
from pdpost.reading.embedded_model import at_rest, read
from pdpost.reading.frame_steps import frames, last_step
from pdpost.reading.time_text import time_text
from pdsolve.results import Results

LISTED = 6  # fragments in sentences
RANGE = (10, 50, 90)  # percentiles of speeds


@dataclass(frozen=True)
class SummaryInSpace:
    """What the cracks of a body did until a step."""

    step: int
    surface: Surface
    frame_step: NDArray[np.int64]  # (t,) frames until the step
    time: NDArray[np.float64]  # (t,) s
    area: NDArray[np.float64]  # (t,) m^2, that opened during the run
    dissipated: NDArray[np.float64]  # (t,) J
    front_length: NDArray[np.float64]  # (t,) m
    fronts: list[Polyline]  # at the step, the longest first
    speed: NDArray[np.float64]  # (f,) m/s, of the front over each face; NaN where it is not known or at rest
    junctions: int  # edges where more than two faces meet: a crack branched there, or two met
    fragments: Fragments
    rayleigh_speed: float  # m/s
    G0: float  # J/m^2, of the body's own material

    @property
    def release(self) -> NDArray[np.float64]:
        """Dissipated energy over the area that opened (t,), J/m^2; NaN before anything opened."""
        opened = self.area > 0
        return np.where(opened, self.dissipated / np.where(opened, self.area, 1.0), np.nan)


class _Solid(msgspec.Struct):
    """The key of the grid file that the fracture energy comes from."""

    material: Material


def crack_in_space(results: Results, step: int | None = None, threshold: float = CRACKED) -> SummaryInSpace:
    """The cracks of a body until `step` (default: the last). Nodes are cracked above the damage `threshold`.

    Raises ResultsError if there is no frame yet.
    """
    step = last_step(results) if step is None else step
    steps, times = frames(results)
    past = steps <= step
    steps, times = steps[past], times[past]
    found = opened(results, step, threshold)
    cracks = surface(results, step, found)
    books = results.history()
    last = step * float(results.meta()["time_step"])
    return SummaryInSpace(
        step=step,
        surface=cracks,
        frame_step=steps,
        time=times,
        area=cracks.area_at(times),
        dissipated=np.interp(times, books["time"], books["dissipated"]),
        front_length=np.array([sum(map(length, fronts(cracks, time))) for time in times]),
        fronts=fronts(cracks, last),
        speed=front_speeds(results, cracks),
        junctions=int((np.bincount(cracks.sides.ravel(), minlength=len(cracks.edges)) > 2).sum()),
        fragments=fragments(results, step, found),
        rayleigh_speed=rayleigh_of(results),
        G0=read(results, _Solid).material.G0,
    )


def front_speeds(results: Results, cracks: Surface) -> NDArray[np.float64]:
    """Speed of the front over each face (f,), m/s; NaN at rest and where it is not known."""
    if not len(cracks.faces) or at_rest(results):
        return np.full(len(cracks.faces), np.nan)
    speed = speeds(cracks)
    return np.where(speed > rayleigh_of(results), np.nan, speed)


def _speeds(found: SummaryInSpace) -> NDArray[np.float64] | None:
    """The 10th, 50th and 90th percentile of the front's speed, weighted by area, m/s; None if it is nowhere known."""
    known = np.isfinite(found.speed)
    if not known.any():
        return None
    order = np.argsort(found.speed[known])
    share = np.cumsum(found.surface.area[known][order])
    at = np.searchsorted(share, np.array(RANGE) / 100 * share[-1]).clip(max=len(order) - 1)
    return np.asarray(found.speed[known][order][at])


def numbers(found: SummaryInSpace) -> dict[str, object]:
    """The summary as plain numbers, for JSON."""
    speed = _speeds(found)
    grown = found.surface.grown
    return {
        "step": found.step,
        "faces": len(grown),
        "area": float(found.surface.area[grown].sum()),
        "pre_crack_area": float(found.surface.area[~grown].sum()),
        "dissipated_over_area": float(found.release[-1]),
        "G0": found.G0,
        "first_opened": float(found.surface.time[grown][0]) if grown.any() else None,
        "speed": None if speed is None else dict(zip(("low", "median", "high"), speed.tolist(), strict=True)),
        "rayleigh_speed": found.rayleigh_speed,
        "front_length": sum(map(length, found.fronts)),
        "fronts": found.fronts,
        "junctions": found.junctions,
        "fragments": found.fragments._asdict() | {"pieces": [each._asdict() for each in found.fragments.pieces]},
    }


def table(found: SummaryInSpace) -> tuple[tuple[str, ...], list[tuple[object, ...]]]:
    """Header and rows: area, energy and front of every frame."""
    header = ("step", "time, s", "area, m^2", "dissipated, J", "dissipated/area, J/m^2", "front, m")
    columns = found.frame_step, found.time, found.area, found.dissipated, found.release, found.front_length
    return header, list(zip(*(column.tolist() for column in columns), strict=True))


def _front(found: SummaryInSpace) -> str:
    """Words for the front at the end."""
    long = [length(line) * 1e3 for line in found.fronts]
    if not long:
        return "front at the end: none, the cracks end at the surface of the body"
    parts = "" if len(long) == 1 else f" in {len(long)} lines, the longest {long[0]:.4g} mm"
    return f"front at the end: {sum(long):.4g} mm{parts}"


def sentences(found: SummaryInSpace) -> list[str]:
    """The summary for a reader, a line each."""
    grown = found.surface.grown
    if not grown.any():
        return ["nothing opened"]
    area, speed = float(found.surface.area[grown].sum()), _speeds(found)
    lines = [
        f"area that opened: {area * 1e6:.4g} mm^2, the first at {time_text(float(found.surface.time[grown][0]))}",
        f"dissipated over area, of G0: {found.release[-1] / found.G0:.3g}",
        _front(found),
    ]
    if speed is not None:
        low, middle, high = speed
        lines.append(
            f"speed of the front: {middle:.4g} m/s in the median ({middle / found.rayleigh_speed:.2f} of the Rayleigh"
            f" speed), {low:.4g} to {high:.4g} m/s over four fifths of the area"
        )
    if found.junctions:
        lines.append(f"edges between more than two faces: {found.junctions}; the crack branched there, or cracks met")
    pieces = found.fragments.pieces
    if len(pieces) > 1:
        some = ", ".join(f"{piece.mass * 1e3:.4g}" for piece in pieces[:LISTED])
        more = f" and {len(pieces) - LISTED} lighter ones" if len(pieces) > LISTED else ""
        lines.append(f"{len(pieces)} fragments of {some} g{more}, {found.fragments.crumbs_mass * 1e3:.3g} g in crumbs")
    return lines
