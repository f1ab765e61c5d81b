"""Databases of runs beside a study's table: those that it names, and those of a study that has lost its table."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path

from pdsolve.results import BusyError, EmptyError, Results, holder
from pdsolve.results.side_files import expect_sound
from pdsolve.study.description import Study, StudyError
from pdsolve.study.table import Row

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
    odd = StudyError(f"{runs} has files of other runs than those of this {study.drawing.name}; move them away")
    if runs.is_dir() and not all(NUMBERED.fullmatch(path.name) for path in runs.iterdir()):
        raise odd
    numbers: dict[str, int] = {}
    begin, end = provenance("|", study.digest).split("|")
    for path in databases(runs):
        try:
            with Results.open(path) as results:
                said = str(results.meta().get("provenance"))
        except EmptyError:
            continue
        if not said.startswith(begin) or not said.endswith(end):
            raise odd
        numbers[said.removeprefix(begin).removesuffix(end)] = int(path.stem)
    return numbers


def own_runs(output: Path, runs: Path, rows: Sequence[Row], digest: str) -> list[Path]:
    """The databases in a folder that the rows of the table at `output` name, where nothing else may be.

    `digest` is that of the study's drawing. Raises StudyError for other files, and for results of another run;
    BusyError for a run that is being written; ResultsError for a damaged one.
    """
    named = {row.file.name: row for row in rows if row.file.parent == runs}
    for path in sorted(runs.iterdir()) if runs.is_dir() else ():
        match = NUMBERED.fullmatch(path.name)
        row = None if match is None else named.get(f"{match[1]}.sqlite")
        if row is None or path.is_symlink() or not path.is_file():
            raise StudyError(f"{path} is among the runs of {output.name}, whose table does not name it; move it away")
        if path.name == row.file.name and not _is_run(path, row, digest):
            raise StudyError(f"{path} has results of another run than {output.name} says; move it away")
        expect_sound(row.file)
        if (name := holder(row.file)) is not None:
            raise BusyError(f"{row.file}: a run is writing to it ({name}); wait for its end")
    return [row.file for row in named.values()]


def _is_run(path: Path, row: Row, digest: str) -> bool:
    """Whether a database is empty, or of the run in a row of a table. Raises ResultsError."""
    try:
        with Results.open(path) as results:
            said = results.meta().get("provenance")
    except EmptyError:
        return True
    return said in (provenance(row.key, digest), f"pdsolve study: {row.key}")  # as older ones say
