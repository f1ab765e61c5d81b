"""The folder of what is compiled is the user's alone, wherever there can be one."""

from __future__ import annotations

import os
import stat
import sys
import tempfile
from pathlib import Path

import pytest

from pdmesh import trust

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="folders have no modes there")

found = trust.private_folder.__wrapped__  # not the one of this process


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current folder."""
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    return tmp_path / "here"


@pytest.fixture
def places(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[Path]:
    """Where there can be one, the best first."""
    for number, name in enumerate(("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "")):
        (tmp_path / str(number)).mkdir()
        if name:
            monkeypatch.setenv(name, str(tmp_path / str(number)))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "2"))
    return [tmp_path / f"{number}" / f"pdsuite-{os.getuid()}" for number in range(3)]


def mode(folder: Path) -> int:
    return stat.S_IMODE(folder.lstat().st_mode)


def test_it_is_where_the_user_says_with_no_rights_of_others(places: list[Path]) -> None:
    before = os.umask(0)
    try:
        assert found() == (places[0], True)
    finally:
        os.umask(before)
    assert mode(places[0]) == 0o700
    (places[0] / "kernel").write_text("mine")
    assert found() == (places[0], True)
    assert (places[0] / "kernel").exists()


@pytest.mark.parametrize(("rights", "stays"), [(0o755, True), (0o777, False), (0o770, False), (0o1777, False)])
def test_rights_of_others_are_taken_away_and_what_they_may_have_put_there_goes(
    places: list[Path], tmp_path: Path, rights: int, stays: bool
) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "mine").write_text("mine")
    places[0].mkdir()
    (places[0] / "kernels").mkdir()
    (places[0] / "kernels" / "a.nbi").write_text("whose?")
    (places[0] / "link").symlink_to(tmp_path / "elsewhere")
    places[0].chmod(rights)
    assert found() == (places[0], True)
    assert mode(places[0]) == 0o700
    assert (places[0] / "kernels").exists() == (places[0] / "link").is_symlink() == stays
    assert (tmp_path / "elsewhere" / "mine").exists()


def test_a_link_or_a_file_in_its_place_is_not_followed(places: list[Path], tmp_path: Path) -> None:
    (tmp_path / "others").mkdir()
    (tmp_path / "others").chmod(0o755)  # whatever the umask
    places[0].symlink_to(tmp_path / "others")
    places[1].write_text("a file")
    assert found() == (places[2], True)
    assert mode(tmp_path / "others") == 0o755
    assert list((tmp_path / "others").iterdir()) == []


def test_a_folder_of_another_user_is_left_alone(
    places: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where all are another's, it is a new one that goes with the process."""
    other = os.getuid() + 1
    monkeypatch.setattr(os, "getuid", lambda: other)
    theirs = [place.with_name(f"pdsuite-{other}") for place in places]
    for folder in theirs:
        folder.mkdir()
        folder.chmod(0o777)
        (folder / "kernel").write_text("theirs")
    folder, stays = found()
    assert not stays
    assert folder.parent == tmp_path / "2"
    assert folder not in theirs
    assert mode(folder) == 0o700
    assert all(mode(folder) == 0o777 and (folder / "kernel").exists() for folder in theirs)


def test_a_user_without_a_home_has_one_for_temporary_files(
    places: list[Path], here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import pwd

    def nobody(user: int) -> object:
        raise KeyError(user)

    for name in ("HOME", "NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(pwd, "getpwuid", nobody)
    assert found() == (places[2], True)
    assert list(here.glob("~*")) == []


def test_places_that_are_not_absolute_or_cannot_be_written_to_are_passed_over(
    places: list[Path], here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("NUMBA_CACHE_DIR", "kernels")
    assert found() == (places[1], True)
    assert not Path("kernels").exists()
    Path("file").write_text("")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(here / "file"))
    assert found() == (places[1], True)
