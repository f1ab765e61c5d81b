"""Checks of what a run computes: inverted triangles of nodes, lost digits, contact and breaks that are not resolved.

On a square lattice inverted triangles are found without arrays of all triangles.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from itertools import combinations
from typing import NamedTuple, cast

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdmesh.model.material import Material
from pdmesh.model.material_constants import critical_stretch
from pdmesh.model.neighbours import ROUND_OFF, tree_of
from pdsolve.checks import named, warn
from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.laws import limits
from pdsolve.laws.law import Sizes
from pdsolve.model import Model, ModelWarning
from pdsolve.operators.contact.at_rest import RestingContact
from pdsolve.operators.together import unwrap_bond_operator
from pdsolve.run.system import System
from pdsolve.state import Broken, State

AROUND = 4  # nodes next to a node, of which two and the node are a triangle to look at
TOGETHER = 1000  # nodes whose bonds are asked for at once
FLAT = 0.1  # of a spacing squared: neighbours that span less are in line with the node
FRACTION = 0.005  # of what breaks a bond: displacements must be known to that, as errors add up over steps

LARGEST = 0.1  # plastic strain up to which j2 in its total form counts as one for small strains


class DisplacementRange(NamedTuple):
    """The least and the largest displacement along each axis, m, and their number type."""

    minimum_by_axis: tuple[float, ...]
    maximum_by_axis: tuple[float, ...]
    dtype_name: str


def compute_displacement_range(u: NDArray[np.floating]) -> DisplacementRange:
    """The extent of displacements (n, d), m."""
    least, most = (tuple(float(of(column)) for column in u.T) for of in (np.min, np.max))  # not over both axes: slow
    return DisplacementRange(least, most, u.dtype.name)


class InversionAndPrecisionChecks:
    """Checks the motion of a run from time to time; gives each warning once."""

    def __init__(
        self,
        model: Model,
        initial_bonds_of_rows: Callable[[int, int], tuple[NDArray[np.int64], NDArray[np.int64]]],
        inversion_and_imprecision_warned: tuple[bool, bool] = (False, False),
    ) -> None:
        """`initial_bonds_of_rows(first, end)` returns the rows of both ends of the initial bonds of sources `first` to
        `end` - 1; `inversion_and_imprecision_warned` are the warnings given already, of nodes before."""
        self._model, (self._said, self._vague) = model, inversion_and_imprecision_warned
        self._bonds, self._own = initial_bonds_of_rows, slice(None)
        self._triangles: _NodeTriangles | None = None  # of nodes off a lattice
        self._apart: NDArray[np.bool_] | None = None  # (n,) nodes whose triangle was not bonded at the start
        self._smallest = float(model.grid.delta.min())
        breaking, ratio = [np.inf], model.settings.horizon.ratio
        for spacing, material in _spacings_of_materials(model):
            sizes = Sizes(critical_stretch(material, ratio * spacing), spacing, ratio * spacing, ratio)
            breaking += (limits(material, sizes).peak * spacing).tolist()
        self._breaking = min(breaking)  # m, lengthening that breaks or softens a bond

    @property
    def inversion_and_imprecision_warned(self) -> tuple[bool, bool]:
        """Whether warnings of inverted triangles, and of displacements too large for their precision, are given."""
        return self._said, self._vague

    @property
    def smallest_spacing_and_breaking_elongation(self) -> tuple[float, float]:
        """The smallest spacing, and the lengthening that breaks or softens a bond, m."""
        return self._smallest, self._breaking

    def set_smallest_spacing_and_breaking_elongation_of_ranks(
        self, spacings_and_elongations: Sequence[tuple[float, float]], local_rows: slice
    ) -> None:
        """Take these lengths of all ranks as known, and look at the triangles of `local_rows` alone."""
        self._smallest, self._breaking = (min(column) for column in zip(*spacings_and_elongations, strict=True))
        self._own = local_rows

    def triangles_may_be_inverted(self, displacement_range: DisplacementRange) -> bool:
        """Whether triangles may be inverted."""
        wide = max(
            most - least
            for least, most in zip(displacement_range.minimum_by_axis, displacement_range.maximum_by_axis, strict=True)
        )
        return self._model.grid.dimension == 2 and not self._said and wide >= self._smallest

    def warn_of_inverted_triangle(self, triangle_text: str, step: int) -> None:
        """Warn, once, of an inverted triangle in `triangle_text`."""
        self._said = True
        warn(
            self._model,
            f"step {step}: a triangle turned inside out with its bonds intact, {triangle_text}: bonds do not keep nodes"
            " apart; use less compression",
        )

    def warn_of_imprecise_displacements(self, displacement_range: DisplacementRange, step: int) -> None:
        """Warn, once, of displacements too large for their precision."""
        largest = max(
            abs(value) for value in (*displacement_range.minimum_by_axis, *displacement_range.maximum_by_axis)
        )
        error = float(np.finfo(displacement_range.dtype_name).eps * largest)
        if not self._vague and error > FRACTION * self._breaking:
            self._vague = True
            warn(
                self._model,
                f"step {step}: displacements reach {largest:.3g} m, which {displacement_range.dtype_name} knows to"
                f" {error:.2g} m, and {FRACTION * self._breaking:.2g} m are needed: {self._breaking:.2g} m break a"
                " bond",
            )

    def describe_inverted_triangle(self, u: NDArray[np.floating], broken: Broken) -> str | None:
        """The nodes of an inverted triangle whose bonds are intact, in words; None if there is none."""
        nodes = len(self._model.grid)
        if self._apart is None:
            self._apart = np.zeros(nodes, dtype=bool)
        turned = self._find_inverted_triangles(u)
        near = np.zeros(nodes, dtype=bool)
        near[turned[:, 0]] = True
        broken_keys = (nodes * broken.source + broken.target)[near[broken.source]]
        for end in (1, 2):
            turned = turned[~np.isin(nodes * turned[:, 0] + turned[:, end], broken_keys, assume_unique=True)]
        were_bonded = np.zeros(len(turned), dtype=bool)
        for part in np.unique(turned[:, 0] // TOGETHER).tolist():
            rows = np.flatnonzero(turned[:, 0] // TOGETHER == part)
            source, target = self._bonds(part * TOGETHER, min((part + 1) * TOGETHER, nodes))
            keys, corner_keys = nodes * source + target, nodes * turned[rows, 0]
            bonded = [np.isin(corner_keys + turned[rows, end], keys, assume_unique=True) for end in (1, 2)]
            were_bonded[rows] = bonded[0] & bonded[1]
        self._apart[turned[~were_bonded, 0]] = True
        turned = turned[were_bonded]
        if len(turned):
            return ", ".join(named(self._model, int(corner)) for corner in turned[0])
        return None

    def _find_inverted_triangles(self, u: NDArray[np.floating]) -> NDArray[np.int64]:
        """Corners (t, 3) of the inverted triangles, without those whose nodes were not bonded at the start."""
        assert self._apart is not None
        position, flat = self._model.grid.position, FLAT * self._smallest**2
        inverted = None
        if self._triangles is None:
            inverted = find_inverted_lattice_triangles(position, u, self._own, flat, self._apart)
        if inverted is not None:
            return inverted
        if self._triangles is None:
            near = tree_of(position).query(position, min(AROUND + 1, len(position)))[1][:, 1:]
            ends, twice = np.zeros((2, len(position)), dtype=np.int64), np.zeros(len(position))
            for pair in combinations(near.T, 2):
                twice_area = _cross_product(*(position[end] - position for end in pair))
                larger = np.abs(twice_area) > np.abs(twice) * (1 + ROUND_OFF)
                ends[:, larger], twice[larger] = np.array(pair)[:, larger], twice_area[larger]
            low, high, _ = self._own.indices(len(position))
            rows = low + np.flatnonzero(np.abs(twice[low:high]) >= flat)
            self._triangles = _NodeTriangles(np.column_stack([rows, *ends[:, rows]]), twice[rows])
        corners, before = self._triangles
        current_position = position + u
        turned = (
            before
            * _cross_product(*(current_position[corners[:, end]] - current_position[corners[:, 0]] for end in (1, 2)))
            <= 0
        )
        return corners[turned & ~self._apart[corners[:, 0]]]


def _spacings_of_materials(model: Model) -> Iterator[tuple[NDArray[np.float64], Material]]:
    """The spacings (k,), m, at which there are nodes of materials that differ in numbers alone, and these materials."""
    delta = model.grid.delta
    if model.grid.fields:
        return ((delta[rows], material) for rows, material in model.materials_at(np.arange(len(delta))))
    spacings = np.unique(delta)
    has_spacing = np.zeros((len(model.materials), len(spacings)), dtype=np.bool_)
    has_spacing[model.material_of, np.searchsorted(spacings, delta)] = True
    numbers, columns = np.nonzero(has_spacing)
    return ((spacings[columns[some]], material) for some, material in model.material_columns.of(numbers))


class _NodeTriangles(NamedTuple):
    """For each node, the largest triangle with two of its nearest nodes, if they are not in line with it; t of them."""

    corner_rows: NDArray[np.int64]  # (t, 3)
    signed_double_areas: NDArray[np.float64]  # (t,) twice its area, m^2, with the sign of its sense


def _cross_product(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


LINES = 2  # of a lattice: nodes on it may be that far from those beside them
ON_LATTICE = 1e-6  # spacings: nodes this near to a lattice are on it


def find_inverted_lattice_triangles(
    position: NDArray[np.float64],
    u: NDArray[np.floating],
    local_rows: slice,
    least_double_area: float,
    is_excluded_node: NDArray[np.bool_],
) -> NDArray[np.int64] | None:
    """Rows (t, 3) of the corners of triangles that displacements u (n, 2), m, have inverted, by the first corner.

    A node of `local_rows` has one with the nearest nodes within `LINES` spacings along x and along y, if twice its area
    is at least `least_double_area`, m^2, and if it is not excluded. None if the nodes (n, 2), m, are not row by row on
    a square lattice, of which some may be missing.
    """
    low, high, _ = local_rows.indices(len(position))
    places, moves = (np.require(values, requirements=("C", "W")) for values in (position, u))
    corners = np.empty((16, 3), dtype=np.int64)
    while True:
        count = int(
            _fill_and_count_inverted_triangles(places, moves, low, high, least_double_area, is_excluded_node, corners)
        )
        if count <= len(corners):
            return None if count < 0 else corners[:count]
        corners = np.empty((count, 3), dtype=np.int64)


@cached_njit(nogil=True, error_model="numpy")
def _fill_and_count_inverted_triangles(position, u, first_row, end_row, least_double_area, is_excluded_node, corners):  # type: ignore[no-untyped-def]
    """List inverted triangles as far as there is room; returns how many there are, -1 off a lattice."""
    site_numbers = np.empty(len(position), np.int64)
    stride, count = _fill_site_numbers_and_find_row_stride(position, site_numbers), 0
    if stride == 0:
        return -1
    search_positions = np.zeros((2, 4), np.int64)
    for n in range(len(position)):
        a, b = (
            _find_neighbour_along_axis(site_numbers, search_positions[0], n, 1),
            _find_neighbour_along_axis(site_numbers, search_positions[1], n, stride),
        )
        before = _signed_double_triangle_area(position, u, 0.0, n, a, b)
        if (
            first_row <= n < end_row
            and not is_excluded_node[n]
            and abs(before) >= least_double_area
            and before * _signed_double_triangle_area(position, u, 1.0, n, a, b) <= 0
        ):
            if count < len(corners):
                corners[count, 0], corners[count, 1], corners[count, 2] = n, a, b
            count += 1
    return count


@njit(**INNER)
def _fill_site_numbers_and_find_row_stride(position, site_numbers):  # type: ignore[no-untyped-def]
    """Number the nodes (n,) row by row; returns the step from a row to the next, 0 off a lattice."""
    x0, y0, x1, spacing = np.inf, np.inf, -np.inf, np.inf
    for n in range(len(position)):
        x, y = position[n, 0], position[n, 1]
        x0, y0, x1 = min(x0, x), min(y0, y), max(x1, x)
        if n > 0 and x > position[n - 1, 0]:
            spacing = min(spacing, x - position[n - 1, 0])
    if not np.isfinite(spacing):
        return 0
    stride = int(np.rint((x1 - x0) / spacing)) + LINES + 1
    for n in range(len(position)):
        x, y = (position[n, 0] - x0) / spacing, (position[n, 1] - y0) / spacing
        column, row = np.rint(x), np.rint(y)
        site_numbers[n] = int(row) * stride + int(column)
        if max(abs(x - column), abs(y - row)) > ON_LATTICE or (n > 0 and site_numbers[n] <= site_numbers[n - 1]):
            return 0
    return stride


@njit(**INNER)
def _find_neighbour_along_axis(site_numbers, search_positions, node, number_step):  # type: ignore[no-untyped-def]
    """The nearest node along an axis, or the node itself: numbers of nodes along it are `number_step` apart.

    `search_positions` (4,) are updated.
    """
    nearest = node
    for k in range(4):
        wanted = site_numbers[node] + (k // 2 + 1) * (number_step if k % 2 == 0 else -number_step)
        while search_positions[k] < len(site_numbers) - 1 and site_numbers[search_positions[k]] < wanted:
            search_positions[k] += 1
        if nearest == node and site_numbers[search_positions[k]] == wanted:
            nearest = search_positions[k]
    return nearest


@njit(forceinline=True, **INNER)
def _signed_double_triangle_area(position, u, displacement_factor, node, a, b):  # type: ignore[no-untyped-def]
    """Twice the area of a triangle, m^2, displaced by a `displacement_factor` of u."""
    x, y = position[node, 0] + displacement_factor * u[node, 0], position[node, 1] + displacement_factor * u[node, 1]
    ax, ay = position[a, 0] + displacement_factor * u[a, 0] - x, position[a, 1] + displacement_factor * u[a, 1] - y
    bx, by = position[b, 0] + displacement_factor * u[b, 0] - x, position[b, 1] + displacement_factor * u[b, 1] - y
    return ax * by - ay * bx


RESOLVED = 4.0  # spacings: half-width from which on it is Hertz's


def warn_of_unresolved_contact_width(system: System, state: State) -> None:
    """Warn of the narrowest contact of two round bodies under the largest force of a run at rest."""
    contact, bodies = system.contact, system.model.grid.bodies
    if contact is None or bodies is None or system.model.settings.run.solver != "static":
        return
    contact = cast("RestingContact", contact)  # as at rest
    contact.measure_widths(state)
    narrow = {pair: width.half for pair, width in contact.widths.items() if width.half < RESOLVED}
    if narrow:
        (first, second), half = min(narrow.items(), key=lambda item: item[1])
        warn(
            system.model,
            f"$.bodies: '{bodies.names[first]}' and '{bodies.names[second]}' touch over a half-width of {half:.1f}"
            f" spacings, less than the {RESOLVED:g} of round bodies: the width and the pressure of a narrower"
            " contact are not resolved; use a finer spacing",
        )


def warn_if_plastic_strain_is_large(system: System, step: int) -> bool:
    """Warn if the equivalent plastic strain of a node is above `LARGEST`; returns whether one is."""
    solid = getattr(getattr(unwrap_bond_operator(system.operator), "columns", None), "solid", None)
    if solid is None:
        return False
    p = solid.history[:, :6].astype(float)
    largest = float(np.sqrt(2 / 3 * ((p[:, :3] ** 2).sum(axis=1) + 2 * (p[:, 3:] ** 2).sum(axis=1))).max(initial=0.0))
    if largest <= LARGEST:
        return False
    warnings.warn(
        f"{system.model.name}: step {step}: the plastic strain is {largest:.3g}, more than {LARGEST:g}, and j2 is"
        " for small strains: stress and volume are wrong; use material.form = 'rate' for large ones",
        ModelWarning,
        stacklevel=2,
    )
    return True
