"""A report of a run as one self-contained HTML page: results first, then the model and how it was solved.

A quasi-static run begins with its load-displacement curve. Maps that are zero everywhere are named and left out. For
bodies in space, fields are shown on planes through the middle; the scene is left out.
"""

from __future__ import annotations

import base64
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pdmesh.model.amounts import pair_count, way
from pdmesh.model.suggestions import called
from pdmesh.plain_figure import Figure
from pdmesh.plain_text import for_html
from pdpost.figures import charts, crack_figure, crack_surface_figure, field_figure
from pdpost.figures.animation import gif
from pdpost.figures.colours import prefixed, scaled, spelled
from pdpost.figures.scene_figure import acted_on, scene
from pdpost.figures.style import written
from pdsolve.measures import crack_3d, crack_summary
from pdsolve.measures.balance import (
    AMOUNTS,
    energy_balance,
    energy_loss_warnings,
    mass_balance_with_unit,
    thickness_unit_suffix,
)
from pdsolve.measures.embedded_model import at_rest, counts_load_steps, moment, whole
from pdsolve.measures.fields import FIELDS as FIELDS_BY_NAME
from pdsolve.measures.fields import default_field_name, field_values
from pdsolve.measures.forces import moving_conditions, read_condition_force_histories, strongest
from pdsolve.measures.frame_steps import OF_DIFFUSION, chosen, frames, has_diffusion_only
from pdsolve.measures.softened_bonds import separation_history
from pdsolve.results import DamagedError, Nodes, Results, ResultsError

DPI = 110
FRAMES = 40  # of the animation, at most
CURVES = 6  # conditions in a chart, at most
FIELDS = ("damage", "displacement", "velocity", "acceleration", "energy", *OF_DIFFUSION)
OF_MOTION = {"velocity", "acceleration"}  # zero in equilibrium
UNITS = {"E": "Pa", "rho": "kg/m³", "G0": "J/m²", "D": "m²/s", "C_solid": "mol/m³", "C_sat": "mol/m³"}
VIEWPORT = '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
STYLE = """
:root { color-scheme: light dark; --ink: #222; --paper: #fff; --line: #ccc; }
@media (prefers-color-scheme: dark) { :root { --ink: #ddd; --paper: #1c1e21; --line: #555; } }
body { font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper); }
body { max-width: 56rem; margin: 2rem auto; padding: 0 1rem; }
h1 { font-size: 1.6rem; } h2 { font-size: 1.2rem; border-bottom: 1px solid var(--line); margin-top: 2.2rem; }
table { border-collapse: collapse; margin: 0.6rem 0; } td, th { text-align: left; padding: 0.15rem 1.2rem 0.15rem 0; }
th { font-weight: 600; vertical-align: top; }
img { max-width: 100%; height: auto; display: block; margin: 0.6rem auto; background: #fff; border-radius: 4px; }
td { overflow-wrap: anywhere; }
"""
PROVENANCE = {
    "program": "program",
    "provenance": "made by",
    "created": "date",
    "numpy": "numpy",
    "numba": "numba",
    "mode": "mode",
    "precision": "precision",
    "threads": "threads",
    "kernel": "kernel",
    "status": "status",
}


def report(results: Results, name: str, *, animation: str = "") -> str:
    """The page, titled `name`; equal results give equal text. Raises ResultsError if there is no frame yet.

    `animation` is HTML in place of a film.
    """
    steps, _ = frames(results)
    model, meta, nodes = whole(results), results.meta(), results.nodes(0)
    moves, flat = not has_diffusion_only(results), results.dimension == 2
    scene_images = [_image(scene(results, model), "the plate, its grid and its conditions")] if flat else []
    sections = [
        *([("Load and displacement", curve)] if (curve := _load_displacement(results)) else []),
        *([("Crack", _crack(results))] if moves else []),
        ("Animation", [animation] if animation else _film(results, steps)),
        *_fields_at_peak(results, steps),
        (f"Fields at {moment(results, int(steps[-1]), 'µs')}", _fields(results, int(steps[-1]))),
        ("Balance", _balance(results) if moves else _masses(results)),
        ("Scene", [*scene_images, _conditions(nodes, model)]),
        ("Grid", [_table(_grid(results, nodes))]),
        ("Settings", [_table(_settings(model, meta, at_rest(results), counts_load_steps(results)))]),
        ("Provenance", [_table((title, meta[key]) for key, title in PROVENANCE.items() if key in meta)]),
    ]
    body = "\n".join(f"<h2>{for_html(title)}</h2>\n" + "\n".join(parts) for title, parts in sections)
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n{VIEWPORT}'
        f"<title>{for_html(name)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n<h1>{for_html(name)}</h1>\n{body}\n</body>\n</html>\n"
    )


def _fields_at_peak(results: Results, steps: NDArray[np.int64]) -> list[tuple[str, list[str]]]:
    """The fields in the frame nearest to the largest force of a quasi-static run; nothing where it is the last one."""
    curves = moving_conditions(read_condition_force_histories(results)) if at_rest(results) else []
    if not curves:
        return []
    curve = strongest(curves, 1)[0]
    step = int(steps[np.abs(steps - int(curve.step[curve.peak_index])).argmin()])
    if step in (0, int(steps[-1])):
        return []
    return [(f"Fields at the largest force, {moment(results, step, 'µs')}", _fields(results, step))]


def _load_displacement(results: Results) -> list[str]:
    """The curve of a quasi-static run and its peaks; nothing for other runs and where no condition moves."""
    if not at_rest(results) or not len(results.reactions()):
        return []
    per = thickness_unit_suffix(results)
    every_curve = moving_conditions(read_condition_force_histories(results))
    if not every_curve:
        return []
    curves, items = strongest(every_curve, CURVES), []
    for curve in curves:
        peak, force, way = curve.peak_index, curve.force_along_axis, curve.displacement_along_axis
        newton, newtons = scaled([force], f"N{per}")
        metre, metres = scaled([way], "m")
        items.append(
            f"{curve.name}: the largest force is {force[peak] * newton:.4g} {newtons}, at a displacement of"
            f" {way[peak] * metre:.4g} {metres} ({moment(results, int(curve.step[peak]), 'µs')})"
        )
    if more := len(every_curve) - len(curves):
        items.append(f"{more} more conditions, with smaller forces, are left out")
    said = "".join(f"<li>{for_html(item)}</li>" for item in items)
    return [_image(charts.load_displacement(curves, per=per), "load-displacement curve"), f"<ul>{said}</ul>"]


def _film(results: Results, steps: NDArray[np.int64]) -> list[str]:
    """A film of the default field, or of the displacement where that field is zero; and how many frames it has."""
    last, name = int(steps[-1]), default_field_name(results, int(steps[0]))
    if _is_zero(results, name, last) and "ux" in results.stored(last):
        name = "displacement"
    every = max(1, -(-len(steps) // FRAMES))
    film, count = gif(results, name, every=every, dpi=80), len(chosen(results, every))
    words = f"{FIELDS_BY_NAME[name].title} in {count} of {len(steps)} frames"
    return [_picture(film, "gif", f"{name} over time"), f"<p>{for_html(words)}</p>"]


def _grid(results: Results, nodes: Nodes) -> dict[str, str]:
    low, high = nodes.position.min(axis=0) * 1e3, nodes.position.max(axis=0) * 1e3
    levels, counts = np.unique(nodes.delta, return_counts=True)
    bonds, total_size = pair_count(int((nodes.family - nodes.cut).sum())), float(nodes.area.sum())
    changes = len(results.epochs()) - 1
    later = f" at the start, {len(results.nodes().ids)} at the end, after {changes} changes" if changes else ""
    cracks = results.cracks()
    pre_cracks = f"{len(cracks)} triangles" if results.dimension == 3 else _text(cracks.tolist()) + " m"
    extent = {"area": f"{total_size * 1e6:.6g} mm²"} if len(low) == 2 else {"volume": f"{total_size * 1e9:.6g} mm³"}
    return {
        "nodes": str(len(nodes.ids)) + later,
        "spacings": ", ".join(f"{count} of {level * 1e3:.4g} mm" for level, count in zip(levels, counts, strict=True)),
        "from, to": f"{_text(low.tolist(), '.4g')} to {_text(high.tolist(), '.4g')} mm",
        **extent,
        "bonds": f"{bonds}, and {pair_count(int(nodes.cut.sum()))} cut by pre-cracks",
        "pre-cracks": pre_cracks if len(cracks) else "none",
    }


def _settings(model: dict[str, Any], meta: Mapping[str, Any], static: bool, counts_steps: bool) -> dict[str, str]:
    run = model.get("run", {})
    made_of = model.get("medium") or model["material"]
    settings = {name: f"{_text(value)} {UNITS.get(name, '')}".rstrip() for name, value in made_of.items()}
    settings |= {
        f"region {number + 1}": _text(region["material"]) for number, region in enumerate(model.get("regions", []))
    }
    settings["horizon"] = f"{model.get('horizon', {}).get('ratio', 3.0):g} spacings"
    second, prefix = prefixed(float(meta["time_step"]))
    step, sure = (f"{meta[name] * second:.4g} {prefix}s" for name in ("time_step", "stable_time_step"))
    if not counts_steps:
        settings["time step"] = step if static else f"{step}, stable up to {sure}"
    settings |= {name: _text(value) for name, value in run.items() if name != "time_step"}
    settings |= {
        name.removeprefix("Peridynamics/"): _text(value) for name, value in model.get("parameters", {}).items()
    }
    return {"drawing": model.get("source", ""), **settings}


def _conditions(nodes: Nodes, model: dict[str, Any]) -> str:
    rows = []
    for number, condition in enumerate(model.get("conditions", [])):
        what = {key: value for key, value in condition.items() if key not in ("kind", "name", "nodes")}
        name = called(condition.get("name"), number)
        count = int(acted_on(nodes, condition).sum())
        words = ", ".join(f"{key} {_text(value)}" for key, value in what.items())
        rows.append((name, f"{condition['kind']} of {count} nodes: {words}"))
    return _table(rows)


def _balance(results: Results) -> list[str]:
    books, per = energy_balance(results), thickness_unit_suffix(results)
    names = ("work", "kinetic", "strain", "dissipated", *(("damped",) if np.isfinite(books.damped[-1]) else ()))
    names = (*names, *(("friction",) if books.friction[-1] else ()))
    last = {name: f"{getattr(books, name)[-1]:.5g} J{per}" for name in names}
    last = {"put in" if name == "work" else name: value for name, value in last.items()}
    last["balance error"] = f"{books.error[-1]:+.2e} of the energy supplied"
    last["broken bonds"] = str(pair_count(len(results.breaks().step)))
    said = "".join(f"<li>{for_html(sentence)}</li>" for sentence in energy_loss_warnings(results))
    parts = [
        _table(last),
        *([f"<ul>{said}</ul>"] if said else []),
        _image(charts.balance(books, per, counts_load_steps(results)), "energies over time"),
    ]
    if len(results.reactions()):
        histories = read_condition_force_histories(results)
        parts.append(
            _image(
                charts.reactions(strongest(histories, CURVES), per=per, counts_load_steps=counts_load_steps(results)),
                "forces of loads and grips",
            )
        )
    return parts


def _masses(results: Results) -> list[str]:
    books, unit = mass_balance_with_unit(results)
    at_end = {name: float(getattr(books, name)[-1]) for name in AMOUNTS}
    last = {way(name, amount): f"{abs(amount):.6g} {unit}" for name, amount in at_end.items()}
    last["balance error"] = f"{books.error[-1]:+.1e} of what there was"
    if np.isfinite(books.solid_share_left[-1]):
        last["solid left"] = f"{books.solid_share_left[-1]:.2%}"
    return [_table(last), _image(charts.masses(books, unit), "amounts over time")]


def _crack(results: Results) -> list[str]:
    if results.dimension == 3:
        in_space = crack_3d.crack_3d(results)
        sentences = crack_3d.summary_sentences(in_space)
        figure = crack_surface_figure.crack_surface(results, in_space)
        words = "surface of the crack, its area and its cost"
        shown = len(in_space.surface.face_corners) > 0
    else:
        summary = crack_summary.crack(results)
        sentences = crack_summary.summary_sentences(summary)
        figure, words = crack_figure.crack(results, summary), "path, length and speed of the crack"
        shown = len(summary.branches) > 0
    items = "".join(f"<li>{for_html(spelled(sentence))}</li>" for sentence in sentences)
    return [f"<ul>{items}</ul>", *([_image(figure, words)] if shown else [])]


def _fields(results: Results, step: int) -> list[str]:
    parts, zero = [], []
    for name in (*FIELDS, *(["separation"] if separation_history(results) is not None else [])):
        if name in OF_MOTION and at_rest(results):
            continue
        try:
            if _is_zero(results, name, step):
                zero.append(name)
            else:
                parts.append(_image(field_figure.field(results, name, step), name))
        except DamagedError:
            raise
        except ResultsError:  # a field that was not stored, or is of another physics
            continue
    return parts + ([f"<p>Zero at all nodes: {for_html(', '.join(zero))}.</p>"] if zero else [])


def _is_zero(results: Results, name: str, step: int) -> bool:
    """Whether no node has another value than 0. Raises ResultsError."""
    values = field_values(results, name, step)
    return not (np.isfinite(values) & (values != 0)).any()


def _table(rows: Mapping[str, object] | Iterable[tuple[str, object]]) -> str:
    pairs = rows.items() if isinstance(rows, Mapping) else rows
    cells = "".join(f"<tr><th>{for_html(name)}</th><td>{for_html(value)}</td></tr>\n" for name, value in pairs)
    return f"<table>\n{cells}</table>"


def _text(value: object, digits: str = "g") -> str:
    if isinstance(value, float):
        return f"{value:{digits}}"
    if isinstance(value, dict):
        return ", ".join(f"{key} {_text(item)}" for key, item in value.items())
    if isinstance(value, list):
        return f"({', '.join(_text(item, digits) for item in value)})"
    return str(value)


def _image(figure: Figure, alternative: str) -> str:
    return _picture(written(figure, "png", DPI), "png", alternative)


def _picture(data: bytes, kind: str, alternative: str) -> str:
    text = base64.b64encode(data).decode()
    return f'<img alt="{for_html(alternative)}" src="data:image/{kind};base64,{text}">'
