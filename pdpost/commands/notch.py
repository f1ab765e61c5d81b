"""Write a run's cracks, of particles or of a body, as pre-cracks of another run."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, NamedTuple

from pdmesh import commandline
from pdpost.commands import shared
from pdpost.commands.shared import add_csv, add_frame, add_results, check_csv, chosen_frame

if TYPE_CHECKING:
    from pdpost.commands.shared import Commands
    from pdsolve.results import Results


class _Found(NamedTuple):
    """Cracks at a frame, as the notch of a grid file and for a reader."""

    notch: tuple[tuple[float, ...], ...]  # of the grid file, m
    written: str  # what the grid file holds
    words: str
    result: dict[str, Any]  # for JSON
    header: tuple[str, ...]
    rows: Iterable[tuple[Any, ...]]


def add(commands: Commands) -> None:
    """Put `notch` on the command line."""
    notch = commands.add_parser(
        "notch",
        help="write the model of a run with its grown cracks as the notch, to solve it again",
        description="Write the grid file of a run with --cracks particles, or of a body that cracked, with its cracks"
        " at a frame as the notch. It can then be solved under other loads. --csv and --json give the cracks: polylines"
        " in a plate, triangles in a body.",
    )
    add_results(notch)
    commandline.add_common_options(
        notch, "the grid file (default: the results' name with .notch.json; none with --json or --csv alone)"
    )
    add_frame(notch)
    add_csv(notch)
    notch.set_defaults(run=_notch)


def _notch(args: argparse.Namespace) -> int:
    import msgspec

    from pdmesh.model.document import read_document, write_file
    from pdsolve.measures.embedded_model import model_text
    from pdsolve.results import Results

    none = args.output is None and (args.json or args.csv is not None)
    path = None if none else commandline.output_path(args.output, args.results, ".notch.json", args.force)
    check_csv(args, path)
    with Results.open(args.results) as results:
        step, time = chosen_frame(results, args)
        document = read_document(model_text(results), results.name)
        pre_cracks = (_triangles if results.dimension == 3 else _polylines)(results, step)
    if path is not None:
        write_file(msgspec.structs.replace(document, notch=pre_cracks.notch), path)
    written = [] if path is None else [f"{path}: the grid file, with {pre_cracks.written}"]
    result = {"output": None if path is None else str(path), "step": step, "time": time, **pre_cracks.result}
    words = [*written, f"{pre_cracks.words}, at {time:.4g} s"]
    return shared.deliver(args, result, words, pre_cracks.header, pre_cracks.rows, None)


def _polylines(results: Results, step: int) -> _Found:
    """The cracks of particles of a plate. Raises ResultsError without any."""
    from pdsolve.fracture.crack_particles import arms, polylines, until
    from pdsolve.results import ResultsError

    particles = until(results.particles(), step)
    if not len(particles.place):
        raise ResultsError(f"{results.name} has no particles; use a run with --cracks particles")
    segments, lines = arms(particles), polylines(particles)
    return _Found(
        notch=tuple((x0, y0, 0.0, x1, y1, 0.0) for x0, y0, x1, y1 in segments.tolist()),
        written=f"{len(segments)} segments of cracks",
        words=f"{len(lines)} polylines of {len(particles.place)} particles",
        result={"lines": lines},
        header=("line", "x, m", "y, m"),
        rows=((number, *place) for number, line in enumerate(lines) for place in line.tolist()),
    )


def _triangles(results: Results, step: int) -> _Found:
    """The pre-cracks of a body, and what opened in its run. Raises ResultsError without any."""
    import numpy as np

    from pdsolve.measures.crack_faces import (
        build_crack_surface,
        find_opened_face_neighbours,
        triangles_of_grown_faces,
    )
    from pdsolve.results import ResultsError

    cracks = build_crack_surface(results, step, find_opened_face_neighbours(results, step))
    opened_triangles = triangles_of_grown_faces(cracks)
    triangles = np.concatenate([results.cracks(), opened_triangles])
    if not len(triangles):
        raise ResultsError(f"{results.name} has no crack; use a body in which neighbours parted")
    area = float(cracks.face_area[cracks.face_opened_during_run].sum())
    return _Found(
        notch=tuple(map(tuple, triangles.tolist())),
        written=f"{len(triangles)} triangles of cracks",
        words=f"{len(opened_triangles)} triangles of {area * 1e6:.4g} mm^2 that opened",
        result={"triangles": triangles, "area": area},
        header=("triangle", "x, m", "y, m", "z, m"),
        rows=((t, *place) for t, triangle in enumerate(triangles.reshape(-1, 3, 3).tolist()) for place in triangle),
    )
