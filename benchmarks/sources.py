"""Solve the examples of the other sources: python -m benchmarks.sources

Writes numbers (claimed, accepted, measured) and pictures of the pages below docs/verification/reproductions. Results
stay in `build/sources` and are used again; delete that folder for a fresh run.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.models import scene_model
from benchmarks.pages import DOCS, markdown_table, pictured, write_block
from benchmarks.thesis import provenance
from pdpost.figures import field_figure
from pdpost.figures.style import save, styled
from pdsolve.laws.higher_order_correspondence import fit
from pdsolve.measures.cracks import find_crack_events
from pdsolve.results import Results
from pdsolve.run.simulation import Options, simulate

CLASSICAL, FIBRES, ELEMENTS = "the classical bar", "fibres of the classical beam", "finite elements"
INDEPENDENT = "an independent program"
RESULTS = Path("build/sources")
HEADER = ["", "claimed by the source", "accepted", "whose number", "measured", "accepted?"]


class Number(NamedTuple):
    """One number of an example."""

    what: str
    claimed: str  # by the source, "none" where it has no number
    low: float
    high: float
    whose: str  # the number that the range is around
    value: float

    def row(self) -> list[str]:
        """As a line of a table."""
        verdict = "yes" if self.low <= self.value <= self.high else "**no**"
        return [self.what, self.claimed, f"{self.low:.6g} to {self.high:.6g}", self.whose, f"{self.value:.6g}", verdict]


class Example(NamedTuple):
    """A shipped scene: what is measured and drawn of it."""

    title: str
    scene: str
    numbers: Callable[[Results], list[Number]]
    field: str
    times: tuple[float, ...]  # s, of pictures: the frame nearest to each


def last(results: Results) -> int:
    """The step of the last frame."""
    return int(results.frames()[0][-1])


def near(results: Results, time: float) -> int:
    """The step of the frame nearest to a time, s."""
    steps, times = results.frames()
    return int(steps[np.abs(times - time).argmin()])


def within(middle: float, share: float) -> tuple[float, float]:
    """A range around a number."""
    low, high = sorted((middle * (1 - share), middle * (1 + share)))
    return low, high


def _bar(results: Results) -> list[Number]:
    x = results.nodes().position[:, 0]
    end, numbers = x > x.max() - 1e-9, []
    for time, exact in ((1.0, 1.0), (2.0, 2.0), (3.0, 1.0)):
        value = float(results.field("ux", near(results, time))[end].mean()) / 1e-3
        what = f"displacement of the end at {time:g} L / c, over sigma L / E"
        numbers.append(Number(what, "none", *within(exact, 0.05), CLASSICAL, value))
    return numbers


def _branching(results: Results) -> list[Number]:
    whole = find_crack_events(results)
    first = float(results.breaks().step.min()) * results.summary()["time_step"] * 1e6
    place = np.nan if whole.branching is None else whole.branching.along * 1e3
    through = np.nan if whole.split is None else whole.split.time * 1e6
    return [
        Number("first broken bond, µs", "7.6", 5.5, 8.0, INDEPENDENT, first),
        Number("place of branching, mm", "a picture", 60, 90, INDEPENDENT, place),
        Number("far edge reached, µs", "60 (45 by XFEM)", 42, 60, INDEPENDENT, through),
    ]


def _square(results: Results) -> list[Number]:
    position = results.nodes().position
    middle = np.abs(position - 0.5).max(axis=1).argmin()
    turned = float(np.degrees(results.field("rotation", last(results))[middle]))
    exact = 30 - np.degrees(0.5)
    return [Number("rotation of the middle, degrees", "none", exact - 1e-2, exact + 1e-2, "30 degrees - 1/2", turned)]


def _rubber(results: Results) -> list[Number]:
    reactions, step = results.reactions(), last(results)
    pull = reactions["force_x"][(reactions["condition"] == 1) & (reactions["step"] == step)]
    return [Number("reaction over E", "none", *within(0.42257, 0.04), ELEMENTS, float(pull[0]))]


def _beam(results: Results) -> list[Number]:
    x, y = results.nodes().position.T
    middle, numbers = np.abs(x) < 1e-6, []
    cell = np.where(np.abs(y[middle]) > 0.0499, 0.5, 1.0) * 0.01
    for times, exact in ((1, 1.0), (2, 1.3930), (3, 1.4733), (4, 1.5022)):
        moment = float((results.field("sxx", 4 * times)[middle] * y[middle] * cell).sum() / 46.8787e4)
        numbers.append(Number(f"moment at {times} times the first bend", "none", *within(exact, 0.03), FIBRES, moment))
    return numbers


def _orders() -> str:
    """What a corner of the bent square sees, by order."""
    Y, X = (each.ravel()[1:] / 20 for each in np.mgrid[0:21, 0:21])
    eta = _bent(X, Y) - np.column_stack([X, Y])
    xi, rows = np.column_stack([X, Y]), []
    claimed = {1: ("1.35", 1.3521), 3: ('"35"', 31.3460), 5: ("29.99", 29.9906), 7: ("30.00", 30.0)}
    for order, (said, known) in claimed.items():
        Q, t, _ = fit(xi, np.ones(len(X)), order, 1.0, 1.0)
        F = np.eye(2) + (Q[: len(xi)].T @ eta).T @ t
        turned = float(np.degrees(np.arctan2(F[1, 0] - F[0, 1], F[0, 0] + F[1, 1])))
        what = f"rotation seen from the corner, order {order}, degrees"
        rows.append(Number(what, said, known - 1e-3, known + 1e-3, INDEPENDENT, turned).row())
    return "## What orders of gradients see\n\n" + markdown_table(HEADER, rows)


def _bent(X: NDArray[np.float64], Y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places less that of the corner."""
    c, s = np.cos(np.pi / 6), np.sin(np.pi / 6)
    x, y = (0.5 + Y) * np.sin(X), (0.5 + Y) * np.cos(X) - 0.5
    return np.column_stack([c * x - s * y, s * x + c * y])


PAGES = {
    "correspondence": (
        Example("A bar under sudden end stress", "bar.py", _bar, "displacement", (0.5, 1.0, 2.0)),
        Example("A branching plate", "branching_plate.py", _branching, "damage", (7.6e-6, 45e-6, 60e-6)),
    ),
    "gradients": (
        Example("A square that bends and turns", "bent_square.py", _square, "rotation", (1.0,)),
        Example("A block of rubber between clamps", "rubber_block.py", _rubber, "stress", (1.0,)),
        Example("A beam of steel that flows", "plastic_beam.py", _beam, "plastic", (1.0, 2.0, 4.0)),
    ),
}


def solved(example: Example) -> Path:
    """The results of an example, solved unless they are there already."""
    path = RESULTS / f"{Path(example.scene).stem}.sqlite"
    if not path.exists():
        simulate(scene_model(example.scene), path, Options(threads=1)).close()
    return path


def section(example: Example, folder: Path) -> str:
    """Numbers and pictures of an example."""
    pictures = []
    with Results.open(solved(example)) as results:
        rows = [number.row() for number in example.numbers(results)]
        steps, times = results.frames()
        for step in (near(results, time) for time in example.times):
            name = f"{Path(example.scene).stem}.{step}.png"
            with styled({"savefig.dpi": 80}):
                save(field_figure.field(results, example.field, step), folder / name)
            pictures.append([f"{example.field} at {times[list(steps).index(step)]:.4g} s", pictured(name)])
    title = f"## {example.title} (`geometries/{example.scene}`)\n\n"
    return title + markdown_table(HEADER, rows) + "\n" + markdown_table(["", ""], pictures)


def main() -> int:
    """Write the blocks of the pages and their pictures."""
    RESULTS.mkdir(parents=True, exist_ok=True)
    for name, examples in PAGES.items():
        page = DOCS / "verification" / "reproductions" / name / "index.md"
        sections = [_orders()] if name == "gradients" else []
        sections += [section(example, page.parent) for example in examples]
        write_block(page, "examples", "\n".join([provenance(), *sections]))
        print(f"The page: {page}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
