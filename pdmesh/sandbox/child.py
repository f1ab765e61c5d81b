"""Running the reader: Gmsh's part of reading a drawing, done in an empty folder and a process of its own."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pdmesh.sandbox.copies import Copy
from pdmesh.sandbox.scan import OWN
from pdmesh.shapes import CHORD_TOLERANCE, SceneError

SYSTEM_LIBRARIES = (
    "libgl1 libglu1-mesa libxft2 libxcursor1 libxinerama1 libxrender1 libxfixes3 libxext6 libfontconfig1 libgomp1"
)
WALLS = True  # for all but trusted drawings
ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}  # walls leave no other
PLACE = re.compile(r"'(?:[^']*[/\\])?([0-9]+\.geo)', line ([0-9]+)")  # in Gmsh's messages


def read_copies(
    copies: Mapping[str, Copy], assignments: list[tuple[str, str]], limit: float, tolerance: float = 0.0
) -> dict[str, Any]:
    """What Gmsh finds in copies of which the first is the drawing or the CAD file. Raises SceneError.

    Gmsh has `limit` seconds. `tolerance` is how far a chord of a CAD file may be off its curve, m; 0: by its size.
    """
    first = next(iter(copies))
    with tempfile.TemporaryDirectory(prefix="pdmesh-") as folder:
        for name, copy in copies.items():
            (Path(folder) / name).write_bytes(copy.data)
        job = {
            "path": first,
            "cad": not first.endswith(".geo"),
            "assignments": assignments,
            "tolerance": tolerance,
            "walls": WALLS,
        }
        found = _run(copies[first].path, job, limit, Path(folder))
    found["messages"] = [_in_originals(message, copies) for message in found["messages"]]
    return found


def read_trusted(path: Path, assignments: list[tuple[str, str]], limit: float) -> dict[str, Any]:
    """What Gmsh finds in a drawing where it is, with all that it may do there. Raises SceneError."""
    job = {"path": str(path.resolve()), "cad": False, "assignments": assignments, "tolerance": 0.0, "walls": False}
    return _run(path, job, limit, None)


def _run(path: Path, job: dict[str, Any], limit: float, folder: Path | None) -> dict[str, Any]:
    with tempfile.TemporaryDirectory(prefix="pdmesh-") as aside:
        result, said = Path(aside) / "found.json", Path(aside) / "said"
        command = [sys.executable, "-P", "-m", "pdmesh.sandbox.reader", str(result)]
        work = json.dumps(job | {"chords": CHORD_TOLERANCE, "seconds": limit}).encode()
        environment = os.environ | ONE_THREAD
        try:
            with said.open("wb") as stderr:
                ended = subprocess.run(
                    command,
                    input=work,
                    stdout=subprocess.DEVNULL,
                    stderr=stderr,
                    timeout=limit,
                    check=False,
                    cwd=folder,
                    env=environment,
                ).returncode
        except subprocess.TimeoutExpired:
            raise SceneError(f"{path}: Gmsh was still reading after {limit:g} s, expected it to end") from None
        try:
            found: dict[str, Any] = json.loads(result.read_bytes())
        except (OSError, ValueError):
            raise SceneError(
                f"{path}: Gmsh stopped before the end of the drawing: {_last_words(said, ended)}"
            ) from None
    _check_installed(found)
    return found


def _last_words(said: Path, ended: int) -> str:
    lines = said.read_bytes()[-4000:].decode(errors="replace").strip().splitlines()
    if lines:
        return lines[-1]
    return f"killed by {signal.Signals(-ended).name}" if ended < 0 else "no message"


def _check_installed(found: Mapping[str, Any]) -> None:
    if found["missing"]:
        raise SceneError(
            f"Gmsh is not installed: Python finds no module '{found['missing']}'; this installs it: pip install gmsh"
        )
    if found["library"]:
        raise SceneError(
            f"Gmsh cannot be loaded: {found['library']}; on Debian and Ubuntu this installs what it needs:"
            f" apt-get install {SYSTEM_LIBRARIES}"
        )


def _in_originals(message: str, copies: Mapping[str, Copy]) -> str:
    """Gmsh's message with the files and lines of the user's own, and names as the drawing has them."""

    def place(match: re.Match[str]) -> str:
        copy = copies.get(match[1])
        if copy is None or not 0 < int(match[2]) <= len(copy.origins):
            return match[0]
        return f"'{copy.path}', line {copy.origins[int(match[2]) - 1]}"

    return PLACE.sub(place, message).replace(OWN, "")
