"""The digest of a grid file: what changes after it was written is said, and a file that was changed is still used."""

from __future__ import annotations

import json
import random
import re
import threading
import time
import warnings
from pathlib import Path
from unittest.mock import Mock

import pytest

from pdmesh import Circle, Material, Scene, box
from pdmesh.__main__ import main as pdmesh
from pdmesh.grid.building import build
from pdmesh.model import document
from pdmesh.model.document import GridError, GridWarning, encode, read_file
from pdsolve.__main__ import main as pdsolve
from pdsolve.model import ModelError, read_model

TEXT = encode(
    build(
        Scene(box(0, 0, 0.02, 0.012), 1e-3, Material(E=65e9, rho=2235.0, G0=204.0))
        .hole(Circle(0.014, 0.006, 0.002))
        .crack([(0, 0.0055), (0.006, 0.0055)])
        .load("top", traction=(0, 1e6))
        .fix("bottom", y=0.0)
    ).document
)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    found = tmp_path / "plate.json"
    found.write_bytes(TEXT)
    return found


def test_what_was_written_is_read_without_a_word(path: Path) -> None:
    document = read_file(path)
    assert document.digest == ""
    assert encode(document) == TEXT


def test_every_changed_digit_is_noticed(path: Path) -> None:
    chance, places = random.Random(7), [found.start() for found in re.finditer(rb"[0-9]", TEXT)]
    for place in chance.sample(places, 120):
        changed = bytearray(TEXT)
        changed[place] = ord("0") + (changed[place] - ord("0") + chance.randint(1, 9)) % 10
        path.write_bytes(changed)
        refused = None
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            try:
                read_model(path)
            except (GridError, ModelError) as error:
                refused = error
        assert refused is not None or GridWarning in {one.category for one in said}, (place, changed[place - 9 : place])


def test_line_ends_may_be_converted(path: Path) -> None:
    path.write_bytes(TEXT.replace(b"\n", b"\r\n"))
    read_file(path)


def test_a_file_of_another_program_is_not_compared(path: Path) -> None:
    plain = json.loads(TEXT)
    plain["material"]["E"] *= 2
    path.write_text(json.dumps({name: value for name, value in plain.items() if name != "digest"}, indent=2))
    assert read_file(path).material.E == 130e9


def test_a_file_that_was_written_anew_with_its_digest_is_said(path: Path) -> None:
    path.write_text(json.dumps(json.loads(TEXT), indent=2))
    with pytest.warns(GridWarning, match=r"\$\.digest"):
        read_file(path)


def test_a_name_that_looks_like_the_key_is_none(path: Path) -> None:
    plain = json.loads(TEXT)
    del plain["digest"]
    plain["source"] = '"digest": "'
    path.write_text(json.dumps(plain))
    read_file(path)


def test_programs_say_it_once_and_go_on(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path.write_bytes(TEXT.replace(b'"E":65000000000.0', b'"E":75000000000.0'))
    for call in (
        ("pdmesh", pdmesh, ["info", str(path)]),
        ("pdsolve", pdsolve, [str(path), "--dry-run", "--set", "run.steps=5"]),
    ):
        name, main, words = call
        assert main(words) == 0
        said = [line for line in capsys.readouterr().err.splitlines() if "$.digest" in line]
        assert len(said) == 1
        assert said[0].startswith(f"{name}: warning: {path}: ")


def test_the_digest_of_a_large_file_is_computed_beside_its_reading(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An edit is said, and what goes wrong on either side is raised and leaves no thread."""
    monkeypatch.setattr(document, "LARGE", 0)
    assert encode(read_file(path)) == TEXT
    path.write_bytes(TEXT.replace(b"2235", b"2236"))
    with pytest.warns(GridWarning):
        read_file(path)
    threads = threading.active_count()
    for place, error in (("_matches", MemoryError), ("read_document", KeyboardInterrupt)):
        with monkeypatch.context() as patch:
            patch.setattr(document, place, Mock(side_effect=error))
            with pytest.raises(error):
                read_file(path)
    until = time.monotonic() + 10.0
    while threading.active_count() > threads and time.monotonic() < until:
        time.sleep(1e-3)
    assert threading.active_count() <= threads
