"""The curves of the tutorials: what stands on their pages is typed, and its tables are drawn over what is known.

`python -m benchmarks.tutorials` writes docs/tutorials/NAME.png; names of tutorials draw those alone. Each page's bash
blocks are run in a folder of their own. Curves that a paper or a formula gives are read from
docs/verification/reproductions/data, where each file names its source; the numbers in a picture's title are measured.
"""

from __future__ import annotations

import argparse
import csv
import json
import re
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

ROOT = Path(__file__).parent.parent
PAGES = ROOT / "docs" / "tutorials"
DATA = ROOT / "docs" / "verification" / "reproductions" / "data"
OURS, REFERENCE = "#0072B2", "#D55E00"
RAYLEIGH = 0.5755  # of sqrt(E / rho), at a Poisson's ratio of 1/3

Columns = dict[str, NDArray[np.float64]]


class Tutorial(NamedTuple):
    """What a page's tables are drawn over."""

    draw: Callable[[Axes, Path], str]  # on these axes, from the folder with the tables; returns the title
    xlabel: str
    ylabel: str


def table(path: Path, **where: str) -> Columns:
    """The columns of a table that hold numbers, of the rows that have these words in their columns."""
    with path.open(newline="", encoding="utf-8") as file:
        lines = (line for line in file if not line.startswith("#"))
        rows = [row for row in csv.DictReader(lines) if all(row[name] == word for name, word in where.items())]
    columns: Columns = {}
    for name in rows[0]:
        try:
            columns[name] = np.array([float(row[name] or "nan") for row in rows])
        except ValueError:
            continue
    return columns


def wave(axes: Axes, folder: Path) -> str:
    """The end of a bar of length, density and modulus 1, over d'Alembert's."""
    computed, reference = table(folder / "end.csv"), table(DATA / "alembert_bar.csv")
    time, u = computed["time, s"], 1e3 * computed["displacement, m"]
    corner, exact = reference.values()
    axes.plot(corner, exact, color=REFERENCE, label="d'Alembert")
    axes.plot(time, u, ".", color=OURS, label="end of the bar")
    off = np.abs(u - np.interp(time % corner[-1], corner, exact)).max() / exact.max()
    return f"off by {off:.1%} of the largest displacement at most"


def hole(axes: Axes, folder: Path) -> str:
    """The stress beside a hole, over Kirsch's."""
    computed, reference = table(folder / "line.csv"), table(DATA / "kirsch_hole.csv")
    r, stress = computed["x, m"] / 5e-3, computed["stress_yy, Pa"] / 1e6
    exact = np.interp(r, *reference.values())
    axes.plot(*reference.values(), color=REFERENCE, label="Kirsch")
    axes.plot(r, stress, ".", color=OURS, label="stress between the nodes")
    away = r > 1.3
    off, at = np.abs(stress / exact - 1)[away].max(), stress[0] / exact[0]
    return f"{at:.2f} of the largest stress at the hole; off by {off:.1%} at most a horizon away from it"


def steel(axes: Axes, folder: Path) -> str:
    """A crack of the struck plate beside lines of the tests' angle and the path of another program."""
    computed, angles = table(folder / "steel.csv", branch="0"), table(DATA / "kalthoff_winkler_angle.csv")
    x, y = 1e3 * computed["x, m"], np.abs(1e3 * computed["y, m"] - 100)
    far = np.array([0.0, 70.0])
    for angle, label, dashes in zip(angles["angle, degrees"], ("tests", "thesis"), ("-", ":"), strict=True):
        line = (50 + far * np.cos(np.radians(angle)), y[0] + far * np.sin(np.radians(angle)))
        axes.plot(*line, dashes, color=REFERENCE, label=f"{label}, {angle:.0f} degrees", zorder=3)
    axes.plot(*table(DATA / "kalthoff_winkler_path.csv").values(), "s", color=REFERENCE, ms=4, label="another program")
    axes.plot(x, y, ".", color=OURS, label="one of two cracks")
    axes.set_aspect("equal")
    axes.set_xlim(45, 145)  # room for the legend
    way = np.hypot(x - x[0], y - y[0])
    angle = np.degrees(np.arctan2(y - y[0], x - x[0]))[int(np.abs(way - 50).argmin())]
    return f"{angle:.1f} degrees over the first 50 mm"


def glass(axes: Axes, folder: Path) -> str:
    """The speed of a crack in glass below the largest one measured, and the angle of its arms."""
    reference = {
        name: table(DATA / "branching_in_glass.csv", quantity=name) for name in ("speed", "fork", "angle of an arm")
    }
    for branch, label in (("2", "before the fork"), ("0", "one of two arms")):
        computed = table(folder / "glass.csv", branch=branch)
        time = 1e6 * computed["time, s"]
        axes.plot(time, computed["speed, m/s"], ".", label=label, color=OURS if branch == "2" else "#56B4E9")
    axes.axhline(float(reference["speed"]["most"][0]), color=REFERENCE, label="largest speed measured")
    axes.axhline(RAYLEIGH * np.sqrt(72e9 / 2440), color=REFERENCE, linestyle=":", label="Rayleigh waves of bonds")
    axes.set_ylim(0, 4200)
    x, y = 1e3 * computed["x, m"], np.abs(1e3 * computed["y, m"])
    plate = axes.inset_axes((0.6, 0.73, 0.39, 0.26), xlabel="", xlim=(60, 100), ylim=(0, 14), xticks=(), yticks=())
    plate.plot(x, y, color="#56B4E9")
    for angle in (float(reference["angle of an arm"][end][0]) for end in ("least", "most")):
        plate.plot(x, (x - x[0]) * np.tan(np.radians(angle)), ":", color=REFERENCE)
    plate.axvline(float(reference["fork"]["most"][0]), color=REFERENCE, linewidth=0.6)
    angle = np.degrees(np.arctan(np.polyfit(x, y, 1)[0]))
    return f"forks at {x[0]:.1f} mm, each arm at {angle:.0f} degrees (inset: 20 and 25 dotted, 68 mm)"


def specimen(axes: Axes, folder: Path) -> str:
    """The force at a pin of a specimen 1 m thick, over that at which a crack grows by the handbook."""
    computed, reference = table(folder / "pin.csv"), table(DATA / "compact_tension.csv")
    force, opening = np.abs(computed["force y, N/m"]) / 1e3, 2e3 * computed["displacement y, m"]
    axes.plot(opening, force, ".-", color=OURS, label="pins")
    W, E, nu, G0 = 0.05, 3e9, 0.25, 350.0
    _, shape, compliance = reference.values()
    stiffness = E / (1 - nu**2)
    grows = np.sqrt(G0 * stiffness * W) / shape
    way = np.concatenate([[0.0], 1e3 * grows * compliance / stiffness])
    axes.plot(way, np.concatenate([[0.0], grows / 1e3]), color=REFERENCE, label="ASTM E399, growth at $G_0$")
    axes.set_xlim(0, 1.05 * opening.max())
    return f"the largest force is {force.max() / grows[0] * 1e3:.2f} of the handbook's"


def holes(axes: Axes, folder: Path) -> str:
    """The path of a fatigue crack on places of a test."""
    computed, reference = table(folder / "path.csv"), table(DATA / "wagner_17_157.csv")
    x, y = 1e3 * computed["x, m"], 1e3 * computed["y, m"]
    tested = np.column_stack(list(reference.values()))
    axes.plot(*tested.T, "o", color=REFERENCE, label="test")
    axes.plot(x, y, ".-", color=OURS, label="particles by K")
    turn = np.radians(np.arange(361))
    for at, up, radius in ((18.0, 10.0, 4.0), (30.0, 0.0, 2.0)):
        axes.fill(at + radius * np.cos(turn), up + radius * np.sin(turn), color="0.9")
    axes.set_aspect("equal")
    fine = np.linspace(0, len(x) - 1, 50 * len(x))
    path = np.column_stack([np.interp(fine, np.arange(len(x)), values) for values in (x, y)])
    off = np.array([np.hypot(*(path - place).T).min() for place in tested])
    return f"off by {off.max():.1f} mm at most, by {off[:-2].max():.1f} mm until 2 mm from the hole"


def beam(axes: Axes, folder: Path) -> str:
    """The load of a notched beam 50 mm thick, over points of Petersson's curve."""
    computed, reference = table(folder / "beam.csv"), table(DATA / "petersson_beam.csv")
    load, down = -computed["force y, N/m"] * 0.05 / 1e3, -1e3 * computed["displacement y, m"]
    at, tested = reference["deflection, mm"], reference["load, N"] / 1e3
    axes.errorbar(at, tested, yerr=0.05 * tested, fmt="o", color=REFERENCE, capsize=3, label="Petersson, to 5 %")
    axes.plot(down, load, ".-", color=OURS, label="cohesive bonds")
    off = np.interp(at, down, load) / tested - 1
    return f"{load.max():.2f} kN at most; {off[0]:+.1%} and {off[1]:+.1%} of the two loads"


def panel(axes: Axes, folder: Path) -> str:
    """The load of a panel 0.1 m thick, over that of a test."""
    computed, reference = table(folder / "panel.csv"), table(DATA / "winkler_l_panel.csv")
    load, up = computed["force y, N/m"] * 0.1 / 1e3, 1e3 * computed["displacement y, m"]
    tested = reference["load, N"] / 1e3
    axes.plot(reference["lift, mm"], tested, "o-", color=REFERENCE, ms=3, label="test, series A")
    axes.plot(up, load, ".-", color=OURS, label="cohesive bonds")
    spent = np.trapezoid(load, up) / np.trapezoid(tested, reference["lift, mm"])
    return f"{load.max():.2f} kN at most, the test {tested.max():.2f}; work {spent:.2f} of the test's"


def rubber(axes: Axes, folder: Path) -> str:
    """The force on a stretched block, over that of finite elements."""
    computed, reference = table(folder / "rubber.csv"), table(DATA / "rubber_block.csv")
    force, stretch = computed["force x, N/m"], computed["displacement x, m"]
    axes.plot(*reference.values(), "o", color=REFERENCE, label="finite elements")
    axes.plot(stretch, force, ".-", color=OURS, label="correspondence")
    off = np.interp(reference["stretch, m"], stretch, force) / reference["force over E, per metre"]
    return f"{off[-1]:.3f} of the finite elements' force at the end"


def quench(axes: Axes, folder: Path) -> str:
    """Temperature and stress across a quenched slab, over their series."""
    stress, heat = table(folder / "stress.csv"), table(folder / "temperature.csv")
    depth, temperature, exact = table(DATA / "quenched_slab.csv").values()
    x, scale = stress["x, m"] / 5e-3, 70e9 * 9e-6 * 100
    scaled, warm = stress["stress_yy, Pa"] / scale, (heat["temperature, K"] - 293) / 100
    for series, ours, dots, label in ((temperature, warm, ".", "temperature"), (exact, scaled, "+", "stress")):
        axes.plot(depth, series, color=REFERENCE, label="series" if dots == "." else None)
        axes.plot(x, ours, dots, color=OURS, label=label)
    off = np.abs(warm - np.interp(x, depth, temperature)).max()
    below = np.abs(scaled - np.interp(x, depth, exact))[x > 1 / 6].max()
    at = scaled[0] / exact[0]
    return f"temperature off by {off:.3f}, stress by {below:.3f}; {at:.3f} of the series' stress at the edge"


def screw(axes: Axes, folder: Path) -> str:
    """The share of a screw that is dissolved, over finite volumes."""
    computed, reference = table(folder / "masses.csv"), table(DATA / "dissolving_screw.csv")
    time, share = computed["time, s"] / 1000, 1 - computed["share left"]
    at, exact = reference.values()
    axes.plot(at, exact, "o", color=REFERENCE, label="finite volumes")
    axes.plot(time, share, ".-", color=OURS, label="nodes and stencils")
    off = np.interp(at, time, share) - exact
    return f"off by {np.abs(off).max():.3f} of the screw at most, by {np.abs(off[at >= 1]).max():.3f} from 1000 s on"


def ring(axes: Axes, folder: Path) -> str:
    """The masses of a ring's fragments, beside Grady's mean."""
    summary = json.loads((folder / "ring.json").read_text(encoding="utf-8"))
    mass = np.sort([each["mass"] for each in summary["fragments"]["pieces"]])[::-1] * 1e3
    (length,) = table(DATA / "fragments_of_a_ring.csv").values()
    whole, rate = 2235 * 2 * np.pi * 0.02 * 0.002**2 * 1e3, 60 / 0.02
    grady = whole * float(length[0]) * (204 / (2235 * rate**2)) ** (1 / 3) / (2 * np.pi * 0.02)
    axes.bar(np.arange(len(mass)) + 1, mass, color=OURS, label="fragments, by mass")
    axes.axhline(grady, color=REFERENCE, label="Grady's mean")
    return f"{len(mass)} fragments, Grady {whole / grady:.0f}"


TUTORIALS = {
    "wave_in_a_bar": Tutorial(wave, "time over L / c", "displacement over sigma L / E"),
    "plate_with_a_hole": Tutorial(hole, "x over the hole's radius", "stress yy, MPa"),
    "kalthoff_and_winkler": Tutorial(steel, "x, mm", "y, mm"),
    "branching_in_glass": Tutorial(glass, "time, µs", "speed, m/s"),
    "compact_tension": Tutorial(specimen, "opening, mm", "force, kN per metre"),
    "cracks_past_holes": Tutorial(holes, "x, mm", "y, mm"),
    "bending_of_concrete": Tutorial(beam, "deflection, mm", "load, kN"),
    "l_shaped_panel": Tutorial(panel, "lift, mm", "load, kN"),
    "block_of_rubber": Tutorial(rubber, "stretch, m", "force over E, per metre"),
    "quenched_slab": Tutorial(quench, "depth over half of the thickness", "T over dT, stress over E alpha dT"),
    "corrosion": Tutorial(screw, "time, 1000 s", "share dissolved"),
    "fragmenting_ring": Tutorial(ring, "fragment", "mass, g"),
}


def typed(page: Path) -> list[str]:
    """The commands of a page's bash blocks, without comments."""
    text = "\n".join(re.findall(r"```bash\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL))
    return [re.sub(r"\s+# .*", "", line) for line in text.replace("\\\n", " ").splitlines() if line.strip()]


def make_picture(name: str) -> None:
    """Run the commands of a tutorial and draw its picture. Raises CalledProcessError."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "geometries").symlink_to(ROOT / "geometries")
        for drawing in PAGES.glob("*.py"):
            (Path(folder) / drawing.name).write_bytes(drawing.read_bytes())
        for line in typed(PAGES / f"{name}.md"):
            subprocess.run(["bash", "-e", "-c", f"{sys.executable} -m {line}"], cwd=folder, check=True)
        figure = Figure(figsize=(6.0, 3.6), layout="constrained")
        axes = figure.add_subplot(xlabel=TUTORIALS[name].xlabel, ylabel=TUTORIALS[name].ylabel)
        axes.set_title(TUTORIALS[name].draw(axes, Path(folder)), fontsize=9)
        axes.legend(frameon=False, fontsize=8)
        figure.savefig(PAGES / f"{name}.png", dpi=120, metadata={"Software": None})


def main() -> None:
    """Make the pictures that are asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help=f"some of {', '.join(TUTORIALS)} (default: all)")
    asked = parser.parse_args().names
    if unknown := sorted(set(asked) - set(TUTORIALS)):
        parser.error(f"found {', '.join(unknown)}, expected some of {', '.join(TUTORIALS)}")
    for name in asked or TUTORIALS:
        print(name, flush=True)
        make_picture(name)


if __name__ == "__main__":
    main()
