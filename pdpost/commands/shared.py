"""Options shared by several commands: results, frame, scale, colours, numbers.

Commands that compute numbers have --json and --csv, and draw a picture only where it is asked for with these.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pdmesh import commandline
from pdmesh.plain_text import for_csv, print_text

if TYPE_CHECKING:
    Commands = argparse._SubParsersAction[argparse.ArgumentParser]
    from pdpost.figures.field_figure import Shown
    from pdsolve.results import Results

SMALLEST = 1e-3  # share of a window that the plate fills: 30 by 30 of 1000 by 1000 pixels
NO_PICTURE = "; a picture is drawn only with -o then"  # with --json
YIELDS = "K means nothing here, as the body yields"


def add_results(command: argparse.ArgumentParser) -> None:
    """The database that every command reads."""
    command.add_argument("results", type=Path, help="a database written by pdsolve")


def add_picture_command(commands: Commands, name: str, about: str, no_picture: str = "") -> argparse.ArgumentParser:
    """Add a command that reads results and draws a picture; `no_picture` says when it does not."""
    command = commands.add_parser(name, help=about, description=f"{about[0].upper()}{about[1:]}.")
    add_results(command)
    commandline.add_common_options(
        command,
        f"the picture, in the format of its suffix (default: the results' name with .{name}.png{no_picture})",
        NO_PICTURE,
    )
    add_style(command)
    return command


def add_style(command: argparse.ArgumentParser) -> None:
    """Add --style: settings of matplotlib. Versions up to 1.0 called it --set, which sets a model elsewhere."""
    commandline.add_assignments(
        command,
        "--style",
        "change how pictures are drawn: a matplotlib setting, such as savefig.dpi=300 or font.size=11",
    )
    commandline.add_assignments(command, "--set", argparse.SUPPRESS)


def add_journal(command: argparse.ArgumentParser) -> None:
    """Add --journal: sizes and fonts for the columns of a journal."""
    command.add_argument(
        "--journal",
        type=lambda name: ("journal", name),
        action="append",
        dest="assignments",
        metavar="NAME",
        help="set the width and fonts to those of a journal's column: elsevier, elsevier-middle, springer, aps, ieee,"
        " or each of these with -wide",
    )


def add_frame(command: argparse.ArgumentParser, several: bool = False, default: int | None = -1) -> None:
    """Add --frame, --step and --time, and --frames if `several`. The `default` is a frame; None means all frames."""
    which = command.add_mutually_exclusive_group()
    which.add_argument(
        "--frame",
        type=int,
        default=default,
        metavar="N",
        help="frame number, counted from 0, or from the end if negative",
    )
    which.add_argument("--step", type=int, metavar="N", help="the frame after this time step or load step of the run")
    which.add_argument(
        "--time", type=seconds, metavar="S", help="the frame nearest to this time of the run, s or such as 20us"
    )
    if several:
        which.add_argument(
            "--frames", type=_frames, metavar="N,N,...", help="draw several frames on one sheet, with one colour scale"
        )


def _frames(text: str) -> list[int]:
    try:
        return [int(word) for word in text.split(",")]
    except ValueError:
        raise argparse.ArgumentTypeError(f"cannot read '{text}'; use numbers of frames, such as 10,50,90") from None


def chosen_frames(results: Results, args: argparse.Namespace) -> list[int]:
    """Steps chosen by --frames. Raises ResultsError naming the frames there are."""
    _expect_plate(results, "--frames")
    steps = []
    for number in args.frames:
        args.frame = number
        steps.append(chosen_frame(results, args)[0])
    return steps


def chosen_frame(results: Results, args: argparse.Namespace) -> tuple[int, float]:
    """Step and time (s) chosen by --frame, --step or --time. Raises ResultsError naming the frames there are."""
    import numpy as np

    from pdsolve.measures.frame_steps import frames
    from pdsolve.results import ResultsError

    steps, times = frames(results)
    count = len(steps)
    if args.step is not None:
        if args.step not in steps:
            near = " or ".join(str(steps[k]) for k in np.unique(np.abs(steps - args.step).argsort(kind="stable")[:2]))
            raise ResultsError(f"{args.results} has no frame of step {args.step}; use {near}, the nearest")
        at = int(np.flatnonzero(steps == args.step)[0])
    elif args.time is not None:
        slack = 1e-9 * times[-1]  # of what is typed
        if not times[0] - slack <= args.time <= times[-1] + slack:
            raise ResultsError(f"--time is {args.time:g} s, outside the run; use {times[0]:g} to {times[-1]:g} s")
        at = int(np.abs(times - args.time).argmin())
    elif -count <= args.frame < count:
        at = args.frame
    else:
        raise ResultsError(f"{args.results} has no frame {args.frame}; use 0 to {count - 1} or -{count} to -1")
    return int(steps[at]), float(times[at])


def add_scale(command: argparse.ArgumentParser, default: str) -> None:
    """Add --scale: the factor on displacements in a picture."""
    command.add_argument(
        "--scale",
        type=_scale,
        default=default,
        metavar="N",
        help="draw the deformed shape, with displacements times N; 0: undeformed; auto: large enough to see"
        f" (default: {default})",
    )


def _scale(text: str) -> float | None:
    """A number of at least 0, or None for "auto"."""
    if text == "auto":
        return None
    try:
        scale = float(text)
    except ValueError:
        scale = -1.0
    if not 0 <= scale < float("inf"):
        raise argparse.ArgumentTypeError(f"cannot read '{text}'; use a number from 0, or auto")
    return scale


def chosen_scale(results: Results, step: int, args: argparse.Namespace) -> float:
    """The scale asked for, or one at which the frame's displacements can be seen; 0 if it holds none.

    Raises ResultsError.
    """
    from pdpost.figures.sheets import chosen_scale

    if args.scale != 0:
        _expect_plate(results, "--scale")
    if args.scale is not None:
        return float(args.scale)
    if not {"ux", "uy"} <= set(results.stored(step)):
        commandline.warn(f"{args.results}: holds no displacements; the reference is drawn")
        return 0.0
    return chosen_scale(results, step)


def add_window(command: argparse.ArgumentParser) -> None:
    """Add --window: the part of the plate in the picture."""
    command.add_argument(
        "--window",
        type=_window,
        metavar="X0,Y0,X1,Y1",
        help="draw this part of the plate alone, m, or with a unit, such as 0,0,50,20mm (default: all of it)",
    )


def _window(text: str) -> tuple[float, float, float, float]:
    x0, y0, x1, y1 = lengths(text, 4)
    if not (x0 < x1 and y0 < y1):
        raise argparse.ArgumentTypeError(f"'{text}' is empty; use the lower left and then the upper right corner")
    return x0, y0, x1, y1


def lengths(text: str, *counts: int) -> tuple[float, ...]:
    """Lengths, m, from a text such as ``0,20,50mm``, as many as one of the `counts`. Raises ArgumentTypeError."""
    from pdmesh.quantities import UNITS, quantities

    try:
        values = quantities(text, UNITS)
    except ValueError:
        values = ()
    if len(values) not in counts:
        several = " or ".join(map(str, counts))
        raise argparse.ArgumentTypeError(
            f"cannot read '{text}'; use {several} finite numbers with commas in between, in m, or with one of the"
            f" units {', '.join(UNITS)} behind the last"
        )
    return values


def seconds(text: str) -> float:
    """A time, s, from a text such as ``20us``, as an option's type."""
    from pdmesh.quantities import TIMES, quantity

    try:
        return quantity(text, TIMES)
    except ValueError:
        raise argparse.ArgumentTypeError(
            f"cannot read '{text}'; use a number, in s, or with one of the units {', '.join(TIMES)}"
        ) from None


def point(text: str) -> tuple[float, float]:
    """A place x,y, m, as an option's type."""
    x, y = lengths(text, 2)
    return x, y


def place(text: str) -> tuple[float, ...]:
    """A place x,y or x,y,z, m, as an option's type."""
    return lengths(text, 2, 3)


def check_window(results: Results, args: argparse.Namespace) -> None:
    """Raise ResultsError if --window shows nothing of the plate."""
    if args.window is None:
        return
    _expect_plate(results, "--window")
    from shapely import box

    from pdpost.figures.sheets import seen
    from pdsolve.measures.frame_steps import last_frame
    from pdsolve.measures.plate_geometry import read_plate_geometry
    from pdsolve.results import ResultsError

    shape, window = read_plate_geometry(results).plate_shape, box(*args.window)
    asked, whole = (",".join(f"{edge:g}" for edge in edges) for edges in (args.window, shape.bounds))
    if not shape.intersects(window) or shape.touches(window):
        raise ResultsError(f"--window {asked} shows nothing of the plate; use some of {whole} (m)")
    if box(*shape.bounds).intersection(window).area < SMALLEST * window.area:
        raise ResultsError(
            f"--window {asked} shows the plate as a point; use some of {whole} (m), or write units such as 20mm"
        )
    nodes = results.nodes(last_frame(results))
    if not seen(nodes.position, args.window).any():
        raise ResultsError(f"--window {asked} has no node in it; use one wider than {nodes.delta.max():g} m")


def _expect_plate(results: Results, option: str) -> None:
    """Raise ResultsError for a body in space: its sections are drawn whole and undeformed."""
    from pdsolve.results import ResultsError

    if results.dimension == 3:
        raise ResultsError(f"{option} is for plates; leave it out for a body in space (pdpost export is for ParaView)")


def plane(text: str) -> tuple[str, float]:
    """A plane across an axis, such as z=1e-3. Raises ArgumentTypeError."""
    axis, _, number = text.partition("=")
    from pdmesh.quantities import UNITS, quantity

    try:
        at = quantity(number, UNITS) if axis in ("x", "y", "z") else None
    except ValueError:
        at = None
    if at is None:
        raise argparse.ArgumentTypeError(f"cannot read '{text}'; use a plane such as z=1e-3, in m, or z=1mm")
    return axis, at


def some_of(first: str, second: str) -> Callable[[str], tuple[str, ...]]:
    """A type of an option: one of two names, or both with a comma between."""

    def names_of(text: str) -> tuple[str, ...]:
        names = tuple(text.split(","))
        if not set(names) <= {first, second}:
            raise argparse.ArgumentTypeError(f"cannot read '{text}'; use {first}, {second} or {first},{second}")
        return names

    return names_of


def add_colours(command: argparse.ArgumentParser) -> None:
    """Add --largest, the value at which the colours end, and --hide, of lines."""
    command.add_argument(
        "--hide",
        type=some_of("cracks", "zone"),
        default=(),
        metavar="NAMES",
        help="lines that are left out: cracks, zone (the border of finer nodes), or cracks,zone",
    )
    add_largest(
        command,
        "; fields with a sign end at -N too (default: for damage the first of 0.05, 0.1, 0.2, 0.5 and 1 that no node"
        " exceeds, otherwise the largest value, or the value that 99.5 %% of the nodes stay below if a few are far"
        " above it; for strain and stress, nodes that have lost more than 0.35 of their bonds do not count)",
    )


def add_largest(command: argparse.ArgumentParser, more: str = "") -> None:
    """Add --largest, the value at which the colours end: a text that `largest_of` reads once the field is known."""
    command.add_argument(
        "--largest",
        type=_amount,
        metavar="N",
        help=f"the value at which the colours end, in SI units or with a unit, such as 50MPa or 20um{more}",
    )


def _amount(text: str) -> str:
    """A text of a number above 0, with a unit or without."""
    from pdmesh.quantities import NUMBER

    number = NUMBER.fullmatch(text)
    if number is None or not 0 < float(number[1]) < float("inf"):
        raise argparse.ArgumentTypeError(f"cannot use '{text}'; use a number above 0, with a unit such as MPa or um")
    return text


def largest_of(args: argparse.Namespace, field: str) -> float | None:
    """The value of --largest, in the SI unit of a field. Raises UsageError for a unit of something else."""
    from pdmesh.quantities import KINDS, quantity
    from pdsolve.measures.fields import FIELDS

    if args.largest is None or field not in FIELDS:  # which is refused where it is read
        return None
    unit = FIELDS[field].unit
    units = KINDS.get(unit, {})
    try:
        return quantity(args.largest, units)
    except ValueError:
        usable = f", in {unit}" if unit else " without a unit"
        usable += f", or with one of the units {', '.join(units)}" if units else ""
        raise commandline.UsageError(
            f"--largest: cannot use '{args.largest}' for {field}; use a number above 0{usable}"
        ) from None


def drawing_options(args: argparse.Namespace, field: str, scale: float) -> dict[str, Any]:
    """What the options of a command say of a picture of a field, as arguments of the figure."""
    largest = largest_of(args, field)
    return {"scale": scale, "largest": largest, "window": args.window, "hide": args.hide}


def positive(text: str) -> float:
    """A number above 0, as an option's type."""
    try:
        number = float(text)
    except ValueError:
        number = 0.0
    if not 0 < number < float("inf"):
        raise argparse.ArgumentTypeError(f"cannot use '{text}'; use a number above 0")
    return number


def add_clip(command: argparse._ActionsContainer) -> None:
    """Put --clip on a command."""
    command.add_argument(
        "--clip",
        type=plane,
        metavar="AXIS=M",
        help="of a body: cut away what is in front of a plane, and show the cracks (needs the extra render)",
    )


def add_cracked(command: argparse.ArgumentParser) -> None:
    """Add --cracked: the damage of cracked nodes."""
    command.add_argument(
        "--cracked",
        type=_damage,
        metavar="DAMAGE",
        help="the damage above which a node is cracked (default: 0.35, or 0.92 of what a straight crack along the"
        " lattice breaks where that is less: 0.29 in space with a horizon of 2 spacings)",
    )


def _damage(text: str) -> float:
    """A damage from 0 to below 1, as an option's type."""
    try:
        damage = float(text)
    except ValueError:
        damage = -1.0
    if not 0 <= damage < 1:
        raise argparse.ArgumentTypeError(f"cannot read '{text}'; use a damage from 0 to below 1")
    return damage


def add_csv(command: argparse.ArgumentParser) -> None:
    """Add --csv: the file for the numbers behind the picture."""
    command.add_argument(
        "--csv", metavar="FILE", help="write the numbers behind the picture as a table, in SI units; - writes to stdout"
    )


def check_csv(args: argparse.Namespace, *others: Path | None) -> None:
    """Raise UsageError if --csv names a file that is also in `others`, or stdout when --json writes to it."""
    if args.csv == "-" and args.json:
        raise commandline.UsageError("--csv - and --json both write to stdout; use one of them")
    if args.csv is None or args.csv == "-":
        return
    path = commandline.output_path(Path(args.csv), args.results, ".csv", args.force)
    if path.resolve() in {output.resolve() for output in others if output is not None}:
        raise commandline.UsageError(f"--csv: {path} is written to as well; name another file")


def picture_path(args: argparse.Namespace, suffix: str) -> Path | None:
    """Path of the picture; None if only numbers were asked for. Raises UsageError."""
    none = args.output is None and (args.json or getattr(args, "csv", None) is not None)
    picture = None if none else commandline.output_path(args.output, args.results, suffix, args.force)
    if hasattr(args, "csv"):
        check_csv(args, picture)
    return picture


def write_csv(args: argparse.Namespace, table: bytes) -> None:
    """Write a table to the file asked for, or to stdout."""
    from pdmesh.files import write_atomically

    if args.csv == "-":
        print_text(table.decode(), end="")
    else:
        write_atomically(Path(args.csv), table)


def numbers(shown: Shown) -> dict[str, float | int | None]:
    """Smallest and largest valid value, and the number of nodes without one."""
    import numpy as np

    valid_values = shown.values[np.isfinite(shown.values) & ~shown.torn]
    ends = (float(valid_values.min()), float(valid_values.max())) if len(valid_values) else (None, None)
    torn, count = int(shown.torn.sum()), len(shown.values)
    return {
        "smallest": ends[0],
        "largest": ends[1],
        "nodes": count,
        "unknown": count - torn - len(valid_values),
        "torn": torn,
    }


def add_every(command: argparse.ArgumentParser) -> None:
    """Add --every N and --stride N: which frames are taken."""
    which = command.add_mutually_exclusive_group()
    which.add_argument(
        "--every",
        type=commandline.count,
        metavar="N",
        help="steps of the run between two frames that are taken, as in pdsolve (default: all frames)",
    )
    which.add_argument("--stride", type=commandline.count, metavar="N", help="take every Nth frame")


def chosen_stride(results: Results, args: argparse.Namespace) -> int:
    """Which frames --every or --stride takes, as a number of frames. Raises ResultsError naming the steps there are."""
    from pdsolve.measures.frame_steps import frames
    from pdsolve.results import ResultsError

    if args.every is None:
        return args.stride or 1
    steps, _ = frames(results)
    apart = int(steps[1] - steps[0]) if len(steps) > 1 else args.every
    if args.every > steps[-1] - steps[0]:
        raise ResultsError(
            f"--every is {args.every} steps, and frames span {steps[-1] - steps[0]}; use a smaller multiple of {apart}"
        )
    if args.every % apart:
        raise ResultsError(
            f"--every is {args.every} steps, and frames are {apart} steps apart; use a multiple of {apart}, or --stride"
            " N for every Nth frame"
        )
    return int(args.every // apart)


def counted(args: argparse.Namespace, doing: str) -> Callable[[list[int]], Iterable[int]]:
    """An iterator over steps that shows a progress bar on stderr if it is a terminal and --quiet was not given."""

    def steps(frame_steps: list[int]) -> Iterable[int]:
        if args.quiet or not sys.stderr.isatty():
            return frame_steps
        from tqdm import tqdm

        return tqdm(frame_steps, desc=doing, unit=" frames", dynamic_ncols=True, leave=False)  # type: ignore[no-any-return]

    return steps


def add_command(commands: Commands, name: str, about: str) -> argparse.ArgumentParser:
    """Add a command that reads results, draws a picture and prints its numbers."""
    command = add_picture_command(commands, name, about, "; none with --json or --csv alone")
    add_journal(command)
    add_csv(command)
    return command


def styled(path: Path | None, settings: Mapping[str, str]) -> AbstractContextManager[None]:
    """`style.styled` if there is a picture or a setting to check; otherwise a null context, without importing
    matplotlib."""
    if path is None and not settings:
        return nullcontext()
    from pdpost.figures import style

    return style.styled(settings)


def deliver(
    args: argparse.Namespace,
    result: Mapping[str, Any],
    lines: Sequence[str],
    header: Sequence[str],
    rows: Iterable[Sequence[Any]],
    picture: Path | None,
) -> int:
    """Print the result, write the table and return the exit code. Values that are not numbers become null or empty."""
    if args.csv is not None:
        table = [header, *(finite(row) for row in rows)]
        write_csv(args, "".join(",".join(map(for_csv, line)) + "\n" for line in table).encode())
        if args.csv == "-":
            return commandline.OK
        lines = [f"{args.csv}: the numbers", *lines]
    if picture is not None:
        result, lines = {"output": str(picture), **result}, [f"{picture}: the picture", *lines]
    commandline.report(finite(dict(result)), lines, args)
    return commandline.OK


def finite(value: Any) -> Any:
    """A value for JSON: arrays and tuples become lists, floats that are not finite become None."""
    import numpy as np

    if isinstance(value, Mapping):
        return {str(key): finite(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return finite(value.tolist())
    if isinstance(value, tuple | list):
        return [finite(item) for item in value]
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
