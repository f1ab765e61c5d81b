"""Additions from the command line to any drawing, ``--refine`` and ``--crack``.

A model stores them among its parameters, so that it can be built again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TypeVar

from pdmesh.drawing.parameters import unit_of
from pdmesh.model.document import ADAPTS
from pdmesh.quantities import UNITS, Unit, quantities, quantity
from pdmesh.scene.body import Body
from pdmesh.scene.plate import Refinement
from pdmesh.scene.scene import Scene
from pdmesh.scene.shapes import SceneError

REFINE, CRACK = "--refine ", "--crack "  # begin the names under which a model keeps what was added
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


def sorted_out(parameters: Mapping[str, float | str]) -> tuple[list[tuple[str, str]], list[str], list[str]]:
    """A model's parameters, split into assignments to its drawing, refinements and cracks."""
    refine, cracks = (
        [str(word) for name, word in parameters.items() if name.startswith(key)] for key in (REFINE, CRACK)
    )
    assignments = [(name, str(value)) for name, value in parameters.items() if not name.startswith((REFINE, CRACK))]
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
