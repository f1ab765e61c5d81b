"""The model of a study's run: its drawing built, overridden by settings, and disturbed.

A disturbance displaces pre-cracks or nodes, or shortens the time step. The disturbances do not change the problem, but
they change how a crack branches.
"""

from __future__ import annotations

import dataclasses
import math
import sqlite3
import warnings
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from pdmesh import Body, SceneError, UntrustedError, build_file, file_parameters, read_scene
from pdmesh.file_kinds import MESHES
from pdmesh.model import contradictions
from pdmesh.model.document import GridError, Material, Medium, Settings, in_steps, read_file, settings_of
from pdmesh.model.neighbours import connected
from pdmesh.model.node_grid import Grid, grid_of
from pdmesh.model.possible import impossible
from pdmesh.model.settings_overlay import overlaid
from pdmesh.model.suggestions import called
from pdmesh.model.unused_settings import in_vain
from pdsolve.estimate import Plan, estimate_run
from pdsolve.model import Model, ModelError
from pdsolve.options import Options
from pdsolve.results.opening import connect
from pdsolve.results.schema import statements
from pdsolve.study.description import Case, Repeat, Study, StudyError

NEAR = 1e-6  # of a spacing: an end this near to the edge of the plate is on it
NAMED = (".geo", ".py", ".json")  # drawings that say what parameters they have
LOOKED_AT = 5  # runs, until one can be read
# To lay settings over, where names alone are looked at
ANY = Settings(material=Material(E=1.0, rho=1.0, G0=1.0), medium=Medium(D=1.0))


def disturbed(model: Model, repeat: Repeat, repetition: int, time_step: float) -> Model:
    """The model of a repetition; `time_step`, s, is that of the undisturbed run. Repetition 0 is undisturbed.

    Equal seed and repetition give equal draws. Raises ModelError for a model that cannot be disturbed.
    """
    if repetition == 0:
        return model
    disturbances = tuple(name for name in ("notch", "step", "noise") if getattr(repeat, name))
    for wrong in impossible(contradictions.Case(model.settings, model.grid.dimension, disturbances=disturbances)):
        raise ModelError(f"{model.name}: {wrong}")
    draw = np.random.default_rng([repeat.seed, repetition])
    across, shorter = draw.uniform(-1, 1), draw.uniform(0, 1)
    grid, settings = model.grid, model.settings
    if repeat.step:
        step = time_step * (1 - repeat.step * shorter)
        run = in_steps(settings.run, time_step)
        steps = math.ceil(run.steps * time_step / step - NEAR)
        settings = msgspec.structs.replace(settings, run=msgspec.structs.replace(run, time_step=step, steps=steps))
    if repeat.notch:
        if not len(grid.cracks):
            raise ModelError(
                f"{model.name}: repeat.notch: there is no pre-crack to move; add one, or use step or noise"
            )
        grid = replace(grid, cracks=_moved(grid, repeat.notch * across * float(grid.delta.min())))
    if repeat.noise:
        low, high = grid.position.min(axis=0), grid.position.max(axis=0)  # a bare list of nodes marks none as border
        outermost = ((grid.position == low) | (grid.position == high)).any(axis=1)
        inside = ~(grid.border | outermost)  # a node outside the outline has no bonds
        noise = draw.standard_normal(grid.position.shape) * (repeat.noise * grid.delta * inside)[:, None]
        grid = replace(grid, position=grid.position + noise, lattice=None)
    return replace(model, grid=grid, settings=settings)


def _moved(grid: Grid, far: float) -> NDArray[np.float64]:
    """Pre-cracks (k, 4), each moved by `far`, m, across its first segment, with kinks and forks as one.

    An end on the plate's edge stays there: the crack is extended.
    """
    import shapely

    ends = grid.cracks.reshape(-1, 2)  # of segment i: 2 i and 2 i + 1
    owner = np.repeat(np.arange(len(grid.cracks)), 2)
    _, place = np.unique(np.round(ends / (NEAR * float(grid.delta.min()))), axis=0, return_inverse=True)
    first = np.full(place.max() + 1, -1)
    first[place[::-1]] = owner[::-1]
    part = connected(len(grid.cracks), owner, first[place])
    along = np.diff(grid.cracks.reshape(-1, 2, 2), axis=1)[:, 0]
    along /= np.maximum(np.hypot(*along.T), 1e-300)[:, None]
    leader = along[np.unique(part, return_index=True)[1]][part]
    shift = far * np.column_stack([-leader[:, 1], leader[:, 0]])
    outward = np.stack([-along, along], axis=1).reshape(-1, 2)
    # The plate's edge and those of holes; for a bare list of nodes, its bounding box
    rings = [*grid.outline, *grid.holes]
    if not rings:
        low, high = grid.position.min(axis=0), grid.position.max(axis=0)
        rings = [np.array([low, (high[0], low[1]), high, (low[0], high[1])])]
    edges = shapely.MultiLineString([np.vstack([ring, ring[:1]]) for ring in rings])
    is_on_edge = np.asarray(shapely.dwithin(edges, shapely.points(ends), NEAR * float(grid.delta.min())))
    drawn_out = (abs(far) * is_on_edge)[:, None] * outward
    return np.asarray((ends + np.repeat(shift, 2, axis=0) + drawn_out).reshape(-1, 4))


def model_of_run(drawing: Path, case: Case, trust: bool = False) -> Model:
    """The model of a run from the drawing at this path. Raises SceneError, GridError, ModelError."""
    if drawing.suffix.lower() == ".json" and not case.drawing:
        document = read_file(drawing)
        grid, settings = grid_of(document, str(drawing)), settings_of(document)
    else:
        built = build_file(drawing, case.assignments("drawing"), trust=trust)
        grid, settings = built.grid, built.settings
    model = Model(grid, overlaid(settings, drawing, None, case.assignments("model")), str(drawing))
    said = in_vain(model.settings, case.model)
    if said is not None:
        raise ModelError(f"{drawing}: {said}")
    if not case.repetition:
        return model
    step = model.settings.run.time_step or 0.0
    if case.repeat.step and not step:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # the run will warn
            step = estimate_run(model, options(case)).time_step
    return disturbed(model, case.repeat, case.repetition, step)


def options(case: Case, threads: int = 1) -> Options:
    """Solver options of a case."""
    settings: dict[str, Any] = dict(case.options)
    return Options(**settings, threads=threads)


def plan_distinct_runs(study: Study, trust: bool = False) -> list[tuple[Case, int, Plan]]:
    """The first case of each distinct run, how many cases share it, and its plan.

    Runs that differ in disturbances and random parameters alone are one.

    Raises StudyError, SceneError, GridError, ModelError.
    """
    check_study_and_return_dimension(study, trust)
    alike: dict[str, list[Case]] = {}
    random = {name for _, name, _ in study.description.random.named()}
    for case in study.cases():
        drawing, model = (
            {name: value for name, value in named.items() if name not in random} for named in (case.drawing, case.model)
        )
        common = dataclasses.replace(case, drawing=drawing, model=model, repetition=0)
        alike.setdefault(common.key, []).append(case)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the solver warns when it solves
        return [
            (cases[0], len(cases), estimate_run(model_of_run(study.drawing, cases[0], trust), options(cases[0])))
            for cases in alike.values()
        ]


def check_study_and_return_dimension(study: Study, trust: bool = False) -> int:
    """The dimension, 2 or 3, of the study's plates or bodies.

    Raises StudyError for a parameter that neither drawing nor model uses, for a measure that no run can have, and for a
    program as drawing without `trust`.
    """
    cases = study.cases()
    for case in {tuple(case.values): case for case in cases}.values():
        try:
            if case.drawing and study.drawing.suffix.lower() in NAMED:
                file_parameters(study.drawing, case.assignments("drawing"), trust)
            overlaid(ANY, Path("model"), None, case.assignments("model"))
        except UntrustedError as error:
            raise StudyError(f"{study.path}: $.drawing: {error}") from None
        except (SceneError, GridError, ModelError) as error:
            raise StudyError(f"{study.path}: {error}") from None
    for case in cases[:LOOKED_AT]:
        try:
            dimension = _dimension(study.drawing, case, trust)
            _check_measures(study, case, dimension, trust)
            return dimension
        except UntrustedError as error:
            raise StudyError(f"{study.path}: $.drawing: {error}") from None
        except (SceneError, GridError, ModelError, OSError):
            continue  # what is wrong is said of each run
    return 2


def _check_measures(study: Study, case: Case, dimension: int, trust: bool) -> None:
    """Raise StudyError for a condition that the model of a case lacks, and for a query that is none of a database.

    Raises SceneError, GridError, ModelError for a model that cannot be built.
    """
    names: list[str] = []
    quantities = [(f"$.measures.{name}", *measure.quantity) for name, measure in study.description.measures.items()]
    fit = study.description.fit
    for place, field, value in quantities if fit is None else [*quantities, ("$.fit", "condition", fit.condition)]:
        if field == "sql":
            try:
                with closing(connect(None)) as connection:
                    connection.executescript(";".join(statements(dimension)))
                    connection.execute(f"EXPLAIN {value}")
            except (sqlite3.Error, sqlite3.Warning, ValueError) as error:  # a warning: two statements
                raise StudyError(f"{study.path}: {place}.sql: {error} (pdpost sql lists the tables)") from None
        elif field in ("peak_force", "displacement_at_peak", "condition"):
            if not names:
                settings = model_of_run(study.drawing, replace(case, repetition=0), trust).settings
                names = [called(condition.name, number) for number, condition in enumerate(settings.conditions)]
                names += [cell.name for cell in settings.run.load_cells]
            if value not in names:
                raise StudyError(
                    f"{study.path}: {place}.{field}: there is no condition '{value}'; use one of"
                    f" {', '.join(names) or 'a model with conditions'}"
                )


def _dimension(drawing: Path, case: Case, trust: bool) -> int:
    """The dimension of the plate or body of a drawing. Raises StudyError for diffusion, SceneError or GridError."""
    if drawing.suffix.lower() in MESHES:
        return 2
    if drawing.suffix.lower() == ".json" and not case.drawing:
        document = read_file(drawing)
        dimension, has_diffusion_only = document.dimension, document.physics == "diffusion"
    else:
        scene = read_scene(drawing, case.assignments("drawing"), trust=trust)
        dimension, has_diffusion_only = 3 if isinstance(scene, Body) else 2, scene.medium is not None
    if has_diffusion_only:
        raise StudyError(
            f"{drawing} is a model of diffusion, and a study measures cracks and energies; use one of mechanics"
        )
    return dimension
