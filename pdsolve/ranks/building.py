"""The bonds of a model, made by all ranks at once."""

from __future__ import annotations

import math

from pdsolve.lattice.layout import LANES
from pdsolve.laws import law_of
from pdsolve.model import Model
from pdsolve.numerics.team import Team
from pdsolve.options import Options
from pdsolve.ranks import part
from pdsolve.ranks.slabs import Slab, slabs_of, starts_of
from pdsolve.results.schema import CHUNK


def built(
    model: Model, options: Options, team: Team, make: part.Make, make_tiled: part.MakeTiled
) -> tuple[list[Slab], list[part.Built]]:
    """The slabs of all ranks, which have their bonds then, and what they say of them.

    `make_tiled` makes the operator of a window in tiles, `make` that of one whose bonds are not in blocks. Raises
    ModelError.
    """
    unit = LANES if len(model.grid) <= options.one_file else math.lcm(LANES, CHUNK)  # whole chunks in each file
    slabs, plain = slabs_of(model, team.size, unit), options._replace(team=None)
    starts = starts_of(slabs)
    # a lattice is a few numbers, from which each rank makes the nodes of its window; other nodes are sent
    shares = [(slab, model if model.grid.lattice else model.window(slab.begin, slab.end)) for slab in slabs]
    built_parts: list[part.Built | None] = [None]
    if law_of(model).pair is not None and options.kernel != "listed":
        if model.grid.dimension == 3 and (model.grid.lattice or (model.grid.delta == model.grid.delta[0]).all()):
            built_parts = team.everywhere(part.build_tiles, plain, make_tiled, starts, items=shares)
        if None in built_parts:
            built_parts = team.everywhere(part.build, plain, starts, items=shares)
        plain = plain if built_parts[0] is not None else plain._replace(kernel="listed")  # as one process has it
    if built_parts[0] is None:
        built_parts = team.everywhere(part.build_window, plain, make, starts, items=shares)
        if len({built_part.kernel for built_part in built_parts if built_part is not None}) > 1:
            plain = plain._replace(kernel="listed")  # some windows lie on a lattice, others do not
            built_parts = team.everywhere(part.build_window, plain, make, starts, items=shares)
    return slabs, [built_part for built_part in built_parts if built_part is not None]
