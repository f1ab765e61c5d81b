"""Several processes compile into one cache: each entry of each is kept, and none is compiled twice."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from plates import ROOT

from pdsolve.codegen import jit_cache
from pdsolve.codegen.jit_cache import cached_njit

KERNEL = """
import sys, time
import numpy as np
from numba import njit
from numba.core import event
from pdsolve.codegen.jit_cache import _Entries, cached_njit

count = 0


class Compiled(event.Listener):
    def on_start(self, happened):
        global count
        count += 1

    def on_end(self, happened):
        pass


@cached_njit()
def twice(x):
    return x + x


njit(lambda x: x + 1)(1)  # what compiling takes is there
save, load = _Entries.save, _Entries._load_index
writes = False


def slow(entries):
    found = load(entries)
    if writes:
        time.sleep(0.3)  # the other process reads the same index meanwhile, unless it waits
    return found


def saved(entries, key, data):
    global writes
    writes = True
    save(entries, key, data)
    writes = False


_Entries.save, _Entries._load_index = saved, slow
event.register("numba:compile", Compiled())
print("ready", flush=True)
sys.stdin.readline()
for name in sys.argv[1:]:
    assert twice(getattr(np, name)(3)) == 6
print(count)
"""


Begun = Callable[..., subprocess.Popen[str]]


@pytest.fixture
def begun(tmp_path: Path) -> Begun:
    """Begins a process that compiles `twice` for types, once it may."""
    (tmp_path / "kernel.py").write_text(KERNEL)
    (tmp_path / "cache").mkdir()
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": os.pathsep.join(sys.path)}

    def begin(*names: str) -> subprocess.Popen[str]:
        words = [sys.executable, str(tmp_path / "kernel.py"), *names]
        pipe = subprocess.PIPE
        return subprocess.Popen(words, env=environment, stdin=pipe, stdout=pipe, text=True)

    return begin


def counts(processes: list[subprocess.Popen[str]]) -> list[int]:
    """How often each of them compiles, when they do so at the same time."""
    for process in processes:
        assert process.stdout is not None
        assert process.stdout.readline() == "ready\n"
    for process in processes:
        assert process.stdin is not None
        process.stdin.write("go\n")
        process.stdin.flush()
    return [int(process.communicate()[0]) for process in processes]


@pytest.mark.endurance
@pytest.mark.skipif(sys.platform == "win32", reason="an entry may be lost there, and is compiled again")
def test_two_processes_that_compile_at_the_same_time_lose_no_entry(tmp_path: Path, begun: Begun) -> None:
    types = [("int64", "float64"), ("int32", "float32")]
    both = [begun(*names) for names in types]
    assert counts(both) == [2, 2]
    third = begun(*types[0], *types[1])
    assert third.communicate("go\n")[0] == "ready\n0\n"
    assert len(list((tmp_path / "cache").rglob("*.nbc"))) == 4
    assert list((tmp_path / "cache").rglob("*.tmp.*")) == []


@pytest.mark.slow
@pytest.mark.endurance
@pytest.mark.skipif(sys.platform == "win32", reason="both compile it there")
def test_two_processes_that_need_one_kernel_compile_it_once(tmp_path: Path, begun: Begun) -> None:
    assert sum(counts([begun("int64"), begun("int64")])) == 1
    assert len(list((tmp_path / "cache").rglob("*.nbc"))) == 1


LOADED = """
import sys
from pdsolve.codegen.jit_cache import cached_njit


@cached_njit()
def twice(x):
    return x + x


assert twice(3) == 6
print("numba.np.arraymath" in sys.modules)
assert sys.argv[1:] == [] or twice(2.5) == 5  # compiles, after something was loaded
"""


@pytest.mark.slow
def test_a_process_that_only_loads_kernels_loads_no_compiler(tmp_path: Path) -> None:
    """Of numba's own functions, which take as long as all kernels of a run; one that compiles afterwards has them."""
    (tmp_path / "loaded.py").write_text(LOADED)
    (tmp_path / "cache").mkdir()
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": os.pathsep.join(sys.path)}
    said = [
        subprocess.run(
            [sys.executable, str(tmp_path / "loaded.py"), *words],
            env=environment,
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for words in ((), (), ("more",))
    ]
    assert said == ["True\n", "False\n", "False\n"]


def twice(x: float) -> float:
    return x + x


def test_kernels_leave_python_to_other_threads() -> None:
    """One of them ends the program for a signal; others write results."""
    for options in ({}, {"error_model": "numpy"}):
        kernel: Any = cached_njit(**options)(twice)
        assert kernel.targetoptions["nogil"]
    for package in ("pdmesh", "pdsolve", "pdpost"):
        for file in (ROOT / package).rglob("*.py"):
            assert "nogil=False" not in file.read_text("utf-8"), file


def test_a_compilation_that_was_interrupted_gives_its_lock_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The next attempt of the same process does not wait for it."""
    path = tmp_path / "thrice.py"
    path.write_text("def thrice(x):\n    return 3 * x\n")
    spec = importlib.util.spec_from_file_location("thrice", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    thrice: Any = cached_njit()(module.thrice)
    lock, waits = jit_cache._lock, []

    def lock_at_once(handle: int, wait: float) -> None:
        try:
            lock(handle, 0.0)
        except BlockingIOError:
            waits.append(wait)
            raise

    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(jit_cache, "_lock", lock_at_once)
    with monkeypatch.context() as during:
        during.setattr(thrice._compiler, "compile", interrupt)
        with pytest.raises(KeyboardInterrupt):
            thrice(2)
    assert thrice(2) == 6
    assert waits == []
