"""How large the packages are, and through how many of their files a model goes until it takes its first step.

    python -m benchmarks.size

Lines are all lines of Python. The files are those that have a function called between `simulate` and the first step of
a small plate of brittle bonds; functions that are compiled are not seen.
"""

from __future__ import annotations

import sys
import threading
from pathlib import Path
from types import FrameType

from benchmarks.models import model_of
from pdmesh import Material, Run, Scene, box
from pdsolve import Model, simulate
from pdsolve.lattice.march import LatticeMarch

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ("pdmesh", "pdsolve", "pdpost")


class FirstStep(Exception):
    """The run is where it is followed to."""


def lines(package: str) -> tuple[int, int, int]:
    """The files of a package, their lines, and the lines of the longest."""
    counts = [len(path.read_text(encoding="utf-8").splitlines()) for path in (ROOT / package).rglob("*.py")]
    return len(counts), sum(counts), max(counts)


def small_plate() -> Model:
    """A pulled plate with a pre-crack, of 50 nodes."""
    plate = Scene(box(0, 0, 0.1, 0.05), 1e-2, Material(E=65e9, rho=2235, G0=204), run=Run(duration=1e-5))
    plate = plate.crack([(0, 0.026), (0.05, 0.026)]).load("top", traction=(0, 12e6)).load("bottom", traction=(0, -12e6))
    return model_of(plate)


def followed(model: Model) -> list[str]:
    """The files of the packages, from the checkout's folder, that a model goes through until its first step."""
    simulate(model).close()  # what is compiled and imported is there
    files: set[str] = set()

    def called(frame: FrameType, event: str, _: object) -> None:
        if event == "call":
            files.add(frame.f_code.co_filename)
            if (
                frame.f_code is LatticeMarch.advance.__code__
                and frame.f_locals["end_step"] > frame.f_locals["first_step"]
            ):
                raise FirstStep

    threading.setprofile(called)
    sys.setprofile(called)
    try:
        simulate(model)
    except FirstStep:
        pass
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    ours = {Path(file) for file in files}
    names = (str(path.relative_to(ROOT)) for path in ours if path.is_relative_to(ROOT) and path.suffix == ".py")
    return sorted(name for name in names if name.startswith(PACKAGES))


def main() -> None:
    """Print both."""
    total = 0
    for package in PACKAGES:
        files, count, longest = lines(package)
        total += count
        print(f"{package}: {count} lines in {files} files, the longest of {longest}")
    print(f"together: {total} lines")
    files = followed(small_plate())
    print(f"{len(files)} files from `simulate` to the first step:", *files, sep="\n  ")


if __name__ == "__main__":
    main()
