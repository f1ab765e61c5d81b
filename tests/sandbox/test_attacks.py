"""Hostile drawings: refused in one line or harmless; those that are real do their harm as soon as nobody looks."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from hostile import ATTACKS

pytest.importorskip("gmsh", exc_type=(ImportError, OSError))

from pdmesh.__main__ import main


def lay(files: dict[str, str | bytes], folder: Path) -> None:
    for name, content in files.items():
        path = folder / name
        if isinstance(content, bytes):
            path.write_bytes(content)
        elif content.startswith("to:"):
            path.symlink_to(content.removeprefix("to:"))
        else:
            path.write_bytes(content.encode())


@pytest.mark.parametrize("name", ATTACKS)
def test_refused_or_harmless(name: str, here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    attack = ATTACKS[name]
    lay(attack.files, here)
    code = main(list(attack.words))
    out, err = capsys.readouterr()
    assert not (here / "touched").exists()
    assert "topsecret" not in out + err
    if attack.said:
        assert (code, out) == (2, "")
        assert err.startswith("pdmesh: ")
        assert attack.said in err
        assert err.count("\n") == 1
        assert {path.name for path in here.iterdir()} == set(attack.files)
    else:
        assert (code, err) == (0, "")


@pytest.mark.parametrize("name", [name for name, attack in ATTACKS.items() if attack.real])
def test_real(name: str, here: Path) -> None:
    """The proof that the attack is one: it works where the drawing is trusted."""
    attack = ATTACKS[name]
    lay(attack.files, here)
    main([*attack.words, "--trust", "-q"])
    for _ in range(100):  # some do it behind one's back
        if (here / "touched").exists():
            return
        time.sleep(0.02)
    pytest.fail("an attack that does nothing")
