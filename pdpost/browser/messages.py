"""The data of a run as messages to the page, each by its address: numbers and texts as JSON, arrays as bytes.

A message is the length of its header (uint32), the header (JSON, padded to a multiple of four bytes) and its arrays
(float32 or int32), all little-endian. Addresses are ``run``, ``charts``, ``summary``, ``nodes/STEP``,
``field/NAME/COMPONENT/STEP``, ``displacement/STEP``, ``cracks/STEP``, ``history/NODE`` and ``history/usual``. Every
value is one that another command of pdpost shows, computed by the same function.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from numpy.typing import NDArray

from pdmesh.model.amounts import way
from pdmesh.model.output_fields import FIELDS as STORED
from pdmesh.model.output_fields import of_dimension
from pdmesh.plain_text import for_line
from pdpost.figures import colours, field_figure
from pdpost.figures.style import COLOURS, TORN, UNKNOWN
from pdsolve.fracture.crack_particles import arms, until
from pdsolve.measures import balance, crack_3d, crack_summary, fields, forces, histories
from pdsolve.measures.crack_faces import build_crack_surface, find_opened_face_neighbours
from pdsolve.measures.embedded_model import at_rest, counts_load_steps
from pdsolve.measures.frame_steps import frames, has_diffusion_only, vector
from pdsolve.measures.paths import crack_paths
from pdsolve.measures.plate_geometry import read_plate_geometry
from pdsolve.results import DamagedError, Results, ResultsError

MOST_POINTS = 2000  # of a curve
MOST_CURVES = 12  # of a chart
ENERGIES = ("kinetic", "strain", "dissipated", "total", "damped", "friction")
USUAL = "history/usual"  # the address of the histories of probes, or else of the node that moves furthest
SCALAR = "value"  # the component of a scalar in an address


class Curve(NamedTuple):
    """A curve of a chart with t points, SI units."""

    name: str
    time: NDArray[np.float64]  # (t,)
    x: NDArray[np.float64]  # (t,)
    y: NDArray[np.float64]  # (t,)


def message(header: dict[str, Any], **arrays: NDArray[Any]) -> bytes:
    """A header and named arrays as bytes."""
    kinds = {name: "i4" if array.dtype.kind == "i" else "f4" for name, array in arrays.items()}
    header["arrays"] = [(name, kinds[name], array.size) for name, array in arrays.items()]
    text = json.dumps(header, allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    parts = [np.ascontiguousarray(array, dtype=f"<{kinds[name]}").tobytes() for name, array in arrays.items()]
    return b"".join([len(text).to_bytes(4, "little"), text, *parts])


def answer(results: Results, address: str, most: int | None = None) -> bytes | None:
    """The message at an address; None for an unknown one. `most` is the number of nodes that is not exceeded.

    What the run lacks, such as a field that is not stored, is a message with an `error` in words. Raises DamagedError.
    """
    kind, *words = address.split("/")
    known: dict[tuple[str, int], Callable[..., bytes]] = {
        ("run", 0): lambda: run(results),
        ("charts", 0): lambda: time_charts(results),
        ("summary", 0): lambda: summary(results),
        ("nodes", 1): lambda step: nodes(results, int(step), most),
        ("field", 3): lambda name, part, step: field(results, name, part, int(step), most),
        ("displacement", 1): lambda step: displacement(results, int(step), most),
        ("cracks", 1): lambda step: cracks(results, int(step)),
        ("history", 1): lambda node: node_charts(results, node),
    }
    compute = known.get((kind, len(words)))
    if compute is None or (words and not words[-1].isdecimal() and address != USUAL):
        return None
    try:
        return compute(*words)
    except DamagedError:
        raise
    except (ResultsError, fields.FieldError) as error:
        return message({"error": for_line(str(error))})


def shown_rows(count: int, most: int | None) -> NDArray[np.int64]:
    """Rows of the nodes that are shown: all, or `most` of them, spread over the body."""
    if most is None or count <= most:
        return np.arange(count)
    return np.sort(np.random.default_rng(0).permutation(count)[:most])


def available_fields(results: Results, step: int) -> list[fields.NodalField]:
    """The fields that the frame at `step` has, the default one first."""
    stored, diffusion = set(results.stored(step)), has_diffusion_only(results)

    def is_there(name: str) -> bool:
        if name in STORED and set(of_dimension(name, results.dimension)) <= stored:
            return True
        if fields.FIELDS[name].is_fitted_to_bonds:
            return not diffusion and set(of_dimension("displacement", results.dimension)) <= stored
        return name in ("damage", "separation") and not diffusion

    first = fields.default_field_name(results, step)
    names = [first, *(name for name in fields.FIELDS if name != first)]
    return [fields.FIELDS[name] for name in names if is_there(name)]


def run(
    results: Results, some_steps: Sequence[int] | None = None, some_fields: Sequence[tuple[str, str]] | None = None
) -> bytes:
    """What the run is: its status, frames and fields, and the colours of the page. Raises ResultsError.

    Only the frames and the components of fields (name, component) that are named are listed, without names all.
    """
    steps, times = frames(results)
    last = int(steps[-1])
    chosen = np.arange(len(steps)) if some_steps is None else np.flatnonzero(np.isin(steps, some_steps))
    steps, times = steps[chosen], times[chosen]
    listed = []
    for entry in available_fields(results, last):
        parts = entry.component_names(results.dimension) or (SCALAR,)
        parts = tuple(part for part in parts if some_fields is None or (entry.name, part) in some_fields)
        listed += [{"name": entry.name, "title": entry.title, "unit": entry.unit, "components": parts}] * bool(parts)
    header = {
        "status": str(results.meta().get("status", "running")),
        "dimension": results.dimension,
        "steps": steps.tolist(),
        "times": times.tolist(),
        "moments": [colours.at(results, step) for step in steps.tolist()],
        "epochs": [results.epoch(step) for step in steps.tolist()],
        "fields": listed,
        "can_move": set(of_dimension("displacement", results.dimension)) <= set(results.stored(last)),
        "has_cracks": not has_diffusion_only(results),
        "palettes": {  # 256 colours, each red, green and blue from 0 to 255
            name: colormaps[name](np.linspace(0, 1, 256), bytes=True)[:, :3].ravel().tolist()
            for name in ("viridis", "magma_r", "coolwarm")
        },
        "curve_colours": COLOURS,
        "node_colours": {"torn": TORN, "unknown": UNKNOWN},
    }
    return message(header)


def nodes(results: Results, step: int, most: int | None = None) -> bytes:
    """Ids (n,), places (n, 3) from the centre and spacings (n,), m, of the nodes at a step; a plate has z = 0."""
    there = results.nodes(step)
    rows = shown_rows(len(there.ids), most)
    low, high = there.position.min(axis=0), there.position.max(axis=0)
    centre = (low + high) / 2
    wider = (len(there.ids) / len(rows)) ** (1 / results.dimension)
    header = {
        "centre": [*centre.tolist(), 0.0][:3],
        "size": (high - low + 2 * float(there.delta.max())).tolist(),
        "count": len(there.ids),
    }
    position = _in_space((there.position - centre)[rows])
    return message(header, ids=there.ids[rows].astype(np.int32), position=position, spacing=there.delta[rows] * wider)


def field(results: Results, name: str, part: str, step: int, most: int | None = None) -> bytes:
    """A component (n,) of a field, SI: infinite where it is left out near cracks, NaN where it is unknown."""
    part = fields.choose_component(name, None if part == SCALAR else part, results.dimension)
    shown = field_figure.values_of(results, name, step, part)
    whole = 1.0 if name in colours.SHARES else None  # lest the scale change from frame to frame
    range_of = colours.colours(name, part, shown.values[~shown.torn], whole)
    header = {
        "title": colours.title(results, name, part, step, 0.0).replace("\n", " "),
        "legend": [{"colour": colour, "words": words} for colour, words in field_figure.explained(shown)],
        "unit": fields.FIELDS[name].unit,
        **{key: value for key, value in range_of._asdict().items() if key != "beyond"},
    }
    values = np.where(shown.torn, np.inf, shown.values)
    return message(header, value=values[shown_rows(len(values), most)])


def displacement(results: Results, step: int, most: int | None = None) -> bytes:
    """Displacements (n, 3), m, of the nodes; 0 where they are unknown."""
    values = np.nan_to_num(vector(results, "displacement", step))
    return message({}, moved=_in_space(values[shown_rows(len(values), most)]))


def cracks(results: Results, step: int) -> bytes:
    """Cracks after a step, m, from the centre of the nodes: lines of a plate, triangles (t, 9) of a body.

    Lines are paths, those of `pdpost crack`, pre-cracks and the arms of cracks that are particles.
    """
    there = results.nodes(step)
    centre = (there.position.min(axis=0) + there.position.max(axis=0)) / 2
    if results.dimension == 3:
        surface = build_crack_surface(results, step, find_opened_face_neighbours(results, step))
        corners = (surface.corners - centre)[surface.face_corners[:, [0, 1, 2, 0, 2, 3]]]
        return message({}, triangles=corners.reshape(-1, 9))
    pre_cracks = read_plate_geometry(results).pre_cracks
    segments = np.concatenate([pre_cracks, arms(until(results.particles(), step), after=0)]).reshape(-1, 2, 2)
    lines = [("path", points) for points in crack_paths(results, step)]
    lines += [("pre-crack" if number < len(pre_cracks) else "path", pair) for number, pair in enumerate(segments)]
    points = np.concatenate([np.zeros((0, 2)), *(points for _, points in lines)]) - centre
    return message({"lines": [(kind, len(points)) for kind, points in lines]}, points=_in_space(points))


def summary(results: Results) -> bytes:
    """The sentences of `pdpost crack`."""
    if results.dimension == 3:
        sentences = crack_3d.summary_sentences(crack_3d.crack_3d(results))
    else:
        sentences = crack_summary.summary_sentences(crack_summary.crack(results))
    return message({"sentences": [for_line(colours.spelled(sentence)) for sentence in sentences]})


def time_charts(results: Results) -> bytes:
    """Forces, and energies or amounts; what the run does not have is left out."""
    shown = []
    for draw in (_forces, _energies, _amounts):
        try:
            shown += draw(results)
        except DamagedError:
            raise
        except ResultsError:  # of another physics, or not stored
            continue
    return message({"charts": shown})


def node_charts(results: Results, node: str) -> bytes:
    """The displacement of a node over time, or of the "usual" nodes as `pdpost history` draws them."""
    ids = histories.usual_history_nodes(results) if node == "usual" else [int(node)]
    read = (histories.node_history(results, node_id) for node_id in ids[:MOST_CURVES])
    curves = [Curve(one.label, one.time, one.time, one.value) for one in read]
    return message({"charts": [_chart("Displacement of nodes", _time(results), ("displacement", "m"), curves)]})


def _energies(results: Results) -> list[dict[str, Any]]:
    energy, unit = balance.energy_balance(results), f"J{balance.thickness_unit_suffix(results)}"
    names = [name for name in ENERGIES if name not in ENERGIES[4:] or np.any(getattr(energy, name) > 0)]
    curves = [Curve(name, energy.time, energy.time, getattr(energy, name)) for name in names]
    curves.append(Curve("put in", energy.time, energy.time, energy.work))
    return [_chart("Energy", _time(results), ("energy", unit), curves)]


def _amounts(results: Results) -> list[dict[str, Any]]:
    amounts, unit = balance.mass_balance_with_unit(results)
    curves = []
    for name in balance.AMOUNTS:
        column = getattr(amounts, name)
        if np.any(column):
            signed = np.where(column[-1] < 0, -column, column)
            curves.append(Curve(way(name, column[-1]), amounts.time, amounts.time, signed))
    return [_chart("Amounts", _time(results), ("amount", unit), curves)]


def _forces(results: Results) -> list[dict[str, Any]]:
    """Forces over the displacement of their nodes in runs at rest, over time in others."""
    unit, rest, curves = f"N{balance.thickness_unit_suffix(results)}", at_rest(results), []
    for one in forces.read_condition_force_histories(results):
        axis = one.main_axis
        x = one.displacement[:, axis] if rest else one.time
        curves.append(Curve(f"{one.name} ({one.kind}), {'xyz'[axis]}", one.time, x, one.force[:, axis]))
    if rest:  # what hardly moves has no curve
        most = max(float(np.ptp(curve.x)) for curve in curves)
        curves = [curve for curve in curves if np.ptp(curve.x) >= forces.STILL * most]
    title, x_axis = ("Force and displacement", ("mean displacement", "m")) if rest else ("Forces", _time(results))
    return [_chart(title, x_axis, ("force", unit), curves)]


def _time(results: Results) -> tuple[str, str]:
    """The word and the unit of an axis of time."""
    return ("load step", "") if counts_load_steps(results) else ("time", "s")


def _chart(title: str, x: tuple[str, str], y: tuple[str, str], curves: Sequence[Curve]) -> dict[str, Any]:
    """A chart for the page: curves in SI units; axes are words and units, with the factor to the unit they show."""
    ends = {}
    for key, (word, unit) in (("x", x), ("y", y)):
        factor, shown = colours.scaled([getattr(curve, key) for curve in curves], unit)
        ends[key] = {"label": f"{word}, {shown}" if shown else word, "factor": factor}
    shown_curves = []
    for curve in curves[:MOST_CURVES]:
        rows = _outline(curve.y)
        points = {
            key: [float(value) if np.isfinite(value) else None for value in getattr(curve, key)[rows]]
            for key in ("time", "x", "y")
        }
        shown_curves.append({"name": for_line(curve.name), **points})
    return {"title": title, **ends, "curves": shown_curves, "left_out": len(curves[MOST_CURVES:])}


def _outline(values: NDArray[np.float64]) -> NDArray[np.int64]:
    """Rows that draw a curve of many points: the smallest and the largest of each stretch, the first and the last."""
    if len(values) <= MOST_POINTS:
        return np.arange(len(values))
    sound = np.nan_to_num(values)
    bounds = np.linspace(0, len(values), MOST_POINTS // 2, dtype=np.int64)
    stretches = list(itertools.pairwise(bounds.tolist()))
    low = [first + int(sound[first:last].argmin()) for first, last in stretches]
    high = [first + int(sound[first:last].argmax()) for first, last in stretches]
    return np.unique([0, *low, *high, len(values) - 1])


def _in_space(vectors: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors (n, 2) or (n, 3) as (n, 3)."""
    return np.column_stack([vectors, np.zeros((len(vectors), 3 - vectors.shape[1]))])
