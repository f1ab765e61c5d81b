"""Bodies beside the first one, and regions, in drawings of plates and of bodies in space: groups and parameters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, TypeVar

from pdmesh.drawing import parameters as named
from pdmesh.drawing.parameters import PREFIX, Parameters
from pdmesh.scene.body import Body
from pdmesh.scene.scene import Scene
from pdmesh.scene.shapes import SceneError

S = TypeVar("S", Scene, Body)


def with_bodies(scene: S, shapes: Mapping[str, Any], parameters: Parameters) -> S:
    """The scene with these bodies beside it, by name. Raises SceneError naming the parameter."""
    for name, shape in shapes.items():
        folder = f"Bodies/{name}"
        rigid = parameters.flag(f"{folder}/Rigid", False)
        parameter_names = parameters.below(folder) - {"Spacing", "Rigid", "Spin", *_speeds(scene)}
        wrong = sorted(parameter_names - set(named.RIGID) if rigid else parameter_names & set(named.RIGID))
        if wrong:
            what = "rigid" if rigid else "not rigid"
            raise SceneError(
                f"parameter '{PREFIX}{folder}/{wrong[0]}' cannot be used for a body that is {what}; leave it out"
            )
        spacing = parameters.maybe_length(f"{folder}/Spacing")
        velocity: Any = tuple(parameters.number(f"{folder}/{speed}", 0.0) for speed in _speeds(scene))
        spin = _spin(scene, parameters, f"{folder}/Spin")
        if rigid:
            scene = scene.rigid(
                shape,
                name,
                parameters.maybe(f"{folder}/Mass"),
                velocity,
                spin,
                parameters.text(f"{folder}/Held").split(),
                parameters.profile(f"{folder}/Profile"),
                spacing,
                radius=parameters.maybe_length(f"{folder}/Radius"),
            )
            continue
        material = named.material(parameters, folder, scene.material) if parameter_names else None
        scene = scene.body(shape, name, spacing, material, velocity, spin)
    return scene


def with_regions(scene: S, materials: Mapping[str, Any], media: Mapping[str, Any], parameters: Parameters) -> S:
    """The scene with these regions of other materials and of other media, by name. Raises SceneError."""
    for name, shape in materials.items():
        material = named.material(parameters, f"Materials/{name}", scene.material)
        if material is None:
            raise SceneError(f"parameter '{PREFIX}Materials/{name}/E' is missing; give a number")
        scene = scene.region(shape, material, name)
    for name, shape in media.items():
        scene = scene.diffusivity(shape, parameters.number(f"Media/{name}/D"), name)
    return scene


def _speeds(scene: Scene | Body) -> list[str]:
    return [f"Velocity {axis}" for axis in ("xyz" if isinstance(scene, Body) else "xy")]


def _spin(scene: Scene | Body, parameters: Parameters, name: str) -> Any:
    """Spin, rad/s; of a body in space about x, y and z."""
    if isinstance(scene, Scene):
        return parameters.number(name, 0.0)
    text = parameters.text(name, "0 0 0")
    try:
        x, y, z = map(float, text.split())
    except ValueError:
        raise SceneError(f"parameter '{PREFIX}{name}' is '{text}'; use three numbers 'x y z' in a body") from None
    return x, y, z
