"""A summary of the cracks of a body: their surface, its area and energy, its front, and the fragments."""

from __future__ import annotations

from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.material import Material
from pdsolve.measures.crack_faces import CrackSurface, build_crack_surface, find_opened_face_neighbours
from pdsolve.measures.crack_fronts import Polyline, estimate_front_speed_at_faces, front_lines_at, line_length
from pdsolve.measures.embedded_model import at_rest, counts_load_steps, own_G0, read
from pdsolve.measures.fatigue import cycles_at_times
from pdsolve.measures.fragments import BodyFragments, find_body_fragments
from pdsolve.measures.frame_steps import frames, last_step, moment_text
from pdsolve.measures.json_keys import fields_by_json_key
from pdsolve.measures.speed import RAYLEIGH, limiting_speed
from pdsolve.results import Results

LISTED = 6  # fragments in sentences
RANGE = (10, 50, 90)  # percentiles of speeds


@dataclass(frozen=True)
class CrackSurfaceSummary:
    """What the cracks of a body did until a step."""

    step: int
    surface: CrackSurface
    frame_step: NDArray[np.int64]  # (t,) frames until the step
    frame_time: NDArray[np.float64]  # (t,) s
    grown_area: NDArray[np.float64]  # (t,) m^2, that opened during the run
    dissipated_energy: NDArray[np.float64]  # (t,) J
    front_length: NDArray[np.float64]  # (t,) m
    front_lines: list[Polyline]  # at the step, the longest first
    front_speed: NDArray[np.float64]  # (f,) m/s, of the front over each face; NaN where it is not known or at rest
    junction_edge_count: int  # edges where more than two faces meet: a crack branched there, or two met
    fragments: BodyFragments
    limiting_speed: float  # m/s: of waves, that cracks stay below
    G0: float  # J/m^2, of the body's own material
    G0_remark: str = ""  # on ratios to G0
    limiting_speed_name: str = RAYLEIGH
    counts_load_steps: bool = False  # times are the numbers of load steps
    cycles: NDArray[np.float64] | None = None  # (t,) of the frames of a run of fatigue, whose energy is no G0

    @property
    def dissipated_energy_per_area(self) -> NDArray[np.float64]:
        """Dissipated energy over the area that opened (t,), J/m^2; NaN before anything opened."""
        opened = self.grown_area > 0
        return np.where(opened, self.dissipated_energy / np.where(opened, self.grown_area, 1.0), np.nan)


class _FractureEnergyGridFileKeys(msgspec.Struct):
    """The key of the grid file that the fracture energy comes from."""

    material: Material


def crack_3d(results: Results, step: int | None = None, threshold: float | None = None) -> CrackSurfaceSummary:
    """The cracks of a body until `step` (default: the last). Nodes are cracked above the damage `threshold`.

    Raises ResultsError if there is no frame yet.
    """
    step = last_step(results) if step is None else step
    steps, times = frames(results)
    past = steps <= step
    steps, times = steps[past], times[past]
    parted_pairs = find_opened_face_neighbours(results, step, threshold)
    cracks = build_crack_surface(results, step, parted_pairs)
    energy_balance = results.history()
    limit = limiting_speed(results)
    last = step * float(results.meta()["time_step"])
    return CrackSurfaceSummary(
        step=step,
        surface=cracks,
        frame_step=steps,
        frame_time=times,
        grown_area=cracks.grown_area_at(times),
        dissipated_energy=np.interp(times, energy_balance["time"], energy_balance["dissipated"]),
        front_length=np.array([sum(map(line_length, front_lines_at(cracks, time))) for time in times]),
        front_lines=front_lines_at(cracks, last),
        front_speed=front_speeds_below_limit(results, cracks),
        junction_edge_count=int((np.bincount(cracks.face_edges.ravel(), minlength=len(cracks.edge_corners)) > 2).sum()),
        fragments=find_body_fragments(results, step, parted_pairs),
        limiting_speed=limit.value,
        G0=read(results, _FractureEnergyGridFileKeys).material.G0,
        G0_remark=own_G0(results),
        limiting_speed_name=limit.name,
        counts_load_steps=counts_load_steps(results),
        cycles=cycles_at_times(results, times),
    )


def front_speeds_below_limit(results: Results, cracks: CrackSurface) -> NDArray[np.float64]:
    """Speed of the front over each face (f,), m/s; NaN at rest and where it is not known."""
    if not len(cracks.face_corners) or at_rest(results):
        return np.full(len(cracks.face_corners), np.nan)
    speed = estimate_front_speed_at_faces(cracks)
    return np.where(speed > limiting_speed(results).value, np.nan, speed)


def _front_speed_percentiles(summary: CrackSurfaceSummary) -> NDArray[np.float64] | None:
    """The 10th, 50th and 90th percentile of the front's speed, weighted by area, m/s; None if it is nowhere known."""
    finite = np.isfinite(summary.front_speed)
    if not finite.any():
        return None
    order = np.argsort(summary.front_speed[finite])
    share = np.cumsum(summary.surface.face_area[finite][order])
    at = np.searchsorted(share, np.array(RANGE) / 100 * share[-1]).clip(max=len(order) - 1)
    return np.asarray(summary.front_speed[finite][order][at])


def summary_for_json(summary: CrackSurfaceSummary) -> dict[str, object]:
    """The summary as plain numbers, for JSON."""
    speed = _front_speed_percentiles(summary)
    new_faces = summary.surface.face_opened_during_run
    pieces = [fields_by_json_key(piece) for piece in summary.fragments.pieces]
    return {
        "step": summary.step,
        "faces": len(new_faces),
        "area": float(summary.surface.face_area[new_faces].sum()),
        "pre_crack_area": float(summary.surface.face_area[~new_faces].sum()),
        "dissipated_over_area": float(summary.dissipated_energy_per_area[-1]),
        "G0": summary.G0,
        "first_opened": float(summary.surface.opening_time[new_faces][0]) if new_faces.any() else None,
        "speed": None if speed is None else dict(zip(("low", "median", "high"), speed.tolist(), strict=True)),
        summary.limiting_speed_name.lower().replace(" ", "_"): summary.limiting_speed,
        "front_length": sum(map(line_length, summary.front_lines)),
        "fronts": summary.front_lines,
        "junctions": summary.junction_edge_count,
        "fragments": fields_by_json_key(summary.fragments) | {"pieces": pieces},
    }


def frame_table(summary: CrackSurfaceSummary) -> tuple[tuple[str, ...], list[tuple[object, ...]]]:
    """Header and rows: area, energy and front of every frame."""
    columns = {
        "step": summary.frame_step,
        "load step" if summary.counts_load_steps else "time, s": summary.frame_time,
        "area, m^2": summary.grown_area,
        "dissipated, J": summary.dissipated_energy,
        "dissipated/area, J/m^2": summary.dissipated_energy_per_area,
        "front, m": summary.front_length,
    }
    if summary.cycles is not None:  # bonds that lost their life dissipate less than G0
        del columns["dissipated/area, J/m^2"]
        columns["cycles"] = summary.cycles
    return tuple(columns), list(zip(*(column.tolist() for column in columns.values()), strict=True))


def summary_sentences(summary: CrackSurfaceSummary) -> list[str]:
    """The summary for a reader, a line each."""
    new_faces = summary.surface.face_opened_during_run
    if not new_faces.any():
        return ["nothing opened"]
    area, speed = float(summary.surface.face_area[new_faces].sum()), _front_speed_percentiles(summary)
    front = "none, the cracks end at the surface of the body"
    if long := [line_length(line) * 1e3 for line in summary.front_lines]:
        parts = "" if len(long) == 1 else f" in {len(long)} lines, the longest {long[0]:.4g} mm"
        front = f"{sum(long):.4g} mm{parts}"
    first_opening_time = float(summary.surface.opening_time[new_faces][0])
    lines = [
        f"area that opened: {area * 1e6:.4g} mm^2, the first at"
        f" {moment_text(first_opening_time, summary.counts_load_steps)}",
        f"front at the end: {front}",
    ]
    if summary.cycles is None:
        ratio = summary.dissipated_energy_per_area[-1] / summary.G0
        lines.insert(1, f"dissipated over area, of G0: {ratio:.3g}{summary.G0_remark}")
    if speed is not None:
        low, middle, high = speed
        lines.append(
            f"speed of the front: {middle:.4g} m/s in the median ({middle / summary.limiting_speed:.2f} of the"
            f" {summary.limiting_speed_name}), {low:.4g} to {high:.4g} m/s over four fifths of the area"
        )
    if summary.junction_edge_count:
        lines.append(
            f"edges between more than two faces: {summary.junction_edge_count}; the crack branched there, or cracks met"
        )
    pieces = summary.fragments.pieces
    if len(pieces) > 1:
        mass_text = ", ".join(f"{piece.mass * 1e3:.4g}" for piece in pieces[:LISTED])
        more = f" and {len(pieces) - LISTED} lighter ones" if len(pieces) > LISTED else ""
        lines.append(
            f"{len(pieces)} fragments of {mass_text} g{more},"
            f" {summary.fragments.small_pieces_mass * 1e3:.3g} g in crumbs"
        )
    return lines
