"""The command `pdmesh`: builds a grid from a drawing and reports on both."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pdmesh import commandline
from pdmesh.file_kinds import FileKind
from pdmesh.plain_text import print_text
from pdmesh.quantities import UNITS

if TYPE_CHECKING:
    from pdmesh.model.document import Document, Settings
    from pdmesh.model.node_grid import Grid

DRAWING = "a drawing (.geo, STEP, BREP), a scene in Python, a mesh, or a grid file"

NO_MATERIAL = (
    "no material: pdsolve refuses this model; build it again with --force --set material.E=70GPa"
    " --set material.rho=2700 --set material.G0=10, of your material, or give these to pdsolve"
)


def parser() -> argparse.ArgumentParser:
    """The command line of pdmesh."""
    program = commandline.program("pdmesh", "Turn a drawing of a plate into a peridynamic node grid.")
    program.set_by = _parameter
    commands = program.add_subparsers(dest="command", required=True, metavar="COMMAND")
    build = commands.add_parser(
        "build", help="build a node grid from a drawing, a scene or a mesh, and write it as JSON"
    )
    _add_drawing(build, "the grid file (default: the drawing's name with .json, in the current folder)")
    build.add_argument("--dry-run", action="store_true", help="say what would be built, and write nothing")
    build.set_defaults(run=_build)
    info = commands.add_parser("info", help="report the nodes, bonds, material, conditions and cracks of a model")
    _add_drawing(info, "a file for the report as JSON (default: none)")
    _add_mode(info)
    info.set_defaults(run=_info)
    preview = commands.add_parser("preview", help="draw the nodes, cracks and conditions")
    _add_drawing(preview, "the picture, in the format of its suffix (default: the model's name with .png)")
    preview.add_argument("--bonds", action="store_true", help="draw the bonds around the end of the first crack")
    preview.set_defaults(run=_preview)
    plan = commands.add_parser(
        "plan",
        help="estimate nodes, bonds, memory and time of a scene or a study, and compare with one uniform spacing",
    )
    _add_drawing(plan, "a file for the report as JSON (default: none)")
    plan.add_argument(
        "--within",
        type=commandline.share,
        metavar="SHARE",
        help="propose spacing, horizon, zones and time step that keep the error of displacements within this share,"
        " such as 2%%; based on measured scenes",
    )
    _add_mode(plan)
    plan.set_defaults(run=_plan)
    params = commands.add_parser("params", help="list the parameters of a drawing: value, unit, meaning")
    _add_drawing(params, "a file for the list, as JSON (default: none)")
    params.set_defaults(run=_params)
    init = commands.add_parser(
        "init", help="write a drawing of a part (STEP, BREP, STL) to fill in, and a picture of its faces or edges"
    )
    init.add_argument("drawing", type=Path, metavar="part", help="a part from a CAD program: STEP, BREP or STL")
    commandline.add_common_options(init, "the drawing (default: the part's name with .geo, beside the part)")
    init.add_argument(
        "--unit",
        choices=tuple(UNITS),
        help="unit of lengths in the drawing (default: mm for STEP; BREP and STL files do not name their unit)",
    )
    init.set_defaults(run=_init)
    schema = commands.add_parser("schema", help="print the JSON Schema of the grid file")
    schema.add_argument("-o", "--output", type=Path, metavar="FILE", help="the file to write (default: stdout)")
    schema.add_argument("--force", action="store_true", help="overwrite the output if it exists")
    schema.add_argument("--json", action="store_true", help="accepted for uniformity: the schema is JSON")
    schema.set_defaults(run=_schema, quiet=False)
    doctor = commands.add_parser("doctor", help="list what is installed and what is missing, and how to install it")
    doctor.add_argument("--json", action="store_true", help="print the findings as JSON on stdout")
    doctor.set_defaults(run=_doctor, quiet=False)
    return program


def _parameter(word: str) -> str:
    """The parameter of drawings that an unknown option may mean, as --set gives it; "" if there is none."""
    from pdmesh.drawing.parameters import NAMES, OF_SETTINGS
    from pdmesh.spelling import meant

    name = meant(word, [*OF_SETTINGS, *NAMES], cutoff=1.0)
    return f"--set {name}=VALUE" if name else ""


def _add_mode(command: argparse.ArgumentParser) -> None:
    command.add_argument(
        "--mode",
        choices=("thesis", "conservative"),
        default="conservative",
        help="mode of the run (default: conservative)",
    )


def _add_drawing(command: argparse.ArgumentParser, output: str) -> None:
    command.add_argument("drawing", type=Path, help=DRAWING)
    commandline.add_common_options(command, output)
    commandline.add_assignments(
        command,
        "--set",
        "override a parameter of the drawing, such as Zones/fine/Spacing=0.5mm, or a setting as pdsolve names it, such"
        " as material.E=65GPa; numbers without a unit are in the drawing's",
    )
    command.add_argument(
        "--refine",
        action="append",
        default=[],
        metavar="WHAT:DISTANCE[:SPACING]",
        help="refine the grid within a distance of every crack, notch or hole, such as crack:4e-3 or crack:4mm",
    )
    command.add_argument(
        "--crack",
        action="append",
        default=[],
        dest="cracks",
        metavar="X0,Y0,X1,Y1",
        help="add a pre-crack between two points, such as 0,20,50,20mm; more points make kinks",
    )
    command.add_argument(
        "--unit",
        choices=tuple(UNITS),
        help="unit of lengths in the drawing and on the command line (default: the drawing's, or m)",
    )
    command.add_argument(
        "--adapt",
        choices=("none", "auto", "hybrid", "split", "collocation"),
        help="auto, hybrid, collocation: build the finest spacing everywhere; the solver uses peridynamics where bonds"
        " may break and a coarse lattice (hybrid; auto: if that costs less) or stencils (collocation) elsewhere; split:"
        " build the coarsest spacing, whose cells split where the energy is high",
    )
    commandline.add_trust(command)


def _assigned(args: argparse.Namespace) -> list[tuple[str, str]]:
    """Assignments of --set, with --unit as the parameter Units."""
    adapt = [("--adapt", args.adapt)] if args.adapt else []
    return [*([("Units", args.unit)] if args.unit else []), *adapt, *args.assignments]


def _build(args: argparse.Namespace) -> int:
    from pdmesh.drawing.file_reading import build_file
    from pdmesh.model import unused_settings, zone_strengths
    from pdmesh.model.document import write_file
    from pdmesh.model.possible import refuse
    from pdmesh.reports.report import nodes_by_spacing

    path = commandline.output_path(args.output, args.drawing, ".json", args.force or args.dry_run)
    built = build_file(args.drawing, _assigned(args), args.refine, args.trust, args.cracks)
    grid, settings = built.grid, built.settings
    refuse(settings, grid.dimension, str(args.drawing), grid.field_quantities)
    unheard = unused_settings.in_vain(settings, [name for name, value in args.assignments if value != "{}"])
    if unheard is not None:
        raise commandline.UsageError(unheard)
    if args.assignments:
        _check_as_solver(grid, settings, str(args.drawing))
    if not args.dry_run:
        write_file(built.document, path)
    counts = nodes_by_spacing(grid)
    result: dict[str, Any] = {
        "output": None if args.dry_run else str(path),
        "nodes": len(grid),
        "nodes_by_spacing": counts,
        "area" if grid.dimension == 2 else "volume": grid.size,
        "shifts": {f"{shift.spacing:g}": shift.offset for shift in built.shifts},
        "loaded_nodes": {condition.name: len(condition.nodes or ()) for condition in settings.conditions},
    }
    lines = [
        f"{path}: {len(grid)} nodes ({', '.join(f'{number} of {spacing} m' for spacing, number in counts.items())})"
    ]
    lines += map(str, built.shifts)
    if args.dry_run:
        lines.append(f"{path} was not written (--dry-run); pdmesh info reports more")
    if settings.material is None and settings.medium is None:
        lines.append(NO_MATERIAL)
    said = (*unused_settings.remarks(settings), *zone_strengths.remarks(built.grid, settings))
    notes = [*built.notes, *(f"warning: {path}: {remark}" for remark in said)]
    result["notes"] = notes
    for note in notes:
        if note.startswith("warning:"):
            commandline.warn(note)
        else:
            commandline.note(f"note: {note}", args)
    commandline.report(result, lines, args)
    return commandline.OK


def _check_as_solver(grid: Grid, settings: Settings, name: str) -> None:
    """Raise the solver's error for settings that contradict each other or the grid; a material may come later."""
    if settings.material is not None or settings.medium is not None:
        from pdsolve import Model

        Model(grid, settings, name)


def _document(args: argparse.Namespace) -> Document:
    """The model in a .json file, or the model that any other file would be built into."""
    from pdmesh.drawing.file_reading import build_file, document_with_settings
    from pdmesh.model.document import read_file
    from pdmesh.model.node_grid import grid_of

    assigned = _assigned(args)
    if args.drawing.suffix.lower() == ".json" and not (args.refine or args.cracks):
        if not assigned:
            return read_file(args.drawing)
        document = document_with_settings(args.drawing, assigned)
        if document is not None:
            _check_as_solver(grid_of(document, str(args.drawing)), document, str(args.drawing))
            return document
    return build_file(args.drawing, assigned, args.refine, args.trust, args.cracks).document


def _info(args: argparse.Namespace) -> int:
    from pdmesh.reports.report import info, info_lines

    result = info(_document(args), str(args.drawing), args.mode)
    _warn(result, args)
    return _say(result, info_lines(result), args)


def _preview(args: argparse.Namespace) -> int:
    from pdmesh import plain_figure
    from pdmesh.model.node_grid import grid_of
    from pdmesh.reports import preview

    none = args.json and args.output is None
    path = None if none else commandline.output_path(args.output, args.drawing, ".png", args.force)
    document = _document(args)
    if path is not None:
        plain_figure.save(preview.draw(document, str(args.drawing), args.bonds), path)
    output, nodes = None if path is None else str(path), len(grid_of(document, str(args.drawing)))
    commandline.report({"output": output, "nodes": nodes}, [str(path)], args)
    return commandline.OK


def _plan(args: argparse.Namespace) -> int:
    if args.drawing.suffix.lower() == ".toml":
        from pdsolve import plan_study, study_plan_lines

        options = (
            ("--set", args.assignments),
            ("--refine", args.refine),
            ("--crack", args.cracks),
            ("--unit", args.unit),
        )
        more = (("--adapt", args.adapt), ("--within", args.within), ("--mode", args.mode != "conservative"))
        for name, value in (*options, *more):
            if value:
                raise commandline.UsageError(f"{name} cannot be combined with a study; set it in {args.drawing}")
        result = plan_study(args.drawing, args.trust)
        return _say(result, study_plan_lines(result), args)
    from pdmesh.drawing.file_reading import read_scene
    from pdmesh.reports.report import plan, plan_lines
    from pdmesh.scene.shapes import SceneError

    scene = read_scene(args.drawing, _assigned(args), args.refine, args.trust, args.cracks)
    reason = ""
    try:
        if args.within is None:
            result = plan(scene, args.mode)
            _warn(result, args)
            return _say(result, plan_lines(result), args)
        from pdmesh.reports import accuracy_estimate
        from pdmesh.scene.scene import Scene

        if not isinstance(scene, Scene):
            raise SceneError("--within is for plates, where errors were measured; leave it out for a body in space")
        proposal = accuracy_estimate.proposal(scene, args.within)
        reason = accuracy_estimate.because(proposal.within, proposal.feature, proposal.named)
        result = {"proposal": accuracy_estimate.described(proposal), **plan(proposal.scene, args.mode)}
    except SceneError as error:
        raise SceneError(f"{args.drawing}: {reason}{error}") from None
    _warn(result, args)
    return _say(result, [*accuracy_estimate.lines(proposal), "", *plan_lines(result)], args)


def _params(args: argparse.Namespace) -> int:
    from pdmesh.drawing.file_reading import file_parameters

    parameters = file_parameters(args.drawing, _assigned(args), args.trust)
    result = {entry.name: {"value": entry.value, "unit": entry.unit, "meaning": entry.meaning} for entry in parameters}
    name, value = (max((len(f"{getattr(entry, key)}") for entry in parameters), default=0) for key in ("name", "value"))
    lines = [
        f"{entry.name:{name}}  {entry.value!s:{value}}  {entry.unit:7} {entry.meaning}".rstrip() for entry in parameters
    ]
    return _say(result, lines, args)


def _init(args: argparse.Namespace) -> int:
    from pdmesh.drawing.part import read_part, refuse_other_kinds
    from pdmesh.drawing.part_model import MARK, drawing_text
    from pdmesh.files import write_atomically
    from pdmesh.plain_figure import save
    from pdmesh.reports import part_picture

    refuse_other_kinds(args.drawing)
    beside = args.drawing.parent
    path = commandline.output_path(args.output or args.drawing.with_suffix(".geo"), args.drawing, ".geo", args.force)
    if path.suffix.lower() != ".geo" or path.parent.resolve() != beside.resolve():
        raise commandline.UsageError(
            f"{path}: a drawing reads its part from its own folder; name a .geo file in {beside}"
        )
    named_picture = path.with_name(f"{path.stem}_numbers.png")
    picture = commandline.output_path(named_picture, args.drawing, ".png", args.force, is_companion=True)
    part = read_part(args.drawing, args.unit)
    text = drawing_text(part, picture.name)
    save(part_picture.draw(part), picture)
    write_atomically(path, text.encode())
    noun = "faces" if part.dimension == 3 else "edges"
    marks = sum(MARK in line.partition("//")[0] for line in text.splitlines())
    lines = [
        f"{path}: {marks} values to fill in, marked {MARK}; then: pdmesh build {path}",
        f"{picture}: the numbers of {len(part.shapes)} {noun}",
    ]
    result = {"output": str(path), "picture": str(picture), noun: len(part.shapes), "values_to_fill_in": marks}
    commandline.report(result, lines, args)
    return commandline.OK


def _warn(result: dict[str, Any], args: argparse.Namespace) -> None:
    """Print the warnings of a result, which `pdmesh build` gives too."""
    for remark in result.get("warnings", ()):
        commandline.warn(f"warning: {args.drawing}: {remark}")


def _say(result: dict[str, Any], lines: Sequence[str], args: argparse.Namespace) -> int:
    """Print a result and write it as JSON to the file of --output; returns the exit code."""
    if args.output is not None:
        from pdmesh.files import write_atomically

        path = commandline.output_path(args.output, args.drawing, ".json", args.force)
        write_atomically(path, (json.dumps(result, indent=2, allow_nan=False) + "\n").encode())
    commandline.report(result, lines, args)
    return commandline.OK


def _schema(args: argparse.Namespace) -> int:
    from pdmesh.files import write_atomically
    from pdmesh.model.document import schema

    text = json.dumps(schema(), indent=2) + "\n"
    if args.output is None:
        print_text(text, end="")
    else:
        write_atomically(commandline.output_path(args.output, Path("grid"), ".json", args.force), text.encode())
    return commandline.OK


def _doctor(args: argparse.Namespace) -> int:
    from pdmesh.reports import doctor

    findings = doctor.findings()
    keys = {"detail": "found"}  # as programs that read the output know it
    records = [{keys.get(name, name): value for name, value in finding._asdict().items()} for finding in findings]
    commandline.report({"findings": records}, doctor.lines(findings), args)
    return commandline.OK if all(finding.good or not finding.needed for finding in findings) else commandline.FAILURE


def main(argv: Sequence[str] | None = None) -> int:
    """Run pdmesh; returns its exit code."""
    args = parser().parse_args(commandline.words(argv))

    def command() -> int:
        if args.command == "init":
            commandline.expect(args.drawing, FileKind.DRAWING)
        elif args.command not in ("schema", "doctor"):
            studies = (FileKind.STUDY,) if args.command == "plan" else ()
            commandline.expect(args.drawing, FileKind.DRAWING, FileKind.MODEL, *studies)
            commandline.expect_other_outputs(args)
        from pdmesh.model.document import GridWarning

        with commandline.warnings_as_notes("pdmesh", args, GridWarning):
            return int(args.run(args))

    return commandline.run("pdmesh", command, _exits)


def _exits() -> dict[type[Exception], int]:
    from pdmesh.model.document import GridError
    from pdmesh.model.settings_overlay import ModelError
    from pdmesh.scene.shapes import SceneError

    errors: list[type[Exception]] = [SceneError, GridError, ModelError]
    if "pdsolve.study" in sys.modules:
        from pdsolve import StudyError

        errors.append(StudyError)
    if "pdmesh.plain_figure" in sys.modules:
        from pdmesh.plain_figure import FigureError

        errors.append(FigureError)
    return dict.fromkeys(errors, commandline.BAD_INPUT)


if __name__ == "__main__":
    sys.exit(main())
