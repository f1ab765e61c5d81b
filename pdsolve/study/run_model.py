"""The model of a study's run: its drawing built, overridden by settings, and disturbed."""

from __future__ import annotations

import dataclasses
import warnings
from pathlib import Path
from typing import Any

from pdmesh import Body, SceneError, UntrustedError, build_file, file_parameters, read_scene
from pdmesh.file_kinds import MESHES
from pdmesh.model.document import GridError, Material, Medium, Settings, read_file, settings_of
from pdmesh.model.node_grid import grid_of
from pdmesh.model.settings_overlay import overlaid
from pdmesh.model.unused_settings import in_vain
from pdsolve.estimate import Plan, estimate_run
from pdsolve.model import Model, ModelError
from pdsolve.options import Options
from pdsolve.study.description import Case, Study, StudyError
from pdsolve.study.disturbed import disturbed

NAMED = (".geo", ".py", ".json")  # drawings that say what parameters they have
LOOKED_AT = 5  # runs, until one can be read
# To lay settings over, where names alone are looked at
ANY = Settings(material=Material(E=1.0, rho=1.0, G0=1.0), medium=Medium(D=1.0))


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
    """The first case of each distinct run (disturbances aside), how many cases share it, and its plan.

    Raises StudyError, SceneError, GridError, ModelError.
    """
    check_study_and_return_dimension(study, trust)
    alike: dict[str, list[Case]] = {}
    for case in study.cases():
        alike.setdefault(dataclasses.replace(case, repetition=0).key, []).append(case)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the solver warns when it solves
        return [
            (cases[0], len(cases), estimate_run(model_of_run(study.drawing, cases[0], trust), options(cases[0])))
            for cases in alike.values()
        ]


def check_study_and_return_dimension(study: Study, trust: bool = False) -> int:
    """The dimension, 2 or 3, of the study's plates or bodies.

    Raises StudyError for a parameter that neither drawing nor model uses, and for a program as drawing without `trust`.
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
            return _dimension(study.drawing, case, trust)
        except UntrustedError as error:
            raise StudyError(f"{study.path}: $.drawing: {error}") from None
        except (SceneError, GridError, OSError):
            continue  # what is wrong is said of each run
    return 2


def _dimension(drawing: Path, case: Case, trust: bool) -> int:
    """The dimension of the plate or body of a drawing. Raises StudyError for diffusion, SceneError or GridError."""
    if drawing.suffix.lower() in MESHES:
        return 2
    if drawing.suffix.lower() == ".json" and not case.drawing:
        document = read_file(drawing)
        dimension, diffuses = document.dimension, document.physics == "diffusion"
    else:
        scene = read_scene(drawing, case.assignments("drawing"), trust=trust)
        dimension, diffuses = 3 if isinstance(scene, Body) else 2, scene.medium is not None
    if diffuses:
        raise StudyError(
            f"{drawing} is a model of diffusion, and a study measures cracks and energies; use one of mechanics"
        )
    return dimension
