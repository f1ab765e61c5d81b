"""Errors of laws at equal effective length, by a plate with a hole at rest: a chart, and a section of a page.

`python -m benchmarks.effective_length` writes docs/effective_length.png and the section in docs/guide/models.md.

Laws with the same horizon are not equally local: one whose influence falls off acts over less of it. What tells is how
long waves slow down, omega^2 = (E' / rho) k^2 (1 - (k l)^2 / 12 + ...): a chain of springs between next neighbours l
apart does the same. l is read off a law's own tangent: with T_ij its entries along x for a wave along x,
l^2 = sum T_ij x^4 / sum T_ij x^2.
"""

from __future__ import annotations

import sys
import warnings
from pathlib import Path
from typing import NamedTuple

import matplotlib as mpl
import msgspec
import numpy as np

from benchmarks.pages import put_section
from pdmesh.model.document import Horizon, Material, Settings
from pdsolve.model import Model
from pdsolve.options import Options
from pdsolve.run.prepare import prepare
from pdsolve.state import State

ROOT = Path(__file__).parent.parent
UNIT = Material(E=1.0, rho=1.0, G0=1e9, nu=1 / 3, plane="stress")  # the Poisson's ratio that bonds have
SOLID = msgspec.structs.replace(UNIT, failure="none")
FINENESS = 12  # nodes in the radius of the hole
RATIOS = (3.0, 4.0, 5.0, 6.0)  # of horizon to spacing
STRIP, OVER = (60, 24), 1.2  # nodes; times G0
LAWS = {
    "bonds, conical": msgspec.structs.replace(UNIT, micromodulus="conical"),
    "bonds, constant": msgspec.structs.replace(UNIT, micromodulus="constant"),
    **{
        f"ordinary, {influence}": msgspec.structs.replace(SOLID, model="ordinary", influence=influence)
        for influence in ("constant", "inverse", "cubic spline")
    },
    **{
        f"correspondence, {influence}": msgspec.structs.replace(SOLID, model="correspondence", influence=influence)
        for influence in ("constant", "cubic spline")
    },
    "Breitzman-Dayal, cubic spline": msgspec.structs.replace(
        SOLID, model="correspondence", control="breitzman-dayal", influence="cubic spline"
    ),
}

ABOVE = f"""
## Laws at equal effective length

The effective length l of a law depends on its horizon and on its influence function. The dispersion of long waves
defines it: omega^2 = (E' / rho) k^2 (1 - (k l)^2 / 12 + ...). The error is that of the displacement of a plate with a
hole of {FINENESS} spacings in tension at rest (Kirsch), in plane stress with a Poisson's ratio of 1/3.

![Errors over effective length](../effective_length.png)

The table has the error in %, and l in spacings in brackets:

"""
BETWEEN = f"""
At equal length the cubic spline of an ordinary solid is no better than its other influence functions. It is better at
equal horizon because its effective length is shorter. A crack needs a long enough effective length, or it sticks to the
lattice. The second table measures this: a strip of {STRIP[0]} x {STRIP[1]} nodes is pulled apart slowly until it stores
{OVER} times G0 per length of crack ahead. The table has the share of the ligament's bonds that break then, in %:

"""
BELOW = """
Cracks do not run if the effective length is less than two spacings. The default `influence` of `ordinary` is therefore
constant. For elastic problems choose the cubic spline. `python -m benchmarks.effective_length` writes this section.
"""


class Found(NamedTuple):
    """What a law comes to."""

    length: float  # spacings
    error: float  # relative
    through: float | None  # share of a strip's ligament that breaks; None of laws that do not fail here


def length_of(material: Material, ratio: float) -> float:
    """The effective length, in spacings, of a law deep inside a plate."""
    from plates import square_grid

    side = 2 * int(2 * ratio + 3) + 1
    model = Model(square_grid(side, side, 1.0), Settings(material=material, horizon=Horizon(ratio)))
    system, _ = prepare(model, Options(kernel="listed", threads=1))
    nodes, middle = side**2, side**2 // 2
    rest = State(*np.zeros((3, nodes, 2)), *np.zeros((3, nodes)))
    row = system.operator.tangent(rest)[[2 * middle]].toarray()[0, ::2]
    x = system.model.grid.position[:, 0] - system.model.grid.position[middle, 0]
    return float(np.sqrt((row * x**4).sum() / (row * x**2).sum()))


def measured(material: Material, ratio: float) -> Found:
    """A law with a horizon of so many spacings."""
    from kirsch import solved
    from plates import GLASS
    from strips import torn

    through = None
    if material.model != "correspondence":
        own = {name: getattr(material, name) for name in ("model", "nu", "micromodulus", "influence")}
        glass = msgspec.structs.replace(GLASS, failure="stretch", **own)
        through = torn(glass, ratio, *STRIP, over=OVER).through
    return Found(length_of(material, ratio), solved(FINENESS, ratio, material).error, through)


def section(found: dict[str, list[Found]]) -> str:
    """The section of the page."""
    rows = [f"| | {' | '.join(f'm = {ratio:g}' for ratio in RATIOS)} |", "|---" * (1 + len(RATIOS)) + "|"]
    rows += [
        f"| {name} | {' | '.join(f'{100 * one.error:.2f} ({one.length:.2f})' for one in row)} |"
        for name, row in found.items()
    ]
    torn = [
        f"| {name} | {' | '.join(f'{100 * (one.through or 0.0):.0f}' for one in row)} |"
        for name, row in found.items()
        if row[0].through is not None
    ]
    return (ABOVE + "\n".join(rows) + "\n" + BETWEEN + "\n".join([*rows[:2], *torn]) + "\n" + BELOW).lstrip()


def draw(found: dict[str, list[Found]], path: Path) -> None:
    """The chart."""
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(7, 4.5), layout="constrained")
    for name, row in found.items():
        marker = "s" if name.startswith("bonds") else "o" if name.startswith("ordinary") else "^"
        length, error = np.array([one[:2] for one in row]).T
        axes.plot(length, 100 * error, marker=marker, label=name)
    axes.set(xlabel="effective length, spacings", ylabel="error of displacement, %", xscale="log", yscale="log")
    axes.grid(which="both", alpha=0.3)
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=150)


def main() -> int:
    """Measure, draw and write."""
    sys.path.insert(0, str(ROOT / "tests"))
    warnings.simplefilter("ignore")
    found: dict[str, list[Found]] = {}
    for name, material in LAWS.items():
        for ratio in RATIOS:
            one = measured(material, ratio)
            found.setdefault(name, []).append(one)
            print(f"{name}, m = {ratio:g}: l = {one.length:.3f} spacings, error {100 * one.error:.3f} %", flush=True)
    draw(found, ROOT / "docs" / "effective_length.png")
    put_section(ROOT / "docs" / "guide" / "models.md", section(found))
    return 0


if __name__ == "__main__":
    sys.exit(main())
