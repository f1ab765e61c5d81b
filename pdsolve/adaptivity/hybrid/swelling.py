"""What swelling makes of the pieces of clipped bonds and of border nodes, and the energy that all springs hold.

A free node is strained by its temperature or content; a spring, or a piece of one, by the mean of its ends, and is
stretched from there. Fine nodes have strains where they are idle too, so that cells that become fine have theirs.

Free bodies whose strain e is linear bend: u_,xx = (e_,x, -e_,y) and u_,yy = -u_,xx. Places between two coarse nodes are
off the line between them by w (w - 1) / 2 times the square of their distance times that, so that such bodies are free
of stress with any zone.
"""

from __future__ import annotations

from typing import Any

from numba import njit
from numba.extending import overload

from pdsolve.adaptivity.hybrid.forces import interpolate_border_nodes
from pdsolve.adaptivity.hybrid.node_constants import node_constant_at_place
from pdsolve.codegen.inner_functions import INNER, is_none
from pdsolve.codegen.jit_cache import cached_njit
from pdsolve.zone.cells import place_number_at, place_on_finer_lattice


def set_swelling_offsets_of_bond_pieces(lattice: Any, zone: Any) -> None:
    """Set what the strains of nodes add to the displacements between the ends of pieces, where nodes swell."""


@overload(set_swelling_offsets_of_bond_pieces, jit_options=INNER)
def _overload_set_swelling_offsets_of_bond_pieces(lattice, zone):  # type: ignore[no-untyped-def]
    fine = zone.types[zone.fields.index("fine")]
    if is_none(fine.types[fine.fields.index("negative_half_swelling")]):
        return lambda lattice, zone: None

    def set_offsets_of_bond_pieces(lattice, zone):  # type: ignore[no-untyped-def]
        fine, coarse, pieces = zone.fine.negative_half_swelling, zone.coarse.negative_half_swelling, zone.clipped_pieces
        for n in range(zone.counts.clipped_pieces):
            spring, first, second = pieces.springs[n], pieces.ends[n, 0], pieces.ends[n, 1]
            both = _negative_half_swelling_at_end(fine, coarse, first) + _negative_half_swelling_at_end(
                fine, coarse, second
            )
            x0, y0 = swelling_offset_from_chord(lattice, fine, first.first_node, first.second_node, first.second_weight)
            x1, y1 = swelling_offset_from_chord(
                lattice, fine, second.first_node, second.second_node, second.second_weight
            )
            spring.swelling_x = both * spring.xi_x + x1 - x0
            spring.swelling_y = both * spring.xi_y + y1 - y0

    return set_offsets_of_bond_pieces


def swelling_offset_from_chord(
    lattice: Any, negative_half_swelling: Any, first_node: Any, second_node: Any, w: Any
) -> Any:
    """How far a place at share w from coarse `first_node` to `second_node` is off their line, (x, y) in m.

    `negative_half_swelling` (n,) is that of fine nodes. A `second_node` below 0 is none.
    """


@overload(swelling_offset_from_chord, jit_options=INNER)
def _overload_swelling_offset_from_chord(lattice, negative_half_swelling, first_node, second_node, w):  # type: ignore[no-untyped-def]
    if is_none(negative_half_swelling):
        return lambda lattice, negative_half_swelling, first_node, second_node, w: (0.0, 0.0)

    def offset_from_chord(lattice, negative_half_swelling, first_node, second_node, w):  # type: ignore[no-untyped-def]
        if second_node < 0 or first_node == second_node:
            return 0.0, 0.0
        numbering, q = lattice.numbering, min(first_node, second_node)
        level = abs(second_node - first_node) == 1
        along, across = (1, numbering.fine.strides[1]) if level else (numbering.fine.strides[1], 1)
        p = place_on_finer_lattice(numbering.coarse, numbering.fine, 2, q)
        scale = -4 * lattice.spacing * w * (w - 1)
        on = scale * (negative_half_swelling[p + 2 * along] - negative_half_swelling[p]) / 2
        aside = -scale * _minmod_difference(negative_half_swelling, lattice.node_constants, p + along, across)
        return (on, aside) if level else (aside, on)

    return offset_from_chord


@njit(**INNER)
def _minmod_difference(values, node_constants, p, step):  # type: ignore[no-untyped-def]
    """Difference of values from a place to the next: the smaller of both sides, 0 if they differ in sign.

    So it is that of linear values, and no leap at a crack is one.
    """
    up, down = values[p + step] - values[p], values[p] - values[p - step]
    has_next = node_constant_at_place(node_constants, node_constants.mass, p + step) > 0
    has_previous = node_constant_at_place(node_constants, node_constants.mass, p - step) > 0
    if not (has_next and has_previous):
        return (up if has_next else 0.0) + (down if has_previous else 0.0)
    if up * down <= 0:
        return 0.0
    return up if abs(up) < abs(down) else down


@njit(forceinline=True, **INNER)
def _negative_half_swelling_at_end(fine, coarse, end):  # type: ignore[no-untyped-def]
    """Minus half the strain at an end of a piece."""
    if end.second_node < 0:
        return fine[end.first_node]
    return (1 - end.second_weight) * coarse[end.first_node] + end.second_weight * coarse[end.second_node]


@cached_njit(error_model="numpy")
def set_all_swelling_offsets(lattice, zone, displacement_buffer_index):  # type: ignore[no-untyped-def]
    """See `set_swelling_offsets_of_bond_pieces`; border nodes too."""
    set_swelling_offsets_of_bond_pieces(lattice, zone)
    border, count = zone.border_nodes, zone.counts.border_nodes
    for n in range(count):
        node, negative_half_swelling = border[n], zone.fine.negative_half_swelling
        node.swelling_x, node.swelling_y = swelling_offset_from_chord(
            lattice, negative_half_swelling, node.first_coarser_node, node.second_coarser_node, node.second_weight
        )
    interpolate_border_nodes(
        zone.fine.u[displacement_buffer_index], zone.coarse.u[displacement_buffer_index], border, count
    )


@cached_njit(error_model="numpy")
def average_fine_values_to_coarse(lattice, fine_values, coarse_values):  # type: ignore[no-untyped-def]
    """Set values of coarse nodes to the mean of fine ones (n,) around them: 1/4, 1/2, 1/4 along each axis.

    What a cell holds is so that of its fine nodes. Along an axis on which there is no node on one side, the middle one
    alone counts, so that linear values stay exact.
    """
    numbering, nodes, stride = lattice.numbering, lattice.node_constants, lattice.numbering.fine.strides[1]
    for y in range(numbering.cells.counts[1] + 1):
        for x in range(numbering.cells.counts[0] + 1):
            p = place_number_at(numbering.fine, (2 * x, 2 * y))
            mean = _weighted_mean_along_line(fine_values, nodes, p, 1)
            if (
                node_constant_at_place(nodes, nodes.mass, p + stride) > 0
                and node_constant_at_place(nodes, nodes.mass, p - stride) > 0
            ):
                mean = mean / 2 + _weighted_mean_along_line(fine_values, nodes, p + stride, 1) / 4
                mean += _weighted_mean_along_line(fine_values, nodes, p - stride, 1) / 4
            coarse_values[place_number_at(numbering.coarse, (x, y))] = mean


@njit(**INNER)
def _weighted_mean_along_line(values, node_constants, p, step):  # type: ignore[no-untyped-def]
    """Mean of a value and the next ones on a line, if there are both."""
    for neighbour in (p + step, p - step):
        if node_constant_at_place(node_constants, node_constants.mass, neighbour) == 0:
            return values[p]
    return values[p] / 2 + (values[p - step] + values[p + step]) / 4
