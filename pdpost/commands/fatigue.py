"""Growth of cracks by fatigue, and Paris's line through it."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from pdpost.commands import number_options
from pdpost.commands.shared import add_every, counted

if TYPE_CHECKING:
    from pdpost.commands.shared import Commands
    from pdpost.measures.fatigue import Growth, Line


def add(commands: Commands) -> None:
    """Put `fatigue` on the command line."""
    about = "draw the growth of cracks over cycles, and the growth a cycle over the range of K"
    parser = number_options.add_command(commands, "fatigue", about)
    add_every(parser)
    parser.add_argument("--beside", metavar="RESULTS", help="a second run in the same picture")
    commands.choices["fatigue"].set_defaults(run=_fatigue)


def _fatigue(args: argparse.Namespace) -> int:
    from pdpost.measures import fatigue

    path = number_options.picture_path(args, ".fatigue.png")
    with number_options.styled(path, dict(args.assignments)):
        life, found = _measured(args, args.results)
        line = fatigue.paris(found)
        other = None if args.beside is None else _measured(args, args.beside)[1]
        if path is not None:
            from pathlib import Path

            from pdpost.figures import style
            from pdpost.figures.fatigue_figure import Run
            from pdpost.figures.fatigue_figure import fatigue as figure

            runs = [Run("" if other is None else Path(args.results).stem, found, line)]
            if other is not None:
                runs.append(Run(Path(args.beside).stem, other, fatigue.paris(other)))
            style.save(figure(runs), path)
    lines = [f"{life:.6g} cycles in all"]
    lines += [f"{one.name}: grown by {one.length[-1] * 1e3:.4g} mm until {one.cycles[-1]:.4g} cycles" for one in found]
    lines += ["found too few frames of a growing crack for a line" if line is None else _words(line)]
    result = {
        "cycles": life,
        "line": None if line is None else line._asdict(),
        "tips": [one._asdict() for one in found],
    }
    header = ("tip", "cycles", "growth, m", "K, Pa m^0.5", "dK, Pa m^0.5", "da/dN to the next, m", "settled")
    return number_options.deliver(args, result, lines, header, (row for one in found for row in _rows(one)), path)


def _measured(args: argparse.Namespace, name: str) -> tuple[float, list[Growth]]:
    """The cycles of a run in all, and the growth of its tips. Raises ResultsError."""
    from pathlib import Path

    from pdpost.measures import fatigue
    from pdpost.reading.embedded_model import expect_mechanics
    from pdpost.reading.frame_steps import chosen
    from pdsolve.results import Results

    with Results.open(Path(name)) as results:
        expect_mechanics(results)
        life = float(fatigue.cycles(results)[-1])
        return life, fatigue.growth(results, chosen(results, args.every), counted(args, "summing"))


def _words(line: Line) -> str:
    import numpy as np

    at = float(line.at(np.array(10e6)))
    return (
        f"da/dN = {at:.4g} m a cycle at 10 MPa m^0.5, m = {line.m:.4g}, from {line.points} points, which scatter by"
        f" {10**line.scatter - 1:.1%}"
    )


def _rows(one: Growth) -> Any:
    rate, settled = [*one.rate.tolist(), float("nan")], [*one.settled.tolist(), None]
    for row in zip(one.cycles, one.length, one.K, one.dK, rate, settled, strict=True):
        yield (one.name, *row)
