"""Files beside databases, tables and folders of studies of anyone's making: one line or an answer, no file touched."""

from __future__ import annotations

from pathlib import Path

import pytest
from forged_databases import apart
from forged_side_files import KINDS, forged_cases, prepare


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with sound files in ``sound``."""
    folder = tmp_path_factory.mktemp("beside")
    (folder / "sound").mkdir()
    prepare(folder / "sound")
    return folder


@pytest.mark.quick_cases(5)
@pytest.mark.parametrize("number", [*range(1, 8), 9, 10, 11])  # 0 and 8 draw a report
def test_some_forgeries(sound: Path, number: int) -> None:
    """One case each, of all kinds."""
    assert forged_cases(sound, 3, 1, number) == []


@pytest.mark.endurance
def test_hundreds_of_forgeries(sound: Path) -> None:
    assert apart("forged_cases", sound, 4, 300, module="forged_side_files", limit=3000) == []


def test_every_kind_has_its_turns() -> None:
    from forged_side_files import TURNS

    assert set(TURNS) == set(KINDS)
