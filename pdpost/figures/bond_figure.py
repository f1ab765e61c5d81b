"""A picture of the bonds: intact ones sky blue, broken ones vermilion; with many bonds, the share that is broken."""

from __future__ import annotations

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colors import LinearSegmentedColormap, Normalize

from pdmesh.plain_figure import Figure
from pdpost.figures import field_figure, raster, sheets
from pdpost.figures.colours import at
from pdpost.figures.raster import Box
from pdpost.figures.sheets import box_of, legend, mark, seen, shape, sheet
from pdpost.figures.style import SKY_BLUE, VERMILION
from pdsolve.measures.bond_pairs import BondPairs, read_bond_pairs
from pdsolve.measures.frame_steps import last_frame
from pdsolve.results import Results

INTACT, BROKEN = SKY_BLUE, VERMILION
FEW = "#fbe3d0"  # of the bonds broken
LINES = 200_000  # bonds; more are counted in pixels
SHARP = 5_000  # lines; more are put into a PDF or SVG as an image
INK = 60.0  # points of line width over the root of how many lines


def bonds(
    results: Results,
    step: int | None = None,
    *,
    scale: float = 0.0,
    window: Box | None = None,
    bond_pairs: BondPairs | None = None,
) -> Figure:
    """The bonds after `step` (default: the last frame), on nodes displaced by `scale` times their displacement.

    `window` is the part in view, m; `bond_pairs` are the bonds if the caller has them. Raises ResultsError.
    """
    step = last_frame(results) if step is None else step
    where = shape(results, step, scale)._replace(corners=None)
    bond_pairs = read_bond_pairs(results, step) if bond_pairs is None else bond_pairs
    box = window or box_of([where])
    in_view = seen(where.position, box)[bond_pairs.node_rows].any(axis=1)
    visible_pairs = BondPairs(bond_pairs.node_rows[in_view], bond_pairs.is_broken[in_view])
    many = len(visible_pairs.is_broken) > LINES
    on = sheet(box, bar=many)
    if many:
        # the share of broken bonds among those with their middle in a pixel; pixels are no finer than the nodes
        middle = where.position[visible_pairs.node_rows].mean(axis=1)
        x0, _, x1, _ = on.box
        columns = int(np.clip((x1 - x0) / where.delta.min(), 16, sheets.pixels(on)))
        share, _ = raster.averages(
            middle, np.zeros(len(middle)), visible_pairs.is_broken.astype(float), on.box, columns
        )
        cmap = LinearSegmentedColormap.from_list("broken", [FEW, BROKEN]).with_extremes(under=INTACT, bad="#ffffff00")
        shares = ScalarMappable(Normalize(1e-9, 1.0), cmap)
        sheets.show(on, shares.to_rgba(np.ma.masked_invalid(share), bytes=True), where)
        on.figure.colorbar(shares, cax=field_figure.beside(on), label="share of broken bonds", extend="min")
        for broken, colour, word in ((False, INTACT, "intact"), (True, BROKEN, "broken")):
            count = int((visible_pairs.is_broken == broken).sum())
            on.axes.plot([], [], "s", color=colour, label=f"{count} bonds {word}")
    else:
        width = float(np.clip(INK / np.sqrt(max(len(visible_pairs.is_broken), 1)), 0.15, 0.8))
        for broken, colour, word, order in ((False, INTACT, "intact", 1), (True, BROKEN, "broken", 2)):
            ends = visible_pairs.node_rows[visible_pairs.is_broken == broken]
            lines = LineCollection(
                list(where.position[ends] * on.factor),
                colors=colour,
                linewidths=width * (1.5 if broken else 1),
                zorder=order,
                rasterized=len(visible_pairs.is_broken) > SHARP,
            )
            on.axes.add_collection(lines, autolim=False)
            on.axes.plot([], [], color=colour, linewidth=1.5, label=f"{len(ends)} bonds {word}")
    mark(on, where)
    legend(on)
    on.axes.set_title(f"Bonds {at(results, step, scale)}")
    return on.figure
