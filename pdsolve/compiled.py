"""What compiled loops need before the first of them runs."""

from __future__ import annotations

import os
from functools import cache
from pathlib import Path
from typing import Any

import numba

from pdsolve.stale import drop_stale


@cache
def settle(*kernels: Any) -> None:
    """Choose how threads wait, and drop what is compiled of these kernels but out of date; once a process.

    On Linux the OpenMP layer starts a parallel loop three times as fast as numba's own. Its threads wait for each
    other by spinning, for so long that a second busy program makes a run ten times slower; a shorter spin costs 3 %.
    """
    numba.config.THREADING_LAYER_PRIORITY = ["omp", "tbb", "workqueue"]
    os.environ.setdefault("GOMP_SPINCOUNT", "1000")
    if not numba.config.DISABLE_JIT:
        drop_stale(Path(__file__).parent, [Path(kernel.stats.cache_path) for kernel in kernels])
