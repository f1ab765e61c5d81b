"""Hostile drawings: refused in one line or harmless; those that are real do their harm as soon as nobody looks."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from hostile_drawings import ATTACKS, BREAKING, PLATE, REAL, Attack

pytest.importorskip("gmsh", exc_type=(ImportError, OSError))

from pdmesh.__main__ import main
from pdmesh.drawing.sandbox import child


def lay(attack: Attack, folder: Path) -> None:
    """Its files; ``touched`` is there, wherever Gmsh runs."""
    for name, content in attack.files.items():
        path = folder / name
        if isinstance(content, str) and content.startswith("to:"):
            path.symlink_to(content.removeprefix("to:"))
        else:
            data = content if isinstance(content, bytes) else content.encode()
            path.write_bytes(data.replace(b"touched", str(folder / "touched").encode()))


def check_refused(attack: Attack, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What is said is one line, and nothing is left behind."""
    lay(attack, folder)
    code = main(list(attack.words))
    out, err = capsys.readouterr()
    assert not (folder / "touched").exists()
    assert "topsecret" not in out + err
    if attack.said:
        assert (code, out) == (2, "")
        assert err.startswith("pdmesh: ")
        assert attack.said in err
        assert err.count("\n") == 1
        assert {path.name for path in folder.iterdir()} == set(attack.files)
    else:
        assert (code, err) == (0, "")


@pytest.mark.slow
@pytest.mark.parametrize("name", ATTACKS)
def test_refused_or_harmless(
    name: str, here: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """By the list alone."""
    monkeypatch.setattr(child, "WALLS", False)
    check_refused(ATTACKS[name], here, capsys)


@pytest.mark.quick_cases(8)
@pytest.mark.parametrize("name", BREAKING)
def test_what_would_break_the_process(name: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    check_refused(BREAKING[name], here, capsys)


@pytest.mark.process
@pytest.mark.quick_cases(1)
@pytest.mark.parametrize("name", REAL)
def test_real(name: str, here: Path) -> None:
    """The proof that the attack is one: it works where the drawing is trusted."""
    attack = ATTACKS[name]
    lay(attack, here)
    main([*attack.words, "--trust", "-q"])
    for _ in range(2000):  # some do it behind one's back
        if (here / "touched").exists():
            return
        time.sleep(0.02)
    pytest.fail("an attack that does nothing")


@pytest.mark.process
def test_python_beside_a_trusted_drawing(here: Path) -> None:
    """A drawing is trusted; what lies beside it is not asked."""
    lay(Attack({"plate.geo": PLATE, "json.py": "open('touched', 'w')\n"}, ""), here)
    assert main(["build", "plate.geo", "--trust", "-q"]) == 0
    assert not (here / "touched").exists()
