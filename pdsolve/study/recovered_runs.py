"""Databases of runs whose study has lost its table."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

from pdsolve.results import EmptyError, Results
from pdsolve.study.description import Study, StudyError

NUMBERED = re.compile(r"(\d{4,})\.sqlite(?:-(?:wal|shm|journal|lock))?")


def provenance(key: str, digest: str) -> str:
    """Origin of a run, as stored in its database: the key of its case and the SHA-256 of the study's drawing."""
    return f"pdsolve study: {key} of {digest}"


def databases(runs: Path) -> Iterator[Path]:
    """The databases of runs in their folder, by number."""
    if runs.is_dir():
        for path in sorted(runs.iterdir()):
            if NUMBERED.fullmatch(path.name) and path.suffix == ".sqlite":
                yield path


def kept(runs: Path, study: Study) -> dict[str, int]:
    """Numbers of the runs in a folder by their keys, to rebuild a lost table.

    Raises StudyError for other files or runs of another drawing; ResultsError for a damaged database.
    """
    odd = StudyError(
        f"{runs}: found files in it, expected none before the first run, or runs of this {study.drawing.name} (--force"
        " removes old runs)"
    )
    if runs.is_dir() and not all(NUMBERED.fullmatch(path.name) for path in runs.iterdir()):
        raise odd
    found: dict[str, int] = {}
    begin, end = provenance("|", study.digest).split("|")
    for path in databases(runs):
        try:
            with Results.open(path) as results:
                said = str(results.meta().get("provenance"))
        except EmptyError:
            continue
        if not said.startswith(begin) or not said.endswith(end):
            raise odd
        found[said.removeprefix(begin).removesuffix(end)] = int(path.stem)
    return found
