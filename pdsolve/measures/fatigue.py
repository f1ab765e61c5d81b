"""Growth of cracks by fatigue: their length over the cycles, and the growth a cycle over the range of intensity.

K is sqrt(J E'), of the largest load of a cycle, and its range dK = (1 - R) K with a load ratio R of 0 or more; below 0
a crack is taken to be closed, and dK = K. Paris's line is da/dN = C dK^m.

The growth a cycle is that between two frames, and belongs to the dK with which a crack whose K grows exponentially
from that of the first frame, K0, to that of the second, K1, takes as many cycles:

    dK^m = m log(K1 / K0) / (K0^-m - K1^-m)

The life of a smooth body is that until its first bonds break. Its line, Wöhler's, is N = 1 / (A1 eps^m1) over the range
eps of their stretch. Of a body in space the area that opened is measured over the cycles.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Cycled, Fatigue, Horizon, Run
from pdsolve.measures import stress_intensities
from pdsolve.measures.crack_faces import build_crack_surface, find_opened_face_neighbours
from pdsolve.measures.embedded_model import read
from pdsolve.measures.frame_steps import frames
from pdsolve.measures.tips import crack_branches
from pdsolve.results import Results, ResultsError

Array = NDArray[np.float64]

SETTLED = 2.0  # horizons that a crack of bonds grows until the life ahead of it is that of a crack that grows
FEWEST = 3  # points of a line
FLAT = 1e-6  # m log(K1 / K0), below which both are as good as one
NEARLY_ALL = 0.9  # of all growth: what comes later is the last tenth
FAR = 10.0  # times the cycles until the last tenth of the growth: charts are logarithmic from here on
FIRST, ROUNDS = 3.0, 20  # slope to begin with, and how often it is taken anew
CYCLES = Cycled._fields.index("cycles")


class TipFatigueGrowth(NamedTuple):
    """A tip at t frames, and its t - 1 ways from one to the next."""

    name: str
    cycles: Array  # (t,)
    grown_length: Array  # (t,) m, that the crack has grown since the start of the run
    K: Array  # (t,) Pa m^0.5
    dK: Array  # (t,) Pa m^0.5
    growth_per_cycle: Array  # (t - 1,) m a cycle
    is_past_slow_start: NDArray[np.bool_]  # (t - 1,) whether it is beyond the start, which is slower


class ParisLine(NamedTuple):
    """Paris's line."""

    C: float  # m a cycle at 1 Pa m^0.5
    m: float
    point_count: int
    scatter: float  # of points about it: the standard deviation of log10 of the growth

    def growth_per_cycle(self, dK: Array) -> Array:
        """Growth a cycle, m."""
        return np.asarray(self.C * dK**self.m)


class CrackAreaGrowth(NamedTuple):
    """The area of the cracks of a body in space that opened under loads that repeat."""

    cycles: Array  # (t,) of the frames
    area: Array  # (t,) m^2


class FatigueLife(NamedTuple):
    """What a run under loads that repeat came to."""

    name: str
    total_cycles: float  # in all
    total_cycles_error: float | None  # cycles, estimated, from the length of jumps; None: jumps go from break to break
    first_break_cycles: (
        float | None
    )  # cycles until its first bonds broke; None: none did, or the crack is one of particles
    first_break_strain_range: float | None  # of the stretch of these bonds
    fatigue_law: Fatigue
    tip_growths: list[TipFatigueGrowth]  # of the cracks of a plate; empty: a smooth one
    paris_line: ParisLine | None  # Paris's, through these
    area_growth: CrackAreaGrowth | None = None  # of a body in space
    end_reason: str | None = None  # why the run ended, if it did before its steps were over
    K_refusal: str = ""  # why no tip has a K; then `tip_growths` are lengths alone

    def cycles_until_last_tenth(self) -> float | None:
        """Cycles until nine tenths of the growth are over of what grew most; None where nothing grew."""
        growths = [(tip.cycles, tip.grown_length) for tip in self.tip_growths]
        growths += [self.area_growth] if self.area_growth is not None else []
        cycles, grown = max(growths, key=lambda growth: growth[1][-1], default=(np.zeros(1), np.zeros(1)))
        return float(cycles[grown >= NEARLY_ALL * grown[-1]][0]) if grown[-1] > 0 else None

    @property
    def spans_orders_of_magnitude(self) -> bool:
        """Whether the last tenth of the growth took most of the cycles by far."""
        until = self.cycles_until_last_tenth()
        return until is not None and 0 < until * FAR < self.total_cycles

    def woehler_cycles_to_break(self, strain_range: Array) -> Array:
        """Wöhler's line: cycles until bonds stretched by these ranges break, away from damage."""
        A1, m1 = self.fatigue_law.A1, self.fatigue_law.m1
        if A1 is None or m1 is None:
            return np.full(len(strain_range), np.inf)
        return np.where(strain_range > self.fatigue_law.endurance, 1 / (A1 * strain_range**m1), np.inf)

    def growth_per_cycle_of_input_law(self, dK: Array) -> Array | None:
        """Growth a cycle by what the run was given: C and m, or m alone through the middle of the settled points."""
        C, m = self.fatigue_law.C, self.fatigue_law.m
        if m is None or (C is None and self.paris_line is None):
            return None
        if C is not None:
            return np.asarray(C * dK**m)
        assert self.paris_line is not None
        rate, at = growth_per_cycle_and_dK_past_slow_start(self.tip_growths, m)
        return np.asarray(np.exp(np.log(rate).mean()) * (dK / np.exp(np.log(at).mean())) ** m)


def growth_per_cycle_and_dK_past_slow_start(growths: Sequence[TipFatigueGrowth], paris_exponent: float) -> Array:
    """Growth a cycle, m, and dK of all settled points, (2, p), for Paris's exponent."""
    columns = [np.empty((2, 0))]
    for growth in growths:
        good = growth.is_past_slow_start & (growth.growth_per_cycle > 0) & np.isfinite(growth.growth_per_cycle)
        columns.append(
            np.array([growth.growth_per_cycle[good], effective_dK_between_frames(growth, paris_exponent)[good]])
        )
    return np.concatenate(columns, axis=1)


def effective_dK_between_frames(growth: TipFatigueGrowth, paris_exponent: float) -> Array:
    """The dK (t - 1,) to which the growth between two frames belongs, for Paris's exponent."""
    first, last = growth.dK[:-1], growth.dK[1:]
    more = np.log(last / first)
    steep = np.abs(paris_exponent * more) > FLAT
    with np.errstate(divide="ignore", invalid="ignore"):
        effective_range = first * (paris_exponent * more / -np.expm1(-paris_exponent * more)) ** (1 / paris_exponent)
    return np.where(steep, effective_range, (first + last) / 2)


class _FatigueGridFileKeys(msgspec.Struct):
    """The keys of the grid file that fatigue needs."""

    horizon: Horizon = Horizon()
    run: Run = Run()
    notch: list[Any] = []


def measure_fatigue_life(
    results: Results,
    steps: Sequence[int],
    progress: Callable[[list[int]], Iterable[int]] = lambda steps: steps,
    threshold: float | None = None,
    until: float = np.inf,
) -> FatigueLife:
    """The life of a run, and the growth of its cracks; nodes of a body are cracked above the damage `threshold`.

    Cycles after `until` do not count. Raises ResultsError.
    """
    N, model = cycles_after_steps(results), read(results, _FatigueGridFileKeys)
    all_cycles, last = N[-1], int(np.searchsorted(N, until, side="right")) - 1
    if not any(0 < step <= last for step in steps):
        raise ResultsError(f"{results.name} has no frame until {until:g} cycles; use {N[min(1, len(N) - 1)]:g} or more")
    N, steps = N[: last + 1], [step for step in steps if step <= last]
    said = results.summary()
    is_body = results.dimension == 3
    growths, refusal = list[TipFatigueGrowth](), ""
    if model.notch and not is_body:
        try:
            growths = measure_tip_growths(results, steps, progress)
        except stress_intensities.NoRoomError as error:
            growths, refusal = measure_branch_growths(results, N, threshold), str(error)
            if not growths:
                raise
    first, stretch = (said.get(name) for name in ("first_break", "first_range"))
    broke = first is not None and stretch is not None and stretch > 0
    fatigue = model.run.fatigue or Fatigue()
    name = Path(results.name).stem
    broken = (first, stretch) if broke else (None, None)
    return FatigueLife(
        name,
        float(N[-1]),
        said.get("cycles_error"),
        *broken,
        fatigue,
        growths,
        fit_paris_line(growths),
        measure_area_growth(results, N, threshold) if is_body else None,
        said.get("ended") if all_cycles == N[-1] else None,
        refusal,
    )


def measure_branch_growths(results: Results, cycles: Array, threshold: float | None = None) -> list[TipFatigueGrowth]:
    """Lengths of the branches of cracks over the cycles (s + 1,) after each step, without K."""
    growths, time_step = [], float(results.meta()["time_step"])
    for number, branch in enumerate(crack_branches(results, len(cycles) - 1, threshold)):
        step = np.rint(branch.passing_time / time_step).astype(np.int64).clip(max=len(cycles) - 1)
        n, way = cycles[step], branch.length_along_crack
        with np.errstate(divide="ignore", invalid="ignore"):
            rate = np.diff(way) / np.diff(n)
        unknown = np.full(len(n), np.nan)
        growths.append(
            TipFatigueGrowth(f"branch {number}", n, way, unknown, unknown, rate, np.zeros(len(rate), dtype=bool))
        )
    return growths


def measure_area_growth(results: Results, cycles: Array, threshold: float | None = None) -> CrackAreaGrowth:
    """The area that opened in a body until each frame; `cycles` (s + 1,) are those after each step."""
    steps, times = frames(results)
    last = min(int(steps[-1]), len(cycles) - 1)
    surface = build_crack_surface(results, last, find_opened_face_neighbours(results, last, threshold))
    known = steps < len(cycles)
    return CrackAreaGrowth(cycles[steps[known]], surface.grown_area_at(times[known]))


def cycles_after_steps(results: Results) -> Array:
    """Cycles (s + 1,) after each step until the last checkpoint, those of step 0 first. Raises ResultsError."""
    checkpoint_state = results.checkpoint()[1] if results.has_checkpoint() else {}
    if "cycled" not in checkpoint_state:
        raise ResultsError(f"{results.name} has no cycles; use a run with run.fatigue")
    return np.concatenate([[0.0], checkpoint_state["cycled"].reshape(-1, len(Cycled._fields))[:, CYCLES]])


def cycles_at_times(results: Results, times: Array) -> Array | None:
    """Cycles (t,) until times, s, of a run of fatigue, NaN after its last checkpoint; None of another run."""
    if not results.has_checkpoint() or "cycled" not in results.checkpoint()[1]:
        return None
    cycles = cycles_after_steps(results)
    step = np.arange(len(cycles)) * float(results.meta()["time_step"])
    return np.asarray(np.interp(times, step, cycles, right=np.nan))


def measure_tip_growths(
    results: Results, steps: Sequence[int], progress: Callable[[list[int]], Iterable[int]] = lambda steps: steps
) -> list[TipFatigueGrowth]:
    """The growth of each tip that has room for J at two frames or more. Raises ResultsError."""
    N, model = cycles_after_steps(results), read(results, _FatigueGridFileKeys)
    ratio = 0.0 if model.run.fatigue is None else max(model.run.fatigue.ratio, 0.0)
    growths = []
    for series in stress_intensities.follow_tip_intensities(
        results, [step for step in steps if step < len(N)], progress=progress
    ):
        known_frames = np.flatnonzero((series.value["J"] > 0) & np.isfinite(series.tip_place).all(axis=1))
        if len(known_frames) < 2 or series.last_integrals is None:
            continue
        begins = series.tip_history.tip_at(0.0)
        place = (
            series.tip_place[known_frames]
            if begins is None
            else np.vstack([begins.place, series.tip_place[known_frames]])
        )
        K = np.sqrt(series.value["J"][known_frames] * series.last_integrals.effective_modulus)
        way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(place, axis=0).T))])[-len(known_frames) :]
        least = SETTLED * model.horizon.ratio * float(results.nodes(int(steps[0])).delta.min())
        past_start = way[:-1] >= (least if model.run.cracks == "bonds" else 0.0)
        n = N[series.step[known_frames]]
        with np.errstate(divide="ignore", invalid="ignore"):
            rate = np.diff(way) / np.diff(n)
        growths.append(TipFatigueGrowth(series.tip_history.name, n, way, K, (1 - ratio) * K, rate, past_start))
    if not growths:
        raise ResultsError(f"{results.name}: no tip grows over two frames or more; use a crack that grows")
    return growths


def fit_paris_line(growths: Sequence[TipFatigueGrowth]) -> ParisLine | None:
    """The line through all settled points; None with fewer than three."""
    slope, at_0, x, y = FIRST, 0.0, np.empty(0), np.empty(0)
    for _ in range(ROUNDS):  # as the dK of a point depends on the slope a little
        y, x = np.log10(growth_per_cycle_and_dK_past_slow_start(growths, slope))
        if len(x) < FEWEST:
            return None
        slope, at_0 = (float(number) for number in np.polyfit(x, y, 1))
    return ParisLine(10**at_0, slope, len(x), float(np.std(y - slope * x - at_0)))
