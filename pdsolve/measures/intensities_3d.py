"""J, stress intensities and angle of growth along the fronts of the cracks of a body, at points two spacings apart.

Each is summed over three tubes around a piece of the front: the value is that of the widest, the band is the range of
the three. The fields are gradients fitted to the intact bonds, and the stress computed from them. In a run in time,
velocities and accelerations enter too. The auxiliary fields are those of a stationary crack in plane strain. J needs no
auxiliary fields.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from pdsolve.fracture.fields import Elastic
from pdsolve.fracture.front_integrals import FrontFieldSamples, FrontParameters, Tube, front_integrals
from pdsolve.fracture.gradients import PAIRS, green, hooke
from pdsolve.measures.crack_fronts import (
    CrackPointsAndFronts,
    FrontObstacles,
    FrontPoints,
    crack_points_and_fronts_at,
    sample_front_points,
)
from pdsolve.measures.cracked_nodes import ROUND_OFF
from pdsolve.measures.embedded_model import read
from pdsolve.measures.frame_steps import vector
from pdsolve.measures.loaded_faces import loaded_faces_at
from pdsolve.measures.strain import (
    elastic_constants_of_nodes,
    families_without_broken_bonds,
    is_orthotropic,
    stress_work_if_yielded,
)
from pdsolve.measures.stress_intensities import FractureGridFileKeys, gradient_and_motion, three_radii, value_and_band
from pdsolve.measures.tip_surroundings import UndisturbedRoom
from pdsolve.results import Families, Results, ResultsError

LEAST, MOST = 2.0, 3.5  # horizons of room that are needed, and that are used
HALF = 1.5  # horizons of a tube to both sides of its point
TUBES = ((1.0, 0.8), (1.0, 1.0), (1.4, 1.0))  # inner radii in horizons, outer ones of the room; the second is the value
NAMES = ("J", "K1", "K2", "K3", "angle")


class FrontIntensities(NamedTuple):
    """Fracture parameters at k points of a front in one frame; NaN where a point has no room."""

    name: str
    step: int
    time: float  # s
    length_along_front: NDArray[np.float64]  # (k,) m, from the first end of the front
    points: NDArray[np.float64]  # (k, 3) m
    growth_direction: NDArray[np.float64]  # (k, 3) unit vectors across the front, in the plane of the crack
    crack_normal: NDArray[np.float64]  # (k, 3) unit vectors: K2 and the angle are positive towards it
    value: dict[str, NDArray[np.float64]]  # (k,) each: J, K1, K2, K3, angle
    low: dict[str, NDArray[np.float64]]
    high: dict[str, NDArray[np.float64]]
    J_from_K: NDArray[np.float64]  # (k,) J/m^2, (K1^2 + K2^2) / E' + K3^2 / 2 G
    no_room_reasons: tuple[str, ...]  # for each point why it has no room; "" if it has

    @property
    def points_with_values(self) -> NDArray[np.int64]:
        """The points that have values."""
        return np.flatnonzero(np.isfinite(self.value["J"]))


def follow_front_intensities(
    results: Results,
    steps: Sequence[int],
    near: tuple[float, ...] | None = None,
    tube_radii: tuple[float, float] | None = None,
    progress: Callable[[list[int]], Iterable[int]] = lambda steps: steps,
) -> list[FrontIntensities]:
    """Fracture parameters along the fronts after `steps`, see `compute_front_intensities`.

    Frames without any are left out. Raises ResultsError if none has any.
    """
    if near is not None and len(near) != 3:
        raise ResultsError(f"--tip has {len(near)} numbers; use 3, a place in m")
    front_states: list[FrontIntensities] = []
    why: ResultsError | None = None
    for step in progress(list(steps)):
        try:
            front_states += compute_front_intensities(results, step, near, tube_radii)
        except ResultsError as error:
            why = error
    if not front_states and why is not None:
        raise why
    return front_states


def compute_front_intensities(
    results: Results, step: int, near: tuple[float, ...] | None = None, tube_radii: tuple[float, float] | None = None
) -> list[FrontIntensities]:
    """Fracture parameters along the fronts of a body after `step`: of all, or of the one nearest to a place (3,), m.

    `tube_radii` are those of the widest tube, m; by default tubes fill the room there is. Raises ResultsError if no
    front is inside the body, if no point of any has room for a tube, and for frames that lack fields.
    """
    cracks, nodes = crack_points_and_fronts_at(results, step), results.nodes(step)
    ratio = read(results, FractureGridFileKeys).horizon.ratio
    lines = cracks.front_lines
    if near is not None:
        place = np.array(near)
        lines = sorted(lines, key=lambda line: float(np.linalg.norm(line - place, axis=1).min()))[:1]
    line_points = [sample_front_points(nodes, cracks, line, ratio) for line in lines]
    numbered = [(number, points) for number, points in enumerate(line_points) if len(points.front_places)]
    if not numbered:
        raise ResultsError(f"{results.name}: no front of a crack is inside the body; use a frame with one")
    rooms = _find_undisturbed_rooms(results, step, cracks, [points for _, points in numbered], tube_radii)
    tubes = [
        [
            _choose_tubes(room, ratio * spacing, tube_radii)
            for room, spacing in zip(per_point, points.node_spacing, strict=True)
        ]
        for per_point, (_, points) in zip(rooms, numbered, strict=True)
    ]
    every = [
        (front_place.place, tube)
        for (_, points), per_point in zip(numbered, tubes, strict=True)
        for front_place, wide in zip(points.front_places, per_point, strict=True)
        for tube in wide[1:2]
    ]
    if not every:
        raise ResultsError(f"{results.name}: {_no_room_reasons(numbered[0][1], rooms[0], ratio, tube_radii)[0]}")
    reach = max(np.hypot(tube.outer, tube.half + tube.outer) for _, tube in every)
    tree = cKDTree(nodes.position)
    rows = np.unique(np.concatenate([tree.query_ball_point(place, reach) for place, _ in every]).astype(np.int64))
    at, elastic = _sample_fields_of_nodes(results, step, rows), elastic_constants_of_nodes(results, step)
    faces = loaded_faces_at(results, step)
    series = []
    for (number, points), per_point, room in zip(numbered, tubes, rooms, strict=True):
        nearest = tree.query(np.array([front_place.place for front_place in points.front_places]))[1]
        solids = [Elastic(float(elastic.E[row]), float(elastic.nu[row]), "strain") for row in nearest]
        got = [
            [front_integrals(at, front_place, tube, solid, faces) for tube in wide]
            for front_place, wide, solid in zip(points.front_places, per_point, solids, strict=True)
        ]
        refused = _no_room_reasons(points, room, ratio, tube_radii)
        J_alone = at.work is not None or is_orthotropic(results)
        series.append(_collect_intensities(results, step, f"front {number}", points, got, solids, refused, J_alone))
    return series


def _find_undisturbed_rooms(
    results: Results,
    step: int,
    cracks: CrackPointsAndFronts,
    fronts: list[FrontPoints],
    tube_radii: tuple[float, float] | None,
) -> list[list[UndisturbedRoom]]:
    obstacles, ratio = FrontObstacles(results, step, cracks), read(results, FractureGridFileKeys).horizon.ratio
    return [
        [
            obstacles.find_undisturbed_room(
                front_place, HALF * ratio * spacing, MOST * ratio * spacing if tube_radii is None else tube_radii[1]
            )
            for front_place, spacing in zip(points.front_places, points.node_spacing.tolist(), strict=True)
        ]
        for points in fronts
    ]


def _choose_tubes(room: UndisturbedRoom, horizon: float, tube_radii: tuple[float, float] | None) -> list[Tube]:
    """Three tubes, the second of which gives the value; none without room."""
    half = HALF * horizon
    if tube_radii is not None:
        if room.radius < tube_radii[1] * (1 - ROUND_OFF):
            return []
        return [Tube(*radii, half) for radii in three_radii(*tube_radii)]
    if room.radius < LEAST * horizon * (1 - ROUND_OFF):
        return []
    return [Tube(inner * horizon, outer * room.radius, half) for inner, outer in TUBES]


def _no_room_reasons(
    points: FrontPoints, rooms: list[UndisturbedRoom], horizon_ratio: float, tube_radii: tuple[float, float] | None
) -> tuple[str, ...]:
    """Why each point has no room; "" if it has."""
    said = []
    for front_place, spacing, room in zip(points.front_places, points.node_spacing.tolist(), rooms, strict=True):
        least = LEAST * horizon_ratio * spacing if tube_radii is None else tube_radii[1]
        if room.radius >= least * (1 - ROUND_OFF):
            said.append("")
            continue
        place = ", ".join(f"{x:.4g}" for x in front_place.place)
        wide = f"{LEAST:g} horizons, {least:.3g} m" if tube_radii is None else f"{least:.3g} m"
        said.append(
            f"{room.nearest_obstacle} is {room.radius:.3g} m from the front at ({place}) m; room of {wide} is needed"
        )
    return tuple(said)


def _sample_fields_of_nodes(results: Results, step: int, rows: NDArray[np.int64]) -> FrontFieldSamples:
    """The fields of some nodes."""
    nodes = results.nodes(step)
    families = families_without_broken_bonds(results, results.families(step), step)
    count = np.diff(families.start)[rows]
    start = np.concatenate([[0], np.cumsum(count)])
    neighbour = families.neighbour[np.arange(start[-1]) + np.repeat(families.start[rows] - start[:-1], count)]
    gradient, motion = gradient_and_motion(results, step, Families(start, neighbour), rows)
    strain = green(gradient)
    if "sxx" in results.stored(step):
        stress = vector(results, "stress", step)[rows]
    else:
        stress = hooke(strain, elastic_constants_of_nodes(results, step).at(rows))
    work = stress_work_if_yielded(results, step)
    parts = (
        _symmetric_tensors_of_six_components(strain),
        _symmetric_tensors_of_six_components(stress),
        motion,
        None if work is None else work[rows],
    )
    return FrontFieldSamples(nodes.position[rows], nodes.area[rows], gradient, *parts)


def _symmetric_tensors_of_six_components(six_components: NDArray[np.float64]) -> NDArray[np.float64]:
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
    tube_integrals: list[list[FrontParameters]],
    solids: list[Elastic],
    no_room_reasons: tuple[str, ...],
    J_alone: bool,
) -> FrontIntensities:
    """The values of a front; of a body that has yielded, J alone has a meaning."""
    value, low, high = value_and_band(NAMES, tube_integrals, [J_alone] * len(tube_integrals))
    of_K = np.full(len(tube_integrals), np.nan)
    for at, (tubes, solid) in enumerate(zip(tube_integrals, solids, strict=True)):
        if tubes and not J_alone:
            _, K1, K2, K3 = tubes[1]
            of_K[at] = (K1**2 + K2**2) / solid.effective_modulus + K3**2 / (2 * solid.shear)
    frames = np.array([front_place.frame for front_place in points.front_places])
    return FrontIntensities(
        name,
        step,
        step * float(results.meta()["time_step"]),
        points.length_along_front,
        np.array([front_place.place for front_place in points.front_places]),
        frames[:, 0],
        frames[:, 1],
        value,
        low,
        high,
        of_K,
        no_room_reasons,
    )
