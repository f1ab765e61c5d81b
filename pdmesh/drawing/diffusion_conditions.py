"""Conditions of diffusion and of heat in a drawing, of plates and of bodies.

group                parameters below Peridynamics/
"begin:NAME"         Begins/NAME/Concentration or Temperature
"hold:NAME"          Holds/NAME/Concentration or Temperature; *
"supply:NAME"        Supplies/NAME/Flux, Rate, Heat flux (W/m^2) or Heat rate (W/m^3); *
"exchange:NAME"      Exchanges/NAME/Coefficient or h (W/(m^2 K)), Outside; *
* of each condition  Rows (1), Profile (constant)
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

from pdmesh.drawing.parameters import Parameters, content, either
from pdmesh.scene.body import Body
from pdmesh.scene.scene import Scene

S = TypeVar("S", Scene, Body)
KINDS = ("begin", "hold", "supply", "exchange")


def diffusing(scene: S, places: Mapping[str, Iterable[tuple[str, Any, str]]], parameters: Parameters) -> S:
    """The scene with its conditions of diffusion; `places` has name, place and parameter folder by kind.

    Raises SceneError.
    """
    for name, where, folder in places["begin"]:
        scene = scene.begin(where, content(parameters, folder), name)
    for name, where, folder in places["hold"]:
        scene = scene.hold(where, content(parameters, folder), name=name, **_shared(parameters, folder))
    for name, where, folder in places["supply"]:
        value, word = either(parameters, folder, "Flux", "Rate", "Heat flux", "Heat rate")
        supply = scene.heat if word.startswith("Heat") else scene.supply
        supply_arguments: dict[str, Any] = {word.removeprefix("Heat ").lower(): value}
        scene = supply(where, **supply_arguments, name=name, **_shared(parameters, folder))
    for name, where, folder in places["exchange"]:
        _, word = either(parameters, folder, "Coefficient", "h")
        value, outside = parameters.number(f"{folder}/{word}"), parameters.of_place(f"{folder}/Outside")
        if outside is None:
            outside = parameters.number(f"{folder}/Outside", None if word == "h" else 0.0)
        exchange = scene.convection if word == "h" else scene.exchange
        scene = exchange(where, value, outside, name=name, **_shared(parameters, folder))
    return scene


def _shared(parameters: Parameters, folder: str) -> dict[str, Any]:
    """Rows and profile of a condition."""
    return {
        "rows": parameters.whole(f"{folder}/Rows", 1),
        "profile": parameters.profile(f"{folder}/Profile"),
    }
