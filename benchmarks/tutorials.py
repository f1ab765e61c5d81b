"""The curves of the tutorials: what stands on their pages is typed, and its tables are drawn over what is known.

`python -m benchmarks.tutorials` writes docs/tutorials/NAME.png; names of tutorials draw those alone. Each page's bash
blocks are run in a folder of their own. Curves that a paper or a formula gives stand here with their source; the
numbers in a picture's title are measured.
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
OURS, KNOWN = "#0072B2", "#D55E00"
RAYLEIGH = 0.5755  # of sqrt(E / rho), at a Poisson's ratio of 1/3

PAST_HOLES = (  # mm
    *((8.20, 1.56), (9.71, 1.64), (11.16, 1.75), (12.63, 1.90), (14.08, 2.08), (15.58, 2.35), (16.53, 2.66)),
    *((17.54, 3.08), (18.32, 3.50), (19.06, 4.05), (19.67, 4.55), (20.06, 5.11), (20.22, 5.62), (20.12, 6.46)),
)

Columns = dict[str, NDArray[np.float64]]


class Tutorial(NamedTuple):
    """What a page's tables are drawn over."""

    draw: Callable[[Axes, Path], str]  # on these axes, from the folder with the tables; returns the title
    xlabel: str
    ylabel: str


def table(path: Path, **where: str) -> Columns:
    """The columns of a table that hold numbers, of the rows that have these words in their columns."""
    with path.open(newline="", encoding="utf-8") as file:
        rows = [row for row in csv.DictReader(file) if all(row[name] == word for name, word in where.items())]
    found: Columns = {}
    for name in rows[0]:
        try:
            found[name] = np.array([float(row[name] or "nan") for row in rows])
        except ValueError:
            continue
    return found


def wave(axes: Axes, folder: Path) -> str:
    """d'Alembert: the end of a bar of length, density and modulus 1 moves up and down in a triangle."""
    found = table(folder / "end.csv")
    time, u = found["time, s"], 1e3 * found["displacement, m"]
    exact = 2 * (1 - np.abs(time % 4 / 2 - 1))
    axes.plot(time, exact, color=KNOWN, label="d'Alembert")
    axes.plot(time, u, ".", color=OURS, label="end of the bar")
    return f"off by {np.abs(u - exact).max() / 2:.1%} of the largest displacement at most"


def hole(axes: Axes, folder: Path) -> str:
    """G. Kirsch, Z. VDI 42 (1898) 797-807: a plate without end, pulled along y, on the x axis."""
    found = table(folder / "line.csv")
    r, stress = found["x, m"] / 5e-3, found["stress_yy, Pa"] / 1e6
    exact = 1 + 1 / (2 * r**2) + 3 / (2 * r**4)
    axes.plot(r, exact, color=KNOWN, label="Kirsch")
    axes.plot(r, stress, ".", color=OURS, label="stress between the nodes")
    away = r > 1.3
    off, at = np.abs(stress / exact - 1)[away].max(), stress[0] / exact[0]
    return f"{at:.2f} of the largest stress at the hole; off by {off:.1%} at most a horizon away from it"


def steel(axes: Axes, folder: Path) -> str:
    """J. F. Kalthoff, S. Winkler (1988): cracks leave their notches at some 70 degrees."""
    found = table(folder / "steel.csv", branch="0")
    x, y = 1e3 * found["x, m"], 1e3 * found["y, m"]
    far = np.array([0.0, 70.0])
    axes.plot(50 + far * np.cos(np.radians(70)), y[0] + far * np.sin(np.radians(70)), color=KNOWN, label="70 degrees")
    axes.plot(x, y, ".", color=OURS, label="upper crack")
    axes.set_aspect("equal")
    way = np.hypot(x - x[0], y - y[0])
    angle = np.degrees(np.arctan2(y - y[0], x - x[0]))[int(np.abs(way - 50).argmin())]
    return f"{angle:.1f} degrees over the first 50 mm"


def glass(axes: Axes, folder: Path) -> str:
    """F. P. Bowden et al., Nature 216 (1967) 38-42: cracks in soda-lime glass run at 1580 m/s at most."""
    speed = np.sqrt(72e9 / 2440)
    for branch, label in (("2", "before the fork"), ("0", "one of two arms")):
        found = table(folder / "glass.csv", branch=branch)
        time = 1e6 * found["time, s"]
        axes.plot(time, found["speed, m/s"], ".", label=label, color=OURS if branch == "2" else "#56B4E9")
    axes.axhline(1580, color=KNOWN, label="largest measured")
    axes.axhline(RAYLEIGH * speed, color=KNOWN, linestyle=":", label="Rayleigh waves of bonds")
    axes.set_ylim(0, None)
    fork = table(folder / "glass.csv", branch="0")["x, m"][0]
    return f"the crack forks at {1e3 * fork:.1f} mm"


def specimen(axes: Axes, folder: Path) -> str:
    """ASTM E399: the force at which a crack of length a has the material's K, on a specimen 1 m thick."""
    found = table(folder / "pin.csv")
    force, opening = np.abs(found["force y, N/m"]) / 1e3, 2e3 * found["displacement y, m"]
    axes.plot(opening, force, ".-", color=OURS, label="pins")
    W, a, E, nu, G0 = 0.05, 0.025, 3e9, 0.25, 350.0
    share = a / W
    f = (2 + share) / (1 - share) ** 1.5 * (0.886 + 4.64 * share - 13.32 * share**2 + 14.72 * share**3 - 5.6 * share**4)
    critical = np.sqrt(G0 * E / (1 - nu**2)) * np.sqrt(W) / f / 1e3
    axes.axhline(critical, color=KNOWN, label="E399, at which the slit grows")
    return f"the largest force is {force.max() / critical:.2f} of the handbook's"


def holes(axes: Axes, folder: Path) -> str:
    """D. Wagner, thesis, San Antonio (2018), figure 5.10, specimen 17-157, as M. Castillón digitised it."""
    found = table(folder / "path.csv")
    x, y = 1e3 * found["x, m"], 1e3 * found["y, m"]
    tested = np.array(PAST_HOLES)
    axes.plot(*tested.T, "o", color=KNOWN, label="test")
    axes.plot(x, y, ".-", color=OURS, label="particles by K")
    turn = np.radians(np.arange(361))
    for at, up, radius in ((18.0, 10.0, 4.0), (30.0, 0.0, 2.0)):
        axes.fill(at + radius * np.cos(turn), up + radius * np.sin(turn), color="0.9")
    axes.set_aspect("equal")
    fine = np.linspace(0, len(x) - 1, 50 * len(x))
    path = np.column_stack([np.interp(fine, np.arange(len(x)), one) for one in (x, y)])
    off = np.array([np.hypot(*(path - place).T).min() for place in tested])
    return f"off by {off.max():.1f} mm at most, by {off[:-2].max():.1f} mm until 2 mm from the hole"


def beam(axes: Axes, folder: Path) -> str:
    """P.-E. Petersson, TVBM-1006 (1981): independent programs have a largest load of 0.75 to 0.85 kN."""
    found = table(folder / "beam.csv")
    load, down = -found["force y, N/m"] * 0.05 / 1e3, -1e3 * found["displacement y, m"]
    axes.axhspan(0.75, 0.85, color=KNOWN, alpha=0.3, label="largest load of other programs")
    axes.plot(down, load, ".-", color=OURS, label="cohesive bonds")
    return f"{load.max():.2f} kN at most, at {down[load.argmax()]:.2f} mm"


def panel(axes: Axes, folder: Path) -> str:
    """B. Winkler, thesis, Innsbruck (2001): tests carry 7 to 7.5 kN."""
    found = table(folder / "panel.csv")
    load, up = found["force y, N/m"] * 0.1 / 1e3, 1e3 * found["displacement y, m"]
    axes.axhspan(7.0, 7.5, color=KNOWN, alpha=0.3, label="largest load of tests")
    axes.plot(up, load, ".-", color=OURS, label="cohesive bonds")
    return f"{load.max():.2f} kN at most, at {up[load.argmax()]:.2f} mm"


def rubber(axes: Axes, folder: Path) -> str:
    """Finite elements of the same block (see geometries/rubber_block.py): 0.42257 E at half its length."""
    found = table(folder / "rubber.csv")
    force, stretch = found["force x, N/m"], found["displacement x, m"]
    axes.plot(stretch, force, ".-", color=OURS, label="correspondence")
    axes.plot(0.5, 0.42257, "*", markersize=12, color=KNOWN, label="finite elements")
    return f"{force[-1] / 0.42257:.3f} of the finite elements' force"


def disc(axes: Axes, folder: Path) -> str:
    """The front of a disc of radius 1 in a liquid of radius 3, by a transformed radial grid of 400 cells."""
    found = table(folder / "masses.csv")
    share = 1 - found["share left"]
    time = found["time, s"] / 1000
    front = {0.5: 0.3993, 1.0: 0.5799, 1.5: 0.7186, 2.0: 0.8320, 2.5: 0.9235}
    axes.plot(time, share, color=OURS, label="nodes")
    axes.plot(*zip(*front.items(), strict=True), "o", color=KNOWN, label="radial front")
    off = max(abs(float(np.interp(at, time, share)) - value) for at, value in front.items() if at <= time[-1])
    return f"off by {off:.3f} of the disc at most"


def ring(axes: Axes, folder: Path) -> str:
    """D. E. Grady, J. Appl. Phys. 53 (1982) 322-325: fragments are (24 G / (rho rate^2))^(1/3) long."""
    found = json.loads((folder / "ring.json").read_text(encoding="utf-8"))
    mass = np.sort([each["mass"] for each in found["fragments"]["pieces"]])[::-1] * 1e3
    whole, rate = 2235 * 2 * np.pi * 0.02 * 0.002**2 * 1e3, 60 / 0.02
    grady = whole * (24 * 204 / (2235 * rate**2)) ** (1 / 3) / (2 * np.pi * 0.02)
    axes.bar(np.arange(len(mass)) + 1, mass, color=OURS, label="fragments, by mass")
    axes.axhline(grady, color=KNOWN, label="Grady's mean")
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
    "corrosion": Tutorial(disc, "time, 1000 s", "share dissolved"),
    "body_in_space": Tutorial(ring, "fragment", "mass, g"),
}


def typed(page: Path) -> list[str]:
    """The commands of a page's bash blocks, without comments."""
    text = "\n".join(re.findall(r"```bash\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL))
    return [re.sub(r"\s+# .*", "", line) for line in text.replace("\\\n", " ").splitlines() if line.strip()]


def made(name: str) -> None:
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
        made(name)


if __name__ == "__main__":
    main()
