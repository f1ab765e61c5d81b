"""The parts of the grid file in a database that measures and pictures need; the rest, mostly nodes, is skipped."""

from __future__ import annotations

import json
from typing import Any, TypeVar

import msgspec
import numpy as np

from pdmesh.messages import unfit
from pdmesh.model.contradictions import beyond
from pdmesh.model.document import LARGEST, Crack, Run, Selection, Settings, Vector
from pdmesh.model.grid_file_nodes import repeated_key
from pdmesh.model.interfaces import Interface
from pdmesh.model.suggestions import decode_older, explained
from pdsolve.measures.frame_steps import time_text
from pdsolve.results import Results, ResultsError

T = TypeVar("T", bound=msgspec.Struct)


class _Named(msgspec.Struct):
    """The key of the grid file that names its physics."""

    physics: str = "mechanics"


class _Solved(msgspec.Struct):
    """The key of the grid file that says how the model is solved."""

    run: Run = Run()


class _Interfaces(msgspec.Struct):
    """The key of the grid file that has its interfaces."""

    interfaces: tuple[Interface, ...] = ()


class _Model(Settings, frozen=True, kw_only=True):
    """A grid file without its nodes."""

    notch: tuple[Crack, ...] = ()
    nodes: msgspec.Raw = msgspec.Raw()
    areas: msgspec.Raw = msgspec.Raw()
    fields: msgspec.Raw = msgspec.Raw()
    lattice: msgspec.Raw = msgspec.Raw()
    bodies: msgspec.Raw = msgspec.Raw()
    version: int = 1
    outline: tuple[tuple[Vector, ...], ...] = ()
    holes: tuple[tuple[Vector, ...], ...] = ()
    source: str = ""
    drawing: str = ""
    parameters: dict[str, float | str] = msgspec.field(default_factory=dict)
    digest: str = ""


def read(results: Results, kind: type[T]) -> T:
    """The keys of the model that are fields of `kind`. Raises ResultsError naming what is wrong with them."""
    if "material" in kind.__struct_fields__ and physics_of(results) == "diffusion":
        expect_mechanics(results)
    if isinstance(cached_model := results.decoded.get(kind), kind):
        return cached_model
    try:
        text = results.model()
        model, _ = decode_older(text, kind)
        if _Model not in results.decoded:
            rest, _ = decode_older(text, _Model)
            if (repeated := repeated_key(text)) is not None:
                raise ResultsError(f"{results.name}: model: {repeated} is there twice; keep one")
            _check(results, rest)
            results.decoded[_Model] = rest
    except (msgspec.DecodeError, RecursionError) as error:
        words = explained(error, kind, lambda: msgspec.json.decode(text))
        raise ResultsError(f"{results.name}: model: {words}") from None
    results.decoded[kind] = model
    return model


def model_text(results: Results) -> str:
    """The text of the model without settings that this version no longer has. Raises ResultsError."""
    read(results, _Named)
    return decode_older(results.model(), _Model)[1]


def whole(results: Results) -> dict[str, Any]:
    """The model as parsed JSON, checked except for its nodes. Raises ResultsError."""
    read(results, _Named)
    try:
        model: dict[str, Any] = json.loads(results.model())
    except (ValueError, RecursionError) as error:
        raise ResultsError(f"{results.name} has no model to read ({error}); use results with a grid file") from None
    if not (model.get("medium") or model.get("material")):
        raise ResultsError(f"{results.name}: model: $.material and $.medium are missing; use the file of a run")
    return model


def _check(results: Results, model: _Model) -> None:
    """Raise ResultsError for impossible numbers, and for conditions and regions without nodes."""

    def refuse(place: str, value: object, expected: str) -> None:
        raise ResultsError(f"{results.name}: model: {unfit(place, value, expected)}")

    large = beyond(model, "$", leave_out=("outline", "holes", "notch"))
    if large is not None:
        raise ResultsError(f"{results.name}: model: {large}")
    named: dict[str, tuple[Any, ...]] = {"notch": model.notch, "outline": model.outline, "holes": model.holes}
    for name, shapes in named.items():
        for number, shape in enumerate(shapes):
            place, wide = f"$.{name}[{number}]", {np.asarray(point).size for point in shape}
            if len(wide) != 1 or not np.abs(np.array(shape, dtype=float)).max(initial=0.0) <= LARGEST:
                refuse(place, str(shape)[:60], f"places of at most {LARGEST:g} m")
            if name != "notch" and (len(shape) < 3 or wide != {results.dimension}):
                refuse(place, f"{len(shape)} points", f"at least 3 of {results.dimension} numbers")
    selections: list[Selection] = [*model.conditions, *model.regions, *model.media]
    for selection in selections:
        if selection.nodes is None and (selection.box is None or len(selection.box) != 2 * results.dimension):
            refuse(f"'{selection.name[:40]}'", selection.box, f"nodes, or a box of {2 * results.dimension} numbers")


def expect_mechanics(results: Results) -> None:
    """Raise ResultsError for a model that is not one of mechanics; the message names the commands that show it."""
    physics = physics_of(results)
    if physics != "mechanics":
        raise ResultsError(
            f"{results.name} is of a model of {physics}, and mechanics is needed; use pdpost history,"
            " concentration, content and solid"
        )


def physics_of(results: Results) -> str:
    """The physics of the model: mechanics, diffusion or thermoelastic. Raises ResultsError."""
    return read(results, _Named).physics


def run_of(results: Results) -> Run:
    """The solver settings of the model. Raises ResultsError."""
    return read(results, _Solved).run


def own_G0(results: Results) -> str:
    """A remark on a ratio to G0 where bonds across interfaces may have another; empty without interfaces."""
    return "; of the material's own G0, interfaces have others" if read(results, _Interfaces).interfaces else ""


def at_rest(results: Results) -> bool:
    """Whether the model was solved at rest, so that times are those of load steps. Raises ResultsError."""
    return run_of(results).solver == "static"


def counts_load_steps(results: Results) -> bool:
    """Whether the times of a run at rest are the numbers of its load steps, as along a path; heat and swelling have a
    step of their own. Raises ResultsError."""
    return float(results.meta()["time_step"]) == 1 and at_rest(results) and physics_of(results) == "mechanics"


def moment(results: Results, step: int, micro: str = "us") -> str:
    """When a step is, in words: its time, or its number in a run that counts load steps."""
    if counts_load_steps(results):
        return f"load step {step}"
    return time_text(step * float(results.meta()["time_step"]), micro=micro)
