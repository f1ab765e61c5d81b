"""Forces on some lanes of a block of 64 nodes, slot by slot: straight laws on lattices of any spacings.

The sums of `pdsolve.codegen.plane_slots` for any dimension, over lanes.

blocks   of `pdsolve.operators.simd_lattice.kernel`, b one of them
u        (d, m) displacements of all lanes, m
shrink   (m,) minus half the strain of a free node: a bond is relieved of that of both ends; or None
lane     of the block, the first of those that are summed
s        scratch: the sums of forces, 16 along each axis, then e
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit, types
from numba.extending import intrinsic, overload

from pdsolve.codegen.lanes import beside, keep, listed, same, where_above
from pdsolve.codegen.plane_slots import BOUND, FAR, LANES, PULL, VECTOR
from pdsolve.codegen.pull import NARROW
from pdsolve.codegen.tile_lanes import magnitude
from pdsolve.codegen.vector_code import INT, ROW
from pdsolve.lattice.bond import IN_PLACE, any_beyond, difference, elongation, factor, factor_near, pulled, zeros
from pdsolve.lattice.rows import ONE, relieve, shrinkage
from pdsolve.laws.calls import pair_of

NONE = -1  # no slot


@njit(**IN_PLACE)
def row_of(table, row, lane):  # type: ignore[no-untyped-def]
    """The lanes from `lane` on of a row of a table (., 64)."""
    return beside(table, ONE, np.int64(row) * LANES + lane)[0]


@intrinsic
def sums_in(typingctx, s, like):  # type: ignore[no-untyped-def]
    """The sums of forces at the beginning of a scratch as an array (d, 16); a tuple has d entries."""
    view = types.Array(s.dtype, 2, "C")

    def generate(context, builder, signature, values):  # type: ignore[no-untyped-def]
        data = context.make_array(s)(context, builder, values[0]).data
        sums, size = context.make_array(view)(context, builder), s.dtype.bitwidth // 8
        shape, strides = [INT(len(like)), INT(ROW)], [INT(ROW * size), INT(size)]
        context.populate_array(sums, data=data, shape=shape, strides=strides, itemsize=INT(size), meminfo=None)
        return sums._getvalue()

    return view(s, like), generate


def listed_shrinkage(shrink: Any, ids: Any, at: Any) -> Any:
    """Minus half the strain of free lanes with the nodes listed from `at` on; None of None."""
    raise NotImplementedError("compiled with and without strain")


@overload(listed_shrinkage, jit_options=IN_PLACE)
def _listed_shrinkage(shrink, ids, at):  # type: ignore[no-untyped-def]
    if isinstance(shrink, types.NoneType):
        return lambda shrink, ids, at: None
    return lambda shrink, ids, at: listed(shrink, ONE, ids, at)[0]


def weight(law: Any, blocks: Any, b: Any, slot: Any, lane: Any, e: Any) -> Any:
    """Stiffness over length of lanes at e, 0 without a bond."""
    raise NotImplementedError("compiled for each law")


@overload(weight, jit_options=IN_PLACE)
def _weight(law, blocks, b, slot, lane, e):  # type: ignore[no-untyped-def]
    if pair_of(law).elastic_in_compression:
        return _one_sided_weight
    return lambda law, blocks, b, slot, lane, e: row_of(blocks.stiffness, blocks.slots[slot, PULL], lane)


def _one_sided_weight(law, blocks, b, slot, lane, e):  # type: ignore[no-untyped-def]
    w = row_of(blocks.stiffness, blocks.slots[slot, PULL], lane)
    if blocks.softened[b]:  # shortened bonds have all their stiffness, unless they are broken
        none, near = same(blocks.near, 0.0), row_of(blocks.near, blocks.slots[slot, BOUND], lane)
        whole = where_above(same(blocks.near, np.inf), near, row_of(blocks.stiffness, blocks.whole[slot], lane), none)
        w = where_above(e, none, w, whole)
    return w


def _make_sum(anywhere: bool, any_stretch: bool) -> Any:
    """The sum of the forces of a row's slots from entry `first` of `of_rows` on, added to those in s; of slots with
    neighbours `anywhere`, not only consecutive ones (from 0 then), and with `any_stretch`, not only |e| up to `near`.

    It returns the entry after the last one, or the first one that it does not add. With any stretch that is a slot with
    an e above its edge, which is then in s, but for the entry `updated` where that was seen to. Less general loops keep
    all in registers.
    """

    @njit(**IN_PLACE)
    def add(blocks, shrink, u, b, lane, first, updated, s):  # type: ignore[no-untyped-def]
        axes, sums = blocks.axes, sums_in(s, blocks.axes)
        node, last, number = b * LANES + lane, blocks.start_of_rows[(b * LANES + lane) // ROW + 1], first
        here, near = beside(u, axes, node), shrinkage(shrink, node)
        f = beside(sums, axes, 0) if anywhere else zeros(u, axes)
        while number < last:
            slot = np.uint64(blocks.of_rows[np.uint64(number)])  # saves a look whether it counts from the end
            row, way = blocks.vectors[np.uint64(blocks.slots[slot, VECTOR])], np.int64(blocks.slots[slot, lane // ROW])
            if way < FAR:
                there, far = beside(u, axes, node + way), shrinkage(shrink, node + way)
            elif not anywhere:
                break
            else:
                at = (way - FAR) * ROW + lane % ROW
                there, far = listed(u, axes, blocks.ids, at), listed_shrinkage(shrink, blocks.ids, at)
            eta = relieve(difference(there, here), near, far, row)
            e, bound = elongation(eta, row), row_of(blocks.near, blocks.slots[slot, BOUND], lane)
            g = factor_near(e)
            if any_beyond(magnitude(e), bound):
                if not any_stretch:
                    break
                e = where_above(same(u, np.inf), bound, e, same(u, 0.0))  # lanes without a bond
                if number != updated and any_beyond(e, row_of(blocks.edge, blocks.slots[slot, BOUND], lane)):
                    keep((e,), s, len(axes) * ROW)
                    break
                g = factor(u, e, magnitude(e), same(u, NARROW), g)
            f = pulled(f, weight(blocks.law, blocks, b, slot, lane, e) * e * g, eta, row)
            number += 1
        keep(f, sums, 0)
        return number

    return add


sum_consecutive, add_near, add_any_stretch = _make_sum(False, False), _make_sum(True, False), _make_sum(True, True)
