"""Checks of conditions and regions on selections of nodes."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.contradictions import wrong_monitors
from pdmesh.model.document import (
    Acceleration,
    AnyCondition,
    Displacement,
    Exchange,
    GridError,
    InitialDisplacement,
    InitialVelocity,
    Load,
    Selection,
    Settings,
    Source,
    Spring,
    Timed,
    Velocity,
)
from pdmesh.model.interfaces import wrong_interface
from pdmesh.model.mechanical_conditions import wrong_spin, wrong_spring
from pdmesh.model.node_arrays import Grid
from pdmesh.model.values_at_places import values_at
from pdmesh.model.values_of_place import (
    PlaceError,
    Value,
    end_of_data,
    is_of_place,
    is_over_time,
    named,
    varying,
    wrong_value,
)

WHOLES = {2: "a plate", 3: "a body in space"}
LOADS = ("body_force", "traction", "force", "pressure")
PRESCRIBED = (Displacement, Velocity, Acceleration)
SAME_TIME = 1e-9  # of the end of a run


def components(
    condition: Displacement | Velocity | Acceleration | InitialVelocity | InitialDisplacement, dimension: int = 3
) -> tuple[Value | None, ...]:
    """The components that a condition prescribes along each axis; None leaves one free."""
    return (condition.x, condition.y, condition.z)[:dimension]


def given_of(load: Load) -> dict[str, Sequence[Value]]:
    """What is given of a load's body_force (N/m^3), traction (Pa), force (N/m or N) and pressure (Pa), by name."""
    candidates = ((name, getattr(load, name)) for name in LOADS)
    given = {name: vector for name, vector in candidates if vector is not None}
    return given if load.pressure is None else given | {"pressure": (load.pressure,)}


def last_selecting(selections: Sequence[Selection], grid: Grid) -> NDArray[np.int64]:
    """For each node of a grid (n,) the last of the selections that it is in, counted from 1; 0 if it is in none."""
    numbers, (owner, ids) = np.zeros(len(grid), dtype=np.int64), _listed(selections)
    rows = grid.rows_of(ids) if len(ids) else ids  # in one go, as there may be a selection for each node
    np.maximum.at(numbers, rows[rows >= 0], owner[rows >= 0] + 1)
    for number, selection in enumerate(selections):
        if selection.nodes is None:
            inside = grid.chosen(None, selection.box)
            numbers[inside] = np.maximum(numbers[inside], number + 1)
    return numbers


def _listed(selections: Sequence[Selection]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The numbers of the selections that list nodes, each as often as it has nodes, and the ids of these."""
    lists = [np.array(selection.nodes or (), dtype=np.int64) for selection in selections]
    owner = np.repeat(np.arange(len(lists)), [len(ids) for ids in lists])
    return owner, np.concatenate([*lists, np.zeros(0, dtype=np.int64)])


def check(settings: Settings, grid: Grid, name: str) -> None:
    """Raise GridError for a condition or region, of the file called `name`, without nodes or without effect."""
    for number, condition in enumerate(settings.conditions):
        place = f"{name}: $.conditions[{number}]"
        _check_selection(condition, grid, place)
        _check_condition(condition, place)
        _check_components(condition, grid.dimension, place)
        _check_values(condition, grid, place)
    _check_data_times(settings, name)
    twice = two_motions(settings.conditions, lambda condition: grid.chosen(condition.nodes, condition.box))
    if twice is not None:
        number, axis, earlier_number, row = twice
        kinds = [str(settings.conditions[at].__struct_config__.tag) for at in (number, earlier_number)]
        raise GridError(
            f"{name}: $.conditions[{number}].{axis}: node {int(grid.ids[row])} has a prescribed {kinds[0]} there"
            f" and a prescribed {kinds[1]} by $.conditions[{earlier_number}]; use one of them"
        )
    listed = _listed(settings.regions)
    if not all(region.nodes for region in settings.regions) or len(grid.missing(listed[1])):
        for number, region in enumerate(settings.regions):
            _check_selection(region, grid, f"{name}: $.regions[{number}]")
    _check_interfaces(settings, grid.dimension, name)
    for number, probe in enumerate(settings.run.probes):
        _check_length(probe, grid.dimension, f"{name}: $.run.probes[{number}]")
    for number, gap in enumerate(settings.run.gaps):
        for end in gap.ends:
            _check_length(end, grid.dimension, f"{name}: $.run.gaps[{number}].ends")
    run = settings.run
    if run.gaps or run.load_cells or run.static.control is not None or run.static.opening is not None:
        wrong = wrong_monitors(run, [condition.name for condition in settings.conditions])
        if wrong is not None:
            raise GridError(f"{name}: $.run.{wrong}")


def _check_interfaces(settings: Settings, dimension: int, name: str) -> None:
    names = [region.name for region in settings.regions]
    for number, interface in enumerate(settings.interfaces):
        wrong = wrong_interface(interface, names, dimension)
        if wrong is not None:
            raise GridError(f"{name}: $.interfaces[{number}]{wrong}")


def _check_selection(selection: Selection, grid: Grid, place: str) -> None:
    if (selection.nodes is None) == (selection.box is None):
        raise GridError(f"{place}: neither or both of nodes and box are given; give one of them")
    if selection.nodes is not None:
        node_ids = np.array(selection.nodes, dtype=np.int64)
        missing = grid.missing(node_ids)
        if len(missing):
            raise GridError(f"{place}.nodes: id {missing[0]} does not exist; use the grid's nodes")
        if not selection.nodes:
            raise GridError(f"{place}.nodes is empty; give at least one")
    elif selection.box is not None:
        _check_length(selection.box, 2 * grid.dimension, f"{place}.box")
        if not len(grid.chosen(None, selection.box)):
            raise GridError(f"{place}.box: no node is in {list(selection.box)}; enlarge the box")


def _check_condition(condition: AnyCondition, place: str) -> None:
    if isinstance(condition, Load) and len(given_of(condition)) != 1:
        load_names = " and ".join(given_of(condition)) or "none"
        raise GridError(f"{place}: {load_names} given; give one of {', '.join(LOADS)}")
    shares, nodes = getattr(condition, "shares", None), condition.nodes or ()
    spread = isinstance(condition, Load) and (condition.traction or condition.pressure is not None)
    if isinstance(condition, Load) and shares is not None and (not spread or len(shares) != len(nodes)):
        raise GridError(
            f"{place}.shares has {len(shares)} values; give one for each of {len(nodes)} nodes with a traction, or none"
        )
    if isinstance(condition, Load):
        _check_pressure(condition, place)
    if isinstance(condition, (*PRESCRIBED, InitialDisplacement)) and set(components(condition)) == {None}:
        raise GridError(f"{place}: neither x nor y is given; give at least one of them")
    if isinstance(condition, Source) and (condition.rate is None) == (condition.flux is None):
        raise GridError(f"{place}: neither or both of rate and flux are given; give one of them")
    if isinstance(condition, Source | Exchange):
        needs_length = not isinstance(condition, Source) or condition.flux is not None
        if needs_length and condition.length is condition.surface is None:
            raise GridError(f"{place}.length is missing; give that of the edge (or the surface) gone through")
    if isinstance(condition, Timed):
        times = [time for time, _ in condition.profile]
        if any(not before < after for before, after in itertools.pairwise(times)):
            raise GridError(f"{place}.profile: times {times} do not increase; put them in order")


def _check_pressure(load: Load, place: str) -> None:
    """Raise GridError for a pressure without what it acts on, or for that of another load."""
    vectors, nodes = load.area_vectors or (), load.nodes or ()
    if load.pressure is not None and (not vectors or len(vectors) != len(nodes)):
        raise GridError(f"{place}.area_vectors has {len(vectors)} vectors; give one for each of {len(nodes)} nodes")
    if load.pressure is None and (load.area_vectors is not None or load.faces is not None or load.following):
        raise GridError(f"{place}: area_vectors, faces and following are of a pressure; leave them out, or give one")
    if load.following and not load.faces:
        raise GridError(f"{place}.faces is missing; give those of a pressure that is following")
    if load.following and is_of_place(load.pressure):
        raise GridError(f"{place}.pressure varies with place; use a number, as it is following")


def _check_components(condition: AnyCondition, dimension: int, place: str) -> None:
    """Raise GridError for components of a body in a plate, and for vectors of a plate in a body."""
    if isinstance(condition, Load):
        for key, vector in given_of(condition).items():
            _check_length(vector, 1 if key == "pressure" else dimension, f"{place}.{key}")
        for vector in condition.area_vectors or ():
            _check_length(vector, dimension, f"{place}.area_vectors")
        for face in condition.faces or ():
            _check_length(face, dimension**2, f"{place}.faces")
        extent = "surface" if dimension == 2 else "length"
        if getattr(condition, extent) is not None:
            raise GridError(f"{place}.{extent} cannot be used in {WHOLES[dimension]}; leave it out")
    elif isinstance(condition, Spring):
        wrong = wrong_spring(condition, dimension)
        if wrong is not None:
            raise GridError(f"{place}{wrong}")
    elif isinstance(condition, InitialVelocity) and (wrong := wrong_spin(condition.spin, dimension)) is not None:
        raise GridError(f"{place}.{wrong}")
    elif dimension == 2 and getattr(condition, "z", None) not in (None, 0.0):
        raise GridError(f"{place}.z cannot be used in {WHOLES[2]}; leave it out")


def _check_values(condition: AnyCondition, grid: Grid, place: str) -> None:
    """Raise GridError for an expression or a table that has no finite value at one of the condition's nodes."""
    for name, at, value in varying(condition):
        wrong = wrong_value(value, grid.dimension)
        if is_over_time(value) and (not isinstance(condition, (Load, *PRESCRIBED)) or condition.profile):
            wrong = wrong or "a table has times here; use one value at a place, and for loads and motions no profile"
        if wrong is None:
            try:
                values_at(value, grid.part(grid.chosen(condition.nodes, condition.box)).position)
            except PlaceError as error:
                wrong = str(error)
        if wrong is not None:
            raise GridError(f"{place}.{named(name, at)}: {wrong}")


def _check_data_times(settings: Settings, name: str) -> None:
    """Raise GridError for data over time that ends before the run, if its duration is given."""
    run = settings.run
    if run.duration is not None and run.solver != "static":
        wrong = data_too_short(settings.conditions, run.duration)
        if wrong is not None:
            raise GridError(f"{name}: {wrong}")


def data_too_short(conditions: Sequence[AnyCondition], end: float) -> str | None:
    """What is wrong with data over time that ends before a run does at `end`, s; None if none does."""
    for number, condition in enumerate(conditions):
        last = end_of_data(condition)
        if last is not None and last < end * (1 - SAME_TIME):
            return (
                f"$.conditions[{number}]: its data end at {last:g} s, before the run at {end:g} s; use data over the"
                " whole run, or a shorter run"
            )
    return None


def two_motions(
    conditions: Sequence[AnyCondition], rows_of_one: Callable[[Selection], NDArray[np.int64]]
) -> tuple[int, str, int, int] | None:
    """The first node and component with prescribed motions of two kinds: the later condition's number, the axis, the
    earlier condition's number, and the node's row; None if there is none."""
    motions: list[tuple[int, type, tuple[Value | None, ...], NDArray[np.int64]]] = []
    for number, condition in enumerate(conditions):
        if not isinstance(condition, PRESCRIBED):
            continue
        prescribed_values, rows = components(condition), rows_of_one(condition)
        for earlier_number, kind, theirs, others in motions:
            both = [
                axis
                for axis, a, b in zip("xyz", prescribed_values, theirs, strict=True)
                if a is not None and b is not None
            ]
            if kind is type(condition) or not both:
                continue
            common = np.intersect1d(rows, others)
            if len(common):
                return number, both[0], earlier_number, int(common[0])
        motions.append((number, type(condition), prescribed_values, rows))
    return None


def _check_length(numbers: Sequence[object], expected: int, place: str) -> None:
    if len(numbers) != expected:
        model_kind = WHOLES[2 if expected in (2, 4) else 3]
        raise GridError(f"{place} has {len(numbers)} numbers; give {expected} in {model_kind}")
