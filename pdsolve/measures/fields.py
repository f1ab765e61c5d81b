"""Fields at the nodes of a frame: damage, energy, vectors, tensors, and their components."""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce

import numpy as np
from numpy.typing import NDArray

from pdmesh.model import output_fields
from pdsolve.fracture.gradients import green, hooke, thinning
from pdsolve.measures.cracked_nodes import (
    cracked_damage_of,
    damage_with_pre_cracks_at,
    damage_without_pre_cracks_at,
    separation_at,
)
from pdsolve.measures.frame_steps import OF_DIFFUSION, expect_physics_of, has_diffusion_only, scalar, vector
from pdsolve.measures.strain import displacement_gradients, elastic_constants_of_nodes, thermal_strain_of_nodes
from pdsolve.results import Results

VECTOR = ("magnitude", "x", "y")
POWERS = str.maketrans({"^": None, "2": "²", "3": "³"})
TENSOR = ("largest", "smallest", "xx", "yy", "xy", "zz")  # principal ones in the plane


class FieldError(ValueError):
    """An unknown field or component; the message names those available."""


@dataclass(frozen=True)
class NodalField:
    """A quantity at the nodes. Its first component is the default."""

    name: str
    title: str
    unit: str
    components: tuple[str, ...] = ()  # none: a scalar

    @property
    def is_fitted_to_bonds(self) -> bool:
        """Whether the field is fitted to the intact bonds: strain and stress."""
        return self.components[: len(TENSOR)] == TENSOR

    def component_names(self, dimension: int = 2) -> tuple[str, ...]:
        """The components of this field in 2 or 3 dimensions."""
        if dimension == 2 or not self.components:
            return self.components
        return (*self.components, *(("z",) if self.components == VECTOR else ("xz", "yz")))


def _create_stored_nodal_field(name: str, title: str, components: tuple[str, ...] = ()) -> NodalField:
    """A field stored in results, with its unit from the table of stored fields."""
    unit = output_fields.FIELDS[name].unit
    return NodalField(name, title, "" if unit == "1" else unit.translate(POWERS), components)


FIELDS = {
    field.name: field
    for field in (
        _create_stored_nodal_field("damage", "Damage"),
        NodalField("separation", "Separation", ""),
        _create_stored_nodal_field("energy", "Strain energy"),
        _create_stored_nodal_field("displacement", "Displacement", VECTOR),
        _create_stored_nodal_field("velocity", "Velocity", VECTOR),
        _create_stored_nodal_field("acceleration", "Acceleration", VECTOR),
        NodalField("strain", "Strain", "", TENSOR),
        NodalField("stress", "Stress", "Pa", (*TENSOR, "mises")),
        _create_stored_nodal_field("plastic", "Equivalent plastic strain"),
        _create_stored_nodal_field("rotation", "Rotation"),
        _create_stored_nodal_field("volume", "Volume over that at the start"),
        _create_stored_nodal_field("concentration", "Concentration"),
        _create_stored_nodal_field("content", "Content, the solid counted"),
        _create_stored_nodal_field("solid", "Share that is solid"),
        _create_stored_nodal_field("temperature", "Temperature"),
    )
}


def choose_component(field_name: str, component: str | None, dimension: int = 2) -> str:
    """The component to show: the given one or the first; "" for a scalar. Raises FieldError."""
    if field_name not in FIELDS:
        raise FieldError(f"field '{field_name}' is unknown; use one of {', '.join(FIELDS)}")
    available = FIELDS[field_name].component_names(dimension)
    if component is None:
        return available[0] if available else ""
    if component not in available:
        expected = f"one of {', '.join(available)}" if available else "none, it is a scalar"
        raise FieldError(f"{field_name} has no component '{component}'; use {expected}")
    return component


def default_field_name(results: Results, step: int) -> str:
    """The default field: damage in mechanics; content where a solid dissolves, otherwise concentration."""
    if not has_diffusion_only(results):
        return "damage"
    first = "content" if results.masses()["solid"][0] > 0 else "concentration"
    stored = results.stored(step)
    return next((name for name in (first, *OF_DIFFUSION) if output_fields.FIELDS[name].columns[0] in stored), first)


def find_unreliable_nodes(results: Results, field_name: str, step: int) -> NDArray[np.bool_]:
    """Mask (n,) of nodes whose value is unreliable: for strain and stress, those of cracked nodes.

    A gradient fitted to so few bonds measures the opening of a crack, not a strain.
    """
    if not FIELDS[field_name].is_fitted_to_bonds:
        return np.zeros(len(results.rows(step)), dtype=bool)
    return damage_with_pre_cracks_at(results, step) > cracked_damage_of(results)


def component_is_signed(field_name: str, component: str) -> bool:
    """Whether a component takes both signs."""
    return field_name == "rotation" or (bool(component) and component not in ("magnitude", "mises"))


def field_values(results: Results, field_name: str, step: int, component: str | None = None) -> NDArray[np.float64]:
    """A component (n,) of the field `field_name` after `step`, in SI units; NaN where a node has none.

    Damage is known at every step, other fields at frames that store them. Raises FieldError, and ResultsError naming
    what is stored.
    """
    return all_field_components(results, field_name, step)[choose_component(field_name, component, results.dimension)]


def all_field_components(results: Results, field_name: str, step: int) -> dict[str, NDArray[np.float64]]:
    """All components (n,) of the field `field_name` after `step`, by name; a scalar's name is ""."""
    field = FIELDS[field_name]
    if field_name == "damage" and not has_diffusion_only(results):
        return {"": damage_without_pre_cracks_at(results, step)}
    if field_name == "separation":
        expect_physics_of(results, field_name)
        return {"": separation_at(results, step)}
    if not field.components:
        return {"": scalar(results, field_name, step)}
    if field.components == VECTOR:
        ways = vector(results, field_name, step).T
        return {"magnitude": reduce(np.hypot, ways), **dict(zip("xyz", ways, strict=False))}
    if results.dimension == 3:
        return _strain_or_stress_components_of_body(results, field_name, step)
    if field_name == "stress" and "sxx" in results.stored(step):
        stress = vector(results, "stress", step)
    else:
        strain = green(displacement_gradients(results, step))
        elastic = elastic_constants_of_nodes(results, step)
        free = thermal_strain_of_nodes(results, step)
        if field_name == "strain":
            return {**_plane_tensor_components(strain), "zz": thinning(strain, elastic, free)}
        stress = hooke(strain, elastic, free)
    xx, yy, xy, zz = stress.T
    mises = np.sqrt(((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * xy**2)
    return {**_plane_tensor_components(stress[:, :3]), "mises": mises, "zz": zz}


def _plane_tensor_components(tensor: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    xx, yy, xy = tensor.T
    middle, radius = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    return {"largest": middle + radius, "smallest": middle - radius, "xx": xx, "yy": yy, "xy": xy}


def _strain_or_stress_components_of_body(
    results: Results, field_name: str, step: int
) -> dict[str, NDArray[np.float64]]:
    """All components (n,) of the strain or stress of a body, by name."""
    expect_physics_of(results, field_name)
    if field_name == "stress" and "sxx" in results.stored(step):
        tensor = vector(results, "stress", step)
    else:
        tensor = green(displacement_gradients(results, step))
        if field_name == "stress":
            tensor = hooke(tensor, elastic_constants_of_nodes(results, step), thermal_strain_of_nodes(results, step))
    xx, yy, xy, zz, xz, yz = tensor.T
    matrices = np.moveaxis(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), 2, 0)
    finite = np.isfinite(tensor).all(axis=1)
    principal = np.full((len(tensor), 3), np.nan)
    principal[finite] = np.linalg.eigvalsh(matrices[finite])
    parts = {"largest": principal[:, 2], "smallest": principal[:, 0]}
    parts |= dict(zip(("xx", "yy", "xy", "zz", "xz", "yz"), tensor.T, strict=True))
    if field_name == "stress":
        parts["mises"] = np.sqrt(((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * (xy**2 + xz**2 + yz**2))
    return parts
