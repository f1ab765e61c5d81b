"""When, where and how fast the crack ran, how many pieces are left, and its distance from another run's crack.

Of a study, the crack paths of all runs are in one figure.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from pdmesh import commandline
from pdpost.commands import shared
from pdpost.commands.shared import (
    NO_PICTURE,
    add_cracked,
    add_csv,
    add_frame,
    add_journal,
    add_results,
    add_style,
    add_window,
    check_window,
    chosen_frame,
    picture_path,
)

if TYPE_CHECKING:
    from pdpost.commands.shared import Commands
    from pdsolve.results import Results

ALONE = ("compare", "along", "frame", "step", "time")  # options that a study does not have


def overlaid(args: argparse.Namespace, threshold: float | None) -> int:
    """Draw the crack paths of all runs of a study, for `pdpost crack`; returns the exit code."""
    from pdpost.reading import studies
    from pdsolve.measures import paths
    from pdsolve.measures.frame_steps import last_step
    from pdsolve.measures.plate_geometry import expect_same_plate
    from pdsolve.results import Results, ResultsError

    if any(getattr(args, name) is not None for name in ALONE):
        raise commandline.UsageError(f"a study cannot be combined with --{', --'.join(ALONE)}; give the study alone")
    picture = picture_path(args, ".paths.png")
    study = studies.read(args.results)
    with shared.styled(picture, dict(args.assignments)), Results.open(study.rows[0].file) as first:
        if first.dimension == 3:
            raise ResultsError(f"{args.results} has runs of a body in space; use those of a plate")
        check_window(first, args)
        lines = []
        for row in study.rows:
            with Results.open(row.file) as results:
                expect_same_plate(results, first)
                way = paths.crack_paths(results, last_step(results), threshold)
                lines.append((row, studies.label(row, study.varied), way))
        title = f"Paths of the cracks of {len(lines)} runs"
        if picture is not None:
            from pdpost.figures import study_figure, style

            named_paths = [(name, way) for _, name, way in lines]
            style.save(study_figure.overlay(first, named_paths, title, args.window), picture)
    apart = [
        (row, paths.mean_and_hausdorff_distance(way, lines[0][2])[0])
        for row, _, way in lines[1:]
        if way and lines[0][2]
    ]
    text = [f"{len(lines)} runs, {sum(bool(way) for _, _, way in lines)} with a crack"]
    if apart:
        most = max(apart, key=lambda one: one[1])
        text.append(
            f"mean distance from run {lines[0][0].number}: at most {most[1] * 1e3:.3g} mm (run {most[0].number})"
        )
    rows = [
        (row.number, name, number, *point)
        for row, name, way in lines
        for number, line in enumerate(way)
        for point in line
    ]
    result = {"runs": [{"number": row.number, "series": name, "paths": way} for row, name, way in lines]}
    result["mean_distance"] = [{"number": row.number, "from_first": mean} for row, mean in apart]
    return shared.deliver(args, result, text, ("run", "series", "branch", "x, m", "y, m"), rows, picture)


def add(commands: Commands) -> None:
    """Put `crack` on the command line."""
    crack = commands.add_parser(
        "crack",
        help="draw the path and the speed of the crack; say when it started, branched and split the plate",
        description="Draw the path of the crack, its length and its speed; say when and where it started, branched and"
        " split the plate, and what pieces are left. Speeds are slopes over at least ten spacings of the path, with an"
        " uncertainty band. A speed is left out where its band is too wide, or where the cracked nodes form no line."
        " Cracked nodes belong to no piece. For a body in space the command draws the surface of its cracks, coloured"
        " by when it opened, and says its area, its energy, the speed of its front and the fragments.",
    )
    add_results(crack)
    crack.add_argument(
        "--along",
        choices=("right", "left", "up", "down"),
        help="the direction in which the crack runs (default: measured)",
    )
    add_frame(crack, default=None)
    add_window(crack)
    crack.add_argument(
        "--compare", type=Path, metavar="OTHER", help="draw the crack path of another run of this plate too"
    )
    crack.add_argument(
        "--surface", type=Path, metavar="FILE", help="write the crack surface of a body (.vtp for ParaView, .stl)"
    )
    add_cracked(crack)
    commandline.add_common_options(
        crack,
        "the picture, in the format of its suffix (default: the results' name with .crack.png; none with --json or"
        " --csv alone)",
        NO_PICTURE,
    )
    add_style(crack)
    add_journal(crack)
    add_csv(crack)
    crack.set_defaults(run=_crack)


def _crack(args: argparse.Namespace) -> int:
    from pdpost.reading.studies import is_study
    from pdsolve.results import Results

    threshold = args.cracked
    if "cracked" in dict(args.assignments):  # as versions up to 1.0 had it
        raise commandline.UsageError("cracked is no setting of pictures; use --cracked DAMAGE")
    if is_study(args.results):
        return overlaid(args, threshold)
    path = picture_path(args, ".compare.png" if args.compare else ".crack.png")
    with shared.styled(path, dict(args.assignments)), Results.open(args.results) as results:
        if results.dimension == 3:
            return _of_body(args, results, threshold, path)
        if args.surface is not None:
            raise commandline.UsageError(f"--surface ({args.surface}) is for bodies in space; leave it out for a plate")
        if args.compare is not None:
            with Results.open(args.compare) as second_run:
                return _two(args, results, second_run, threshold, path)
        from pdsolve.measures import crack_summary
        from pdsolve.measures.directions import predict_initial_directions
        from pdsolve.measures.json_keys import fields_by_json_key

        check_window(results, args)
        summary = crack_summary.crack(results, _step(args, results), threshold, args.along)
        if path is not None:
            from pdpost.figures import crack_figure, style

            style.save(crack_figure.crack(results, summary, args.window), path)
        header, rows = crack_summary.path_point_table(summary)
        first = summary.events.first_break
        expected = [] if first is None else predict_initial_directions(results, summary.initial_directions, first.step)
        lines = [*crack_summary.summary_sentences(summary), *crack_summary.prediction_sentences(expected, results)]
        result = {
            **crack_summary.summary_for_json(summary),
            "predicted": [fields_by_json_key(one) for one in expected],
        }
        return shared.deliver(args, result, lines, header, rows, path)


def _of_body(args: argparse.Namespace, results: Results, threshold: float | None, path: Path | None) -> int:
    from pdpost.exports import surface_files
    from pdsolve.measures import crack_3d

    for option in ("along", "window", "compare"):
        if getattr(args, option) is not None:
            raise commandline.UsageError(f"--{option} is for plates; leave it out for a body in space")
    if args.surface is not None:
        surface_files.check_suffix(args.surface)
        commandline.output_path(args.surface, args.results, args.surface.suffix, args.force)
    summary = crack_3d.crack_3d(results, _step(args, results), threshold)
    lines = crack_3d.summary_sentences(summary)
    if path is not None:
        from pdpost.figures import crack_surface_figure, style

        style.save(crack_surface_figure.crack_surface(results, summary), path)
    if args.surface is not None:
        surface_files.write(args.surface, summary.surface, summary.front_speed)
        lines = [f"{args.surface}: the surface, {len(summary.surface.face_corners)} faces", *lines]
    header, rows = crack_3d.frame_table(summary)
    return shared.deliver(args, crack_3d.summary_for_json(summary), lines, header, rows, path)


def _two(
    args: argparse.Namespace, first_run: Results, second_run: Results, threshold: float | None, path: Path | None
) -> int:
    from pdsolve.measures import cracks, paths
    from pdsolve.measures.frame_steps import time_text
    from pdsolve.measures.json_keys import fields_by_json_key
    from pdsolve.measures.paths import compare_cracks

    check_window(first_run, args)
    steps = _step(args, first_run), _step(args, second_run)
    along = args.along or paths.main_growth_direction_name(paths.crack_paths(first_run, steps[0], threshold))
    comparison = compare_cracks(first_run, second_run, steps, cracks.DIRECTIONS[along], threshold)
    lines = ["one of the two runs has no crack: nothing to compare"]
    if comparison.mean_distance is not None and comparison.hausdorff_distance is not None:
        lines = [
            f"mean distance {comparison.mean_distance * 1e3:.3g} mm,"
            f" at most {comparison.hausdorff_distance * 1e3:.3g} mm (Hausdorff)"
        ]
    by_json_key = fields_by_json_key(comparison)
    for name in ("start", "branching", "split"):
        if (later := by_json_key[name]) is not None:
            lines.append(f"{name}: {time_text(later, '+.3g')} in {args.compare}")
    if path is not None:
        from pdpost.figures import crack_figure, style

        names = args.results.stem, args.compare.stem
        if names[0] == names[1]:
            names = str(args.results), str(args.compare)
        style.save(crack_figure.comparison(first_run, steps[0], comparison.paths, names, lines[0], args.window), path)
    rows = [
        (str(name), number, *point)
        for name, lines_of in zip((args.results, args.compare), comparison.paths, strict=True)
        for number, line in enumerate(lines_of)
        for point in line
    ]
    result = by_json_key | {"results": [str(args.results), str(args.compare)], "along": along, "steps": steps}
    return shared.deliver(args, result, lines, ("results", "branch", "x, m", "y, m"), rows, path)


def _step(args: argparse.Namespace, results: Results) -> int:
    from pdsolve.measures.frame_steps import last_step

    if args.frame is not None or args.time is not None:
        return chosen_frame(results, args)[0]
    last = last_step(results)
    if args.step is not None and not 0 <= args.step <= last:
        raise commandline.UsageError(f"--step is {args.step}; use 0 to {last}")
    return last if args.step is None else int(args.step)
