"""The command line shared by the three programs: options, exit codes and error messages, shell completion."""

from __future__ import annotations

import argparse
import json
import os
import re
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NoReturn

from pdmesh import VERSION, stopping, trust
from pdmesh.file_kinds import FileKind, mistaken
from pdmesh.files import irregular
from pdmesh.plain_text import UnprintedError, for_line, leave_stdout, print_text, print_to_stderr
from pdmesh.spelling import meant

LIBRARIES = tuple(["gmsh", "matplotlib", "meshio", "msgspec", "numba", "numpy", "pillow", "scipy", "shapely", "tqdm"])
WITHOUT_MEMORY = ("Cannot allocate memory", "cannot allocate memory", "failed to map segment", "can't start new thread")
OK, FAILURE, BAD_INPUT, UNSTABLE = 0, 1, 2, 3
BY_SIGNAL = 128  # an exit code less the number of the signal that ended a program, as shells have it
# What asks a program to end: Ctrl-C, a scheduler or a shutdown, a terminal that is closed, which Windows has not
STOPS = (signal.SIGINT, signal.SIGTERM, *([signal.SIGHUP] if sys.platform != "win32" else []))
INPUTS = (
    "drawing",
    "model",
    "settings",
    "results",
    "reference",
    "compare",
    "beside",
    "measured",
)  # arguments that name files to read
OUTPUTS = ("output", "csv", "surface", "picture")
SHELLS = ("bash", "zsh", "tcsh", "fish", "powershell")  # that completion knows
WORDS_AND_FILES = {
    "fish": "(__fish_complete_path (commandline -ct)) {}",
    "zsh": "{{_files; compadd {}}}",
    "powershell": "_words_and_files",
}
IN_POWERSHELL = """function _words_and_files {{
  param([string]$WordToComplete)
  ('{}' -split ' ') -like "$WordToComplete*"
  _shtab_powershell_compgen_files $WordToComplete
}}
"""
OF_ARGPARSE = tuple(  # its messages in our words
    (re.compile(pattern), words)
    for pattern, words in (
        (r"^argument (?:COMMAND|([^:]+)): ", r"\1: "),
        (r"^: ", ""),
        (r": expected (?:one|at least one|\d+) arguments?$", " has no value; give one"),
        (r": ignored explicit argument ('.*')$", r" takes no value; leave \1 out"),
        (r": not allowed with argument (.*)$", r" cannot be combined with \1; use one of them"),
        (r": invalid (?:int|count) value: ('.*')$", r": cannot use \1; use a whole number"),
        (r": invalid float value: ('.*')$", r": cannot use \1; use a number"),
        (r"^the following arguments are required: (.*)$", r"\1 is missing; give it"),
        (r"^ambiguous option: (.*) could match (.*)$", r"\1 may stand for \2; write it in full"),
    )
)


class Completion(argparse.Action):
    """Print the shell script that completes the program's words."""

    def __call__(self, parser: argparse.ArgumentParser, _: object, shell: Any, __: object = None) -> NoReturn:
        try:
            import shtab
        except ImportError:
            parser.error("--completion needs the package shtab; install it: pip install 'pdsuite[completion]'")
        for word, make_parser in getattr(parser, "others", {}).items():
            # offered as the first word of a command line, followed by the arguments of its own parser
            first = next(action for action in parser._actions if not action.option_strings)
            first.choices = [*(first.choices or ()), word]
            for action in make_parser()._actions:
                names = {name for known in parser._actions for name in known.option_strings or [known.dest]}
                if not names & set(action.option_strings or [action.dest]):
                    parser._add_action(action)
        _complete_files(parser, shtab, str(shell))
        print_text(shtab.complete(parser, shell=str(shell)))
        parser.exit()


def _complete_files(parser: argparse.ArgumentParser, shtab: Any, shell: str) -> None:
    """Mark all path arguments of a parser and of its commands for completion with file names."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                _complete_files(command, shtab, shell)
        elif action.type is Path and action.choices and shell in WORDS_AND_FILES:  # else the first choice alone
            words = " ".join(action.choices)
            action.complete = {  # type: ignore[attr-defined]
                shell: WORDS_AND_FILES[shell].format(words),
                "preamble": {"powershell": IN_POWERSHELL.format(words)},
            }
        elif action.type is Path and action.choices:
            action.choices = [*shtab.Required.FILE, *action.choices]
        elif action.type is Path:
            action.complete = shtab.FILE  # type: ignore[attr-defined]


class UsageError(ValueError):
    """An invalid command line; the message is one line."""


class Interrupted(KeyboardInterrupt):
    """A stop requested by a signal, whose number determines the exit code."""

    def __init__(self, number: int) -> None:
        super().__init__()
        self.number = number


class Parser(argparse.ArgumentParser):
    """An argument parser that reports an error in one line."""

    others: dict[str, Callable[[], argparse.ArgumentParser]]  # of words that other parsers take over, for completion
    # How --set gives what an unknown option may mean; "" if it means nothing
    set_by: Callable[[str], str] | None = None

    def __init__(self, **settings: Any) -> None:
        super().__init__(**settings)
        # a value of an option, such as -1us or -5,0,50,20mm, is no option
        self._negative_number_matcher = re.compile(r"-\.?\d")

    def error(self, message: str) -> NoReturn:
        for pattern, words in OF_ARGPARSE:
            message = pattern.sub(words, message)
        self.exit(BAD_INPUT, f"{for_line(f'{self.prog}: {message} (--help says more)')}\n")

    def _print_message(self, message: str, file: Any = None) -> None:
        with suppress(UnprintedError):
            print_text(message, file or sys.stderr, end="")

    def parse_args(self, args: Any = None, namespace: Any = None) -> Any:  # argparse types it in two ways
        arguments, surplus = self.parse_known_args(args, namespace)
        if surplus:
            word, instead = surplus[0].partition("=")[0], "leave it out"
            if word.startswith("-"):
                options = list(self._option_string_actions)
                for action in self._actions:
                    if isinstance(action, argparse._SubParsersAction):  # the options of the chosen command too
                        options += action.choices[getattr(arguments, action.dest)]._option_string_actions
                options = [option for option in options if option.startswith("--")]
                meant_option = meant(word, options, cutoff=1.0) or (self.set_by and self.set_by(word))
                if option_name := meant_option or meant(word, options):
                    instead = f"did you mean {option_name}?"
            self.error(f"unknown argument '{surplus[0]}'; {instead}")
        return arguments

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is None or value in action.choices:
            return
        choices = list(map(str, action.choices))
        near = meant(str(value), choices)
        instead = f"did you mean '{near}'?" if near else f"use one of {', '.join(choices)}"
        raise argparse.ArgumentError(action, f"'{value}' is unknown; {instead}")


class _Version(argparse.Action):
    """Print the versions of the program and its libraries, which are looked up only then."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        libraries = (f"{name} {version or 'missing'}" for name, version in dependencies().items())
        python = ".".join(map(str, sys.version_info[:3]))
        print_text(f"{parser.prog} {VERSION}\nPython {python}, {', '.join(libraries)}")
        parser.exit(OK)


def dependencies() -> dict[str, str | None]:
    """Required libraries and their versions; None for a missing one."""
    from importlib import metadata

    versions: dict[str, str | None] = {}
    for name in LIBRARIES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = None
    return versions


def program(name: str, description: str) -> Parser:
    """A parser with ``--version`` and ``--completion``."""
    parser = Parser(prog=name, description=description)
    parser.add_argument(
        "--version", action=_Version, nargs=0, help="print the versions of the program and its libraries"
    )
    parser.add_argument(
        "--completion",
        action=Completion,
        choices=SHELLS,
        help="print a script that completes commands and options in a shell (docs/install.md)",
    )
    return parser


def add_common_options(parser: argparse.ArgumentParser, output: str, with_json: str = "") -> None:
    """Add the options that every command has; `output` is a help text, and `with_json` what --json does besides."""
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help=output)
    parser.add_argument("--force", action="store_true", help="overwrite the output if it exists")
    parser.add_argument("--json", action="store_true", help=f"print the result as JSON on stdout{with_json}")
    parser.add_argument("-q", "--quiet", action="store_true", help="print nothing but errors and warnings")


def add_assignments(parser: argparse.ArgumentParser, option: str, what: str) -> None:
    """Add an `option` that sets a value by its name, and may be repeated; its help is `what`."""
    parser.add_argument(
        option, action="append", default=[], type=_assignment, dest="assignments", metavar="NAME=VALUE", help=what
    )


def add_trust(parser: argparse.ArgumentParser) -> None:
    """Add --trust, for commands that read a drawing: a drawing may be a program or run one."""
    said = "run a scene in Python, or read a drawing that runs commands or reads other files"
    parser.add_argument("--trust", action="store_true", help=said)


def _assignment(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals or not name.strip():
        raise argparse.ArgumentTypeError(f"cannot read '{text}'; use NAME=VALUE")
    return name.strip(), value.strip()


def count(text: str) -> int:
    """A whole number from 1, as an option's type."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"cannot use '{text}'; use a whole number from 1")
    return int(text)


def share(text: str) -> float:
    """A share such as 2% or 0.02, as an option's type."""
    try:
        fraction = float(text.removesuffix("%")) / (100 if text.endswith("%") else 1)
    except ValueError:
        fraction = -1.0
    if not 0 < fraction < 1:
        raise argparse.ArgumentTypeError(f"cannot read '{text}'; use a share such as 2% or 0.02")
    return fraction


def expect(path: Path, *kinds: FileKind) -> None:
    """Raise UsageError for a file that is surely none of these kinds; the message names the command for it."""
    said = mistaken(path, *kinds)
    if said is not None:
        raise UsageError(said)


def expect_other_outputs(args: argparse.Namespace) -> None:
    """Raise UsageError if a file that the user names for output is one that the command reads, or another output.

    `pdmesh build` alone may write a grid file in place.
    """
    in_place = getattr(args, "command", None) == "build" and args.drawing.suffix.lower() == ".json"
    inputs = [path for name in INPUTS for path in paths_of(args, name) if not (in_place and name == "drawing")]
    options: dict[str, str] = {}  # by the file that each names
    for option, output in ((name, path) for name in OUTPUTS for path in paths_of(args, name)):
        first = options.setdefault(os.path.realpath(output), option)
        if first != option:
            raise UsageError(f"{output} is named by --{first} and by --{option}; give each a file of its own")
        with suppress(OSError):  # no file yet
            if any(path.samefile(output) for path in inputs):
                raise UsageError(f"{output} is an input of this command; name another file to write to")


def paths_of(args: argparse.Namespace, name: str) -> list[Path]:
    """The paths that the option or argument `name` has; none if the command does not have it."""
    value = getattr(args, name, None)
    return [Path(path) for path in (value if isinstance(value, list) else [value]) if path is not None]


def output_path(named_path: Path | None, source: Path, suffix: str, force: bool, is_companion: bool = False) -> Path:
    """Output path: `named_path`, or the source's name with the new suffix in the current folder.

    A link is followed where the user named it: not by default, nor for its companion (`is_companion`). Raises
    UsageError if a file exists and `force` is not set, if it is no regular file, or if the folder is missing.
    """
    if not source.name:
        raise UsageError(f"{source} is a folder; name a file")
    path = named_path if named_path is not None else Path(source.name).with_suffix(suffix)
    try:
        irregular_kind = irregular(path)
    except OSError as error:  # a name that is too long, links in a ring
        raise UsageError(f"{path}: {error.strerror}") from None
    if suffix != ".json" and path.exists() and source.exists() and path.samefile(source):
        raise UsageError(f"{path} is the input itself; name another file to write to")
    if path.is_dir() or not path.parent.is_dir():
        raise UsageError(
            f"{path}: {'this is a folder' if path.is_dir() else f'no folder {path.parent}'}; name a file in an"
            " existing folder"
        )
    if irregular_kind is not None:
        raise UsageError(f"{path} is {irregular_kind}, not a regular file, and is not overwritten; name another file")
    if path.exists() and not force:
        raise UsageError(f"{path} already exists; use --force to overwrite it")
    if path.is_symlink() and (named_path is None or is_companion):
        how = "remove it" if is_companion else "-o follows it"
        raise UsageError(f"{path} is a link; {how}")
    return path


def report(result: dict[str, Any], lines: Sequence[str], args: argparse.Namespace) -> None:
    """Print a command's result on stdout: as JSON, as lines for a reader, or not at all."""
    if args.json:
        print_text(json.dumps(result, indent=2, allow_nan=False))
    elif not args.quiet:
        print_text("\n".join(map(for_line, lines)))


def note(message: str, args: argparse.Namespace) -> None:
    """Print a message on stderr, unless --quiet. One that a result may be wrong is for `warn`."""
    if not args.quiet:
        print_to_stderr(message)


def warn(message: str) -> None:
    """Print a message on stderr that a result may be wrong or lacks something, also with --quiet."""
    print_to_stderr(message)


@contextmanager
def warnings_as_notes(name: str, args: argparse.Namespace, *kinds: type[Warning]) -> Iterator[None]:
    """A context that prints warnings of these kinds as lines of the program `name`, each once."""
    with warnings.catch_warnings():
        for kind in kinds:
            warnings.simplefilter("always", category=kind)
        warnings.showwarning = _shown_once(name, args.quiet)
        yield


def _shown_once(name: str, quiet: bool = False) -> Callable[..., None]:
    """A replacement of `warnings.showwarning` that prints each warning once as a line.

    If `quiet`, it leaves out those that only inform, whose class has `informs`: others mean that a result may be wrong.
    """
    said = set()

    def show(message: Warning | str, *_: Any, **__: Any) -> None:
        if not (quiet and getattr(message, "informs", False)) and str(message) not in said:
            said.add(str(message))
            print_to_stderr(f"{name}: warning: {message}")

    return show


def words(argv: Sequence[str] | None) -> list[str]:
    """The words of a command line: the given ones, or this process's own after `trust.settle`.

    Outside of `run`, where nothing is to be saved, Ctrl-C then ends the process at once, as other signals do.
    """
    if argv is not None:
        return list(argv)
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    trust.settle()
    return sys.argv[1:]


def run(name: str, command: Callable[[], int], exits: Callable[[], dict[type[Exception], int]]) -> int:
    """Run `command`; an expected error becomes one line on stderr and its exit code, a TrustWarning one line.

    `exits` returns the exit codes of expected errors. It is called only after an error, so that it may import their
    modules.
    """
    with _interrupts(name) as interrupts, _trust_warnings(name):
        try:
            try:
                check_environment()
                if trust.dropped:
                    warnings.warn(trust.describe_dropped(trust.dropped), trust.TrustWarning, stacklevel=1)
                return command()
            except (UnprintedError, Interrupted):
                raise
            except Exception as error:
                if interrupts:
                    raise KeyboardInterrupt from error
                code, message = said(error, exits)  # whose imports may be interrupted
        except UnprintedError as error:
            leave_stdout()
            if error.is_closed:
                return OK
            code, message = FAILURE, str(error)
        except Interrupted as stop:
            code, message = _stopped(stop.number)
        except KeyboardInterrupt:
            code, message = _stopped(*interrupts[:1])
    print_to_stderr(f"{name}: {' '.join(message.split())}")
    return code


def check_environment() -> None:
    """Raise UsageError for environment variables that make the libraries fail."""
    for name, low, high in (("NUMBA_NUM_THREADS", 1, 4096), ("SOURCE_DATE_EPOCH", 0, 253402300799)):
        text = os.environ.get(name, "")
        if text and not (text.isascii() and text.isdecimal() and low <= int(text[:20]) <= high):
            raise UsageError(f"{name} is '{text[:40]}'; set it to a whole number from {low} to {high}, or unset it")


def expect_memory(least: int) -> None:
    """Raise MemoryError if the process may use fewer bytes of address space than `least` (`ulimit -v`)."""
    if sys.platform != "win32":
        import resource

        most = resource.getrlimit(resource.RLIMIT_AS)[0]
        if most != resource.RLIM_INFINITY and most < least:
            raise MemoryError


def _stopped(number: int = signal.SIGINT) -> tuple[int, str]:
    by = "" if number == signal.SIGINT else f" by {signal.Signals(number).name}"
    return BY_SIGNAL + number, f"interrupted{by}"


@contextmanager
def _trust_warnings(name: str) -> Iterator[None]:
    """A context that prints each TrustWarning once; other warnings are shown as usual."""
    with warnings.catch_warnings():
        warnings.simplefilter("always", trust.TrustWarning)
        show, show_trust = warnings.showwarning, _shown_once(name)

        def tell(message: Warning | str, category: type[Warning], *rest: Any, **more: Any) -> None:
            (show_trust if issubclass(category, trust.TrustWarning) else show)(message, category, *rest, **more)

        warnings.showwarning = tell
        yield


def said(error: Exception, exits: Callable[[], dict[type[Exception], int]]) -> tuple[int, str]:
    """Exit code and message of an expected error; raises any other."""
    if isinstance(error, UsageError | trust.SettingsError):
        return BAD_INPUT, str(error)
    if _lacks_memory(error):
        return FAILURE, "not enough memory; use fewer nodes, or raise the limit (ulimit -v)"
    if isinstance(error, OSError):
        return FAILURE, f"{error.filename or ''}: {error.strerror or error}".lstrip(": ")
    code = next((code for kind, code in exits().items() if isinstance(error, kind)), None)
    if code is None:
        raise error
    return code, str(error)


def _lacks_memory(error: BaseException | None) -> bool:
    """Whether an error was caused by lack of memory, also where a library has wrapped it."""
    while error is not None:
        if isinstance(error, MemoryError) or any(word in str(error) for word in WITHOUT_MEMORY):
            return True
        error = error.__cause__ or (None if error.__suppress_context__ else error.__context__)
    return False


@contextmanager
def _interrupts(name: str) -> Iterator[list[int]]:
    """A context that collects the signals received, as an import can turn one into another error.

    A signal ends the program `name` also where it is not back in Python in time.
    """
    came: list[int] = []

    def interrupt(number: int, _: object) -> None:
        came.append(number)
        raise KeyboardInterrupt

    if threading.current_thread() is not threading.main_thread():
        yield came
        return
    usual = (signal.default_int_handler, signal.SIG_DFL)  # no one else listens, nor is no one to
    before = {number: handler for number in STOPS if (handler := signal.getsignal(number)) in usual}

    def line(number: int) -> tuple[int, str]:
        code, message = _stopped(number)
        return code, f"{name}: {message}"

    with stopping.forced_end(frozenset(before), line):
        for number in before:
            signal.signal(number, interrupt)
        try:
            yield came
        finally:
            for number, handler in before.items():
                signal.signal(number, handler)
