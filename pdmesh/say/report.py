"""What a model holds, and what a scene will cost: the numbers behind `pdmesh info` and `pdmesh plan`."""

from __future__ import annotations

from typing import Any

import numpy as np

from pdmesh.grid.lattice import grid_of_nodes, place_nodes
from pdmesh.model import selection
from pdmesh.model.cloud import Grid, grid_of
from pdmesh.model.document import Document, Settings
from pdmesh.model.visibility import plate_of
from pdmesh.say.families import count, stable_step
from pdmesh.scene.scene import Scene

# What a run takes, measured on two cores: 1.2 to 2.7 ns a bond and step on the shipped scenes, breaking included; at
# its peak, while bonds are made, 90 000 nodes and 2.1 to 2.5 million bonds 0.53 (thesis mode) to 0.66 GB
SECONDS_PER_BOND_STEP = 1.8e-9
BYTES_AT_LEAST, BYTES_PER_BOND = 190_000_000, 200

MOST_COUNTED = 3_000_000  # nodes of a one-scale equivalent that are still placed, not estimated
SAMPLE = 20_000  # nodes whose bonds stand for those of a larger grid


def info(document: Document, name: str) -> dict[str, Any]:
    """What the model called `name` holds, for `pdmesh info`. Raises GridError."""
    grid = grid_of(document, name)
    selection.check(document, grid, name)
    plate, at_hole = plate_of(grid, name), grid.hole_id >= 0
    ratio = document.horizon.ratio
    bonds, cut = count(grid, ratio)
    low, high = grid.position.min(axis=0), grid.position.max(axis=0)
    result: dict[str, Any] = {
        "model": name,
        "source": document.source,
        "nodes": len(grid),
        "nodes_by_spacing": nodes_by_spacing(grid),
        "border_nodes": int(grid.border.sum()),
        "nodes_at_holes": {str(hole): int((grid.hole_id == hole).sum()) for hole in np.unique(grid.hole_id[at_hole])},
        "bonds": bonds,
        "bonds_cut_by_cracks": cut,
        "bounding_box": [*low.tolist(), *high.tolist()],
        "area_of_nodes": float(grid.areas.sum()) if grid.areas is not None else float((grid.delta**2).sum()),
        "area_of_shape": None if plate is None else float(plate.area),
        "crack_segments": len(grid.cracks),
        "horizon_ratio": ratio,
        "smallest_stable_step": smallest_step(document, grid),
        "time_step": document.run.time_step,
        "steps": document.run.steps,
        "area_rule": document.area_rule,
        "material": _fields(document.material),
        "regions": [{"name": region.name} | _fields(region.material) for region in document.regions],
        "conditions": [_condition(condition, grid) for condition in document.conditions],
    }
    return result


def nodes_by_spacing(grid: Grid) -> dict[str, int]:
    """How many nodes there are of each spacing, m."""
    return _by_spacing(*np.unique(np.round(grid.delta, 15), return_counts=True))


def info_lines(result: dict[str, Any]) -> list[str]:
    """What `info` found, for a reader."""
    x0, y0, x1, y1 = result["bounding_box"]
    lines = [
        f"{result['model']}: {result['nodes']} nodes"
        f" ({', '.join(f'{number} of {spacing} m' for spacing, number in result['nodes_by_spacing'].items())})",
        f"x {x0:g} to {x1:g} m, y {y0:g} to {y1:g} m; area {result['area_of_nodes']:.10g} m^2"
        + ("" if result["area_of_shape"] is None else f", of the shape {result['area_of_shape']:.10g} m^2"),
        f"{result['bonds']} directed bonds at horizon ratio {result['horizon_ratio']:g},"
        f" {result['bonds_cut_by_cracks']} of them cut by {result['crack_segments']} crack segments",
        _step_line(result["smallest_stable_step"], result["time_step"], result["steps"]),
    ]
    if result["material"]:
        lines.append("material: " + _words(result["material"]))
    lines += [f"material '{region['name']}': " + _words(region) for region in result["regions"]]
    return lines + [
        f"{entry['kind']} '{entry.get('name', '')}': {entry['nodes']} nodes, "
        + _words({key: value for key, value in entry.items() if key not in ("kind", "name", "nodes", "box")})
        for entry in result["conditions"]
    ]


def plan_lines(result: dict[str, Any]) -> list[str]:
    """What `plan` found, for a reader: the scene and its one-scale equivalent side by side."""
    own, flat = result["scene"], result["one_scale"]
    units = {"smallest_stable_step": "s", "time_step": "s", "steps": "", "memory_bytes": "B", "solve_seconds": "s"}
    rows = [("", "this scene", "one scale")]
    for spacing, number in own["nodes_by_spacing"].items():
        rows.append((f"nodes of {spacing} m", str(number), str(flat["nodes_by_spacing"].get(spacing, 0))))
    rows += [(key, str(own[key]), str(flat[key])) for key in ("nodes", "bonds")]
    rows += [
        (key.replace("_", " "), _quantity(own[key], unit), _quantity(flat[key], unit)) for key, unit in units.items()
    ]
    return [f"{label:22}{here:>14}{there:>14}" for label, here, there in rows]


def _quantity(value: float | None, unit: str) -> str:
    return "?" if value is None else f"{value:.4g} {unit}".strip()


def _step_line(stable: float | None, step: float | None, steps: int) -> str:
    sure = "no material, so no stable step" if stable is None else f"surely stable step {stable:.4g} s"
    return f"{sure}; run: {'steps' if step is None else f'{step:.4g} s x'} {steps}"


def _words(fields: dict[str, Any]) -> str:
    return ", ".join(
        f"{name} = {value:g}" if isinstance(value, float) else f"{name} = {value}"
        for name, value in fields.items()
        if value is not None and name != "name"
    )


def _by_spacing(spacings: Any, counts: Any) -> dict[str, int]:
    """Counts by spacing; a mesh's many spacings as their range."""
    if len(spacings) > 16:
        return {f"{spacings[0]:g} to {spacings[-1]:g}": int(np.sum(counts))}
    return {f"{spacing:g}": int(number) for spacing, number in zip(spacings, counts, strict=True)}


def _fields(struct: Any) -> dict[str, Any]:
    return {} if struct is None else {name: getattr(struct, name) for name in struct.__struct_fields__}


def _condition(condition: Any, grid: Grid) -> dict[str, Any]:
    values = {"kind": condition.__struct_config__.tag} | _fields(condition)
    values["nodes"] = int(selection.selected(grid, condition.nodes, condition.box).sum())
    return {name: value for name, value in values.items() if value not in (None, (), "")}


def smallest_step(settings: Settings, grid: Grid) -> float | None:
    """The surely stable time step (s) of the finest nodes and the fastest material; None without a material."""
    materials = [material for material in (settings.material, *(r.material for r in settings.regions)) if material]
    if not materials:
        return None
    return min(stable_step(material, settings.horizon.ratio, float(grid.delta.min())) for material in materials)


def plan(scene: Scene) -> dict[str, Any]:
    """What a scene will cost, and what it would with its finest spacing everywhere. Raises SceneError."""
    own = _cost(scene)
    flat = scene.one_scale()
    one_scale = _cost(flat) if flat.shape.area / flat.finest**2 < MOST_COUNTED else _estimated_cost(flat, own)
    return {"source": scene.source, "scene": own, "one_scale": one_scale}


def _cost(scene: Scene) -> dict[str, Any]:
    nodes = place_nodes(scene)
    grid = grid_of_nodes(scene, nodes.position, nodes.delta, nodes.delta**2)
    bonds, _ = count(grid, scene.horizon, sample=SAMPLE)
    return {"nodes_by_spacing": nodes_by_spacing(grid)} | _price(scene, len(grid), bonds)


def _estimated_cost(scene: Scene, own: dict[str, Any]) -> dict[str, Any]:
    nodes = round(scene.shape.area / scene.finest**2)
    bonds = round(own["bonds"] / own["nodes"] * nodes)
    return {"nodes_by_spacing": {f"{scene.finest:g}": nodes}} | _price(scene, nodes, bonds)


def _price(scene: Scene, nodes: int, bonds: int) -> dict[str, Any]:
    materials = [material for material in (scene.material, *(r.region.material for r in scene.regions)) if material]
    stable = min((stable_step(material, scene.horizon, scene.finest) for material in materials), default=None)
    step = scene.run.time_step or stable
    return {
        "nodes": nodes,
        "bonds": bonds,
        "smallest_stable_step": stable,
        "time_step": step,
        "steps": scene.run.steps,
        "memory_bytes": BYTES_AT_LEAST + bonds * BYTES_PER_BOND,
        "solve_seconds": bonds * scene.run.steps * SECONDS_PER_BOND_STEP,
    }
