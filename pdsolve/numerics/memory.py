"""Memory of arrays: aligned to lines of the cache, and returned to the system by Linux's C library."""

from __future__ import annotations

import ctypes
import sys
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

MMAP_THRESHOLD = -3  # as malloc.h numbers it
LARGE = 2**22  # bytes of an array that has its own pages


def aligned(values: NDArray[Any], more: int = 0) -> NDArray[Any]:
    """A copy aligned to 64 bytes, as vectors across a cache line cost twice.

    It has room for `more` rows, which take no memory until they are written.
    """
    shape = (len(values) + more, *values.shape[1:])
    wanted = values.itemsize * int(np.prod(shape))
    room = np.empty(wanted + 64, dtype=np.uint8)
    at = -room.ctypes.data % 64
    copy = room[at : at + wanted].view(values.dtype).reshape(shape)
    copy[: len(values)] = values
    return copy


def aligned_zeros(shape: tuple[int, ...], dtype: DTypeLike) -> NDArray[Any]:
    """Zeros aligned to 64 bytes, which take memory as they are written."""
    count = np.dtype(dtype).itemsize * int(np.prod(shape))
    room = np.zeros(count + 64, dtype=np.uint8)
    at = -room.ctypes.data % 64
    return room[at : at + count].view(dtype).reshape(shape)


def bytes_of_arrays(*parts: Any) -> int:
    """The memory, bytes, of the arrays among these and in tuples among these; one that is there twice counts once."""
    sizes, waiting = dict[int, int](), list(parts)
    while waiting:
        part = waiting.pop()
        if isinstance(part, tuple | list):
            waiting.extend(part)
        elif isinstance(part, np.ndarray):
            start = part.ctypes.data
            sizes[start] = max(sizes.get(start, 0), part.nbytes)
    return sum(sizes.values())


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
