"""Solve every scene of the thesis in both modes: python -m benchmarks.thesis

Writes the numbers and pictures of docs/verification/reproductions/thesis. Results stay in `build/thesis` and are used
again; delete that folder for a fresh run.
"""

from __future__ import annotations

import platform
import sys
import time
from datetime import date
from pathlib import Path

import numba
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from tqdm import tqdm

from benchmarks.claims import CASES, Case, measured
from benchmarks.pages import DOCS, markdown_table, pictured, write_block
from benchmarks.runs import case_model, first_steps, solved
from pdmesh import VERSION
from pdmesh.model.lattice_calibration import full_family
from pdmesh.model.material_constants import critical_stretch
from pdpost.figures import field_figure
from pdpost.figures.style import save, styled
from pdsolve.laws import limits
from pdsolve.laws.law import Sizes
from pdsolve.options import Options
from pdsolve.results import Results
from pdsolve.run.prepare import prepare

PAGE, RESULTS = DOCS / "verification" / "reproductions" / "thesis" / "index.md", Path("build/thesis")
MODES = ("thesis", "conservative")
WAVE_STEPS = (10, 30, 50, 70, 90, 100)
ROUNDS, TIMED = 6, 60  # of timing, the fastest counts; steps in each


def provenance() -> str:
    """When, and with what, a page was written."""
    versions = f"numpy {np.__version__}, numba {numba.__version__}, Python {platform.python_version()}"
    return f"Written on {date.today().isoformat()} by version {VERSION}; {versions}; {platform.machine()}.\n"


def _section(case: Case) -> tuple[str, list[str]]:
    values, pictures, missed = [], [], []
    for mode in MODES:
        with Results.open(solved(case, mode, RESULTS)) as results:
            values.append(measured(case, results))
            for step in case.pictures:
                name = f"{case.name}.{mode}.{step}.png"
                with styled({"savefig.dpi": 80}):
                    save(field_figure.field(results, "damage", step), PAGE.with_name(name))
                pictures.append((step, mode, name))
    rows = []
    for claim, thesis, conservative in zip(case.claims, *values, strict=True):
        verdict = "yes" if claim.accepts(thesis) else "**no**"
        if not claim.accepts(thesis):
            missed.append(f"{case.name}, {claim.what} {thesis:.4g}")
        rows.append([claim.what, claim.claimed, claim.accepted, f"{thesis:.4g}", verdict, f"{conservative:.4g}"])
    header = ["", "claimed", "accepted", "thesis mode", "accepted?", "conservative mode"]
    text = f"### {case.title}\n\n" + (markdown_table(header, rows) + "\n" if rows else "")
    shown = [[f"step {step}", *(pictured(name) for at, _, name in pictures if at == step)] for step in case.pictures]
    return text + markdown_table(["", "thesis mode", "conservative mode"], shown), missed


def _case(name: str) -> Case:
    return next(case for case in CASES if case.name == name)


def _tables() -> str:
    glass, soda = (case_model(_case(name)).materials[0] for name in ("duran50", "soda_lime"))
    steel = case_model(_case("kalthoff_winkler")).materials[0]
    rows4 = [
        [f"{name}, {delta * 1e3:g} mm", claimed, f"{critical_stretch(material, np.array([4 * delta]))[0]:.6f}"]
        for name, material, delta, claimed in (
            ("Duran 50", glass, 1e-3, "0.001170"),
            ("soda-lime", soda, 1e-3, "0.000905"),
            ("Duran 50", glass, 2e-3, "0.000827"),
            ("soda-lime", soda, 2e-3, "0.000640"),
        )
    ]
    rows6 = []
    for delta, claimed in ((1e-3, "0.00337, 0.00552"), (2e-3, "0.00238, 0.00390")):
        horizon = np.array([3 * delta])
        peak, limit = limits(steel, Sizes(critical_stretch(steel, horizon), horizon / 3, horizon, 3.0))
        rows6.append([f"{delta * 1e3:g} mm", claimed, f"{peak[0]:.5f}, {limit[0]:.5f}"])
    return "\n".join(
        [
            "## Tables\n",
            f"Table 1: a full family has {full_family(3.0)} bonds at m = 3 (claimed 28).\n",
            "Table 4, critical stretches:\n",
            markdown_table(["", "claimed", "here"], rows4),
            "Table 6, stretches at the peak and at the end of the bilinear law:\n",
            markdown_table(["spacing", "claimed", "here"], rows6),
            _table_5(),
        ]
    )


def _table_5() -> str:
    """Two scales against one, timed in turns."""
    models = [case_model(_case(name)) for name in ("duran50", "duran50_one_scale")]
    rows = []
    for kernel, name in (("listed", "time, bond by bond as in the thesis"), ("blocks", "time, by the fast kernel")):
        problems = [prepare(model, Options("thesis", kernel=kernel)) for model in models]
        if not rows:
            counts = [("nodes", "0.644", [len(model.grid) for model in models])]
            counts.append(("bonds", "", [problem.system.directed_bond_count for problem in problems]))
            rows = [[what, claimed, f"{two} / {one} = {two / one:.3f}"] for what, claimed, (two, one) in counts]
        best = [np.inf, np.inf]
        for turn in range(ROUNDS):
            for at, problem in enumerate(problems):
                began = time.perf_counter()
                problem.advance(1 + TIMED * turn, 1 + TIMED * (turn + 1))
                best[at] = min(best[at], time.perf_counter() - began)
        rows.append([name, "0.645", f"{best[0] / best[1]:.2f}"])
    return "Table 5, two scales against one:\n\n" + markdown_table(["", "claimed", "here"], rows)


def _waves() -> str:
    """Figures 36 and 37: the acceleration of the first steps, the wave reflected where spacings change."""
    columns = [("duran50", "thesis"), ("duran50", "conservative"), ("duran50_one_scale", "thesis")]
    rows = []
    for step in WAVE_STEPS:
        row = [f"step {step}"]
        for name, mode in columns:
            picture = f"acceleration.{name}.{mode}.{step}.png"
            path = first_steps(_case(name), mode, RESULTS, WAVE_STEPS)
            with Results.open(path) as results, styled({"savefig.dpi": 60}):
                save(field_figure.field(results, "acceleration", step, largest=1e6), PAGE.with_name(picture))
            row.append(pictured(picture))
        rows.append(row)
    header = ["", "two scales, thesis mode", "two scales, conservative mode", "one scale, thesis mode"]
    return markdown_table(header, rows)


def _histories() -> str:
    """Figures 34, 35, 68 and 69: displacements of two nodes that are mirror images of each other."""
    rows = []
    for name, node, image, mirrored in (
        ("duran50", (0.05, 0.0005), (0.05, -0.0005), "uy"),
        ("soda_lime", (0.05, 0.0005), (0.05, -0.0005), "uy"),
        ("v_notch", (0.0395, 0.03), (0.0405, 0.03), "ux"),
    ):
        for mode in MODES:
            with Results.open(solved(_case(name), mode, RESULTS)) as results:
                times, histories = _history(results, (node, image))
            picture = f"history.{name}.{mode}.png"
            _plot_history(times, histories, PAGE.with_name(picture))
            along = "ux" if mirrored == "uy" else "uy"
            largest = max(np.abs(history[key]).max() for history in histories for key in ("ux", "uy"))
            off = np.abs(histories[0][mirrored] + histories[1][mirrored]).max()
            off = max(off, np.abs(histories[0][along] - histories[1][along]).max())
            rows.append([f"{_case(name).title}, {mode} mode", f"{off / largest:.1e}", pictured(picture)])
    return markdown_table(["", "asymmetry over the largest displacement", ""], rows)


def _history(
    results: Results, places: tuple[tuple[float, float], ...]
) -> tuple[NDArray[np.float64], list[dict[str, NDArray[np.float64]]]]:
    position = results.nodes().position
    rows = [int(np.hypot(*(position - place).T).argmin()) for place in places]
    steps, times = results.frames()
    ux, uy = (np.array([results.field(key, int(step)) for step in steps]) for key in ("ux", "uy"))
    return times, [{"ux": ux[:, row], "uy": uy[:, row]} for row in rows]


def _plot_history(times: NDArray[np.float64], histories: list[dict[str, NDArray[np.float64]]], path: Path) -> None:
    with styled({"savefig.dpi": 80}):
        figure = Figure(figsize=(5, 2.6), layout="constrained")
        axes = figure.add_subplot(xlabel="time, µs", ylabel="displacement, µm")
        for number, (history, style) in enumerate(zip(histories, ("-", "--"), strict=True)):
            for key, colour in (("ux", "tab:blue"), ("uy", "tab:orange")):
                axes.plot(times * 1e6, history[key] * 1e6, style, color=colour, label=f"{key}, node {number + 1}")
        axes.legend(fontsize=7)
        save(figure, path)


def main() -> int:
    """Solve everything, draw the pictures, write the blocks of the page."""
    RESULTS.mkdir(parents=True, exist_ok=True)
    sections, outside = [], []
    for case in tqdm(CASES, unit=" scene", disable=not sys.stderr.isatty()):
        section, of_case = _section(case)
        sections.append(section)
        outside += of_case
    verdict = "All numbers of the thesis mode are within the accepted ranges.\n"
    if outside:
        verdict = f"Outside the accepted range in the thesis mode: {'; '.join(outside)}.\n"
    write_block(PAGE, "versions and tables", f"{provenance()}\n{_tables()}")
    write_block(PAGE, "scenes", "\n".join([verdict, *sections]))
    write_block(PAGE, "waves", _waves())
    write_block(PAGE, "histories", _histories())
    print(f"The page: {PAGE}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
