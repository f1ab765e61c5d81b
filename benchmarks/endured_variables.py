"""Environment variables that lead to a library of the current folder or of others: no command loads it."""

from __future__ import annotations

import sys
from pathlib import Path

from benchmarks.endured import Part, Until
from benchmarks.kills import module_of_tests
from benchmarks.kinds_of_run import KINDS
from pdsolve.run.simulation import simulate

OF_LINKER = ("LD_AUDIT", "LD_PRELOAD")  # the dynamic linker loads these before any line of a program runs
ENDED = (0, 2)  # an answer, or a line
EVERY = 4  # of the forgeries, one in so many is tried by a command; the unit tests try all in one process


def variables(folder: Path, until: Until) -> Part:
    """Commands with hostile variables, beside a library in the current folder that makes a file when loaded."""
    hostile = module_of_tests("hostile_variables")
    if hostile.COMPILER is None or sys.platform != "linux":
        return Part(0, 1, note="no C compiler, or not Linux")
    here = folder / "here"
    here.mkdir()
    mark = hostile.plant_library(here)
    model, options = KINDS["bonds"]()
    (here / "plate.json").write_text(model.to_json(), encoding="utf-8")
    simulate(model, here / "small.sqlite", options).close()
    chosen = [forgery for forgery in hostile.FORGERIES[::EVERY] if forgery[0].name not in OF_LINKER]
    marks, traces, wrong, tried = [], 0, 0, 0
    for number, (variable, form) in enumerate(chosen):
        if not until(30.0):
            break
        scratch = folder / str(number)
        scratch.mkdir()
        value = hostile.FORMS[form](variable, here, scratch)
        ended = hostile.run_command(hostile.COMMANDS[number % 2], here, {variable.name: value})
        tried += 1
        traces += "Traceback" in ended.stderr
        wrong += ended.returncode not in ENDED
        if mark.exists():
            marks.append(f"{variable.name}, {form}")
            mark.unlink()
    return Part(
        tried, len(chosen), len(marks), traces, wrong, f"code ran by {'; '.join(marks)}" if marks else "no code ran"
    )
