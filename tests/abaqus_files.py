"""Files of Abaqus for tests of the reader: a plate, a part of it, and refusals."""

from __future__ import annotations

import warnings
from pathlib import Path

import pytest

from pdmesh import SceneError
from pdmesh.drawing.abaqus import read_abaqus

PLATE = "*NODE\n1,0,0\n2,1,0\n3,1,1\n4,0,1\n*ELEMENT, TYPE=CPS4\n7,1,2,3,4\n"
PART = f"*PART, NAME=P\n{PLATE}*END PART\n"
PARTS = f"{PART}*ASSEMBLY\n*INSTANCE, NAME=one, PART=P\nROW\n*END INSTANCE\n*END ASSEMBLY\n"
NO_NUMBER = ("inf", "nan", "1e30", "1.7", "9" * 20, "9" * 5000, "+-5", "\u00b2", "1_0", "\u0663", "", "-")


def written(folder: Path, text: str | bytes) -> Path:
    """A file of this text."""
    path = folder / "part.inp"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def refusal(folder: Path, text: str | bytes) -> str:
    """The message for a file that is refused, in one line and without a warning."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(SceneError) as caught:
            read_abaqus(written(folder, text))
    assert len(str(caught.value).splitlines()) == 1
    return str(caught.value)
