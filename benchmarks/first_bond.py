"""When the first bond of Kalthoff and Winkler's steel breaks, uniform and with a fine zone that moves.

Writes its section of `docs/adaptivity.md`: python -m benchmarks.first_bond [SPACING ...], in m. One run says nothing of
how sure a time is: there are eight of each, whose steps differ.
"""

from __future__ import annotations

import sys

import numpy as np

from benchmarks.adaptivity import FIRST, PAGE, model, solved
from benchmarks.pages import put_section

SPACINGS = ("5e-4", "2.5e-4", "1.25e-4")  # m
SHARES = np.linspace(1, 0.87, 8)  # of the surely stable step
LASTS = 24e-6  # s

TEXT = """{first}

`python -m benchmarks.first_bond` solves Kalthoff and Winkler's steel until its first bond breaks, with {count} steps
from {most:g} to {least:g} of the sure one. Mean, and the least and the greatest, of its time in us:

| spacing, mm | uniform | hybrid | difference of the means |
|---|---|---|---|
{rows}
A coarse cell that a pre-crack cuts in two is two strips: its edges have the stiffness of strips with free faces, and
its corners the mass of their own side. With those of a whole cell instead, the first bond was 0.10 us late at 0.5 mm
and 0.15 us at 0.25 mm. Two errors of opposite signs are left, of the struck edge and of the waves' way: a held row of
fine nodes has a soft skin, which acts as 1.2 h more plate and which a coarse edge lacks. Cracks that open (Duran's
glass) start on time.
"""


def main(spacings: list[str]) -> int:
    """Measure and write the section."""
    rows = []
    for spacing in spacings or SPACINGS:
        plate = model("kalthoff_winkler_steel.py", (("spacing", spacing),))
        found = {
            adapt: [1e6 * solved(plate, adapt, share, LASTS).first for share in SHARES] for adapt in ("none", "hybrid")
        }
        cells = [f"{np.mean(some):.3f} ({min(some):.3f} to {max(some):.3f})" for some in found.values()]
        late = np.mean(found["hybrid"]) - np.mean(found["none"])
        rows.append(f"| {1e3 * float(spacing):g} | {' | '.join(cells)} | {late:+.3f} |\n")
        print(rows[-1], end="", file=sys.stderr, flush=True)
    words = {"count": len(SHARES), "most": SHARES[0], "least": SHARES[-1], "rows": "".join(rows), "first": FIRST}
    put_section(PAGE, TEXT.format(**words))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
