"""Options shared by the commands that compute numbers: --json, --csv, and when a picture is drawn."""

from __future__ import annotations

import argparse
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pdmesh import commandline
from pdmesh.plain_text import for_csv
from pdpost.commands.shared import (
    add_csv,
    add_journal,
    add_picture_command,
    write_csv,
)

if TYPE_CHECKING:
    from pdpost.commands.shared import Commands


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
