"""The words the three programs share: options, exit codes, and what happens to an error."""

from __future__ import annotations

import argparse
import json
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NoReturn

from pdmesh import VERSION
from pdmesh.files import irregular

LIBRARIES = tuple(["gmsh", "matplotlib", "meshio", "msgspec", "numba", "numpy", "pillow", "scipy", "shapely", "tqdm"])
OK, FAILURE, BAD_INPUT, UNSTABLE, INTERRUPTED = 0, 1, 2, 3, 130


class UsageError(ValueError):
    """A command line that asks for something that cannot be done; the message is one line."""


class Parser(argparse.ArgumentParser):
    """Says in one line what is wrong with a command line."""

    others: dict[str, Callable[[], argparse.ArgumentParser]]  # of words that other parsers take over, for completion

    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f"{self.prog}: {message} (--help says more)\n")


class _Version(argparse.Action):
    """Says which version it is, and of which libraries: they are looked up when they are asked for."""

    def __call__(self, parser: argparse.ArgumentParser, *_: object) -> NoReturn:
        libraries = (f"{name} {version or 'missing'}" for name, version in dependencies().items())
        python = ".".join(map(str, sys.version_info[:3]))
        print(f"{parser.prog} {VERSION}\nPython {python}, {', '.join(libraries)}")
        parser.exit(OK)


class _Completion(argparse.Action):
    """Prints what lets a shell complete the program's words."""

    def __call__(self, parser: argparse.ArgumentParser, _: object, shell: Any, __: object = None) -> NoReturn:
        try:
            import shtab
        except ImportError:
            parser.error("--completion: found no package shtab, expected it: pip install 'pdsuite[completion]'")
        for word, other in getattr(parser, "others", {}).items():
            _complete_word(parser, word, other())
        _complete_files(parser, shtab)
        print(shtab.complete(parser, shell=str(shell)))
        parser.exit(OK)


def _complete_word(parser: argparse.ArgumentParser, word: str, other: argparse.ArgumentParser) -> None:
    """Let the first word of a command line be `word` too, and what `other` takes follow it."""
    first = next(action for action in parser._actions if not action.option_strings)
    first.choices = [*(first.choices or ()), word]
    for action in other._actions:
        if not set(action.option_strings) & set(parser._option_string_actions):
            parser._add_action(action)


def _complete_files(parser: argparse.ArgumentParser, shtab: Any) -> None:
    """Mark all words of a parser that are paths, those of its commands too."""
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                _complete_files(command, shtab)
        elif action.type is Path and action.choices:
            action.choices = [*shtab.Required.FILE, *action.choices]
        elif action.type is Path:
            action.complete = shtab.FILE  # type: ignore[attr-defined]


def dependencies() -> dict[str, str | None]:
    """The libraries that are needed, and their versions; None of one that is missing."""
    from importlib import metadata

    found: dict[str, str | None] = {}
    for name in LIBRARIES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = None
    return found


def program(name: str, description: str) -> Parser:
    """A parser with ``--version`` and ``--completion``."""
    parser = Parser(prog=name, description=description)
    parser.add_argument("--version", action=_Version, nargs=0, help="say which version it is, and of which libraries")
    parser.add_argument(
        "--completion",
        action=_Completion,
        choices=("bash", "zsh", "tcsh"),
        help="print a script that lets a shell complete words (docs/install.md)",
    )
    return parser


def add_common_options(parser: argparse.ArgumentParser, output: str, assignment: str) -> None:
    """The options every command has; `output` and `assignment` say what they mean here."""
    parser.add_argument("-o", "--output", type=Path, metavar="FILE", help=output)
    parser.add_argument("--force", action="store_true", help="overwrite the output if it exists")
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        type=_assignment,
        dest="assignments",
        metavar="NAME=VALUE",
        help=assignment,
    )
    parser.add_argument("--json", action="store_true", help="print the result as JSON on stdout")
    parser.add_argument("-q", "--quiet", action="store_true", help="print nothing but errors")


def _assignment(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals or not name.strip():
        raise argparse.ArgumentTypeError(f"found '{text}', expected NAME=VALUE")
    return name.strip(), value.strip()


def share(text: str) -> float:
    """A share such as 2% or 0.02, as an option's type."""
    try:
        found = float(text.removesuffix("%")) / (100 if text.endswith("%") else 1)
    except ValueError:
        found = -1.0
    if not 0 < found < 1:
        raise argparse.ArgumentTypeError(f"found '{text}', expected a share such as 2% or 0.02")
    return found


def output_path(given: Path | None, source: Path, suffix: str, force: bool) -> Path:
    """Where to write: `given`, or the source's name with the new suffix in the current folder.

    Raises UsageError if something is there already and `force` is not set, if it is no regular file, or if the folder
    is missing.
    """
    if not source.name:
        raise UsageError(f"{source}: found a folder, expected a file")
    path = given if given is not None else Path(source.name).with_suffix(suffix)
    try:
        found = irregular(path)
    except OSError as error:  # a name that is too long, links in a ring
        raise UsageError(f"{path}: {error.strerror}") from None
    if source.suffix != suffix and path.exists() and source.exists() and path.samefile(source):
        raise UsageError(f"{path}: found the input itself, expected another file to write to")
    if path.is_dir() or not path.parent.is_dir():
        raise UsageError(f"{path}: found {'a' if path.is_dir() else 'no'} folder, expected a file's name in a folder")
    if found is not None:
        raise UsageError(f"{path}: found {found}, expected a regular file or none; nothing else is written to")
    if path.exists() and not force:
        raise UsageError(f"{path}: found a file there already, expected none (--force overwrites it)")
    return path


def report(result: dict[str, Any], lines: Sequence[str], args: argparse.Namespace) -> None:
    """Print a command's result on stdout: as JSON, as lines for a reader, or not at all."""
    if args.json:
        print(json.dumps(result, indent=2, allow_nan=False))
    elif not args.quiet:
        print("\n".join(lines))


def note(message: str, args: argparse.Namespace) -> None:
    """Tell the user something on stderr, unless quiet."""
    if not args.quiet:
        print(message, file=sys.stderr)


def run(name: str, command: Callable[[], int], exits: Callable[[], dict[type[Exception], int]]) -> int:
    """Run `command`; an error to expect becomes one line on stderr and its exit code.

    `exits` gives the exit codes of the errors to expect; it is asked only when there is one, so that it may
    import what raises them.
    """
    with _interrupts() as interrupts:
        try:
            return command()
        except KeyboardInterrupt:
            code, message = INTERRUPTED, "interrupted"
        except Exception as error:
            code, message = (INTERRUPTED, "interrupted") if interrupts else _said(error, exits)
    print(f"{name}: {' '.join(message.split())}", file=sys.stderr)
    return code


def _said(error: Exception, exits: Callable[[], dict[type[Exception], int]]) -> tuple[int, str]:
    """Exit code and message of an error to expect; raises any other."""
    if isinstance(error, UsageError):
        return BAD_INPUT, str(error)
    if isinstance(error, OSError):
        return FAILURE, f"{error.filename or ''}: {error.strerror or error}".lstrip(": ")
    code = next((code for kind, code in exits().items() if isinstance(error, kind)), None)
    if code is None:
        raise error
    return code, str(error)


@contextmanager
def _interrupts() -> Iterator[list[int]]:
    """The interrupts that came: a library that is being imported may make another error of one."""
    came: list[int] = []

    def interrupt(number: int, _: object) -> None:
        came.append(number)
        raise KeyboardInterrupt

    listens = signal.getsignal(signal.SIGINT) is signal.default_int_handler  # no one else does, nor is no one to
    if not listens or threading.current_thread() is not threading.main_thread():
        yield came
        return
    signal.signal(signal.SIGINT, interrupt)
    try:
        yield came
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
