"""J, stress intensities, T-stress and angle of growth of every crack tip of a run, frame by frame.

Each is computed on three rings around the tip: the value is that of the middle ring, the band is the range of the
three. The fields are those of `fields` and `strain`: gradients fitted to the intact bonds, and the stress computed from
them. In a run in time, velocities and accelerations enter too. The auxiliary fields are those of a stationary crack, so
the intensities of a running crack are those of a stationary one with the same fields. J needs no auxiliary fields. Of a
body that has yielded, J alone is known, from the work of its stress; so it is of a body with orthotropic solids, as the
auxiliary fields are of isotropic ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh.model.document import Horizon, Material
from pdsolve.fracture.domain_integrals import FractureParameters, Ring, Sampled, SampledMotion, integrals
from pdsolve.fracture.fields import Elastic
from pdsolve.fracture.gradients import gradients_of, green
from pdsolve.fracture.loaded_faces import LoadedFaces
from pdsolve.measures import fields
from pdsolve.measures.cracked_nodes import ROUND_OFF, damage_with_pre_cracks_at
from pdsolve.measures.embedded_model import at_rest, read
from pdsolve.measures.frame_steps import vector
from pdsolve.measures.loaded_faces import loaded_faces_at
from pdsolve.measures.strain import (
    elastic_constants_of_nodes,
    families_without_broken_bonds,
    is_orthotropic,
    stress_work_if_yielded,
)
from pdsolve.measures.tip_surroundings import (
    TipHistory,
    TipObstacles,
    TipPosition,
    UndisturbedRoom,
    nearest_node_row,
    tip_histories,
)
from pdsolve.results import Families, Results, ResultsError

BLURRED = 2.0  # horizons around a tip where displacements are not the classical ones
LEAST = 3.5  # horizons of room
FINEST = 0.01  # of the spacing: finer nodes are no advice
CRUMB = 0.6  # damage above which a node is no face of a crack, and what is fitted to its bonds says nothing
RINGS = ((0.0, 0.8), (0.25, 0.8), (0.5, 0.95))  # inner ends between the blurred and 0.8, outer ones of the room


class NoRoomError(ResultsError):
    """No tip of a crack has room for the integrals around it."""


class TipRingIntegrals(NamedTuple):
    """The rings around a tip in one frame, and the values on each."""

    tip: TipPosition
    rings: tuple[Ring, ...]
    ring_parameters: tuple[FractureParameters, ...]
    effective_modulus: float  # Pa, E' of the plate there: E, or E / (1 - nu^2) in plane strain
    J_alone: bool  # whether only J has a meaning: nodes of the plate have yielded, or a solid is orthotropic


class TipIntensityHistory(NamedTuple):
    """Fracture parameters of a tip at t frames; NaN where the tip does not exist or has no room.

    All but J are NaN, too, where J alone has a meaning.
    """

    tip_history: TipHistory
    step: NDArray[np.int64]  # (t,)
    time: NDArray[np.float64]  # (t,) s
    tip_place: NDArray[np.float64]  # (t, 2) m
    value: dict[str, NDArray[np.float64]]  # (t,) each: J, K1, K2, T, angle
    low: dict[str, NDArray[np.float64]]
    high: dict[str, NDArray[np.float64]]
    last_integrals: TipRingIntegrals | None  # of the last frame with room
    no_room_reason: str  # why there was no room, the last time, and what would give it; "" if there always was
    J_from_K: NDArray[np.float64]  # (t,) J/m^2, (K1^2 + K2^2) / E', which J is of a crack at rest in a classical plate

    @property
    def K_differs_from_J(self) -> NDArray[np.bool_]:
        """Frames (t,) with (K1^2 + K2^2)/E' outside the band of J. Trust J there: it needs no auxiliary field."""
        slack = ROUND_OFF * np.abs(self.value["J"])
        return (self.J_from_K < self.low["J"] - slack) | (self.J_from_K > self.high["J"] + slack)


NAMES = ("J", "K1", "K2", "T", "angle")


class FractureGridFileKeys(msgspec.Struct):
    """The keys of the grid file that fracture parameters need."""

    material: Material
    horizon: Horizon = Horizon()


def follow_tip_intensities(
    results: Results,
    steps: Sequence[int],
    near: tuple[float, float] | None = None,
    ring: Ring | None = None,
    progress: Callable[[list[int]], Iterable[int]] = lambda steps: steps,
) -> list[TipIntensityHistory]:
    """Fracture parameters of a run's tips at the frames `steps`: of all tips, or of the one nearest to a place, m.

    `ring` is the widest of the rings, m; by default the rings fill the available room. Raises ResultsError if no tip is
    inside the plate, if none has room for a ring (all are named), and for frames that lack fields.
    """
    every = tip_histories(results, max(steps))
    time_step = float(results.meta()["time_step"])
    if not every:
        raise ResultsError(f"{results.name}: no tip of a crack is inside the plate; use a frame with one")
    chosen = every
    if near is not None:
        target = np.array(near)

        def distance_to_tip(front: TipHistory) -> float:
            places = [tip.place for step in steps if (tip := front.tip_at(step * time_step)) is not None]
            return min((float(np.hypot(*(place - target))) for place in places), default=np.inf)

        chosen = [min(every, key=distance_to_tip)]
    obstacles = TipObstacles(results, every)
    state = CachedFrameFields(results)
    got: list[list[TipRingIntegrals | None]] = [[] for _ in chosen]
    refused = [""] * len(chosen)
    for step in progress(list(steps)):
        for number, front in enumerate(chosen):
            tip, rings = front.tip_at(step * time_step), None
            if tip is not None:
                room = obstacles.find_undisturbed_room(tip, step, step * time_step)
                said = _no_room_reason(results, step, tip, room, ring)
                refused[number] = said or refused[number]
                if not said:
                    rings = state.integrate_around_tip(step, tip, _choose_rings(results, step, tip, room, ring))
            got[number].append(rings)
    if not any(any(front_rings) for front_rings in got):
        all_of_them = [f"{front.name}: {why}" for front, why in zip(chosen, refused, strict=True) if why]
        raise NoRoomError(f"{results.name}: {'; '.join(all_of_them) or 'found no tip of a crack at these frames'}")
    when = np.array(steps, dtype=np.int64)
    return [
        _collect_intensity_history(front, when, time_step, front_rings, why)
        for front, front_rings, why in zip(chosen, got, refused, strict=True)
    ]


def value_and_band(
    names: Sequence[str], integrals_at: Sequence[Sequence[NamedTuple]], J_alone_at: Sequence[bool]
) -> list[dict[str, NDArray[np.float64]]]:
    """Values (t,) by name of the second of three integrals, then the least and the largest of them.

    Without integrals all are NaN, and all but the first name where J alone has a meaning.
    """
    columns = {name: np.full((3, len(integrals_at)), np.nan) for name in names}
    for at, (parameters, J_alone) in enumerate(zip(integrals_at, J_alone_at, strict=True)):
        for name in (names[:1] if J_alone else names) if parameters else ():
            values = [float(getattr(one, name)) for one in parameters]
            columns[name][:, at] = values[1], min(values), max(values)
    return [{name: column[row] for name, column in columns.items()} for row in range(3)]


def three_radii(inner: float, outer: float) -> tuple[tuple[float, float], ...]:
    """Three rings within the given one, the second of which it is."""
    quarter = (outer - inner) / 4
    return (inner, outer - quarter), (inner, outer), (inner + quarter, outer)


def gradient_and_motion(
    results: Results, step: int, families: Families, rows: NDArray[np.int64] | None = None
) -> tuple[NDArray[np.float64], SampledMotion | None]:
    """Displacement gradients (r, d, d) of `rows`, by default of all nodes, and how these move; None at rest.

    `families` are those of the rows. Gradients at nodes that have lost most of their bonds are NaN.
    """
    nodes = results.nodes(step)
    chosen = slice(None) if rows is None else rows
    gradient = gradients_of(nodes.position, nodes.area, vector(results, "displacement", step), *families, rows)
    gradient[damage_with_pre_cracks_at(results, step)[chosen] > CRUMB] = np.nan
    if at_rest(results):
        return gradient, None
    velocity, acceleration = (vector(results, name, step) for name in ("velocity", "acceleration"))
    rates = gradients_of(nodes.position, nodes.area, velocity, *families, rows)
    density = read(results, FractureGridFileKeys).material.rho
    return gradient, SampledMotion(density, velocity[chosen], acceleration[chosen], rates)


class CachedFrameFields:
    """The fields of a frame as the integrals need them, cached for one frame."""

    def __init__(self, results: Results) -> None:
        self._results, self._step = results, -1
        self._sampled: Sampled | None = None
        self._faces: LoadedFaces | None = None

    def integrate_around_tip(self, step: int, tip: TipPosition, rings: tuple[Ring, ...]) -> TipRingIntegrals:
        """Fracture parameters of a tip on rings after a step."""
        if self._sampled is None or self._step != step:
            self._step, self._sampled = step, self._sample_fields(step)
            self._faces = loaded_faces_at(self._results, step)
        nodes = self._results.nodes(step)
        every, near = elastic_constants_of_nodes(self._results, step), nearest_node_row(nodes, tip.place)
        elastic = Elastic(float(every.E[near]), float(every.nu[near]), every.plane)
        of = self._sampled, tip.place, tip.direction
        ring_integrals = tuple(integrals(*of, ring, elastic, self._faces) for ring in rings)
        J_alone = self._sampled.work is not None or is_orthotropic(self._results)
        return TipRingIntegrals(tip, rings, ring_integrals, elastic.effective_modulus, J_alone)

    def _sample_fields(self, step: int) -> Sampled:
        results, nodes = self._results, self._results.nodes(step)
        families = families_without_broken_bonds(results, results.families(step), step)
        gradient, motion = gradient_and_motion(results, step, families)
        stress = fields.all_field_components(results, "stress", step)
        parts = np.column_stack([stress[part] for part in ("xx", "yy", "xy")])
        return Sampled(
            nodes.position, nodes.area, gradient, green(gradient), parts, motion, stress_work_if_yielded(results, step)
        )


def _spacing_at_tip(results: Results, step: int, tip: TipPosition) -> float:
    """The spacing of the node nearest to a tip, m."""
    nodes = results.nodes(step)
    return float(nodes.delta[nearest_node_row(nodes, tip.place)])


def _no_room_reason(results: Results, step: int, tip: TipPosition, room: UndisturbedRoom, ring: Ring | None) -> str:
    """Why a tip has no room for rings, and the spacing that would give it room; "" if it has."""
    x, y = tip.place
    spacing, ratio = _spacing_at_tip(results, step, tip), read(results, FractureGridFileKeys).horizon.ratio
    if ring is not None and ring.outer - ring.inner < spacing:
        wide = f"{ring.outer - ring.inner:.3g} m wide; use at least a spacing, {spacing:.3g} m"
        return f"the ring around the tip at ({x:.4g}, {y:.4g}) m is {wide}"
    least = LEAST * ratio * spacing if ring is None else ring.outer
    if room.radius >= least * (1 - ROUND_OFF):
        return ""
    where = f"{room.radius:.3g} m from" if room.radius > ROUND_OFF * spacing else "at"
    message = f"{room.nearest_obstacle} is {where} the tip at ({x:.4g}, {y:.4g}) m; it needs room of"
    if ring is not None:
        return f"{message} {least:.3g} m"
    enough, finer = room.radius / (LEAST * ratio), ""
    if enough > FINEST * spacing:
        unit = 10.0 ** (np.floor(np.log10(enough)) - 1)  # two digits, rounded down
        finer = f" (nodes {np.floor(enough / unit * (1 + ROUND_OFF)) * unit:.2g} m apart have it)"
    return f"{message} {LEAST:g} horizons, {least:.3g} m{finer}"


def _choose_rings(
    results: Results, step: int, tip: TipPosition, room: UndisturbedRoom, ring: Ring | None
) -> tuple[Ring, ...]:
    """Three rings; the middle one gives the reported value."""
    if ring is not None:
        return tuple(Ring(*radii) for radii in three_radii(*ring))
    horizon = read(results, FractureGridFileKeys).horizon.ratio * _spacing_at_tip(results, step, tip)
    least = max(BLURRED * horizon, 0.2 * room.radius)
    span = 0.8 * room.radius - least
    return tuple(Ring(least + inner * span, outer * room.radius) for inner, outer in RINGS)


def _collect_intensity_history(
    tip: TipHistory,
    steps: NDArray[np.int64],
    time_step: float,
    frame_integrals: list[TipRingIntegrals | None],
    no_room_reason: str,
) -> TipIntensityHistory:
    places, of_K = np.full((len(steps), 2), np.nan), np.full(len(steps), np.nan)
    value, low, high = value_and_band(
        NAMES,
        [() if rings is None else rings.ring_parameters for rings in frame_integrals],
        [rings is not None and rings.J_alone for rings in frame_integrals],
    )
    for at, rings in enumerate(frame_integrals):
        if rings is not None:
            places[at] = rings.tip.place
            of_K[at] = (value["K1"][at] ** 2 + value["K2"][at] ** 2) / rings.effective_modulus
    last = next((rings for rings in reversed(frame_integrals) if rings is not None), None)
    return TipIntensityHistory(
        tip, steps, np.asarray(steps * time_step), places, value, low, high, last, no_room_reason, of_K
    )
