"""The crack paths of all runs of a study in one figure."""

from __future__ import annotations

import argparse

from pdmesh import commandline
from pdpost.commands import number_options
from pdpost.commands.shared import check_window, picture_path

ALONE = ("compare", "along", "frame", "step", "time")  # options that a study does not have


def overlaid(args: argparse.Namespace, threshold: float) -> int:
    """Draw the crack paths of all runs of a study, for `pdpost crack`; returns the exit code."""
    from pdpost.measures import paths
    from pdpost.measures.plate_geometry import expect_same_plate
    from pdpost.reading import studies
    from pdpost.reading.frame_steps import last_step
    from pdsolve.results import Results, ResultsError

    if any(getattr(args, name) is not None for name in ALONE):
        raise commandline.UsageError(f"a study cannot be combined with --{', --'.join(ALONE)}; give the study alone")
    picture = picture_path(args, ".paths.png")
    study = studies.read(args.results)
    with number_options.styled(picture, dict(args.assignments)), Results.open(study.rows[0].file) as first:
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
    return number_options.deliver(args, result, text, ("run", "series", "branch", "x, m", "y, m"), rows, picture)
