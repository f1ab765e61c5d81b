"""Contents of a model and estimated cost of a scene: the numbers behind `pdmesh info` and `pdmesh plan`."""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import msgspec
import numpy as np

from pdmesh.grid.adaptive_scene import nested, undivided
from pdmesh.grid.bodies import build_body
from pdmesh.grid.bodies_beside import build_scene
from pdmesh.grid.lattice import grid_of_nodes, place_nodes
from pdmesh.model import cohesive_softening, node_arrays, selection, zone_strengths
from pdmesh.model.amounts import pair_count
from pdmesh.model.consistency import examine
from pdmesh.model.contradictions import Case
from pdmesh.model.document import ON_ONE_LATTICE, Document, GridError, Material, Settings, settings_of
from pdmesh.model.fracture_energy import with_fracture_energy
from pdmesh.model.lattice_calibration import along_axes, has_partial_cells, lattice_ratios
from pdmesh.model.load_resultants import resultants
from pdmesh.model.node_grid import Grid, grid_of
from pdmesh.model.possible import excluded_from, refuse
from pdmesh.model.suggestions import called
from pdmesh.model.triangulated_surface import volume
from pdmesh.model.visibility import plate_of
from pdmesh.reports.bonds_and_step import count
from pdmesh.scene.body import Body
from pdmesh.scene.missing_values import known
from pdmesh.scene.scene import Scene

if TYPE_CHECKING:
    from pdsolve import Plan

DEFAULT_MODE = "conservative"
MOST_COUNTED = 3_000_000  # nodes of a one-scale equivalent that are still placed, not estimated
HEAT = {
    "concentration": "temperature",
    "initial concentration": "initial temperature",
    "source": "heat source",
    "exchange": "convection",
}  # kinds of conditions as they are called where heat stretches what moves
IN_MOL = {"value": "mol/m^3", "rate": "mol/(m^3 s)", "flux": "mol/(m^2 s)", "coefficient": "m/s"}
IN_KELVIN = {"value": "K", "rate": "K/s", "flux": "K m/s", "coefficient": "m/s"}
IN_WATTS = {"value": "K", "rate": "W/m^3", "flux": "W/m^2", "coefficient": "W/(m^2 K)"}
NOTHING = 1e-9  # of the largest force, and of that times the size of the grid: round-off
SAMPLE = 20_000  # nodes whose bonds stand for those of a larger grid
IF_NOTHING_BREAKS = "if nothing breaks: each group of breaking bonds needs another equilibrium"


def softening(material: Material | None, ratio: float, spacing: float, dimension: int) -> dict[str, float]:
    """Numbers in SI units, of the conservative mode at a spacing, m; none where bonds do not soften or pull at all.

    Of bilinear bonds `f_t` is the tensile strength that their `kr` amounts to.
    """
    if material is None or material.model not in ("bond", "micropolar"):
        return {}
    material = msgspec.structs.replace(material, plane="space") if dimension == 3 else material
    horizon = ratio * spacing
    if not lattice_ratios(ratio, material.micromodulus, material.plane, has_partial_cells(material)).c11 > 0:
        return {}
    if material.law == "bilinear" and material.kr > 1:
        return {"f_t": cohesive_softening.strength_of_peak(material, ratio, horizon)}
    if material.law != "cohesive" or material.f_t is None:
        return {}
    return {
        "l_ch": cohesive_softening.characteristic_length(material),
        "horizon": horizon,
        "largest_horizon": cohesive_softening.largest_horizon(material, ratio),
        "w_c": float(cohesive_softening.critical_opening(material, ratio, np.array([horizon]))[0]),
        "first_stretch": cohesive_softening.first_stretch(material),
    }


def info(document: Document, name: str, mode: str = DEFAULT_MODE) -> dict[str, Any]:
    """Contents of the model called `name` and the cost of its run in a mode, for `pdmesh info`. Raises GridError."""
    grid = grid_of(document, name)
    examine(grid, name)
    selection.check(document, grid, name)
    if document.material is not None and document.material.critical_stretch is not None:
        try:
            size = document.horizon.ratio, float(grid.delta.min()), grid.dimension
            document = msgspec.structs.replace(document, material=with_fracture_energy(document.material, *size))
        except ValueError as error:
            raise GridError(f"{name}: $.material.{error}") from None
    plate, at_hole = (plate_of(grid, name) if grid.dimension == 2 else None), grid.hole_id >= 0
    ratio = document.horizon.ratio
    run, refused = _estimate(grid, settings_of(document), name, mode)
    within, cut = count(grid, ratio) if run is None else (run.bonds + run.cut_bond_count, run.cut_bond_count)
    low, high = grid.position.min(axis=0), grid.position.max(axis=0)
    result: dict[str, Any] = {
        "model": name,
        "source": document.source,
        "nodes": len(grid),
        "nodes_by_spacing": nodes_by_spacing(grid),
        "border_nodes": int(grid.border.sum()),
        "nodes_at_holes": {str(hole): int((grid.hole_id == hole).sum()) for hole in np.unique(grid.hole_id[at_hole])},
        "mode": mode,
        **_run(within - cut, run),
        "bonds_cut_by_cracks": pair_count(cut),
        "bounding_box": [*low.tolist(), *high.tolist()],
        **_extent(grid, plate),
        "crack_segments": len(grid.cracks),
        "horizon_ratio": ratio,
        "refused": refused,
        "excluded": excluded_from(Case(settings_of(document), grid.dimension, mode, fields=grid.field_quantities)),
        "time_step": run.time_step if run and run.steps_are_load_steps else document.run.time_step,
        "steps": run.steps if run else document.run.steps,
        "area_rule": document.area_rule,
        "physics": document.physics,
        "material": _fields(document.material),
        "critical_stretch": _critical_stretch(document, grid),
        "softening": softening(document.material, ratio, float(grid.delta.min()), grid.dimension),
        "strengths": zone_strengths.described(zone_strengths.zone_strengths(grid, settings_of(document), mode)),
        "warnings": list(zone_strengths.remarks(grid, settings_of(document))),
        "lattice": _lattice(document.material, ratio, grid.dimension, mode),
        "bodies": {}
        if grid.bodies is None
        else {name: int((grid.bodies.number == at).sum()) for at, name in enumerate(grid.bodies.names)},
        "contact": _fields(document.contact),
        "regions": [{"name": region.name} | _fields(region.material) for region in document.regions],
        "medium": _fields(document.medium),
        "media": [{"name": region.name, "D": region.D} for region in document.media],
        "conditions": [_condition(condition, grid) for condition in document.conditions],
        "loads": [
            {"name": load.name, "force": load.force.tolist(), "moment": load.moment.tolist()}
            for load in resultants(document, grid)
        ],
    }
    return result


def _lattice(material: Material | None, ratio: float, dimension: int, mode: str) -> dict[str, float]:
    """Young's modulus over that given, and Poisson's ratio, of a bar of springs along an axis; of others nothing."""
    if material is None or material.model != "bond":
        return {}
    material = msgspec.structs.replace(material, plane="space") if dimension == 3 else material
    if not lattice_ratios(ratio, material.micromodulus, material.plane, has_partial_cells(material)).c11 > 0:
        return {}
    elasticity = along_axes(material, ratio, one_sided=mode == "thesis")
    return {"E_over_given": elasticity.young, "nu": elasticity.poisson}


def _critical_stretch(document: Document, grid: Grid) -> dict[str, float]:
    """The stretch at which brittle bonds of the first body break in the conservative mode, by the spacing, m."""
    zones = zone_strengths.zone_strengths(grid, settings_of(document), "conservative")
    return {
        f"{zone.spacing:g}": zone.critical_stretch
        for zone in zones
        if zone.critical_stretch is not None and (grid.bodies is None or zone.body == grid.bodies.names[0])
    }


def _extent(grid: Grid, plate: Any) -> dict[str, float | None]:
    """Area of a plate, m^2, or volume of a body, m^3: of its nodes and of the drawn shape."""
    size_of_nodes = grid.size
    if grid.dimension == 3:
        return {"volume_of_nodes": size_of_nodes, "volume_of_shape": volume(grid.faces) if len(grid.outline) else None}
    return {"area_of_nodes": size_of_nodes, "area_of_shape": None if plate is None else float(plate.area)}


def nodes_by_spacing(grid: Grid) -> dict[str, int]:
    """Number of nodes of each spacing, m."""
    if not any(grid.delta.strides):  # a number that all have
        return _by_spacing(np.round(grid.delta[:1], 15), np.array([len(grid)]))
    return _by_spacing(*np.unique(np.round(grid.delta, 15), return_counts=True))


def info_lines(result: dict[str, Any]) -> list[str]:
    """The result of `info` in words."""
    box = result["bounding_box"]
    ends = zip("xyz", box[: len(box) // 2], box[len(box) // 2 :], strict=False)
    place = ", ".join(f"{axis} {low:g} to {high:g} m" for axis, low, high in ends)
    what, unit = ("area", "m^2") if len(box) == 4 else ("volume", "m^3")
    shape = result[f"{what}_of_shape"]
    counted = "pairs of nodes within the horizon" if result["refused"] else f"bonds in the {result['mode']} mode"
    lines = [
        f"{result['model']}: {result['nodes']} nodes"
        f" ({', '.join(f'{number} of {spacing} m' for spacing, number in result['nodes_by_spacing'].items())})",
        f"{place}; {what} {result[f'{what}_of_nodes']:.10g} {unit}"
        + ("" if shape is None else f", of the shape {shape:.10g} {unit}"),
        f"{result['bonds']} {counted} at horizon ratio {result['horizon_ratio']:g};"
        f" {result['bonds_cut_by_cracks']} cut by {result['crack_segments']} crack"
        f" {'segments' if len(box) == 4 else 'triangles'}",
        _step_line(result),
    ]
    if result["memory_bytes"] is not None:
        memory, seconds = result["memory_bytes"] / 1e6, result["solve_seconds"]
        rests = f", {IF_NOTHING_BREAKS}" if result["at_rest"] else ""
        lines.append(f"about {memory:.3g} MB of memory and {seconds:.3g} s to solve{rests}")
    if result["most_nodes"] is not None:
        lines.append(_start_line(result["most_nodes"]))
    lines += ["cannot be combined with: " + ", ".join(result["excluded"])] if result["excluded"] else []
    if result["physics"] != "mechanics":
        lines.append(f"physics: {result['physics']}")
    if result["material"]:
        lines.append("material: " + _words(_telling(result["material"])))
    if result["critical_stretch"]:
        stretch_texts = (f"{stretch:.4g} of {spacing} m" for spacing, stretch in result["critical_stretch"].items())
        lines.append(f"critical stretch of brittle bonds: {', '.join(stretch_texts)}")
    lines += [f"body '{name}': {nodes} nodes" for name, nodes in result["bodies"].items()]
    if result["contact"]:
        lines.append("contact: " + _words(result["contact"]))
    if result["softening"]:
        lines.append("softening: " + _words(result["softening"]))
    lines += [f"lattice along its axes: {_words(lattice)}" for lattice in (result["lattice"],) if lattice]
    lines += zone_strengths.lines(result["strengths"])
    if result["medium"]:
        lines.append("medium: " + _words(result["medium"]))
    for kind, regions in (("medium", result["media"]), ("material", [*map(_telling, result["regions"])])):
        lines += [
            f"{kind} '{called(region['name'], at, 'region')}': {_words(region)}" for at, region in enumerate(regions)
        ]
    words = HEAT if result["physics"] == "thermoelastic" or result["medium"].get("carries") == "heat" else {}
    lines += [
        f"{words.get(entry['kind'], entry['kind'])} '{called(entry.get('name'), number)}': "
        + ", ".join(filter(None, (f"{entry['nodes']} nodes", _words(_asked(entry, result["medium"])))))
        for number, entry in enumerate(result["conditions"])
    ]
    return [*lines, *_sums(result["loads"], box)]


def _sums(loads: list[dict[str, Any]], box: list[float]) -> Iterator[str]:
    """The force and the moment of each load, and of all of them, where their profiles are 1."""
    if not loads:
        return
    named_loads = [(f"load '{load['name']}' adds up to", load) for load in loads]
    if len(loads) > 1:
        total = {key: np.sum([load[key] for load in loads], axis=0).tolist() for key in ("force", "moment")}
        named_loads.append(("all loads add up to", total))
    of_force, of_moment = ("N/m", "N") if len(box) == 4 else ("N", "N m")
    strongest = max(abs(value) for load in loads for value in load["force"])
    largest = {"force": strongest, "moment": strongest * float(np.ptp(np.reshape(box, (2, -1)), axis=0).max())}
    for name, load in named_loads:
        force, moment = (
            ", ".join(f"{value if abs(value) > NOTHING * most else 0.0:.4g}" for value in load[key])
            for key, most in largest.items()
        )
        yield f"{name} ({force}) {of_force}, moment about the middle ({moment}) {of_moment}"


def plan_lines(result: dict[str, Any]) -> list[str]:
    """The result of `plan` in words: the scene and its one-scale equivalent side by side."""
    scene_cost, flat = result["scene"], result["one_scale"]
    units = {"smallest_stable_step": "s", "time_step": "s", "steps": "", "memory_bytes": "B", "solve_seconds": "s"}
    unused = {"smallest_stable_step"} if scene_cost["at_rest"] else set()  # steps that a run at rest does not take
    if scene_cost["along_path"] or scene_cost["in_jumps"]:
        unused.add("time_step")
    rows = [("", "this scene", "one scale")]
    for spacing, number in scene_cost["nodes_by_spacing"].items():
        rows.append((f"nodes of {spacing} m", str(number), str(flat["nodes_by_spacing"].get(spacing, 0))))
    rows += [(key, str(scene_cost[key]), str(flat[key])) for key in ("nodes", "bonds")]
    rows += [
        (key.replace("_", " "), _quantity(scene_cost[key], unit), _quantity(flat[key], unit))
        for key, unit in units.items()
        if key not in unused
    ]
    lines = [f"{label:22}{scene_value:>14}{flat_value:>14}" for label, scene_value, flat_value in rows]
    lines += zone_strengths.lines(result.get("strengths", []))
    if scene_cost["at_rest"]:
        lines.append(f"time is that to solve {IF_NOTHING_BREAKS}")
    return lines + ([_start_line(scene_cost["most_nodes"])] if scene_cost["most_nodes"] else [])


def _start_line(most: int) -> str:
    return f"nodes, bonds, memory and time are those of the start; cells may split into {most} nodes at most"


def _quantity(value: float | None, unit: str) -> str:
    return "?" if value is None else f"{value:.4g} {unit}".strip()


def _step_line(result: dict[str, Any]) -> str:
    stable, step, steps = result["smallest_stable_step"], result["time_step"], result["steps"]
    if result["along_path"]:
        return f"quasi-static: about {steps} steps along the equilibrium path"
    if result["in_jumps"]:
        return f"quasi-static: at most {steps} jumps of cycles"
    if result["at_rest"]:
        return f"quasi-static: {step:.4g} s x {steps} load steps"
    if result["refused"]:
        return f"refused by pdsolve ({result['refused']})"
    sure = "no material, so no stable step" if stable is None else f"stable time step {stable:.4g} s"
    return f"{sure}; run: {'steps' if step is None else f'{step:.4g} s x'} {steps}"


def _words(fields: dict[str, Any]) -> str:
    return ", ".join(
        f"{name} = {value:g}" if isinstance(value, float) else f"{name} = {value}"
        for name, value in fields.items()
        if value is not None and name != "name"
    )


def _asked(entry: dict[str, Any], medium: dict[str, Any]) -> dict[str, Any]:
    """The prescribed values of a condition. Those on a content have units: of heat with W where the medium has a heat
    capacity, else with K."""
    prescribed = {
        key: value for key, value in entry.items() if key not in ("kind", "name", "nodes", "box", "edge", "shares")
    }
    if entry["kind"] not in HEAT:
        return prescribed
    units, capacity = IN_MOL, 1.0
    if medium.get("carries") == "heat":
        units, capacity = (IN_KELVIN, 1.0) if medium["heat_capacity"] is None else (IN_WATTS, medium["heat_capacity"])
    per = {key: 1.0 if key == "value" else capacity for key in units}
    return prescribed | {
        key: f"{per[key] * prescribed[key]:g} {unit}" for key, unit in units.items() if key in prescribed
    }


def _by_spacing(spacings: Any, counts: Any) -> dict[str, int]:
    """Counts by spacing; a mesh's many spacings as their range."""
    if len(spacings) > 16:
        return {f"{spacings[0]:g} to {spacings[-1]:g}": int(np.sum(counts))}
    return {f"{spacing:g}": int(number) for spacing, number in zip(spacings, counts, strict=True)}


def _telling(material: dict[str, Any]) -> dict[str, Any]:
    """Fields of a material that differ from their defaults, and those that always matter to its model."""
    usual = {field.name: field.default for field in msgspec.structs.fields(Material)}
    always = ("model", "plane", *(("law", "micromodulus") if material["model"] == "bond" else ()))
    return {name: value for name, value in material.items() if name in always or value != usual.get(name)}


def _fields(struct: Any) -> dict[str, Any]:
    return {} if struct is None else {name: getattr(struct, name) for name in struct.__struct_fields__}


def _condition(condition: Any, grid: Grid) -> dict[str, Any]:
    values = {"kind": condition.__struct_config__.tag} | _fields(condition)
    values["nodes"] = int(node_arrays.selected(grid, condition.nodes, condition.box).sum())
    return {name: value for name, value in values.items() if value not in (None, (), "")}


def run_of(grid: Grid, settings: Settings, name: str, mode: str) -> Plan | None:
    """Cost of a run; None if the solver would refuse it, for instance without a material.

    Raises GridError for settings that no solver accepts, and if the mode excludes the model.
    """
    return _estimate(grid, settings, name, mode)[0]


def _estimate(grid: Grid, settings: Settings, name: str, mode: str) -> tuple[Plan | None, str | None]:
    """Cost of a run, and why the solver would refuse a model with a material; None for what is not so."""
    refuse(settings, grid.dimension, name, grid.field_quantities)
    from pdsolve import Model, ModelError, Options, estimate_run

    if settings.material is None and settings.medium is None:
        return None, None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the solver warns when it solves
        try:
            return estimate_run(Model(grid, settings, name), Options(mode)), None
        except ModelError as error:
            if mode != DEFAULT_MODE and run_of(grid, settings, name, DEFAULT_MODE) is not None:
                raise GridError(str(error)) from None
            return None, str(error).removeprefix(f"{name}: ")


def plan(scene: Scene | Body, mode: str = DEFAULT_MODE) -> dict[str, Any]:
    """Cost of a scene in a mode, beside its cost with the finest spacing everywhere. Raises SceneError."""
    scene = known(scene)
    if isinstance(scene, Scene) and scene.run.adapt in ON_ONE_LATTICE:
        return _moving(scene, mode)
    original = scene
    if isinstance(scene, Scene) and scene.run.adapt == "split":
        scene, _ = undivided(scene)
    grid, settings = (build_body(scene) if isinstance(scene, Body) else build_scene(scene))[:2]
    scene_plan = run_of(grid, settings, scene.source, mode)
    counted, _ = count(grid, scene.horizon, sample=SAMPLE)
    ratio = 1.0 if scene_plan is None else scene_plan.bonds / counted
    nodes, bonds = _one_scale(original, counted / len(grid))
    return {
        "source": scene.source,
        "mode": mode,
        "scene": _cost(nodes_by_spacing(grid), len(grid), counted, scene_plan),
        "strengths": zone_strengths.described(zone_strengths.zone_strengths(grid, settings, mode)),
        "warnings": list(zone_strengths.remarks(grid, settings)),
        "one_scale": _priced({f"{original.finest:g}": nodes}, nodes, round(ratio * bonds), settings, mode, scene_plan),
    }


def _moving(scene: Scene, mode: str) -> dict[str, Any]:
    """Report on the initial grid with a moving fine zone, beside the finest spacing everywhere."""
    scene, _ = nested(scene)
    grid, settings, _ = build_scene(scene)
    counted, _ = count(grid, scene.horizon, sample=SAMPLE)
    everywhere = msgspec.structs.replace(settings, run=msgspec.structs.replace(settings.run, adapt="none"))
    scene_plan, flat = (run_of(grid, run_settings, scene.source, mode) for run_settings in (settings, everywhere))
    spacings, nodes = nodes_by_spacing(grid), len(grid)
    if scene_plan is not None and scene_plan.node_count_if_all_fine is not None:
        nodes, h = scene_plan.nodes, scene.finest
        spacings = _by_spacing(
            (h, 2 * h), (scene_plan.node_count_if_all_fine, scene_plan.nodes - scene_plan.node_count_if_all_fine)
        )
    return {
        "source": scene.source,
        "mode": mode,
        "scene": _cost(spacings, nodes, counted, scene_plan),
        "one_scale": _cost(nodes_by_spacing(grid), len(grid), counted, flat),
    }


def _one_scale(scene: Scene | Body, pairs_per_node: float) -> tuple[int, float]:
    """Number of nodes of the scene on one scale, and of pairs within a horizon.

    With too many nodes, and in space, nodes are not placed; a node then has `pairs_per_node`, as on several scales.
    """
    if isinstance(scene, Body):
        nodes = round(scene.shell.volume / scene.finest**3) if scene.nodes is None else len(scene.nodes.position)
        return nodes, pairs_per_node * nodes
    flat = scene.one_scale()
    nodes = round(flat.shape.area / flat.finest**2)
    if nodes < MOST_COUNTED:
        placed = place_nodes(flat)
        grid = grid_of_nodes(flat, placed.position, placed.delta, placed.delta**2)
        nodes, pairs_per_node = len(grid), count(grid, flat.horizon, sample=SAMPLE)[0] / len(grid)
    return nodes, pairs_per_node * nodes


def _priced(
    spacings: dict[str, int], nodes: int, bonds: int, settings: Settings, mode: str, scene_plan: Plan | None
) -> dict[str, Any]:
    """Cost of a number of nodes and bonds in as many steps as the plan of the scene."""
    if scene_plan is None:
        return _cost(spacings, nodes, bonds, None)
    from pdsolve import Options, estimate_size

    steps = (scene_plan.time_step, scene_plan.stable_time_step)
    run = msgspec.structs.replace(settings.run, steps=scene_plan.steps)
    settings = msgspec.structs.replace(settings, run=run)
    return _cost(
        spacings,
        nodes,
        bonds,
        estimate_size(settings, Options(mode), nodes, bonds, steps, scene_plan.uses_block_kernels),
    )


def _cost(spacings: dict[str, int], nodes: int, counted: int, run: Plan | None) -> dict[str, Any]:
    return {"nodes_by_spacing": spacings, "nodes": nodes} | _run(counted, run)


def _run(counted: int, run: Plan | None) -> dict[str, Any]:
    """Cost of a run; without a plan, the bonds are those within a horizon."""
    return {
        "bonds": pair_count(counted if run is None else run.bonds),
        "at_rest": run is not None and run.steps_are_load_steps,
        "along_path": run is not None and run.steps_are_path_steps,
        "in_jumps": run is not None and run.steps_are_cycle_jumps,
        "smallest_stable_step": None if run is None else run.stable_time_step,
        "time_step": None if run is None else run.time_step,
        "steps": None if run is None else run.steps,
        "most_nodes": None if run is None else run.node_count_if_all_split,
        "memory_bytes": None if run is None else run.memory,
        "solve_seconds": None if run is None else run.wall_time,
    }
