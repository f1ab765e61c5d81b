"""A plate as a small SVG, for notebooks; it needs no library."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

WIDTH, TALLEST, EDGE = 480.0, 360.0, 6.0  # pixels
MOST = 20_000  # nodes; more are not drawn
STYLE = (
    "<style>.plate{fill:#8884;stroke:#888;stroke-width:1}.node{stroke:#56b4e9}.border{stroke:#0072b2}"
    ".node,.border,.crack{stroke-linecap:round;fill:none}.crack{stroke:#d55e00;stroke-width:2}</style>"
)

Ring = NDArray[np.float64] | Sequence[Sequence[float]]


def svg(
    rings: Iterable[Ring],
    cracks: Iterable[Ring],
    nodes: NDArray[np.float64] | None = None,
    delta: NDArray[np.float64] | None = None,
    border: NDArray[np.bool_] | None = None,
) -> str:
    """Outlines and holes as `rings` (k, 2), pre-cracks as lines (k, 2), nodes (n, 2) with spacings (n,), all in m.

    Nodes marked in `border` (n,) are darker.
    """
    edges, lines = ([np.asarray(curve, dtype=float).reshape(-1, 2) for curve in curves] for curves in (rings, cracks))
    all_points = np.vstack(
        [*edges, *([] if nodes is None else [nodes]), *([] if edges or nodes is not None else lines)]
    )
    low, high = all_points.min(axis=0), all_points.max(axis=0)
    size = np.maximum(high - low, 1e-12 + 0.01 * float((high - low).max()))
    factor = min(WIDTH / size[0], TALLEST / size[1])

    def places(points: NDArray[np.float64]) -> NDArray[np.float64]:
        x, y = (factor * (points - low)).T
        return np.column_stack([EDGE + x, EDGE + factor * size[1] - y]).round(2)

    def path(points: NDArray[np.float64]) -> str:
        return "M" + "L".join(f"{x:g},{y:g}" for x, y in places(points).tolist())

    elements = []
    if edges:
        elements.append(f'<path class="plate" fill-rule="evenodd" d="{"".join(path(ring) + "Z" for ring in edges)}"/>')
    if nodes is not None and delta is not None and len(nodes) <= MOST:
        dark = np.zeros(len(nodes), dtype=bool) if border is None else border
        width = np.maximum(0.45 * factor * delta, 0.6).round(1)
        for kind, wide in dict.fromkeys(zip(dark.tolist(), width.tolist(), strict=True)):
            dots = places(nodes[(dark == kind) & (width == wide)]).tolist()
            marks = "".join(f"M{x:g},{y:g}h0" for x, y in dots)
            elements.append(f'<path class="{"border" if kind else "node"}" stroke-width="{wide:g}" d="{marks}"/>')
    elements += [f'<path class="crack" d="{path(line)}"/>' for line in lines if len(line) > 1]
    across, tall = (factor * size + 2 * EDGE).round(1).tolist()
    about = f'width="{across:g}" height="{tall:g}" viewBox="0 0 {across:g} {tall:g}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {about}>{STYLE}{"".join(elements)}</svg>'
