"""Kernels that are compiled once and stored on disk, in a folder of the user's own.

numba checks only a kernel's own file, not the files of functions compiled into it: after a change of array sizes there,
an old kernel would write out of bounds. It also stores compiled code, which is executed as found, wherever the
environment or the current folder say. Kernels are therefore stored where `pdmesh.trust` says, under a name derived from
their sources and from the compiling libraries; two checkouts with equal sources share them. A process waits for a
kernel that another one is compiling. numba's own functions are loaded by processes that compile, which takes them as
long as all else that they import.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np
from numba.core.caching import (
    CompileResultCacheImpl,
    FunctionCache,
    IndexDataCacheFile,
    _CacheLocator,
    _SourceFileBackedLocatorMixin,
)
from numba.core.runtime import rtsys

from pdmesh import trust
from pdsolve.codegen import kernel_sources

KEPT, DAY, UNUSED = 8, 86_400.0, 60 * 86_400.0  # states of the sources; s
LIBRARIES = (sys.version, numba.__version__, llvmlite.__version__, np.__version__)
WAIT, PAUSE = 300.0, 0.05  # s: for another process that compiles the same kernel, at most; between two looks

if sys.platform == "win32":

    def _lock(handle: int, wait: float) -> None:
        """A lock for systems without one: two processes compiling at once may lose an entry and compile it again."""
else:
    import fcntl

    def _lock(handle: int, wait: float) -> None:
        """Lock a file; raises BlockingIOError after `wait` seconds."""
        until = time.monotonic() + wait
        while True:
            try:
                return fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                if time.monotonic() > until:
                    raise
            time.sleep(PAUSE)


def cached_njit(**options: Any) -> Callable[[Any], Any]:
    """A decorator like `numba.njit`, whose functions are compiled by the first process that needs them.

    They leave Python to other threads, one of which ends the program for a signal.
    """

    def decorate(function: Any) -> Any:
        compiled = numba.njit(**{"nogil": True, **options})(function)
        if compiled is not function:  # it is, where numba is told to compile nothing
            compiled._cache = _Cache(function)
        return compiled

    return decorate


@cache
def folder_of(file: str) -> Path:
    """Folder of a file's kernels; unused folders of its older versions are removed."""
    libraries = hashlib.sha256("\n".join(LIBRARIES).encode()).hexdigest()
    name = kernel_sources.name_of(Path(file).resolve())
    folder = trust.private_folder().path / f"{name}-{libraries[:8]}-{kernel_sources.digest_of(file)[:24]}"
    with suppress(OSError):
        is_new = not folder.exists()
        folder.mkdir(exist_ok=True)
        os.utime(folder)
        if is_new:
            # Unused folders beside this one go: of this file all but a few, of other files the very old ones
            now, name = time.time(), folder.name.rpartition("-")[0]
            others = sorted(
                ((other_folder.stat().st_mtime, other_folder) for other_folder in folder.parent.iterdir()), reverse=True
            )
            same = [other_folder for _, other_folder in others if other_folder.name.rpartition("-")[0] == name]
            for used, other_folder in others:
                unused = now - used > (DAY if other_folder in same[KEPT:] else UNUSED)
                if unused and other_folder != folder and other_folder.is_dir():
                    shutil.rmtree(other_folder, ignore_errors=True)
    return folder


def is_kept() -> bool:
    """Whether any kernel of these sources is stored."""
    return any(any(folder_of(file).glob("*.nbi")) for file in kernel_sources.with_kernels())


class _Locator(_SourceFileBackedLocatorMixin, _CacheLocator):
    """Location of a file's kernels, for numba."""

    def __init__(self, function: Any, file: str) -> None:
        self._py_file, self._lineno = file, function.__code__.co_firstlineno

    def get_cache_path(self) -> str:
        return str(folder_of(self._py_file))

    def get_source_stamp(self) -> str:
        return ""  # the folder's name says which sources


class _Entries(IndexDataCacheFile):
    """Stored entries of a kernel: a damaged one is recompiled, one that cannot be stored is compiled each time."""

    def load(self, key: Any) -> Any:
        try:
            return super().load(key)
        except Exception:  # of any kind: pickle's
            return None

    def save(self, key: Any, data: Any) -> None:
        with suppress(OSError), self.alone():  # another would take the same name for another signature
            super().save(key, data)

    def _load_index(self) -> Any:
        try:
            return super()._load_index()
        except Exception:
            return {}

    @contextmanager
    def alone(self, of: str = "", wait: float = 10.0) -> Iterator[None]:
        """A context that excludes other processes, or gives up after waiting `wait`, s."""
        handle = os.open(f"{self._index_path}{of}.lock", os.O_RDWR | os.O_CREAT, 0o600)
        try:
            with suppress(OSError):  # it took too long, or the file system has no locks
                _lock(handle, wait)
            yield
        finally:
            os.close(handle)


class _Kept(CompileResultCacheImpl):
    _locator_classes = (_Locator,)


class _Cache(FunctionCache):
    """Kernels of a function. A process holds a signature's lock from looking it up until it is stored."""

    _impl_class = _Kept

    def __init__(self, function: Any) -> None:  # in place of numba's, which asks for the sources of all kernels
        self._name, self._py_func = repr(function), function
        self._compiling: dict[str, ExitStack] = {}
        self.enable()

    @cached_property
    def _impl(self) -> Any:
        return _Kept(self._py_func)

    @cached_property
    def _cache_path(self) -> str:
        return str(self._impl.locator.get_cache_path())

    @cached_property
    def _cache_file(self) -> _Entries:
        return _Entries(self._cache_path, self._impl.filename_base, self._impl.locator.get_source_stamp())

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        kernel = self._loaded(sig, target_context)
        if kernel is None:
            self._release(sig)  # of a compilation in this process that an exception, such as a signal's, ended
            with suppress(OSError):
                lock = ExitStack()
                lock.enter_context(
                    self._cache_file.alone(f".{hashlib.sha256(str(sig).encode()).hexdigest()[:16]}", WAIT)
                )
                self._compiling[str(sig)] = lock
                kernel = self._loaded(sig, target_context)  # another process may have kept it meanwhile
        if kernel is None:
            blas = "scipy.linalg.cython_blas"
            if blas not in sys.modules:
                sys.modules[blas] = None  # type: ignore[assignment]
                try:
                    import numba.np.arraymath  # noqa: F401
                finally:
                    del sys.modules[blas]
        else:
            self._release(sig)
        return kernel

    def _loaded(self, sig: Any, target_context: Any) -> Any:
        """What is stored for a signature, without all that numba compiles with, which its compiler loads itself."""
        rtsys.initialize(target_context)
        with self._guard_against_spurious_io_errors():
            return self._load_overload(sig, target_context)

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            super().save_overload(sig, data)
        finally:
            self._release(sig)

    def _release(self, sig: Any) -> None:
        if (lock := self._compiling.pop(str(sig), None)) is not None:
            lock.close()
