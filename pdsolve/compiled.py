"""What compiled loops need before the first of them runs."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numba

from pdsolve.stale import drop_stale


@cache
def settle(*kernels: Any) -> None:
    """Drop what is compiled of these kernels but out of date, once a process."""
    if not numba.config.DISABLE_JIT:
        drop_stale(Path(__file__).parent, [Path(kernel.stats.cache_path) for kernel in kernels])
