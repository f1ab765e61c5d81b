"""Growth of cracks by fatigue, Paris's line through it, and Wöhler's line of smooth bodies."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from pdpost.commands import shared
from pdpost.commands.shared import add_cracked, add_every, chosen_stride, counted, picture_path

if TYPE_CHECKING:
    from pdpost.commands.shared import Commands
    from pdsolve.measures.fatigue import FatigueLife

HEADER = (
    *("run", "tip", "cycles", "growth, m", "K, Pa m^0.5", "dK, Pa m^0.5", "da/dN to the next, m", "settled"),
    "range of stretch",
    "opened area, m^2",
)


def add(commands: Commands) -> None:
    """Put `fatigue` on the command line."""
    about = "draw the growth of cracks over cycles, the growth a cycle over the range of K, and lives of smooth bodies"
    parser = shared.add_command(commands, "fatigue", about)
    add_every(parser)
    add_cracked(parser)
    parser.add_argument("--until", type=float, default=float("inf"), metavar="N", help="leave out cycles after N")
    help_text = "other runs, in the same picture and the same numbers"
    parser.add_argument("--beside", metavar="RESULTS", nargs="+", default=[], help=help_text)
    commands.choices["fatigue"].set_defaults(run=_fatigue)


def _fatigue(args: argparse.Namespace) -> int:
    from pathlib import Path

    from pdsolve.measures.embedded_model import expect_mechanics
    from pdsolve.measures.fatigue import measure_fatigue_life
    from pdsolve.measures.frame_steps import chosen
    from pdsolve.measures.json_keys import fields_by_json_key
    from pdsolve.results import Results

    path, runs = picture_path(args, ".fatigue.png"), []
    with shared.styled(path, dict(args.assignments)):
        for name in (args.results, *args.beside):
            with Results.open(Path(name)) as results:
                expect_mechanics(results)
                steps = chosen(results, chosen_stride(results, args))
                runs.append(measure_fatigue_life(results, steps, counted(args, "summing"), args.cracked, args.until))
        if path is not None:
            from pdpost.figures import style
            from pdpost.figures.fatigue_figure import fatigue as figure

            style.save(figure(runs), path)
    run_results = [
        {
            "name": run.name,
            "cycles": run.total_cycles,
            "cycles_error": run.total_cycles_error,
            "first_break": run.first_break_cycles,
            "first_range": run.first_break_strain_range,
            "line": None if run.paris_line is None else fields_by_json_key(run.paris_line),
            "tips": [fields_by_json_key(tip) for tip in run.tip_growths],
            "area": None if run.area_growth is None else run.area_growth._asdict(),
            "cycles_until_last_tenth": run.cycles_until_last_tenth(),
            "ended": run.end_reason,
        }
        for run in runs
    ]
    result = {**run_results[0], "beside": run_results[1:]}
    lines = [line for run in runs for line in ([f"{run.name}:"] if args.beside else []) + _lines(run)]
    rows = (row for run in runs for row in _rows(run))
    return shared.deliver(args, result, lines, HEADER, rows, path)


def _lines(run: FatigueLife) -> list[str]:
    import numpy as np

    wrong = run.total_cycles_error / run.total_cycles if run.total_cycles_error and run.total_cycles else None
    off = "" if wrong is None else f", with an error from jumps and from K that is estimated at {wrong:.1%}"
    until = run.cycles_until_last_tenth()
    grown = "" if until is None else f"; nine tenths of the growth took {until:.6g} cycles"
    lines = [f"{run.total_cycles:.6g} cycles in all{off}{grown}"]
    lines += [f"the run ended: {run.end_reason}"] if run.end_reason else []
    if run.first_break_cycles is not None:
        lines.append(
            f"first bonds broke after {run.first_break_cycles:.6g} cycles,"
            f" stretched by a range of {run.first_break_strain_range:.4g}"
        )
    lines += [
        f"{tip.name}: grown by {tip.grown_length[-1] * 1e3:.4g} mm until {tip.cycles[-1]:.4g} cycles"
        for tip in run.tip_growths
    ]
    if run.area_growth is not None:
        cycles, area = run.area_growth
        opened = cycles[area > 0]
        begin = f", the first before {opened[0]:.6g} cycles" if len(opened) else ""
        lines.append(f"area that opened: {area[-1] * 1e6:.4g} mm^2{begin}")
    if run.tip_growths and run.paris_line is not None:
        at = float(run.paris_line.growth_per_cycle(np.array(10e6)))
        lines.append(
            f"da/dN = C dK^m: m = {run.paris_line.m:.4g}, C = {run.paris_line.C:.4g} m a cycle / (Pa m^0.5)^m, which is"
            f" {at:.4g} m a cycle at 10 MPa m^0.5; from {run.paris_line.point_count} points, which scatter by"
            f" {10**run.paris_line.scatter - 1:.1%}"
        )
    elif run.K_refusal:
        lines.append(f"no K, so that lengths stand alone: {run.K_refusal}")
    elif run.tip_growths:
        lines.append("the crack grows in too few frames for a line; use a longer crack path or a finer grid")
    return lines


def _rows(run: FatigueLife) -> Any:
    none = float("nan")
    if run.first_break_cycles is not None:
        yield (
            run.name,
            "first break",
            run.first_break_cycles,
            none,
            none,
            none,
            none,
            None,
            run.first_break_strain_range,
            none,
        )
    if run.area_growth is not None:
        for cycles, area in zip(*run.area_growth, strict=True):
            yield (run.name, "body", cycles, none, none, none, none, None, none, area)
    for tip in run.tip_growths:
        rate, past_start = [*tip.growth_per_cycle.tolist(), none], [*tip.is_past_slow_start.tolist(), None]
        for row in zip(tip.cycles, tip.grown_length, tip.K, tip.dK, rate, past_start, strict=True):
            yield (run.name, tip.name, *row, none, none)
