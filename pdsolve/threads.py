"""Work that several threads share."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise

LEAST = 1000  # rows: a smaller part is done before another thread has begun


def share(work: Callable[[int, int], None], rows: int, threads: int) -> None:
    """Do `work(first, last)` on all rows, in equal parts side by side; it must let go of Python's lock."""
    parts = max(1, min(threads, rows // LEAST))
    own, *others = pairwise(rows * part // parts for part in range(parts + 1))
    if not others:
        work(*own)
        return
    with ThreadPoolExecutor(len(others)) as pool:
        begun = [pool.submit(work, *ends) for ends in others]
        work(*own)
        for other in begun:
            other.result()
