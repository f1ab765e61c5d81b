"""Additions from the command line to any drawing: ``--refine``, ``--crack``, and settings of the solver by ``--set``.

A model stores them among its parameters, so that it can be built again.
"""

from __future__ import annotations

from collections.abc import Container, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from pdmesh.drawing.parameters import PREFIX, unit_of
from pdmesh.model.document import ADAPTS, Horizon, Medium, Settings
from pdmesh.model.settings_overlay import ModelError, overlaid
from pdmesh.quantities import UNITS, Unit, quantities, quantity
from pdmesh.scene.body import Body
from pdmesh.scene.plate import Refinement
from pdmesh.scene.scene import Scene
from pdmesh.scene.shapes import SceneError

# What begins the names under which a model keeps what was added
REFINE, CRACK, SET = "--refine ", "--crack ", "--set "
ADAPT = "--adapt"  # likewise, the name of how it is to be solved


def added(scene: Scene, refine: Sequence[str], cracks: Sequence[str], adapt: str | None = None) -> Scene:
    """The scene with added zones ``crack:DISTANCE[:SPACING]``, cracks ``x0,y0,x1,y1`` and the adaptivity `adapt`.

    Lengths are in the drawing's unit. Raises SceneError.
    """
    unit, parameters = unit_of(dict(scene.parameters)), dict(scene.parameters)
    for word in cracks:
        try:
            numbers = list(quantities(word, UNITS, unit))
        except ValueError:
            numbers = []
        if len(numbers) < 4 or len(numbers) % 2:
            raise SceneError(
                f"--crack: cannot read '{word}'; give the places of its ends and kinks, x0,y0,x1,y1 or more"
            )
        scene = scene.crack(list(zip(numbers[::2], numbers[1::2], strict=True)), word)
        parameters[CRACK + word] = word
    for word in refine:
        scene = replace(scene, refinements=(*scene.refinements, refinement(word, unit)))
        parameters[REFINE + word] = word
    return adapted(replace(scene, parameters=tuple(parameters.items())), adapt)


S = TypeVar("S", Scene, Body)


def adapted(scene: S, adapt: str | None) -> S:
    """The scene with the adaptivity `adapt`, if any, among its parameters too. Raises SceneError."""
    if adapt is None:
        return scene
    if adapt not in ADAPTS:
        raise SceneError(f"{ADAPT} is '{adapt}'; use one of {', '.join(ADAPTS)}")
    if isinstance(scene, Body) and adapt not in ("none", "auto", "hybrid"):
        raise SceneError(f"{ADAPT} is '{adapt}'; use none, auto or hybrid for a body in space")
    scene = scene.adapt(adapt)  # type: ignore[arg-type]
    return replace(scene, parameters=tuple((dict(scene.parameters) | {ADAPT: adapt}).items()))


def split_settings(
    assignments: Sequence[tuple[str, str]], drawn: Container[str]
) -> tuple[list[tuple[str, str]], list[tuple[str, str]]]:
    """Assignments to a drawing, and to settings of the solver that are none of the names that are `drawn`.

    Of steps and duration, the last counts, as in the solver.
    """
    names = [name.removeprefix(PREFIX) for name, _ in assignments]
    durations = [number for number, name in enumerate(names) if name in ("run.duration", "Run/Duration")]
    assignments = [
        pair for number, pair in enumerate(assignments) if pair[0] != "run.steps" or number > max(durations, default=-1)
    ]
    laid_over = [
        (name, text)
        for name, text in assignments
        if "." in name and name.partition(".")[0] in Settings.__struct_fields__ and name not in drawn
    ]
    return [pair for pair in assignments if pair not in laid_over], laid_over


def with_settings(scene: S, path: Path, assignments: Sequence[tuple[str, str]]) -> S:
    """The scene with settings of the solver laid over its own, which are kept among its parameters.

    Raises SceneError.
    """
    if not assignments:
        return scene
    parts: dict[str, Any] = {"material": scene.material, "run": scene.run, "contact": scene.touching}
    parts |= {"horizon": Horizon(ratio=scene.horizon)} | (
        {"area_rule": scene.area_rule} if isinstance(scene, Scene) else {}
    )
    if isinstance(scene.medium, Medium):
        parts["medium"] = scene.medium
    for name, _ in assignments:
        if name.partition(".")[0] not in parts:
            raise SceneError(f"parameter '{name}' is of a part that the drawing does not have; give it to pdsolve")
    try:
        settings = overlaid(Settings(**parts), path, None, assignments, 2 if isinstance(scene, Scene) else 3)
    except ModelError as error:
        raise SceneError(str(error).removeprefix(f"{path}: ").removeprefix(f"{path} with ")) from None
    changed = {name: getattr(settings, name) for name in parts}
    changed |= {"horizon": settings.horizon.ratio, "touching": changed.pop("contact")}
    parameters = dict(scene.parameters) | {SET + name: text for name, text in assignments}
    if f"{SET}run.fields" in parameters:  # which may have been more than those there were
        parameters[f"{SET}run.fields"] = ",".join(settings.run.fields)
    return replace(scene, **changed, parameters=tuple(parameters.items()))


def sorted_out(parameters: Mapping[str, float | str]) -> tuple[list[tuple[str, str]], list[str], list[str]]:
    """A model's parameters, split into assignments to its drawing, refinements and cracks."""
    refine, cracks = (
        [str(word) for name, word in parameters.items() if name.startswith(key)] for key in (REFINE, CRACK)
    )
    assignments = [
        (name.removeprefix(SET), str(value))
        for name, value in parameters.items()
        if not name.startswith((REFINE, CRACK))
    ]
    return assignments, refine, cracks


def refinement(word: str, unit: Unit) -> Refinement:
    """The refinement that ``crack:4e-3`` or ``hole:4e-3:2.5e-4`` describes. Raises SceneError."""
    target, *numbers = word.split(":")
    try:
        distance, *spacing = (quantity(number, UNITS, unit) for number in numbers)
    except ValueError:
        distance, spacing = 0.0, []
    if target not in ("crack", "notch", "hole") or len(numbers) not in (1, 2) or not distance > 0:
        raise SceneError(
            f"--refine: cannot read '{word}'; use crack, notch or hole, then :DISTANCE or :DISTANCE:SPACING"
        )
    return Refinement(target, distance, spacing[0] if spacing else None)  # type: ignore[arg-type]
