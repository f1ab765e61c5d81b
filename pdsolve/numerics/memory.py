"""What Linux's C library does with memory that NumPy gives back; nothing elsewhere."""

from __future__ import annotations

import ctypes
import sys

MMAP_THRESHOLD = -3  # as malloc.h numbers it
LARGE = 2**22  # bytes of an array that has its own pages


def large_arrays_apart() -> None:
    """Give arrays of 4 MiB and more pages of their own, which return to the system with them.

    The library would raise that to 32 MiB by itself. Zeros that come from its heap are written at once; those in pages
    of their own take memory when they are.
    """
    setting = _library("mallopt")
    if setting is not None:
        setting(MMAP_THRESHOLD, LARGE)


def give_back() -> None:
    """Return what was freed to the system; the library would keep about 300 bytes a node of a model."""
    trim = _library("malloc_trim")
    if trim is not None:
        trim(0)


def _library(name: str) -> ctypes._NamedFuncPointer | None:
    """A function of the C library; None where it is not Linux's."""
    return getattr(ctypes.CDLL(None), name, None) if sys.platform == "linux" else None
