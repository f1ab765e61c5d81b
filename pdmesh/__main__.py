"""The command `pdmesh`: build a grid from a drawing."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from pdmesh import commandline


def parser() -> argparse.ArgumentParser:
    """The command line of pdmesh."""
    program = commandline.program("pdmesh", "Turn a drawing of a plate into a peridynamic node grid.")
    commands = program.add_subparsers(dest="command", required=True, metavar="COMMAND")
    build = commands.add_parser("build", help="read a Gmsh drawing, write the node grid as JSON")
    build.add_argument("drawing", type=Path, help="a .geo file with named physical groups")
    commandline.add_common_options(
        build,
        output="the grid file (default: the drawing's name with .json, in the current folder)",
        assignment="override an ONELAB parameter of the drawing, such as Zones/fine/Spacing=5e-4",
    )
    build.add_argument("--trust", action="store_true", help="read a drawing that runs commands or reads other files")
    build.set_defaults(run=_build)
    return program


def _build(args: argparse.Namespace) -> int:
    from pdmesh.geo import read_geo
    from pdmesh.grid import document_of, write_file
    from pdmesh.lattice import build_grid
    from pdmesh.scene import SceneError

    path = commandline.output_path(args.output, args.drawing, ".json", args.force)
    scene = read_geo(args.drawing, args.assignments, args.trust)
    try:
        grid, settings, shifts = build_grid(scene)
    except SceneError as error:
        raise SceneError(f"{args.drawing}: {error}") from None
    write_file(document_of(grid, settings), path)
    counts = {zone.name: int((grid.delta == zone.spacing).sum()) for zone in scene.zones}
    assert grid.areas is not None
    result = {
        "output": str(path),
        "nodes": len(grid),
        "nodes_by_spacing": {f"{zone.spacing:g}": int((grid.delta == zone.spacing).sum()) for zone in scene.zones},
        "area": float(grid.areas.sum()),
        "shifts": {shift.zone: shift.offset for shift in shifts},
        "loaded_nodes": {load.name: len(load.nodes or ()) for load in settings.conditions},
    }
    lines = [
        f"{path}: {len(grid)} nodes ({', '.join(f'{name} {count}' for name, count in counts.items())})",
        *(
            f"zone '{shift.zone}': lattice shifted by ({shift.offset[0]:g}, {shift.offset[1]:g}) m, off the crack"
            for shift in shifts
        ),
    ]
    commandline.report(result, lines, args)
    return commandline.OK


def main(argv: Sequence[str] | None = None) -> int:
    """Run pdmesh; returns its exit code."""
    args = parser().parse_args(argv)
    return commandline.run("pdmesh", lambda: int(args.run(args)), _exits)


def _exits() -> dict[type[Exception], int]:
    from pdmesh.grid import GridError
    from pdmesh.scene import SceneError

    return dict.fromkeys((SceneError, GridError), commandline.BAD_INPUT)


if __name__ == "__main__":
    sys.exit(main())
