"""The command `pdsolve`: solves a model and writes its results."""

from __future__ import annotations

import argparse
import gc
import os
import shlex
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pdmesh import commandline, stopping
from pdmesh.file_kinds import FileKind
from pdmesh.plain_text import print_text, visible
from pdmesh.spelling import ALIKE, nearest
from pdsolve.ranks import launch
from pdsolve.run.progress import Watch

if TYPE_CHECKING:
    from pdmesh.model.document import Settings
    from pdsolve.estimate import Plan
    from pdsolve.numerics.team import Team


NAMES = {"assignments": "--set", "one_file": "--one-file-up-to"}  # of options whose arguments are called otherwise
EPILOG = (
    "`pdsolve study study.toml` solves many models (`pdsolve study --help`); `pdsolve fit study.toml --measured"
    " curve.csv` fits parameters of a model to a measured curve (`pdsolve fit --help`)."
)


def parser() -> argparse.ArgumentParser:
    """The command line of pdsolve."""
    program = commandline.program("pdsolve", "Solve a peridynamic model and write its results as an SQLite database.")
    program.epilog = EPILOG
    program.others = {"study": _study_parser, "fit": _fit_parser}
    program.set_by = _setting
    program.add_argument(
        "--help-settings",
        action=_HelpSettings,
        nargs=0,
        help="print all settings with unit, default, values and meaning, as tables in Markdown, and end",
    )
    program.add_argument("model", type=Path, help="a grid file in JSON; with --resume, a database of results")
    commandline.add_common_options(
        program, "the database (default: the model's name with .sqlite, in the current folder)"
    )
    commandline.add_assignments(
        program, "--set", "override a setting of the model, such as run.steps=500 or material.E=65GPa"
    )
    program.add_argument("--settings", type=Path, metavar="TOML", help="settings that override those of the model")
    program.add_argument(
        "--mode", choices=("thesis", "conservative"), help="how bonds are filled (default: conservative)"
    )
    program.add_argument(
        "--adapt",
        choices=("none", "auto", "hybrid", "split", "collocation"),
        help="hybrid, collocation: use peridynamics where bonds may break, and a compact lattice (hybrid) or stencils"
        " of the same horizon (collocation) elsewhere; auto: hybrid or none, as costs less; split: split cells where"
        " the energy is high, and merge them afterwards (run.adapt; default: none)",
    )
    program.add_argument(
        "--cracks",
        choices=("bonds", "particles"),
        help="bonds: cracks are broken bonds; particles: cracks grow from their tips as crack particles, and cut bonds"
        " (run.cracks; default: bonds)",
    )
    _add_machine(program)
    program.add_argument("--every", metavar="N", help="steps between two frames (run.every)")
    program.add_argument(
        "--fields",
        metavar="A,B",
        help="fields to store, from ux, uy, vx, vy, ax, ay, energy, damage; +A,B adds to the model's; or all"
        " (run.fields; default: all)",
    )
    program.add_argument(
        "--probe",
        action="append",
        default=[],
        metavar="X,Y",
        help="record the motion of the node nearest to a point, m, or such as 5,20mm (run.probes)",
    )
    _add_ends(program)
    program.add_argument("--dry-run", action="store_true", help="estimate memory and time of the run, solve nothing")
    program.add_argument(
        "--resume",
        action="store_true",
        help="continue a run from its last checkpoint, bit-identical on the same kind of processor",
    )
    return program


def _setting(word: str) -> str:
    """The setting that an unknown option may mean, as --set gives it; "" if there is none."""
    from pdmesh.model.document import Settings
    from pdmesh.model.suggestions import dotted_names
    from pdmesh.spelling import meant

    name = meant(word, dotted_names(Settings), cutoff=1.0)
    return f"--set {name}=VALUE" if name else ""


def _add_machine(program: argparse.ArgumentParser) -> None:
    """Add the options of what computes, and in which numbers."""
    program.add_argument("--threads", type=int, metavar="N", help="number of threads (default: by the number of nodes)")
    program.add_argument(
        "--device",
        action=_Device,
        metavar="cpu|opencl[:N]|list",
        help="what sums bonds: the processor or an OpenCL device (run.device; default: cpu); list: list them and end",
    )
    program.add_argument(
        "--one-file-up-to",
        type=int,
        dest="one_file",
        metavar="NODES",
        help="on many ranks: nodes up to which one database is written; of more, each rank writes one beside it"
        " (default: 10 million)",
    )
    program.add_argument("--precision", choices=("float64", "float32"), help="number type (default: float64)")


class _Device(argparse.Action):
    """Keep the name of a device; for `list`, print the devices and end."""

    def __call__(self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, *_: object) -> None:
        if values == "list":
            parser.exit(commandline.run("pdsolve", _list_devices, _exits))
        setattr(namespace, self.dest, values)


def _add_ends(program: argparse.ArgumentParser) -> None:
    """Add the options of when a run ends, and of equilibrium."""
    program.add_argument(
        "--until",
        metavar="split|quiet:S|none",
        help="stop when the plate has split in two, or when no bond has broken for S seconds, such as 20us; none: at"
        " the end (run.until)",
    )
    program.add_argument("--static", action="store_true", help="solve for equilibrium, in load steps (run.solver)")
    program.add_argument("--float", action="store_true", help="hold unsupported bodies softly (run.static.floating)")


class _HelpSettings(argparse.Action):
    """Print the settings of a model and end."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> None:
        from pdmesh.model.settings_table import markdown, settings

        print_text("\n".join(markdown(settings())))
        parser.exit(commandline.OK)


def _list_devices() -> int:
    from pdsolve.device.runtime import devices

    print_text("\n".join(["cpu  the processor: float64 and float32", *(device.summary for device in devices())]))
    return commandline.OK


def _study_parser() -> argparse.ArgumentParser:
    from pdsolve.study import command

    return command.parser()


def _fit_parser() -> argparse.ArgumentParser:
    from pdsolve.study import fit_command

    return fit_command.parser()


@contextmanager
def _uncollected() -> Iterator[None]:
    """A context without garbage collection: imports create no garbage, and collection takes a tenth of a short run."""
    was = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        if was:
            gc.enable()


def _solve(args: argparse.Namespace, ranks: Team | None) -> int:
    commandline.expect(args.model, FileKind.RESULTS if args.resume else FileKind.MODEL)
    commandline.expect_other_outputs(args)
    launch.expect_room(ranks)
    with _uncollected():
        from pdmesh.model.document import GridWarning
        from pdsolve.codegen.compile_time import compile_time_said
        from pdsolve.model import ModelWarning, read_model
        from pdsolve.numerics.memory import large_arrays_apart
        from pdsolve.results import ResultsWarning, is_empty, state_of
        from pdsolve.run.initial_states import results_file_of_motion_after_equilibrium_path
        from pdsolve.run.progress import format_summary_lines
        from pdsolve.run.simulation import Options, resume, simulate

    large_arrays_apart()
    stopping.expect_long_call()
    _refuse_other_options(args)
    args = _begun_anew(args, is_empty)
    watching = Watch(args.quiet)
    shown = commandline.warnings_as_notes("pdsolve", args, GridWarning, ModelWarning, ResultsWarning)
    with _names_the_signal(watching), watching as watch, shown:
        if args.resume:
            path = args.model
            if args.dry_run:
                return _show_what_is_left(path, args)
            with _says_how_to_go_on(path, args), compile_time_said(lambda words: commandline.note(words, args)):
                results = resume(path, args.threads, watch, team=ranks, device=args.device)
        else:
            options = Options(args.mode or "conservative", args.precision or "float64", args.threads, None, ranks)
            options = options if args.one_file is None else options._replace(one_file=args.one_file)
            model = read_model(args.model, args.settings, [*args.assignments, *_flags(args)])
            if args.float and "static" not in (model.settings.run.solver, model.settings.run.start):
                raise commandline.UsageError("--float is for equilibrium; use --static or run.start static with it")
            _refuse_unused(args, model.settings)
            if args.dry_run:
                from pdsolve.estimate import estimate_run

                return _show_plan(estimate_run(model, options), args)
            output = args.output or Path(args.model.stem + ".sqlite")
            path = commandline.output_path(args.output, args.model, ".sqlite", args.force or is_empty(output))
            if model.settings.run.after == "motion":
                companion = results_file_of_motion_after_equilibrium_path(path)
                commandline.output_path(companion, args.model, ".sqlite", args.force, is_companion=True)
            if not args.force:
                state_of(path)  # a log without its database is left alone
            with _says_how_to_go_on(path, args), compile_time_said(lambda words: commandline.note(words, args)):
                results = simulate(model, path, options, watch, visible(shlex.join(["pdsolve", *sys.argv[1:]])))
        with results:
            path, meta, summary = Path(results.name), results.meta(), results.summary()
    lines = format_summary_lines(path, summary)
    if meta["status"] == "interrupted":
        words = f"interrupted; to go on: pdsolve --resume {shlex.quote(str(path))}"
        if ranks is None:
            lines.insert(0, words)
        else:  # beside what the launcher says on stdout
            commandline.note(f"pdsolve: {words}", args)
    commandline.report({"output": str(path), "status": meta["status"], **summary}, lines, args)
    stopped = commandline.BY_SIGNAL + (watching.signal or signal.SIGINT)
    return commandline.OK if meta["status"] == "finished" else stopped


def _refuse_other_options(args: argparse.Namespace) -> None:
    """Raise UsageError for an option that would change a run that is to go on."""
    fixed_options = ("output", "settings", "mode", "precision", "assignments", "every", "fields", "probe", "until")
    changed = [
        name for name in (*fixed_options, "static", "float", "adapt", "cracks", "one_file") if getattr(args, name)
    ]
    if args.resume and changed:
        raise commandline.UsageError(
            f"--resume keeps the options of the run; leave out {NAMES.get(changed[0], f'--{changed[0]}')}"
        )


def _begun_anew(args: argparse.Namespace, is_empty: Callable[[Path], bool]) -> argparse.Namespace:
    """The arguments of a new run in place of one to go on with, of which nothing is left but an empty database.

    Its model is the file of the same name beside it; without one, nothing is changed.
    """
    path = args.model
    model = path.with_suffix(".json")
    if not args.resume or args.dry_run or not is_empty(path) or not model.is_file():
        return args
    words = f"{path}: nothing in it, its run was stopped before the first frame; {model} is solved anew"
    commandline.warn(f"pdsolve: warning: {words}, without the options of its first start")
    return argparse.Namespace(**{**vars(args), "model": model, "output": path, "resume": False})


@contextmanager
def _says_how_to_go_on(path: Path, args: argparse.Namespace) -> Iterator[None]:
    """A context that says how to continue a stopped run if something would be lost."""
    try:
        yield
    except KeyboardInterrupt as stop:
        if stop.args:
            commandline.note(f"pdsolve: stopped {stop}; to go on: pdsolve --resume {shlex.quote(str(path))}", args)
        raise


@contextmanager
def _names_the_signal(watch: Watch) -> Iterator[None]:
    """A context that raises Interrupted for the signal that stopped a run, if something of it is lost."""
    try:
        yield
    except KeyboardInterrupt:
        raise commandline.Interrupted(watch.signal or signal.SIGINT) from None


def _refuse_unused(args: argparse.Namespace, settings: Settings) -> None:
    """Raise UsageError for a given setting that a run of this kind does not use."""
    from pdmesh.model.unused_settings import in_vain, value_of

    # a table that is emptied, or a setting that is left out, takes away what is said
    setting_names = [name for name, value in (*args.assignments, *_flags(args)) if value != "{}"]
    said = in_vain(settings, [name for name in setting_names if value_of(settings, name) is not None])
    if said is not None:
        raise commandline.UsageError(said)


def _flags(args: argparse.Namespace) -> list[tuple[str, str]]:
    """Flags that stand for settings, as assignments."""
    flags = [] if args.every is None else [("run.every", args.every)]
    if args.adapt is not None:
        flags.append(("run.adapt", f'"{args.adapt}"'))
    if args.device is not None:
        flags.append(("run.device", f'"{args.device}"'))
    if args.cracks is not None:
        flags.append(("run.cracks", f'"{args.cracks}"'))
    if args.fields is not None:
        flags.append(("run.fields", args.fields))
    if args.probe:
        flags.append(("run.probes", f"[{', '.join(_place(place) for place in args.probe)}]"))
    if args.static:
        flags.append(("run.solver", "static"))
    if args.float:
        flags.append(("run.static.floating", "true"))
    if args.until is not None:
        kind, _, quiet = args.until.partition(":")
        if kind not in ("split", "quiet", "none") or (kind == "quiet") != bool(quiet):
            raise commandline.UsageError(f"--until: cannot read '{args.until}'; use split, quiet:SECONDS or none")
        flags += [("run.until", kind), ("run.quiet", _time(quiet) if quiet else "none")]
    return flags


def _place(text: str) -> str:
    """A place X,Y or X,Y,Z as a list in TOML, m. Raises UsageError."""
    from pdmesh.quantities import UNITS, quantities

    try:
        return f"[{', '.join(map(repr, quantities(text, UNITS)))}]"
    except ValueError:
        raise commandline.UsageError(f"--probe: cannot read '{text}'; use X,Y in m, or such as 5,20mm") from None


def _time(text: str) -> str:
    """A time as a number in TOML, s. Raises UsageError."""
    from pdmesh.quantities import TIMES, quantity

    try:
        return repr(quantity(text, TIMES))
    except ValueError:
        raise commandline.UsageError(f"--until: cannot read '{text}'; use seconds, or such as 20us") from None


def _show_plan(plan: Plan, args: argparse.Namespace) -> int:
    from pdmesh.model.amounts import pair_count  # here, as help does without what models need

    steps = f"{plan.steps} steps of {plan.time_step:.4g} s (stable up to {plan.stable_time_step:.4g} s)"
    if plan.steps_are_load_steps:
        steps = f"{plan.steps} load steps of {plan.time_step:.4g} s, times without cracks"
    if plan.steps_are_path_steps:
        steps = f"about {plan.steps} steps along the equilibrium path"
    if plan.steps_are_cycle_jumps:
        steps = f"at most {plan.steps} steps of jumps of cycles"
    bonds = pair_count(plan.bonds)
    lines = [
        f"{plan.nodes} nodes, {bonds} bonds, {steps}",
        f"about {plan.memory / 1e6:.3g} MB of memory and {plan.wall_time:.3g} s for the steps",
    ]
    if plan.node_count_if_all_split is not None:
        lines.append(
            f"that is the start: cells that split add to it, up to {plan.node_count_if_all_split} nodes"
            " if all of them do"
        )
    commandline.report(plan.report_entries() | {"bonds": bonds}, lines, args)
    return commandline.OK


def _show_what_is_left(path: Path, args: argparse.Namespace) -> int:
    """Show the cost of continuing a run; returns the exit code. Raises ResultsError if it cannot continue."""
    from pdsolve.estimate import estimate_run
    from pdsolve.model import model_of
    from pdsolve.results import Results, StateKind, state_of
    from pdsolve.run.simulation import options_from_metadata

    state = state_of(path)
    lines = [f"{path}: {state.message}"]
    report: dict[str, Any] = {"output": str(path), "state": state.kind.name.lower(), "step": state.step, "left": 0}
    if state.kind not in (StateKind.RUNNING, StateKind.FINISHED):
        with Results.open(path) as results:
            model = model_of(results.model(), str(path))
        plan = estimate_run(model, options_from_metadata(model, state.meta, args.threads))
        steps_left = plan.steps - (state.step or 0)
        seconds = plan.wall_time * steps_left / max(plan.steps, 1)
        lines.append(
            f"{steps_left} of {plan.steps} steps are left, about {plan.memory / 1e6:.3g} MB and {seconds:.3g} s"
        )
        report |= plan.report_entries() | {"wall_time": seconds, "left": steps_left}
    commandline.report(report, lines, args)
    return commandline.OK


def main(argv: Sequence[str] | None = None) -> int:
    """Run pdsolve; returns its exit code."""
    # Before numpy: threads of BLAS spin on the cores of the run, and round otherwise than one thread
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    words = commandline.words(argv)
    if words[:1] == ["study"]:
        from pdsolve.study import command

        return launch.alone("pdsolve study", lambda: command.main(words[1:]))
    if words[:1] == ["fit"]:
        from pdsolve.study import fit_command

        return launch.alone("pdsolve fit", lambda: fit_command.main(words[1:]))
    if nearest(words[0] if words else "", ["study", "fit"], ALIKE) and not Path(words[0]).exists():
        parser().error(f"'{words[0]}' is no file; give a model's file, or one of the words study and fit")
    return launch.together(lambda ranks: _alone(words, ranks), _exits)


def _alone(words: list[str], ranks: Team | None) -> int:
    """Run one command, with the other `ranks` at hand."""
    args = parser().parse_args(words)
    return commandline.run("pdsolve", lambda: _solve(args, ranks), _exits)


def _exits() -> dict[type[Exception], int]:
    from pdmesh.model.document import GridError
    from pdsolve.errors import DeviceLostError
    from pdsolve.model import ModelError
    from pdsolve.results import ResultsError, WriteError
    from pdsolve.run.simulation import NotConvergedError, UnstableError

    bad = commandline.BAD_INPUT
    return {
        GridError: bad,
        ModelError: bad,
        WriteError: commandline.FAILURE,
        ResultsError: bad,
        UnstableError: commandline.UNSTABLE,
        NotConvergedError: commandline.UNSTABLE,
        DeviceLostError: commandline.UNSTABLE,
    }


if __name__ == "__main__":
    sys.exit(main())
