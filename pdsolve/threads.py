"""Work that several threads share."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

LEAST = 1000  # rows: a smaller part is done before another thread has begun


def share(work: Callable[[int, int], None], rows: int, threads: int) -> None:
    """Do `work(first, last)` on all rows, in equal parts side by side; it must let go of Python's lock."""
    parts = max(1, min(threads, rows // LEAST))
    ends = [rows * part // parts for part in range(parts + 1)]
    if parts == 1:
        work(0, rows)
        return
    with ThreadPoolExecutor(parts - 1) as pool:
        others = [pool.submit(work, first, last) for first, last in zip(ends[1:-1], ends[2:], strict=True)]
        work(0, ends[1])
        for other in others:
            other.result()
