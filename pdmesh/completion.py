"""Shell completion: the option `--completion`."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any, NoReturn

from pdmesh.printing import print_text


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
                if not set(action.option_strings) & set(parser._option_string_actions):
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
        elif action.type is Path and action.choices and shell == "zsh":  # offers the first choice alone
            action.complete = {shell: f"{{_files; compadd {' '.join(action.choices)}}}"}  # type: ignore[attr-defined]
        elif action.type is Path and action.choices:
            action.choices = [*shtab.Required.FILE, *action.choices]
        elif action.type is Path:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
