"""How long a user waits for `pdsolve` from shell to shell: the Duran plate with five frames, and a word of help.

`python -m benchmarks.processes` prints it; `benchmarks.speed` writes it down with the rest.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

from benchmarks.models import scene_model
from benchmarks.timing import environment, timed

FRAMES = 5
TIMES = 7


def processes() -> dict[str, float]:
    """Seconds from shell to shell: the least of some, but for the first run, which compiles."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        model = scene_model("duran50.geo")
        (folder / "duran50.json").write_text(model.to_json(), encoding="utf-8")
        variables = environment(NUMBA_CACHE_DIR=str(folder / "compiled"))

        def seconds(*arguments: str) -> float:
            words = [sys.executable, *arguments]
            run = partial(subprocess.run, words, check=True, stdout=subprocess.DEVNULL, env=variables)
            return timed(run, time.perf_counter)

        def least(*arguments: str) -> float:
            return min(seconds(*arguments) for _ in range(TIMES))

        files = str(folder / "duran50.json"), "-o", str(folder / "duran50.sqlite")
        run = "-m", "pdsolve", *files, "--force", "-q", "--every", str(model.settings.run.steps // FRAMES)
        return {
            "pdsolve, compiling": seconds(*run),
            f"pdsolve, compiled before, {FRAMES} frames": least(*run),
            "pdsolve --help": least("-m", "pdsolve", "--help"),
            "import numba": least("-c", "import numba"),
        }


if __name__ == "__main__":
    for what, seconds in processes().items():
        print(f"{what}: {seconds:.2f} s")
