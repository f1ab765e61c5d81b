"""J, stress intensities and angle of growth along the fronts of the cracks of a body, at points two spacings apart.

Each is summed over three tubes around a piece of the front: the value is that of the widest, the band is the range of
the three. The fields are gradients fitted to the intact bonds, and the stress computed from them. In a run in time,
velocities and accelerations enter too. The auxiliary fields are those of a stationary crack in plane strain. J needs no
auxiliary fields.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pdmesh.model.document import Horizon, Material
from pdmesh.model.domain_integrals import SampledMotion
from pdmesh.model.front_integrals import FoundInSpace, SampledInSpace, Tube, front_integrals
from pdmesh.model.gradients import PAIRS, gradients_of, green, hooke
from pdmesh.model.tip_fields import Elastic
from pdpost.measures.cracked_nodes import ROUND_OFF, separation_at
from pdpost.measures.front_places import CracksInSpace, FrontPoints, cracks_at, front_points
from pdpost.measures.front_surroundings import ObstaclesInSpace
from pdpost.measures.strain import elastic_constants, remove_broken_bonds, stress_work
from pdpost.measures.stress_intensities import CRUMB
from pdpost.measures.tip_surroundings import UndisturbedRoom
from pdpost.reading.embedded_model import at_rest, read
from pdpost.reading.stored_fields import vector
from pdsolve.results import Results, ResultsError

LEAST, MOST = 2.0, 3.5  # horizons of room that are needed, and that are used
HALF = 1.5  # horizons of a tube to both sides of its point
TUBES = ((1.0, 0.8), (1.0, 1.0), (1.4, 1.0))  # inner radii in horizons, outer ones of the room; the second is the value
NAMES = ("J", "K1", "K2", "K3", "angle")


class _FractureKeys(msgspec.Struct):
    """The keys of the grid file that fracture parameters need."""

    material: Material
    horizon: Horizon = Horizon()


class FrontIntensities(NamedTuple):
    """Fracture parameters at k points of a front in one frame; NaN where a point has no room."""

    name: str
    step: int
    time: float  # s
    length_along: NDArray[np.float64]  # (k,) m, from the first end of the front
    place: NDArray[np.float64]  # (k, 3) m
    growth_direction: NDArray[np.float64]  # (k, 3) unit vectors across the front, in the plane of the crack
    normal: NDArray[np.float64]  # (k, 3) unit vectors: K2 and the angle are positive towards it
    value: dict[str, NDArray[np.float64]]  # (k,) each: J, K1, K2, K3, angle
    low: dict[str, NDArray[np.float64]]
    high: dict[str, NDArray[np.float64]]
    J_from_K: NDArray[np.float64]  # (k,) J/m^2, (K1^2 + K2^2) / E' + K3^2 / 2 G
    refusal_reasons: tuple[str, ...]  # for each point why it has no room; "" if it has

    @property
    def points_with_values(self) -> NDArray[np.int64]:
        """The points that have values."""
        return np.flatnonzero(np.isfinite(self.value["J"]))


def follow_fronts(
    results: Results,
    steps: Sequence[int],
    near: tuple[float, ...] | None = None,
    ring: tuple[float, float] | None = None,
    progress: Callable[[list[int]], Iterable[int]] = lambda steps: steps,
) -> list[FrontIntensities]:
    """Fracture parameters along the fronts after `steps`, see `front_intensities`; frames without any are left out.

    Raises ResultsError if none has any.
    """
    if near is not None and len(near) != 3:
        raise ResultsError(f"--tip has {len(near)} numbers; use 3, a place in m")
    front_states: list[FrontIntensities] = []
    why: ResultsError | None = None
    for step in progress(list(steps)):
        try:
            front_states += front_intensities(results, step, near, ring)
        except ResultsError as error:
            why = error
    if not front_states and why is not None:
        raise why
    return front_states


def front_intensities(
    results: Results, step: int, near: tuple[float, ...] | None = None, ring: tuple[float, float] | None = None
) -> list[FrontIntensities]:
    """Fracture parameters along the fronts of a body after `step`: of all, or of the one nearest to a place (3,), m.

    `ring` are the radii of the widest tube, m; by default tubes fill the room there is. Raises ResultsError if no front
    is inside the body, if no point of any has room for a tube, and for frames that lack fields.
    """
    cracks, nodes = cracks_at(results, step), results.nodes(step)
    ratio = read(results, _FractureKeys).horizon.ratio
    lines = cracks.fronts
    if near is not None:
        place = np.array(near)
        lines = sorted(lines, key=lambda line: float(np.linalg.norm(line - place, axis=1).min()))[:1]
    line_points = [front_points(nodes, cracks, line, ratio) for line in lines]
    numbered = [(number, points) for number, points in enumerate(line_points) if len(points.places)]
    if not numbered:
        raise ResultsError(f"{results.name}: no front of a crack is inside the body; use a frame with one")
    rooms = _find_rooms(results, step, cracks, [points for _, points in numbered], ring)
    tubes = [
        [_choose_tubes(room, ratio * spacing, ring) for room, spacing in zip(per_point, points.spacing, strict=True)]
        for per_point, (_, points) in zip(rooms, numbered, strict=True)
    ]
    every = [
        (front_place.place, tube)
        for (_, points), per_point in zip(numbered, tubes, strict=True)
        for front_place, wide in zip(points.places, per_point, strict=True)
        for tube in wide[1:2]
    ]
    if not every:
        raise ResultsError(f"{results.name}: {_refusal_reasons(numbered[0][1], rooms[0], ratio, ring)[0]}")
    reach = max(np.hypot(tube.outer, tube.half + tube.outer) for _, tube in every)
    tree = cKDTree(nodes.position)
    rows = np.unique(np.concatenate([tree.query_ball_point(place, reach) for place, _ in every]).astype(np.int64))
    at, elastic = _sample_fields(results, step, rows), elastic_constants(results, step)
    series = []
    for (number, points), per_point, room in zip(numbered, tubes, rooms, strict=True):
        nearest = tree.query(np.array([front_place.place for front_place in points.places]))[1]
        solids = [Elastic(float(elastic.E[row]), float(elastic.nu[row]), "strain") for row in nearest]
        got = [
            [front_integrals(at, front_place, tube, solid) for tube in wide]
            for front_place, wide, solid in zip(points.places, per_point, solids, strict=True)
        ]
        refused = _refusal_reasons(points, room, ratio, ring)
        found_here = _collect_intensities(results, step, f"front {number}", points, got, solids, refused)
        series.append(found_here if at.work is None else _keep_only_J(found_here))
    return series


def _find_rooms(
    results: Results, step: int, cracks: CracksInSpace, fronts: list[FrontPoints], ring: tuple[float, float] | None
) -> list[list[UndisturbedRoom]]:
    obstacles, ratio = ObstaclesInSpace(results, step, cracks), read(results, _FractureKeys).horizon.ratio
    return [
        [
            obstacles.undisturbed_room(
                front_place, HALF * ratio * spacing, MOST * ratio * spacing if ring is None else ring[1]
            )
            for front_place, spacing in zip(points.places, points.spacing.tolist(), strict=True)
        ]
        for points in fronts
    ]


def _choose_tubes(room: UndisturbedRoom, horizon: float, ring: tuple[float, float] | None) -> list[Tube]:
    """Three tubes, the second of which gives the value; none without room."""
    half = HALF * horizon
    if ring is not None:
        if room.radius < ring[1] * (1 - ROUND_OFF):
            return []
        quarter = (ring[1] - ring[0]) / 4
        return [Tube(ring[0], ring[1] - quarter, half), Tube(*ring, half), Tube(ring[0] + quarter, ring[1], half)]
    if room.radius < LEAST * horizon * (1 - ROUND_OFF):
        return []
    return [Tube(inner * horizon, outer * room.radius, half) for inner, outer in TUBES]


def _refusal_reasons(
    points: FrontPoints, rooms: list[UndisturbedRoom], ratio: float, ring: tuple[float, float] | None
) -> tuple[str, ...]:
    """Why each point has no room; "" if it has."""
    said = []
    for front_place, spacing, room in zip(points.places, points.spacing.tolist(), rooms, strict=True):
        least = LEAST * ratio * spacing if ring is None else ring[1]
        if room.radius >= least * (1 - ROUND_OFF):
            said.append("")
            continue
        place = ", ".join(f"{x:.4g}" for x in front_place.place)
        wide = f"{LEAST:g} horizons, {least:.3g} m" if ring is None else f"{least:.3g} m"
        said.append(
            f"{room.nearest_obstacle} is {room.radius:.3g} m from the front at ({place}) m; room of {wide} is needed"
        )
    return tuple(said)


def _sample_fields(results: Results, step: int, rows: NDArray[np.int64]) -> SampledInSpace:
    """The fields of some nodes."""
    nodes = results.nodes(step)
    families = remove_broken_bonds(results, results.families(step), step)
    count = np.diff(families.start)[rows]
    start = np.concatenate([[0], np.cumsum(count)])
    neighbour = families.neighbour[np.arange(start[-1]) + np.repeat(families.start[rows] - start[:-1], count)]
    displacements = vector(results, "displacement", step)
    gradient = gradients_of(nodes.position, nodes.area, displacements, start, neighbour, rows)
    gradient[separation_at(results, step)[rows] > CRUMB] = np.nan
    strain = green(gradient)
    if "sxx" in results.stored(step):
        stress = vector(results, "stress", step)[rows]
    else:
        every = elastic_constants(results, step)
        stress = hooke(strain, every._replace(E=every.E[rows], nu=every.nu[rows]))
    motion = None
    if not at_rest(results):
        velocity, acceleration = (vector(results, name, step) for name in ("velocity", "acceleration"))
        density = read(results, _FractureKeys).material.rho
        rates = gradients_of(nodes.position, nodes.area, velocity, start, neighbour, rows)
        motion = SampledMotion(density, velocity[rows], acceleration[rows], rates)
    work = stress_work(results, step)
    parts = _unpack_tensors(strain), _unpack_tensors(stress), motion, None if work is None else work[rows]
    return SampledInSpace(nodes.position[rows], nodes.area[rows], gradient, *parts)


def _unpack_tensors(six_components: NDArray[np.float64]) -> NDArray[np.float64]:
    """Symmetric tensors (n, 3, 3) of (n, 6)."""
    tensors = np.empty((len(six_components), 3, 3))
    for k, (a, b) in enumerate(PAIRS):
        tensors[:, a, b] = tensors[:, b, a] = six_components[:, k]
    return tensors


def _collect_intensities(
    results: Results,
    step: int,
    name: str,
    points: FrontPoints,
    tube_integrals: list[list[FoundInSpace]],
    solids: list[Elastic],
    refusal_reasons: tuple[str, ...],
) -> FrontIntensities:
    columns = {quantity: np.full((3, len(tube_integrals)), np.nan) for quantity in NAMES}
    of_K = np.full(len(tube_integrals), np.nan)
    for at, (tubes, solid) in enumerate(zip(tube_integrals, solids, strict=True)):
        if not tubes:
            continue
        for quantity in NAMES:
            tube_values = [float(getattr(tube, quantity)) for tube in tubes]
            columns[quantity][:, at] = tube_values[1], min(tube_values), max(tube_values)
        _, K1, K2, K3 = tubes[1]
        of_K[at] = (K1**2 + K2**2) / solid.effective_modulus + K3**2 / (2 * solid.shear)
    value, low, high = ({quantity: column[row] for quantity, column in columns.items()} for row in range(3))
    frames = np.array([front_place.frame for front_place in points.places])
    place, time = (
        np.array([front_place.place for front_place in points.places]),
        step * float(results.meta()["time_step"]),
    )
    return FrontIntensities(
        name, step, time, points.along, place, frames[:, 0], frames[:, 1], value, low, high, of_K, refusal_reasons
    )


def _keep_only_J(front: FrontIntensities) -> FrontIntensities:
    """A front of a body that has yielded, of which J alone has a meaning."""
    value, low, high = (
        {name: numbers if name == "J" else np.full_like(numbers, np.nan) for name, numbers in columns.items()}
        for columns in (front.value, front.low, front.high)
    )
    return front._replace(value=value, low=low, high=high, J_from_K=np.full_like(front.J_from_K, np.nan))
