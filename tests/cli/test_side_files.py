"""What every program says of a database, or a study, with a forged journal beside it: no file is touched."""

from __future__ import annotations

import os
import shutil
import struct
from pathlib import Path

import pytest
from messages import mentions

from pdpost.__main__ import main as pdpost
from pdsolve.__main__ import main as pdsolve
from pdsolve.results.side_files import MAGIC
from pdsolve.study.description import read_study
from pdsolve.study.table import Table

MARK = "a file of the user\n"


def forged(database: Path, victim: Path) -> None:
    """Put a hot journal beside a database that names a file of the user as its super-journal."""
    head = database.read_bytes()[:32]
    (page,), (pages,) = struct.unpack_from(">H", head, 16), struct.unpack_from(">I", head, 28)
    name = os.fsencode(victim.resolve())
    end = name + struct.pack(">2I", len(name), sum(name)) + MAGIC
    header = struct.pack(">8s5I", MAGIC, 0, 0, pages, 512, page).ljust(512, b"\0")
    Path(f"{database}-journal").write_bytes(header + struct.pack(">I", 0x40000000 // page + 1) + end)


@pytest.fixture
def victim(here: Path) -> Path:
    """A file of the user."""
    (here / "thesis.txt").write_text(MARK)
    return here / "thesis.txt"


@pytest.mark.parametrize(
    "words",
    [
        ["sql"],
        ["crack"],
        ["report"],
        ["damage"],
        ["verify"],
        ["watch"],
        ["--resume"],
        ["--resume", "--dry-run"],
    ],
    ids=" ".join,
)
def test_no_command_deletes_what_a_journal_names(
    small_results: Path, here: Path, victim: Path, words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    path = Path(shutil.copy(small_results, here / "results.sqlite"))
    before = path.read_bytes()
    forged(path, victim)
    main = pdsolve if words[0] == "--resume" else pdpost
    assert main([words[0], "results.sqlite", *words[1:]]) == 2
    said = capsys.readouterr().err
    assert mentions(said, "results.sqlite-journal", found="super-journal")
    assert said.count("\n") == 1
    assert victim.read_text() == MARK
    assert path.read_bytes() == before
    assert Path("results.sqlite-journal").exists()


def test_nor_does_one_that_reads_a_study(here: Path, victim: Path, capsys: pytest.CaptureFixture[str]) -> None:
    Path("a.geo").write_text("")
    Path("study.toml").write_text('drawing = "a.geo"\nvary.model.G = [1, 2]')
    Table.create(Path("study.sqlite"), read_study(Path("study.toml")), "1.0").close()
    forged(Path("study.sqlite"), victim)
    for words in (["study", "study.sqlite"], ["crack", "study.sqlite"], ["compare", "study.sqlite", "study.sqlite"]):
        assert pdpost(words) == 2
        said = capsys.readouterr().err
        assert mentions(said, "study.sqlite-journal", found="super-journal")
        assert said.count("\n") == 1
    assert victim.read_text() == MARK
