"""Inverted triangles of nodes on a square lattice, without arrays of all triangles."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pdsolve.codegen.inner_functions import INNER
from pdsolve.codegen.jit_cache import cached_njit

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
